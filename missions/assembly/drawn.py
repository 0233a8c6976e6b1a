"""Whom a simulated robot knows: the people of its world, each as they are drawn."""

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from math import atan2

import numpy as np

from config.things import PersonConfig
from drivers.api import DeviceStatus, Report
from drivers.sim.looks import LOOKS
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Pinhole as Lens
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import World
from perception.api import Image
from perception.faces import HaarFaces
from perception.identity import Nobody, Recogniser
from perception.people import KnownPeople, NotOneFace, enrol

PICTURES = 5
"""Pictures that are drawn of each person."""

AWAY = (1.0, 1.5)
"""Metres from the camera at which they are drawn."""

HEIGHT, BELOW = 1.6, 0.5
"""Metres from the floor up to their eyes, and from these down to the camera."""

LENS = Lens(640, 480, 1.0471975512)


def drawn_gallery(people: Sequence[PersonConfig], report: Report) -> Recogniser:
    """Return what knows the people of a world, each as they are drawn: all but those who are not ``known``.

    All looks that none of them has are strangers for sure.
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
        return Nobody()
    others = [_drawn(look) for look in LOOKS if look not in alike]
    return KnownPeople({person.name: _drawn(person.look) for person in known}, [each for each in others if each])


@cache
def _drawn(look: str) -> Sequence[Image]:
    """Return portraits of somebody who is drawn alone in an empty room, the same each time; it takes a second."""
    random, found, detector = np.random.default_rng(0), list[Image](), HaarFaces()
    for number in range(PICTURES):
        away = AWAY[0] + (AWAY[1] - AWAY[0]) * number / (PICTURES - 1)
        somebody = Person("somebody", look, x=away, y=0.0, height=HEIGHT)
        pitch = -atan2(BELOW, away) + random.uniform(-0.1, 0.1)
        view = Viewpoint(0.0, 0.0, HEIGHT - BELOW, yaw=random.uniform(-0.25, 0.25), pitch=pitch)
        image = Renderer(World(people=(somebody,)), LENS, seed=number).draw(view, 0.0)
        with suppress(NotOneFace):  # then there is one picture less
            found.append(enrol(image, detector))
    return found
