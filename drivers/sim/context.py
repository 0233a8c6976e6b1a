"""Context in which simulated parts are made: the world, its physics, and the other simulated parts."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from drivers.api import HeadPose, Pose2D, StatusCallback, SteeringCallback, ignore
from drivers.clock import Clock
from drivers.sim.base_body import BaseBody
from drivers.sim.battery import Battery
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.wheels import SimulatedWheels
from drivers.sim.world import SimulatedWorld

if TYPE_CHECKING:  # imported only for physics
    from drivers.sim.rigid.scene import PhysicsScene


@dataclass(frozen=True, slots=True)
class Physics:
    """Errors of a simulated base, and its ``battery``.

    ``lag`` is the delay of the wheels in seconds, ``slip`` the share (0..1) of the wheels' travel that does not move
    the base, ``gyro_noise`` is in rad/s, ``dropouts`` is the share of lost reports.
    """

    lag: float = 0.0
    slip: float = 0.0
    gyro_noise: float = 0.0
    dropouts: float = 0.0
    battery: Battery | None = None


@dataclass(frozen=True, slots=True)
class SimContext:
    """Context in which a simulated or virtual device is made.

    If ``world`` is None there is open floor without people. ``pose`` returns the true pose of the base at a time,
    ``viewpoint`` the position and direction of the camera, whose pictures have ``camera_noise`` in grey levels.
    ``parts`` are the simulated or virtual devices that exist already, by name of the part. ``part_keys`` are the
    sections of the robot file by part name, and ``part_name`` is the name of the part to make. ``listen_address`` is
    the network address for a robot of ROS 2; if it is empty, any free one is used. ``scene`` is the robot in the
    physics engine, or None.
    """

    clock: Clock
    world: SimulatedWorld | None
    pose: Callable[[float], Pose2D]
    physics: Physics = Physics()
    seed: int = 0
    report: StatusCallback = ignore
    on_change: Callable[[], None] = ignore
    on_steering: SteeringCallback = ignore
    parts: Mapping[str, Any] = field(default_factory=dict)
    part_keys: Mapping[str, Any] = field(default_factory=dict)
    part_name: str = ""
    listen_address: str = ""
    scene: "PhysicsScene | None" = None
    viewpoint: Callable[[float], Viewpoint] = lambda _: Viewpoint()
    camera_noise: float = 0.0

    def make_wheels(self) -> SimulatedWheels:
        """Return wheels with the errors of ``physics``, at the start pose of the world."""
        start = None if self.world is None else self.world.start
        return SimulatedWheels(dead_time=self.physics.lag, slip=self.physics.slip, pose=start)

    def make_body(self) -> BaseBody:
        """Return the body of a base at the start pose of the world."""
        return BaseBody(wheels=self.make_wheels(), ground=self.world, battery=self.physics.battery)


class TrueBase(Protocol):
    """Simulated base with a known true pose."""

    def true_pose(self, time: float) -> Pose2D:
        """Return the true pose of the base in the world frame."""
        ...


class TrueHead(Protocol):
    """Simulated head with a known true pose."""

    def true_pose(self, time: float) -> HeadPose:
        """Return the true pan and tilt, relative to the base."""
        ...
