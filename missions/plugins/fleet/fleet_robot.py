"""Interface through which a fleet member reads, stops and releases its robot."""

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Telemetry:
    """State of a robot, from the last report of its newest run; None is unknown.

    The report arrived ``age`` seconds ago. ``runs`` is True if a run exists or may exist. ``stopped`` names the client
    that latched a stop. Lengths in m, angles in rad, ``battery`` 0..1.
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
    """A robot as its fleet member reads and stops it. Methods may be called from any thread."""

    def read_telemetry(self) -> Telemetry:
        """Return the present telemetry without waiting."""
        ...

    def stop(self, by: str) -> tuple[bool, str]:
        """Latch all actuators, also of later runs; return whether all confirmed it, and a text for people.

        Takes less than a second.
        """
        ...

    def release(self, by: str, *, resume: bool) -> tuple[bool, str]:
        """Release the latched stop of a robot.

        With ``resume``, its missions continue, otherwise they stay paused. Return whether all actuators are released,
        and a text for people.
        """
        ...
