"""Differences between two states of a base that are worth reporting."""

from collections.abc import Mapping
from types import MappingProxyType

from drivers.api import BaseState, Sides
from drivers.api.quick import dataclass

# Names of the hazards in ``BaseState.hazards``, and advice on each. Sides may follow a name: "stall left".

BACKUP_LIMIT = "backup limit"
STALL = "stall"
OBJECT_NEAR = "object near"
UNKNOWN = "hazard of type"
"""A type that this version does not know; its number follows."""

_ADVICE: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        BACKUP_LIMIT: (
            "it does not drive backwards",
            "drive it forwards a little; to lift the limit see `safety_override` in docs/ros2.md",
        ),
        STALL: ("a wheel is blocked", "look for what blocks the wheels"),
        UNKNOWN: ("not known to this version", "`mission ros2 echo /hazard_detection` shows the message"),
    }
)
"""Effect and hint of each hazard that is worth a fault; an object that is near is worth none."""


def describe(hazard: str) -> tuple[str, str] | None:
    """Return a sentence on the hazard with its effect, and a hint; None for one that is no fault."""
    for name, (effect, hint) in _ADVICE.items():
        if hazard.startswith(name):
            return f"{hazard}: {effect}", hint
    return None


ON_THE_FLOOR = "stand the base on the floor, away from the edge"


@dataclass(frozen=True, slots=True)
class Change:
    """What is new since the state before.

    ``faults`` says in words what the base now refuses, each with a hint; ``felt`` is True when any contact, button or
    hazard changed.
    """

    faults: tuple[tuple[str, str], ...]
    felt: bool


def compare(before: BaseState | None, after: BaseState) -> Change:
    """Compare two states; before the first one nothing was felt."""
    faults = []
    if drop := _risen(before.wheel_drop if before else Sides(), after.wheel_drop):
        faults.append((f"wheel drop {drop}: it does not drive", ON_THE_FLOOR))
    if cliff := _risen(before.cliff if before else Sides(), after.cliff):
        faults.append((f"cliff {cliff}: it does not drive forward", ON_THE_FLOOR))
    if after.hazards:
        new = after.hazards - (before.hazards if before else frozenset())
        faults += [fault for hazard in sorted(new) if (fault := describe(hazard)) is not None]
    return Change(tuple(faults), _contacts(before) != _contacts(after))


def _risen(before: Sides, after: Sides) -> str:
    """Name the sides that have come on."""
    names = ("left", "centre", "right")
    return " and ".join(name for name in names if getattr(after, name) and not getattr(before, name))


def _contacts(state: BaseState | None) -> tuple[Sides, Sides, Sides, frozenset[int], frozenset[str]]:
    if state is None:
        return Sides(), Sides(), Sides(), frozenset(), frozenset()
    return state.bumper, state.cliff, state.wheel_drop, state.buttons, state.hazards
