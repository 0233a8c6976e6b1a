"""Whom the robot knows: the user's people for a real camera, the drawn ones for a simulated one."""

from collections.abc import Sequence
from pathlib import Path

from config.people import PersonConfig
from drivers.api import DeviceStatus, Report
from drivers.api.senses import CameraKeys
from missions.assembly.detectors import yunet_file
from missions.assembly.features import Features
from missions.library.interests import Interests
from missions.library.people import PeopleError, people_of
from perception.api import Box, Image
from perception.dlib_people import DlibDescriber, DlibPeople
from perception.identity import Look, Nobody, Recogniser
from perception.people import KnownPeople
from perception.sface import SFacePeople
from perception.yunet import YuNetFaces


def recogniser(
    interests: Interests, report: Report, *, camera: CameraKeys | None = None, drawn: Sequence[PersonConfig] = ()
) -> Recogniser | None:
    """Return what knows the people whom a robot sees: the user's, for a real ``camera``, else those ``drawn``.

    None where the mission does not ask for names. What is the matter with the pictures is told to ``report`` at the
    first look at somebody.
    """
    if not interests.names:
        return None
    notices = list[DeviceStatus]()
    if camera is None:
        from missions.assembly.drawn import drawn_gallery  # noqa: PLC0415 - the metal imports no simulation

        found = drawn_gallery(drawn, notices.append)
    else:
        found = gallery(camera, notices.append)
    return _Remarking(found, notices, report) if notices else found


class _Remarking:
    """A recogniser that tells, at the first look at somebody, what is the matter with its pictures."""

    def __init__(self, recogniser: Recogniser, notices: Sequence[DeviceStatus], report: Report) -> None:
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
        report(DeviceStatus("camera", "fault", str(error), error.hint))

    people = people_of(camera)
    try:
        if people.shut():
            report(
                DeviceStatus("camera", "fault", f"others could read the pictures of people in {people.where}; not now")
            )
        portraits = people.portraits(told)
    except PeopleError as error:
        report(DeviceStatus("camera", "fault", f"nobody can be recognised: {error}", error.hint))
        return Nobody()
    if not portraits:
        report(
            DeviceStatus("camera", "fault", "it knows nobody yet, so that all are unknown", "mission person add NAME")
        )
        return Nobody()
    if camera.identity.method == "sface":
        model = Path(camera.identity.model).expanduser()
        return SFacePeople(model, YuNetFaces(yunet_file(camera)), portraits)
    if camera.identity.method == "dlib":
        describe = DlibDescriber()
        return DlibPeople(portraits, describe, Features(people, describe))
    return KnownPeople(portraits)
