"""Robot in simulated time: a twin per part, in one world, on one timeline."""

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
    """Simulated devices of a robot by part, in their world; only for the parts that the mission uses.

    ``place`` is the position of the camera on the base (m), ``lens`` its lens. ``scene`` is the robot's body with
    physics, else None. The typed properties, such as ``base``, are None if the robot has no such part.
    """

    timeline: Timeline
    world: SimulatedWorld
    parts: dict[str, Any] = field(default_factory=dict)
    place: tuple[float, float, float] = (0.0, 0.0, 1.0)
    lens: Lens = field(default_factory=lambda: Lens(640, 480, 1.047))
    scene: "PhysicsScene | None" = None

    @property
    def devices(self) -> Mapping[str, Device]:
        """Twins of the robot by the names of their parts."""
        return self.parts

    @property
    def base(self) -> BaseTwin | None:
        """Twin of the base, or None."""
        return self._of("base", BaseTwin)

    @property
    def legs(self) -> "LegsTwin | None":
        """Twin of a base with legs, or None."""
        if self.base is not None or "base" not in self.parts:
            return None
        from drivers.legs.twin import LegsTwin  # noqa: PLC0415 - see above

        return self._of("base", LegsTwin)

    @property
    def arms(self) -> "Mapping[str, JointsTwin]":
        """Twins of all arms by the names of their parts."""
        from drivers.servos.twin import JointsTwin  # noqa: PLC0415 - see above

        return {part: twin for part, twin in self.parts.items() if isinstance(twin, JointsTwin)}

    @property
    def microphone(self) -> HearingTwin[Words] | None:
        """Twin of the ears, or None."""
        return self._of("microphone", HearingTwin)

    @property
    def voice(self) -> VoiceTwin | None:
        """Twin of the voice, or None."""
        return self._of("voice", VoiceTwin)

    @property
    def screen(self) -> ScreenTwin | None:
        """Twin of the screen, or None."""
        return self._of("screen", ScreenTwin)

    @property
    def camera(self) -> CameraTwin | None:
        """Twin of the camera, or None."""
        return self._of("camera", CameraTwin)

    @property
    def head(self) -> TrueHead | None:
        """Twin of the head, or None."""
        return self.parts.get("head")

    def pose(self) -> Pose2D:
        """Return the true pose of the base in the world's frame; with physics, that of the robot's trunk."""
        if self.scene is not None:
            self.scene.advance(self.timeline.clock.now())
            return self.scene.pose()
        base: TrueBase | None = self.parts.get("base")
        return self.world.start if base is None else base.true_pose(self.timeline.clock.now())

    def viewpoint(self) -> Viewpoint:
        """Return the true pose of the camera."""
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
