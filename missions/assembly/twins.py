"""A robot in simulated time: a twin for each of its parts, in one world, on one timeline."""

from dataclasses import dataclass, field

from drivers.api import Device, Pose2D
from drivers.sim.timeline import Timeline
from drivers.sim.twins.base import BaseTwin
from drivers.sim.twins.camera import CameraTwin
from drivers.sim.twins.ears import HearingTwin
from drivers.sim.twins.head import HeadTwin
from drivers.sim.twins.joints import JointsTwin
from drivers.sim.twins.neck import NeckTwin
from drivers.sim.twins.ranger import RangerTwin
from drivers.sim.twins.screen import ScreenTwin
from drivers.sim.twins.voice import VoiceTwin
from drivers.sim.viewpoint import Pinhole as Lens
from drivers.sim.viewpoint import Viewpoint, mounted
from drivers.sim.world import World
from perception.api import Words


@dataclass(slots=True)
class Twins:
    """The twins of a robot's parts, None for those that it lacks or the mission does not use, in their world.

    ``place`` is where the camera sits on the base, ``lens`` what it sees through.
    """

    timeline: Timeline
    world: World
    base: BaseTwin | None = None
    head: HeadTwin | NeckTwin | None = None
    arm: JointsTwin | None = None
    range: RangerTwin | None = None
    microphone: HearingTwin[Words] | None = None
    voice: VoiceTwin | None = None
    screen: ScreenTwin | None = None
    camera: CameraTwin | None = None
    place: tuple[float, float, float] = (0.0, 0.0, 1.0)
    lens: Lens = field(default_factory=lambda: Lens(640, 480, 1.047))

    def pose(self) -> Pose2D:
        """Return where the base truly is now, in the world's frame."""
        return self.world.start if self.base is None else self.base.true_pose(self.timeline.clock.now())

    @property
    def devices(self) -> dict[str, Device]:
        """The twins by the names of their parts."""
        found = {
            "base": self.base,
            "head": self.head,
            "arm": self.arm,
            "range": self.range,
            "microphone": self.microphone,
            "voice": self.voice,
            "screen": self.screen,
            "camera": self.camera,
        }
        return {name: twin for name, twin in found.items() if twin is not None}

    def viewpoint(self) -> Viewpoint:
        """Return where the camera truly is and looks now."""
        pan = tilt = 0.0
        if self.head is not None:
            looks = self.head.true_pose(self.timeline.clock.now())
            pan, tilt = looks.pan, looks.tilt
        return mounted(self.pose(), pan, tilt, self.place)
