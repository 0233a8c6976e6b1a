"""From what a user asks for to a sweep that is known to make sense, before the first run."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice, product
from pathlib import Path
from typing import Literal

from config.faults import InvalidFileError, one_of
from config.library import DEFAULT_ROBOT, DEFAULT_WORLD, find
from config.marked import Mapping as MarkedMapping
from config.marked import compose, read_source
from config.units import UNITS
from missions.language.notes import Notes, Words
from missions.language.params import Param, read_params
from missions.language.plan import Plan
from missions.library.drivers import load_robot
from missions.library.shipped import find_mission
from missions.plugins.testing.sweep.knobs import find_knob
from missions.plugins.testing.sweep.sweep import PARAM, Sweep
from missions.plugins.testing.sweep.variation import Drawn, Variation, read_values, shown
from missions.plugins.testing.sweep.worlds import plain_world
from missions.runner import load

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
