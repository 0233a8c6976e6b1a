"""Detectors and phrases that a mission uses; unused detectors do not run."""

from typing import TYPE_CHECKING

from drivers.api.fast_dataclass import dataclass
from drivers.api.sensor_sections import CameraKeys
from missions.language.phrases import all_phrases
from missions.language.plan import Step
from missions.language.wanted_objects import objects_to_find
from perception.api import ThingSpec

if TYPE_CHECKING:
    from perception.tracks import MarkerSet


@dataclass(frozen=True, slots=True)
class Interests:
    """Detectors to run (faces, their ``names``, ``objects``, robots with ``markers``, motion), and phrases to hear."""

    objects: tuple[ThingSpec, ...] = ()
    markers: "MarkerSet | None" = None
    motion: bool = False
    faces: bool = True
    names: bool = False
    phrases: tuple[str, ...] = ()


def interests_of(tree: Step, camera: CameraKeys | None) -> Interests:
    """Return the detectors and phrases that the tree of a mission needs.

    The markers to find are those in the ``camera`` section of the robot file.
    """
    senses = tree.senses
    return Interests(
        objects=objects_to_find(tree) if "things" in senses else (),
        markers=_markers(camera) if "markers" in senses else None,
        motion="motion" in senses,
        faces="faces" in senses or "names" in senses,
        names="names" in senses,
        phrases=all_phrases(tree),
    )


def _markers(camera: CameraKeys | None) -> "MarkerSet":
    from perception.tracks import MarkerSet  # noqa: PLC0415 - most missions look for none

    if camera is None or camera.markers is None:
        return MarkerSet()
    return MarkerSet(camera.markers.family, camera.markers.size, camera.markers.robots)
