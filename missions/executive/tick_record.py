"""Record of one tick: all inputs of the executive, enough to replay its decisions."""

from typing import Literal

from drivers.api.fast_dataclass import dataclass

Question = tuple[str, str, tuple[object, ...]]
"""Part, name and arguments of a query: ``("head", "pose", ())``."""

Answer = tuple[str, str, tuple[object, ...], object]
"""A query or command with its result: the value, or the raised :class:`~drivers.errors.DriverError`."""

TickKind = Literal["tick", "look", "halt"]
"""Kind of a snapshot.

"tick": a tick of the tree; "look": a check of the base guard while paused; "halt": a step of the final halt.
"""


@dataclass(slots=True)
class TickRecord:
    """Record of one tick snapshot, made by the executive; do not change it.

    A record file stores it as a message ``missiontree.Moment``.
    """

    kind: TickKind
    tick: int
    """Number of ticks so far, including this one."""
    t: float
    """Time of the snapshot, in seconds of the run's clock."""
    late: float
    """Seconds after the due time; 0 for an early tick, and for snapshots without a due time."""
    spent: float
    """Real duration of the snapshot in seconds."""
    answers: list[Answer]
    """Results of all queries and commands to the robot's parts in this tick, in order."""
    overheld: tuple[str, float] | None = None
    """The leaf that failed because it blocked this tick for too long: its key in the tree, and for how many seconds."""
