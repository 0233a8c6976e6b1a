"""Recogniser for the people of a simulated world, from drawn portraits."""

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from math import atan2

import numpy as np

from config.world_items import PersonConfig
from drivers.api import DeviceStatus, StatusCallback
from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens as Lens
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from perception.api import Image
from perception.haar_faces import HaarFaceDetector
from perception.identity import FaceRecogniser, NullRecogniser
from perception.people import NotOneFaceError, PatchRecogniser, enrol

PORTRAIT_COUNT = 5
"""Number of portraits that are drawn of each simulated person, from which the recogniser learns the face."""

PORTRAIT_DISTANCES = (1.0, 1.5)
"""Distances in metres from the camera at which portraits are drawn."""

EYE_HEIGHT, CAMERA_DROP = 1.6, 0.5
"""Height of their eyes above the floor, and of the eyes above the camera, in metres."""

LENS = Lens(640, 480, 1.0471975512)


def drawn_gallery(people: Sequence[PersonConfig], report: StatusCallback) -> FaceRecogniser:
    """Return a recogniser for the people in a world file who have ``known: true``; it learns from drawn portraits.

    ``report`` is called if two of them look alike.
    """
    known = [person for person in people if person.known]
    alike = defaultdict[str, list[str]](list)
    for person in known:
        alike[person.look].append(person.name)
    for names in alike.values():
        if len(names) > 1:
            hint = "give each a look of their own in the world file"
            report(DeviceStatus("camera", "fault", f"{' and '.join(names)} look alike", hint))
    if not known:
        return NullRecogniser()
    others = [_portraits(look) for look in APPEARANCES if look not in alike]
    return PatchRecogniser(
        {person.name: _portraits(person.look) for person in known}, [each for each in others if each]
    )


@cache
def _portraits(look: str) -> Sequence[Image]:
    """Return portraits of a person alone in an empty room; always the same. This takes a second."""
    random, found, detector = np.random.default_rng(0), list[Image](), HaarFaceDetector()
    for number in range(PORTRAIT_COUNT):
        away = PORTRAIT_DISTANCES[0] + (PORTRAIT_DISTANCES[1] - PORTRAIT_DISTANCES[0]) * number / (PORTRAIT_COUNT - 1)
        somebody = Person("somebody", look, x=away, y=0.0, height=EYE_HEIGHT)
        pitch = -atan2(CAMERA_DROP, away) + random.uniform(-0.1, 0.1)
        view = Viewpoint(0.0, 0.0, EYE_HEIGHT - CAMERA_DROP, yaw=random.uniform(-0.25, 0.25), pitch=pitch)
        image = Renderer(SimulatedWorld(people=(somebody,)), LENS, seed=number).draw(view, 0.0)
        with suppress(NotOneFaceError):  # then there is one picture less
            found.append(enrol(image, detector))
    return found
