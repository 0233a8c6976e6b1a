"""Virtual legs: the true angles of the virtual servos move the base."""

from dataclasses import asdict

from drivers.api import Pose2D
from drivers.legs.body import body_of
from drivers.legs.declared import LegsKeys
from drivers.legs.kinematics import FootOdometry
from drivers.servos.declared import DynamixelKeys
from drivers.servos.virtual.chain import VirtualServoBus, true_angle
from drivers.sim.context import SimContext
from drivers.virtual.device import VirtualDevice


def make(keys: LegsKeys, stage: SimContext) -> VirtualDevice:
    """Return a virtual walking base, moved by the true angles of the arm's virtual servos. It has no port."""
    arm: DynamixelKeys = stage.part_keys["arm"]
    bus: VirtualServoBus = stage.parts["arm"].device
    body = body_of(keys.body)
    led = FootOdometry(body, Pose2D(0.0, 0.0, 0.0) if stage.world is None else stage.world.start)

    def pose(_: float) -> Pose2D:
        return led.update(body.pose({name: true_angle(bus, arm, name) for name in body.joints}))

    return VirtualDevice(None, pose=pose, state=lambda now: asdict(pose(now)))
