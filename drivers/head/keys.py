"""Keys of two hobby servos that turn a head, for any board."""

from collections.abc import Iterator
from math import pi

from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sections import AxisKeys, HeadKeys


@keys
class ServoKeys(AxisKeys):
    """Hobby servo of the head: it turns from 0 to 180 degrees, and 90 is straight ahead."""

    servo: int = key(low=0, high=3, help="Output of the board.")
    joint: str = key(default="", help="Name of the axis, as in the Rodney project.")
    limits: tuple[float, float] = key(
        "angle", default=(-pi / 2, pi / 2), help="Range of the head on this axis: [lowest, highest]."
    )
    flip: bool = key(default=False, help="Whether it turns the other way.")
    start: int | None = key(
        default=None, low=0, high=180, help="Angle to which the sketch moves it at boot, in degrees of the servo."
    )

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield limits that the servo cannot reach."""
        way = -1 if self.flip else 1
        least, most = sorted((way * (-pi / 2 - self.trim), way * (pi / 2 - self.trim)))
        yield from self.check_reach((least, most), f"servo {self.servo}")


@keys
class TwoServoKeys(HeadKeys):
    """Keys of a head that two hobby servos turn, on any board."""

    pan: ServoKeys = key(help="Servo that turns the head left and right.")
    tilt: ServoKeys = key(help="Servo that turns the head up and down.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error if both axes are on one servo."""
        if self.pan.servo == self.tilt.servo:
            about = (("pan", "servo"), ("tilt", "servo"))
            yield KeyDiagnostic(f"'pan' and 'tilt' are both on servo {self.pan.servo}", about=about)
