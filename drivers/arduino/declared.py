"""Declaration and keys of the Rodney head."""

from collections.abc import Iterator, Mapping
from typing import Literal

from drivers.api.device import ReconnectPolicy
from drivers.api.driver import Driver
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sections import SerialKeys
from drivers.head.keys import ServoKeys, TwoServoKeys


@keys
class PanKeys(ServoKeys):
    """Servo that turns the head left and right."""

    servo: int = key(default=0, low=0, high=3, help="Output of the board.")
    joint: str = key(default="head_pan", help="Name of the axis, as in the Rodney project.")


@keys
class TiltKeys(ServoKeys):
    """Servo that turns the head up and down."""

    servo: int = key(default=1, low=0, high=3, help="Output of the board.")
    joint: str = key(default="head_tilt", help="Name of the axis, as in the Rodney project.")


@keys
class ArduinoKeys(TwoServoKeys, SerialKeys):
    """Keys of a pan/tilt head on an Arduino, with a Rodney sketch or MissionTree's own."""

    protocol: Literal["rosserial", "lines"] = key(
        default="rosserial", help="Protocol of the sketch: `lines` is that of docs/keeper_head, which needs no ROS."
    )
    baud: int = key(default=57_600, low=1, help="Baud rate of the port.")
    boot: float = key(
        "duration",
        default=2.0,
        low=0.0,
        help="Boot time of the board after its port is opened; 0 s if it does not restart.",
    )
    pan: PanKeys = key(help="Servo that turns the head left and right.")
    tilt: TiltKeys = key(help="Servo that turns the head up and down.")
    away: ReconnectPolicy = key(default=ReconnectPolicy(), help="Reconnect policy after it was unplugged or silent.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield servo numbers that MissionTree's own sketch does not have."""
        yield from super().diagnostics()
        if self.protocol == "lines":
            for word, servo, number in (("pan", self.pan.servo, 0), ("tilt", self.tilt.servo, 1)):
                if servo != number:
                    message = f"'{word}' must be servo {number} with 'protocol: lines': change the pins in the sketch"
                    yield KeyDiagnostic(message, (word, "servo"))


@keys
class SecondPanTiltKeys(TwoServoKeys):
    """Keys of a second pan/tilt device on the board of the ``head``, such as a mast."""


def check_board_servos(second: SecondPanTiltKeys, others: Mapping[str, object]) -> Iterator[KeyDiagnostic]:
    """Yield diagnostics if the robot's head has no such board, and for servos that are already in use.

    ``others`` are the other sections of the robot file, by name.
    """
    head = others.get("head")
    if not isinstance(head, ArduinoKeys):
        message = "'driver: arduino_second' needs a 'head' with 'driver: arduino'; this robot has none"
        yield KeyDiagnostic(message, ("driver",))
        return
    if head.protocol == "lines":
        yield KeyDiagnostic("the sketch for 'protocol: lines' has two servos, both of the 'head'", ("driver",))
        return
    taken = {head.pan.servo: "the pan of the 'head'", head.tilt.servo: "the tilt of the 'head'"}
    for name, other in others.items():
        if other is second:
            break  # only the later section is reported
        if isinstance(other, SecondPanTiltKeys):
            taken |= {other.pan.servo: f"the pan of '{name}'", other.tilt.servo: f"the tilt of '{name}'"}
    for axis, axis_keys in (("pan", second.pan), ("tilt", second.tilt)):
        if axis_keys.servo in taken:
            at = (axis, "servo")
            yield KeyDiagnostic(f"servo {axis_keys.servo} is {taken[axis_keys.servo]}", at, about=(at,))


ARDUINO = Driver(
    "arduino",
    "head",
    "Two hobby servos on an Arduino, with the Rodney sketch or MissionTree's own.",
    ArduinoKeys,
    make="drivers.arduino.driver:make",
    twin="drivers.arduino.twin:make",
    virtual="drivers.arduino.virtual:make",
    probe="drivers.arduino.probe:probe",
    usb=("16c0:0483", "1a86:7523", "2341:*", "2a03:*"),
)

SECOND = Driver(
    "arduino_second",
    "head",
    "Two more hobby servos on the board of the head.",
    SecondPanTiltKeys,
    make="drivers.arduino.driver:make_second",
    twin="drivers.arduino.twin:make_second",
    virtual="drivers.arduino.virtual:make_second",
    needs=("head",),
    check=check_board_servos,
)
