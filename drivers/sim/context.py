"""What a simulated part is made with: the world it stands in, its physics, and the other simulated parts."""

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

if TYPE_CHECKING:  # physics are asked for by few
    from drivers.sim.rigid.scene import PhysicsScene


@dataclass(frozen=True, slots=True)
class Physics:
    """How a base errs: ``lag`` (s) and ``slip`` (0..1) of its wheels, ``gyro_noise`` (rad/s), lost reports (0..1)."""

    lag: float = 0.0
    slip: float = 0.0
    gyro_noise: float = 0.0
    dropouts: float = 0.0
    battery: Battery | None = None


@dataclass(frozen=True, slots=True)
class SimContext:
    """Where a twin or a virtual device is made.

    Without a ``world`` there is open floor, and nobody. ``pose`` tells where the base truly is at a time, ``viewpoint``
    where the camera is and looks, whose pictures have ``camera_noise``, in grey levels. ``parts`` are
    the twins, or the ``drivers.virtual.device.VirtualDevice`` devices, that are made already, by name, and ``part_keys`` what the
    robot file says of each of its parts. ``part_name`` is the name of the one that is made. ``listen_address`` is the
    address at which a robot of ROS 2 is to be found; empty for any that is free.
    ``scene`` is the robot's body in physics, None where these are not asked for.
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
        """Return wheels that err as they do here, at the place where the robot starts."""
        start = None if self.world is None else self.world.start
        return SimulatedWheels(dead_time=self.physics.lag, slip=self.physics.slip, pose=start)

    def make_body(self) -> BaseBody:
        """Return the body of a base that stands there."""
        return BaseBody(wheels=self.make_wheels(), ground=self.world, battery=self.physics.battery)


class TrueBase(Protocol):
    """The twin of a base, as the world sees it."""

    def true_pose(self, time: float) -> Pose2D:
        """Return where it truly is, in the world's frame."""
        ...


class TrueHead(Protocol):
    """The twin of a head, as the world sees it."""

    def true_pose(self, time: float) -> HeadPose:
        """Return where it truly looks, from the base."""
        ...
