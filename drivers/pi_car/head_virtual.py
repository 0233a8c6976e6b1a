"""Virtual pan/tilt head on a PCA9685."""

from drivers.head.axis import make_servo_axis
from drivers.pi_car.declared import PiHeadKeys
from drivers.sim.context import SimContext
from drivers.virtual.device import VirtualDevice
from drivers.virtual.guardian import VirtualServos, make_virtual_servos


def make(keys: PiHeadKeys, context: SimContext) -> VirtualDevice:  # noqa: ARG001
    """Return a virtual pan/tilt head on a PCA9685 that still has the angles of an earlier program."""
    pan, tilt = make_servo_axis(keys.pan), make_servo_axis(keys.tilt)
    return make_virtual_servos(VirtualServos((pan.start_degrees, tilt.start_degrees)), pan, tilt, "pan_tilt")
