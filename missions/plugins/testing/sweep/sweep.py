"""A sweep: one mission, the world it runs in, and what differs from run to run. A value that can go to any worker."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, product
from pathlib import Path
from typing import Literal

import cv2

from config.faults import InvalidFileError, Source, one_of
from config.library import DEFAULT_ROBOT, DEFAULT_WORLD, find
from config.marked import Mapping as MarkedMapping
from config.marked import compose, read_source
from config.units import UNITS
from config.world import WorldConfig, read_world
from missions.language.notes import Notes, Words
from missions.language.param_types import Param, read_params
from missions.language.plan import Plan
from missions.library.drivers import load_robot
from missions.library.shipped import find_mission
from missions.plugins.testing.sweep.knobs import find_knob
from missions.plugins.testing.sweep.people import Plain
from missions.plugins.testing.sweep.variation import Drawn, Outcome, Row, Variation, read_values, shown
from missions.plugins.testing.sweep.worlds import plain_world, varied
from missions.request import RunRequest
from missions.runner import Runner, load, robot_of

PARAM = "param."
"""How the names of varied params begin."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """What all runs have in common, and what varies.

    ``world`` is a world file as plain data, ``file`` where it was read from. ``limit`` is how many simulated seconds a
    run may take.
    """

    mission: str
    world: Plain
    file: str
    params: Mapping[str, str] = field(default_factory=dict)
    robot: str | None = None
    behaviours: tuple[Path, ...] = ()
    variations: tuple[Variation, ...] = ()
    eyes: Literal["pixels", "truth"] = "truth"
    limit: float = 300.0
    physics: bool = False

    def draw(self, seed: int) -> tuple[Drawn, ...]:
        """Return what the run with this seed has, in the order of ``variations``."""
        return tuple(variation.draw(seed) for variation in self.variations)

    def params_of(self, values: tuple[Drawn, ...]) -> dict[str, str]:
        """Return the params of the run that has drawn ``values``."""
        pairs = zip(self.variations, values, strict=True)
        mine = {each.name.removeprefix(PARAM): each.text(v) for each, v in pairs if each.name.startswith(PARAM)}
        return {**self.params, **mine}

    def world_of(self, values: tuple[Drawn, ...], seed: int) -> str:
        """Return the world, as the text of a file, of the run that has drawn ``values``. Raises ValueError."""
        pairs = zip(self.variations, values, strict=True)
        return varied(self.world, [(each, v) for each, v in pairs if not each.name.startswith(PARAM)], seed)

    def order(self, seed: int) -> RunRequest:
        """Return what to run for this seed. Raises InvalidFileError, ValueError for a world that cannot be."""
        return self.order_of(self.draw(seed), seed)

    def order_of(self, values: tuple[Drawn, ...], seed: int) -> RunRequest:
        """Return what to run for these values. Raises as ``order`` does."""
        return RunRequest(
            self.mission,
            self.params_of(values),
            robot=self.robot,
            simulate="fast",
            world=self.world_config(values, seed),
            seed=seed,
            behaviours=self.behaviours,
            eyes=self.eyes,
            physics=self.physics,
        )

    def world_config(self, values: tuple[Drawn, ...], seed: int) -> WorldConfig:
        """Return the world of one run, checked. Raises InvalidFileError, ValueError."""
        return read_world(Source(f"{self.file} as of run {seed}", self.world_of(values, seed)))

    def command(self, seed: int, world: Path | None = None) -> str:
        """Return the command that runs one seed again, in ``world`` where that is given: the file of its own world."""
        words = ["mission", "run", self.mission, "--simulate", "fast", "--eyes", self.eyes, "--seed", str(seed)]
        words += [] if self.robot is None else ["--robot", self.robot]
        words += ["--physics"] if self.physics else []
        words += ["--world", self.file if world is None else str(world)]
        for name, text in self.params_of(self.draw(seed)).items():
            words += ["--param", f"{name}={text}"]
        for path in self.behaviours:
            words += ["--behaviours", str(path)]
        return shlex.join(words)


# One run of a sweep, from its seed to its row: the same on every machine.

OVER = "not over within {limit:g} s"
"""Why a run is ended that takes too long."""

OUTCOMES: dict[str, Outcome] = {"success": "success", "failure": "failure", "interrupted": "unfinished"}
"""How a run went, by what its result says."""


class Trials:
    """The runs of one sweep in one process. What they have in common is read once."""

    def __init__(self, sweep: Sweep) -> None:
        self._sweep = sweep
        self._plans: dict[tuple[tuple[str, str], ...], Plan] = {}

    def run(self, seed: int) -> Row:
        """Run the mission once. Raises KeyboardInterrupt when that is interrupted.

        What goes wrong with a run is told in its row, for the others are to go on.
        """
        values = self._sweep.draw(seed)
        try:
            return self._run(seed)
        except Exception as error:  # of whatever kind
            reason = str(error).partition("\n")[0] or type(error).__name__
            return Row(seed, values, "error", reason, 0.0, 0)

    def _run(self, seed: int) -> Row:
        sweep, order = self._sweep, self._sweep.order(seed)
        runner = Runner(order, plan=self._plan(order))
        if runner.twins is None:
            raise RuntimeError("a sweep needs simulated time")
        over = OVER.format(limit=sweep.limit)
        runner.twins.timeline.at(sweep.limit, lambda: runner.executive.stop(over))
        result = runner.run()
        if result.result == "interrupted" and result.reason != over:
            raise KeyboardInterrupt
        outcome = OUTCOMES.get(result.result, "error")
        return Row(seed, sweep.draw(seed), outcome, result.reason, round(result.seconds, 6), result.ticks)

    def _plan(self, order: RunRequest) -> Plan:
        """Return the mission, read once for each set of params: that takes longer than a short run."""
        key = tuple(order.params.items())
        if key not in self._plans:
            self._plans[key] = load(order, robot_of(order))
        return self._plans[key]


def run_some(sweep: Sweep, seeds: Sequence[int]) -> list[Row]:
    """Run some seeds, in their order: the work of a worker. Raises KeyboardInterrupt.

    OpenCV keeps to one thread, for there is a worker for every core.
    """
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        trials = Trials(sweep)
        return [trials.run(seed) for seed in seeds]
    finally:
        cv2.setNumThreads(threads)


# From what a user asks for to a sweep that is known to make sense, before the first run.

CORNERS = 64
"""So many combinations of the ends of all ranges are tried before the first run."""

KINDS = (*UNITS, "number", "count")
"""The kinds of params that can be drawn from a range; any other is text, which can be one of a list."""


class VariationError(ValueError):
    """Something that cannot be varied so; the message names it and says why."""


@dataclass(frozen=True, slots=True)
class Wish:
    """A sweep in the user's words: ``vary`` has the values by name, the rest as in ``missions.request.RunRequest``."""

    mission: str
    vary: Mapping[str, str]
    params: Mapping[str, str]
    robot: str | None = None
    world: str | None = None
    behaviours: tuple[Path, ...] = ()
    eyes: Literal["pixels", "truth"] = "truth"
    limit: float = 300.0
    physics: bool = False


