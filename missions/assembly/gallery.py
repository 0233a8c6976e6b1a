"""Whom the robot knows: the user's people for a real camera, the drawn ones for a simulated one."""

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from math import atan2
from pathlib import Path

import numpy as np

from config.people import PersonConfig
from drivers.api import Notice, Report
from drivers.api.senses import CameraKeys
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Pinhole as Lens
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import World
from missions.assembly.detectors import yunet_file
from missions.assembly.interests import Interests
from missions.people import People, PeopleError, folder
from perception.api import Box, Image
from perception.faces import HaarFaces
from perception.identity import Look, Nobody, Recogniser
from perception.people import NotOneFace, enrol, fisher_people
from perception.sface import SFacePeople
from perception.yunet import YuNetFaces

PICTURES = 8
"""Pictures that are drawn of each person."""

AWAY = (1.0, 1.5)
"""Metres from the camera at which they are drawn."""

HEIGHT, BELOW = 1.6, 0.5
"""Metres from the floor up to their eyes, and from these down to the camera."""

LENS = Lens(640, 480, 1.0471975512)


def people_of(camera: CameraKeys) -> People:
    """Return the people whom a robot knows: in the folder that its file names, else in the user's."""
    named = camera.identity.people
    return People(Path(named).expanduser() if named else folder())


def recogniser(
    interests: Interests, report: Report, *, camera: CameraKeys | None = None, drawn: Sequence[PersonConfig] = ()
) -> Recogniser | None:
    """Return what knows the people whom a robot sees: the user's, for a real ``camera``, else those ``drawn``.

    None where the mission does not ask for names. What is the matter with the pictures is told to ``report`` at the
    first look at somebody.
    """
    if not interests.names:
        return None
    notices = list[Notice]()
    found = drawn_gallery(drawn, notices.append) if camera is None else gallery(camera, notices.append)
    return _Remarking(found, notices, report) if notices else found


class _Remarking:
    """A recogniser that tells, at the first look at somebody, what is the matter with its pictures."""

    def __init__(self, recogniser: Recogniser, notices: Sequence[Notice], report: Report) -> None:
        self._recogniser = recogniser
        self._notices = list(notices)
        self._report = report

    def look(self, image: Image, face: Box) -> Look | None:
        while self._notices:
            self._report(self._notices.pop(0))
        return self._recogniser.look(image, face)


def gallery(camera: CameraKeys, report: Report) -> Recogniser:
    """Return what knows the user's people; with nobody there, or where they cannot be read, all are strangers.

    ``report`` hears of pictures that cannot be read, which are left out.
    """

    def told(error: PeopleError) -> None:
        report(Notice("camera", "fault", str(error), error.hint))

    people = people_of(camera)
    try:
        if people.shut():
            report(Notice("camera", "fault", f"others could read the pictures of people in {people.where}; not now"))
        portraits = people.portraits(told)
    except PeopleError as error:
        report(Notice("camera", "fault", f"nobody can be recognised: {error}", error.hint))
        return Nobody()
    if not portraits:
        report(Notice("camera", "fault", "it knows nobody yet, so that all are unknown", "mission person add NAME"))
        return Nobody()
    if camera.identity.method == "sface":
        model = Path(camera.identity.model).expanduser()
        return SFacePeople(model, YuNetFaces(yunet_file(camera)), portraits)
    return fisher_people(portraits)


def drawn_gallery(people: Sequence[PersonConfig], report: Report) -> Recogniser:
    """Return what knows the people of a world, each as they are drawn: all but those who are not ``known``."""
    known = [person for person in people if person.known]
    alike = defaultdict[str, list[str]](list)
    for person in known:
        alike[person.look].append(person.name)
    for names in alike.values():
        if len(names) > 1:
            hint = "give each a look of their own in the world file"
            report(Notice("camera", "fault", f"{' and '.join(names)} look alike", hint))
    if not known:
        return Nobody()
    return fisher_people({person.name: _drawn(person.look) for person in known})


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
