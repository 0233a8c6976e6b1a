"""Definition of a sweep: one mission, its world, and the values that vary; it can be sent to any worker."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, product
from pathlib import Path
from typing import Literal

import cv2

from config.diagnostics import InvalidFileError, SourceText, suggest_from
from config.library import DEFAULT_ROBOT, DEFAULT_WORLD, find_file
from config.units import UNITS
from config.world import WorldConfig, parse_world
from config.yaml_nodes import Mapping as MarkedMapping
from config.yaml_nodes import compose, read_source
from missions.language.check_context import CheckContext, Vocabulary
from missions.language.param_types import Param, read_params
from missions.language.plan import Plan
from missions.library.drivers import load_robot
from missions.library.shipped import find_mission
from missions.plugins.testing.sweep.parameters import find_parameter
from missions.plugins.testing.sweep.people import PlainMapping
from missions.plugins.testing.sweep.variation import (
    DrawnValue,
    Outcome,
    SweepRow,
    Variation,
    display_value,
    read_values,
)
from missions.plugins.testing.sweep.worlds import plain_world, vary_world
from missions.request import RunRequest
from missions.runner import Runner, load_plan, requested_robot

PARAM_PREFIX = "param."
"""Prefix of a mission's params among the names of a sweep's variations: ``param.speed``."""


@dataclass(frozen=True, slots=True)
class SweepPlan:
    """Settings shared by all runs of a sweep, and the variations.

    ``world`` is a world file as plain data, ``file`` its path. ``limit`` is the time limit of a run in simulated
    seconds.
    """

    mission: str
    world: PlainMapping
    file: str
    params: Mapping[str, str] = field(default_factory=dict)
    robot: str | None = None
    behaviours: tuple[Path, ...] = ()
    variations: tuple[Variation, ...] = ()
    eyes: Literal["pixels", "truth"] = "truth"
    limit: float = 300.0
    physics: bool = False

    def draw(self, seed: int) -> tuple[DrawnValue, ...]:
        """Return the values of the run with this seed, in the order of ``variations``."""
        return tuple(variation.draw(seed) for variation in self.variations)

    def params_of(self, values: tuple[DrawnValue, ...]) -> dict[str, str]:
        """Return the mission's params for a run with these drawn values."""
        pairs = zip(self.variations, values, strict=True)
        mine = {
            each.name.removeprefix(PARAM_PREFIX): each.text(v)
            for each, v in pairs
            if each.name.startswith(PARAM_PREFIX)
        }
        return {**self.params, **mine}

    def world_of(self, values: tuple[DrawnValue, ...], seed: int) -> str:
        """Return the text of the world file of a run with these values. Raises ValueError."""
        pairs = zip(self.variations, values, strict=True)
        return vary_world(self.world, [(each, v) for each, v in pairs if not each.name.startswith(PARAM_PREFIX)], seed)

    def request(self, seed: int) -> RunRequest:
        """Return the run request of this seed. Raises InvalidFileError; ValueError for an invalid world."""
        return self.request_for(self.draw(seed), seed)

    def request_for(self, values: tuple[DrawnValue, ...], seed: int) -> RunRequest:
        """Return the run request for these values. Raises InvalidFileError; ValueError for an invalid world."""
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

    def world_config(self, values: tuple[DrawnValue, ...], seed: int) -> WorldConfig:
        """Return the checked world of one run. Raises InvalidFileError, ValueError."""
        return parse_world(SourceText(f"{self.file} as of run {seed}", self.world_of(values, seed)))

    def command(self, seed: int, world: Path | None = None) -> str:
        """Return the command that repeats the run of one seed, in the world file ``world`` if given."""
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

TIMEOUT_REASON = "not finished within {limit:g} s"
"""Reason of a run that exceeds its time limit."""

OUTCOMES: dict[str, Outcome] = {"success": "success", "failure": "failure", "interrupted": "unfinished"}
"""Outcome of a run in the sweep's table, by the result that the run reports."""


class SweepRuns:
    """Runs of one sweep in one process, which share the loaded files."""

    def __init__(self, sweep: SweepPlan) -> None:
        self._sweep = sweep
        self._plans: dict[tuple[tuple[str, str], ...], Plan] = {}

    def run(self, seed: int) -> SweepRow:
        """Run the mission once. Raises KeyboardInterrupt if interrupted.

        An error of the run is reported in its row, so that the sweep goes on.
        """
        values = self._sweep.draw(seed)
        try:
            return self._run(seed)
        except Exception as error:  # any error of this run
            reason = str(error).partition("\n")[0] or type(error).__name__
            return SweepRow(seed, values, "error", reason, 0.0, 0)

    def _run(self, seed: int) -> SweepRow:
        sweep, order = self._sweep, self._sweep.request(seed)
        runner = Runner(order, plan=self._plan(order))
        if runner.twins is None:
            raise RuntimeError("a sweep needs simulated time")
        over = TIMEOUT_REASON.format(limit=sweep.limit)
        runner.twins.timeline.call_at(sweep.limit, lambda: runner.executive.stop(over))
        result = runner.run()
        if result.result == "interrupted" and result.reason != over:
            raise KeyboardInterrupt
        outcome = OUTCOMES.get(result.result, "error")
        return SweepRow(seed, sweep.draw(seed), outcome, result.reason, round(result.seconds, 6), result.ticks)

    def _plan(self, request: RunRequest) -> Plan:
        """Return the mission, which is loaded once for each set of params: loading takes longer than a short run."""
        key = tuple(request.params.items())
        if key not in self._plans:
            self._plans[key] = load_plan(request, requested_robot(request))
        return self._plans[key]


