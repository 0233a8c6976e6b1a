"""Names of the hazards in ``BaseState.hazards``, and advice on each. Sides may follow a name: "stall left"."""

from collections.abc import Mapping
from types import MappingProxyType

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
