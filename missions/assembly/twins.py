"""A robot in simulated time: a twin for each of its parts, in one world, on one timeline."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from drivers.api import Device, Pose2D
from drivers.base.twin import BaseTwin
from drivers.camera.twin import CameraTwin
from drivers.microphone.twin import HearingTwin
from drivers.screen.twin import ScreenTwin
from drivers.sim.context import TrueBase, TrueHead
from drivers.sim.timeline import Timeline
from drivers.sim.viewpoint import PinholeLens as Lens
from drivers.sim.viewpoint import Viewpoint, camera_viewpoint
from drivers.sim.world import SimulatedWorld
from drivers.voice.twin import VoiceTwin
from perception.api import Words

if TYPE_CHECKING:  # what few robots have is not imported for the others
    from drivers.legs.twin import LegsTwin
    from drivers.servos.twin import JointsTwin
    from drivers.sim.rigid.scene import PhysicsScene

T = TypeVar("T")


@dataclass(slots=True)
class Twins:
    """The twins of a robot's parts, by kind, in their world; those that it lacks or the mission does not use are not.

    ``place`` is where the camera sits on the base, ``lens`` what it sees through. ``scene`` is the robot's body in
    physics, where these were asked for. The properties are the twins to
    which more can be done than a driver is told, None where a robot has others.
    """

    timeline: Timeline
    world: SimulatedWorld
    parts: dict[str, Any] = field(default_factory=dict)
    place: tuple[float, float, float] = (0.0, 0.0, 1.0)
    lens: Lens = field(default_factory=lambda: Lens(640, 480, 1.047))
    scene: "PhysicsScene | None" = None

    @property
    def devices(self) -> Mapping[str, Device]:
        """The twins by the names of their parts."""
        return self.parts

    @property
    def base(self) -> BaseTwin | None:
        """The base."""
        return self._of("base", BaseTwin)

    @property
    def legs(self) -> "LegsTwin | None":
        """The base, where it walks."""
        if self.base is not None or "base" not in self.parts:
            return None
        from drivers.legs.twin import LegsTwin  # noqa: PLC0415 - see above

        return self._of("base", LegsTwin)

    @property
    def arms(self) -> "Mapping[str, JointsTwin]":
        """All arms, by the names of their parts."""
        from drivers.servos.twin import JointsTwin  # noqa: PLC0415 - see above

        return {part: twin for part, twin in self.parts.items() if isinstance(twin, JointsTwin)}

    @property
    def microphone(self) -> HearingTwin[Words] | None:
        """The ears."""
        return self._of("microphone", HearingTwin)

    @property
    def voice(self) -> VoiceTwin | None:
        """The voice."""
        return self._of("voice", VoiceTwin)

    @property
    def screen(self) -> ScreenTwin | None:
        """The face."""
        return self._of("screen", ScreenTwin)

    @property
    def camera(self) -> CameraTwin | None:
        """The camera."""
        return self._of("camera", CameraTwin)

    @property
    def head(self) -> TrueHead | None:
        """The head."""
        return self.parts.get("head")

    def pose(self) -> Pose2D:
        """Return where the base truly is now, in the world's frame; in physics, the trunk."""
        if self.scene is not None:
            self.scene.advance(self.timeline.clock.now())
            return self.scene.pose()
        base: TrueBase | None = self.parts.get("base")
        return self.world.start if base is None else base.true_pose(self.timeline.clock.now())

    def viewpoint(self) -> Viewpoint:
        """Return where the camera truly is and looks now."""
        pan = tilt = 0.0
        if self.head is not None:
            looks = self.head.true_pose(self.timeline.clock.now())
            pan, tilt = looks.pan, looks.tilt
        if self.scene is not None:
            tilt += self.scene.lean()[1]
        return camera_viewpoint(self.pose(), pan, tilt, self.place)

    def _of(self, kind: str, cls: type[T]) -> T | None:
        found = self.parts.get(kind)
        return found if isinstance(found, cls) else None
