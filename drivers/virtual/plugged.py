"""A virtual device as it is plugged in: what is on its wire, and what it truly does."""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.api import HeadPose, Pose2D
from drivers.virtual.terminal import WireDevice


@dataclass(frozen=True, slots=True)
class Plugged:
    """A ``device`` on a wire, whose pseudo-terminal is called after ``wire``; None for a part on the wire of another.

    A base tells its true ``pose`` at a time, a head where it truly ``looks``, and each its ``state`` in plain values.
    All are called while the terminal waits: the device is theirs alone.
    """

    device: WireDevice | None
    wire: str = ""
    pose: Callable[[float], Pose2D] | None = None
    looks: Callable[[float], HeadPose] | None = None
    state: Callable[[float], object] | None = None
