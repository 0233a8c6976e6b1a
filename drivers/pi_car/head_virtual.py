"""A virtual pan/tilt on a PCA9685."""

from drivers.head.axis import servo_axis
from drivers.pi_car.declared import PiHeadKeys
from drivers.sim.stage import Stage
from drivers.virtual.guardian import VirtualServos, plugged_servos
from drivers.virtual.plugged import Plugged


def make(keys: PiHeadKeys, stage: Stage) -> Plugged:  # noqa: ARG001
    """Return a virtual pan/tilt on a PCA9685, whose chip has had power for long."""
    pan, tilt = servo_axis(keys.pan), servo_axis(keys.tilt)
    return plugged_servos(VirtualServos((pan.awake, tilt.awake)), pan, tilt, "pan_tilt")
