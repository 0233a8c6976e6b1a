"""The record of one tick: all that the executive was told from outside in it, enough to decide it over again."""

from typing import Literal

from drivers.api.fast_dataclass import dataclass

Question = tuple[str, str, tuple[object, ...]]
"""Of which part, what, with which arguments: ``("head", "pose", ())``."""

Answer = tuple[str, str, tuple[object, ...], object]
"""A question or command with what came of it: its value, or the :class:`~drivers.errors.DriverError` that it raised."""

TickKind = Literal["tick", "look", "halt"]
"""A tick of the tree; a look at the robot while paused; the halting of the tree, which stops the robot."""


@dataclass(slots=True)
class TickRecord:
    """One frozen tick of a run. The executive makes it and hands it over; nobody alters it.

    Records keep it as ``missiontree.Moment``.
    """

    kind: TickKind
    tick: int
    """How many ticks had been made, this one included."""
    t: float
    """The one time that was read in this moment, in seconds of the run's clock."""
    late: float
    """Seconds after the tick was due; 0 where it came early since it was woken, and for what is not due at a time."""
    spent: float
    """Seconds of real time that it took."""
    answers: list[Answer]
    """Every answer and result of a command, in order."""
    overheld: tuple[str, float] | None = None
    """The key of the leaf that has failed because it held this tick for too long, and for how many seconds."""