def design(wish: Wish) -> tuple[Sweep, Plan]:
    """Return the sweep that is asked for, and the mission as it is with the first values of all.

    Raises InvalidFileError, UnknownNameError, and VariationError for what cannot be varied.
    """
    world = wish.world or DEFAULT_WORLD
    declared = _declared(wish.mission)
    for name in wish.vary:
        if name.removeprefix(PARAM) in wish.params and name.startswith(PARAM):
            raise VariationError(f"{name} is given by --param as well")
    sweep = Sweep(
        mission=wish.mission,
        world=plain_world(read_source(find("worlds", world))),
        file=world,
        params=dict(wish.params),
        robot=wish.robot,
        behaviours=tuple(wish.behaviours),
        variations=tuple(_variation(name, values, declared) for name, values in wish.vary.items()),
        eyes=wish.eyes,
        limit=wish.limit,
        physics=wish.physics,
    )
    _try_corners(sweep)
    first = tuple(each.values.ends()[0] for each in sweep.variations)
    return sweep, load(sweep.order_of(first, 0), load_robot(find("robots", wish.robot or DEFAULT_ROBOT)))


def _declared(mission: str) -> dict[str, Param]:
    """Return the params of a mission; whatever is wrong with the file is told when it is loaded."""
    source = read_source(find_mission(mission))
    root = compose(source)
    return read_params(Notes(source, Words({})), root.get("params")) if isinstance(root, MarkedMapping) else {}


def _variation(name: str, values: str, declared: Mapping[str, Param]) -> Variation:
    try:
        if not name.startswith(PARAM):
            return Variation(name, *read_values(values, find_knob(name).kind))
        param = declared.get(name.removeprefix(PARAM))
        if param is None:
            raise LookupError(one_of(name.removeprefix(PARAM), declared) or "the mission has no params")
        variation = Variation(name, *read_values(values, param.kind if param.kind in KINDS else "text"))
        for value in variation.values.ends():
            param.take(variation.text(value))
    except LookupError as error:
        raise VariationError(f"'{name}' cannot be varied; {error}") from error
    except ValueError as error:
        raise VariationError(f"{name} {error}") from error
    return variation


def _try_corners(sweep: Sweep) -> None:
    """Build the world for the ends of the ranges. Raises VariationError with the first of them that cannot be."""
    for values in islice(product(*(each.values.ends() for each in sweep.variations)), CORNERS):
        try:
            sweep.world_config(values, 0)
        except (InvalidFileError, ValueError) as error:
            if not sweep.variations:
                raise
            fault = error.faults[0] if isinstance(error, InvalidFileError) else None
            what = f"{fault.message}; {fault.suggestion}".rstrip("; ") if fault is not None else str(error)
            raise VariationError(f"with {told(sweep, values)}: {what}") from error


def told(sweep: Sweep, values: tuple[Drawn, ...]) -> str:
    """Say what a run has drawn."""
    pairs = zip(sweep.variations, values, strict=True)
    return ", ".join(f"{each.name}={shown(each, value)}" for each, value in pairs)
