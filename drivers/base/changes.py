"""Changes between two states of a base: of contacts, buttons and hazards."""

from collections.abc import Mapping
from types import MappingProxyType

from drivers.api import BaseState, Sides
from drivers.api.quick import dataclass

# Names of the hazards in ``BaseState.hazards``, with advice. A side may follow a name: "stall left".

BACKUP_LIMIT = "backup limit"
STALL = "stall"
OBJECT_NEAR = "object near"
UNKNOWN = "hazard of type"
"""Prefix of a type that this version does not know; its number follows."""

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
"""Effect and hint of each hazard that is reported as a fault; a near object is not."""


def describe(hazard: str) -> tuple[str, str] | None:
    """Return a message on the hazard with its effect, and a hint; None if it is not a fault."""
    for name, (effect, hint) in _ADVICE.items():
        if hazard.startswith(name):
            return f"{hazard}: {effect}", hint
    return None


ON_THE_FLOOR = "stand the base on the floor, away from the edge"


@dataclass(frozen=True, slots=True)
class Change:
    """Change between two states.

    ``faults`` are pairs of a fault and a hint, for motions that the base now refuses. ``felt`` is True if a contact,
    button or hazard changed.
    """

    faults: tuple[tuple[str, str], ...]
    felt: bool


def compare(before: BaseState | None, after: BaseState) -> Change:
    """Compare two states; ``before`` is None for the first state, which has no contacts before it."""
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
    """Return the names of the sides that became active."""
    names = ("left", "centre", "right")
    return " and ".join(name for name in names if getattr(after, name) and not getattr(before, name))


def _contacts(state: BaseState | None) -> tuple[Sides, Sides, Sides, frozenset[int], frozenset[str]]:
    if state is None:
        return Sides(), Sides(), Sides(), frozenset(), frozenset()
    return state.bumper, state.cliff, state.wheel_drop, state.buttons, state.hazards
