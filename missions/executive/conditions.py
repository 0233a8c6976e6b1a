"""What no condition may rest on: the place of a base that nothing measures."""

from collections.abc import Mapping

from missions.executive.state import BasePart
from missions.language.values import Value

PLACE = frozenset({"base.x", "base.y", "base.heading"})
"""What of a base is dead reckoning where nothing measures it."""


def unmeasured(condition: Value, scope: Mapping[str, object]) -> str:
    """Say what in a condition nothing measures, or nothing. Raises NotConnected while the base does not report."""
    reads = () if condition.template is None else condition.template.reads
    place = next((read.dotted for read in reads if read.dotted in PLACE), "")
    base = scope.get("base")
    if place and isinstance(base, BasePart) and base.reckoned:
        return f"{place} is dead reckoning: this base measures nothing that a condition may rest on"
    return ""
