"""What a mission looks for and listens for: a detector that nobody asks does not run."""

from dataclasses import dataclass

from drivers.api.senses import CameraKeys
from missions.assembly.things import looked_for
from missions.language.phrases import phrases_of
from missions.language.plan import Step
from perception.markers import MarkerKind
from perception.wanted import Wanted


@dataclass(frozen=True, slots=True)
class Interests:
    """Faces and whose they are (``names``), the things ``wanted``, other robots that wear ``markers``, and motion.

    ``phrases`` are what is listened for.
    """

    wanted: tuple[Wanted, ...] = ()
    markers: MarkerKind | None = None
    motion: bool = False
    faces: bool = True
    names: bool = False
    phrases: tuple[str, ...] = ()


def interests_of(tree: Step, camera: CameraKeys | None) -> Interests:
    """Return what the behaviours and expressions of a mission look for, with the markers of the robot file."""
    senses = tree.senses
    kind = MarkerKind()
    if camera is not None and camera.markers is not None:
        kind = MarkerKind(camera.markers.family, camera.markers.size, camera.markers.robots)
    return Interests(
        wanted=looked_for(tree) if "things" in senses else (),
        markers=kind if "markers" in senses else None,
        motion="motion" in senses,
        faces="faces" in senses or "names" in senses,
        names="names" in senses,
        phrases=phrases_of(tree),
    )
