"""How long robots of a fleet wait for each other."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Times:
    """Seconds. A robot reports on a task each ``heartbeat``, and asks ``again`` where it got no answer.

    It lets go of a task that may be repeated once its keeper has not answered for ``lease``; after ``hand_on``, which
    is longer by the time that a run may take to stop, the keeper gives that task to another.
    """

    heartbeat: float = 2.0
    again: float = 1.0
    lease: float = 30.0
    hand_on: float = 50.0
    refused: float = 2.0
