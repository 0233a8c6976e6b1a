"""The leaf that plays a gesture."""

from behaviours.joint_motion import ON_ARM
from behaviours.leaf import argument
from behaviours.playing import Played
from drivers.api import Gesture as Movement


class Gesture(Played):
    """Play a gesture with the arm.

    Running until the last keyframe is reached, then succeeds. A gesture that the joints cannot follow is slowed down.
    Fails before anything moves when the arm lacks a joint or a keyframe lies outside its limits, and in the end when a
    joint did not arrive.
    """

    word = "gesture"
    gesture: Movement = argument("gesture", "which one", principal=True)
    speed: float = argument("number", "1 plays it as recorded, 0.5 at half the speed", default=1.0, low=0.1, high=2.0)
    on: str = ON_ARM

    @property
    def movement(self) -> Movement:
        return self.gesture
