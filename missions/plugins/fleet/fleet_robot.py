"""What a member of a fleet knows and does of the robot itself: handed in, for runs are reached over their sockets."""

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Telemetry:
    """How a robot is: the mission of its newest run, and what that told last, ``age`` seconds ago; None is not known.

    ``runs`` says that there is a run now, or that this is not known. Lengths in m, angles in rad, ``battery`` 0..1.
    """

    runs: bool = False
    mission: str = ""
    paused: bool = False
    stopped: str = ""
    battery: float | None = None
    x: float | None = None
    y: float | None = None
    heading: float | None = None
    age: float | None = None


class FleetRobot(Protocol):
    """A robot, as far as a fleet reaches it. From any thread."""

    def read_telemetry(self) -> Telemetry:
        """Return how it is; at once."""
        ...

    def stop(self, by: str) -> tuple[bool, str]:
        """Latch all that moves, also in runs that begin later; say whether all was told, and in words what came of it.

        Takes less than a second.
        """
        ...

    def release(self, by: str, *, resume: bool) -> tuple[bool, str]:
        """End that; with ``resume`` missions go on, else they stay paused."""
        ...