def run_seeds(sweep: SweepPlan, seeds: Sequence[int]) -> list[SweepRow]:
    """Run some seeds of a sweep in order, in a worker; return their rows. Raises KeyboardInterrupt.

    OpenCV is limited to one thread: there is a worker for every core.
    """
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        trials = SweepRuns(sweep)
        return [trials.run(seed) for seed in seeds]
    finally:
        cv2.setNumThreads(threads)


# From what a user asks for to a sweep that is known to make sense, before the first run.

MAX_CORNERS = 64
"""Maximum number of combinations of range ends whose worlds are checked before the first run of a sweep."""

KINDS = (*UNITS, "number", "count")
"""Kinds of params that can be drawn from a range; other kinds are text, drawn from a list."""


class VariationError(ValueError):
    """Invalid variation; the message names it and the reason."""


@dataclass(frozen=True, slots=True)
class SweepRequest:
    """Request for a sweep. ``vary`` has the varied values as text, by name: ``a..b`` or ``a,b,c``.

    ``limit`` is the time limit of a run in simulated seconds; the other fields are as in
    ``missions.request.RunRequest``.
    """

    mission: str
    vary: Mapping[str, str]
    params: Mapping[str, str]
    robot: str | None = None
    world: str | None = None
    behaviours: tuple[Path, ...] = ()
    eyes: Literal["pixels", "truth"] = "truth"
    limit: float = 300.0
    physics: bool = False


def design_sweep(request: SweepRequest) -> tuple[SweepPlan, Plan]:
    """Return the sweep of a request, and the mission with the first value of each variation.

    Raises InvalidFileError, UnknownNameError, and VariationError for an invalid variation.
    """
    world = request.world or DEFAULT_WORLD
    declared = _declared_params(request.mission)
    for name in request.vary:
        if name.removeprefix(PARAM_PREFIX) in request.params and name.startswith(PARAM_PREFIX):
            raise VariationError(f"{name} is given by --param as well")
    sweep = SweepPlan(
        mission=request.mission,
        world=plain_world(read_source(find_file("worlds", world))),
        file=world,
        params=dict(request.params),
        robot=request.robot,
        behaviours=tuple(request.behaviours),
        variations=tuple(_read_variation(name, values, declared) for name, values in request.vary.items()),
        eyes=request.eyes,
        limit=request.limit,
        physics=request.physics,
    )
    _check_corners(sweep)
    first = tuple(each.values.ends()[0] for each in sweep.variations)
    return sweep, load_plan(
        sweep.request_for(first, 0), load_robot(find_file("robots", request.robot or DEFAULT_ROBOT))
    )


def _declared_params(mission: str) -> dict[str, Param]:
    """Return the params of a mission; errors in its file are reported when it is loaded."""
    source = read_source(find_mission(mission))
    root = compose(source)
    return (
        read_params(CheckContext(source, Vocabulary({})), root.get("params")) if isinstance(root, MarkedMapping) else {}
    )


def _read_variation(name: str, values: str, declared: Mapping[str, Param]) -> Variation:
    try:
        if not name.startswith(PARAM_PREFIX):
            return Variation(name, *read_values(values, find_parameter(name).kind))
        param = declared.get(name.removeprefix(PARAM_PREFIX))
        if param is None:
            raise LookupError(suggest_from(name.removeprefix(PARAM_PREFIX), declared) or "the mission has no params")
        variation = Variation(name, *read_values(values, param.kind if param.kind in KINDS else "text"))
        for value in variation.values.ends():
            param.parse(variation.text(value))
    except LookupError as error:
        raise VariationError(f"'{name}' cannot be varied; {error}") from error
    except ValueError as error:
        raise VariationError(f"{name} {error}") from error
    return variation


def _check_corners(sweep: SweepPlan) -> None:
    """Build the world for combinations of the range ends. Raises VariationError with the first invalid one."""
    for values in islice(product(*(each.values.ends() for each in sweep.variations)), MAX_CORNERS):
        try:
            sweep.world_config(values, 0)
        except (InvalidFileError, ValueError) as error:
            if not sweep.variations:
                raise
            fault = error.diagnostics[0] if isinstance(error, InvalidFileError) else None
            what = f"{fault.message}; {fault.suggestion}".rstrip("; ") if fault is not None else str(error)
            raise VariationError(f"with {describe_draw(sweep, values)}: {what}") from error


def describe_draw(sweep: SweepPlan, values: tuple[DrawnValue, ...]) -> str:
    """Return the drawn values of a run as text."""
    pairs = zip(sweep.variations, values, strict=True)
    return ", ".join(f"{each.name}={display_value(each, value)}" for each, value in pairs)
