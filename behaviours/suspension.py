"""Suspension: a node cannot answer in a tick, only because a sensor has not reported.

py_trees has no status for that: a suspended node is RUNNING and has a ``Suspension``. What its parent makes of it
depends on the parent: a reactive composite stands still, most others are suspended as well.
"""

from drivers.api.quick import dataclass

SILENT = " does not report"


@dataclass(frozen=True, slots=True)
class Suspension:
    """Why a node is suspended: ``reason`` is such as "the range finder does not report".

    ``lost`` is true in the tick in which the suspension has lasted for the run's sensor timeout. The node has failed
    then, or what is around it counts that otherwise (``retry`` tries again); a reactive composite above it fails.
    """

    reason: str
    lost: bool = False


def lost_reason(reason: str, seconds: float) -> str:
    """Return the reason for a failure after a suspension of so many seconds."""
    limit = f"{seconds:g} s"
    if reason.endswith(SILENT):
        return f"{reason.removesuffix(SILENT)} has not reported for {limit}"
    return f"{reason} (waited for {limit})"
