"""The detectors and phrases that a mission asks for: a detector that nobody asks does not run."""

from typing import TYPE_CHECKING

from drivers.api.quick import dataclass
from drivers.api.senses import CameraKeys
from missions.language.phrases import phrases_of
from missions.language.plan import Step
from missions.language.sought import looked_for
from perception.api import Wanted

if TYPE_CHECKING:
    from perception.tracks import MarkerKind


@dataclass(frozen=True, slots=True)
class Interests:
    """Faces and whose they are (``names``), the things ``wanted``, other robots that wear ``markers``, and motion.

    ``phrases`` are what is listened for.
    """

    wanted: tuple[Wanted, ...] = ()
    markers: "MarkerKind | None" = None
    motion: bool = False
    faces: bool = True
    names: bool = False
    phrases: tuple[str, ...] = ()


def interests_of(tree: Step, camera: CameraKeys | None) -> Interests:
    """Return what the behaviours and expressions of a mission look for, with the markers of the robot file."""
    senses = tree.senses
    return Interests(
        wanted=looked_for(tree) if "things" in senses else (),
        markers=_markers(camera) if "markers" in senses else None,
        motion="motion" in senses,
        faces="faces" in senses or "names" in senses,
        names="names" in senses,
        phrases=phrases_of(tree),
    )


def _markers(camera: CameraKeys | None) -> "MarkerKind":
    from perception.tracks import MarkerKind  # noqa: PLC0415 - most missions look for none

    if camera is None or camera.markers is None:
        return MarkerKind()
    return MarkerKind(camera.markers.family, camera.markers.size, camera.markers.robots)
