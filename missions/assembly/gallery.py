"""Recognisers of people, by face embeddings: the user's people for a camera, drawn people for a simulated one."""

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import isfinite
from pathlib import Path

import numpy as np

from config.world_items import PersonConfig
from drivers.api import DeviceStatus, StatusCallback
from drivers.api.sensor_sections import CameraKeys
from missions.assembly.models import yunet_file
from missions.library.interests import Interests
from missions.library.people import (
    FEATURES_FILE,
    NEW_PREFIX,
    People,
    PeopleError,
    people_of,
    picture_digest,
    picture_files,
    read_picture,
)
from perception.api import Box, Image
from perception.crops import portrait_face_box
from perception.dlib_people import FEATURE_LENGTH, DlibDescriber, DlibRecogniser, Feature
from perception.identity import FaceMatch, FaceRecogniser, NullRecogniser
from perception.people import PatchRecogniser
from perception.sface import SFaceRecogniser
from perception.yunet import YuNetFaceDetector

# What dlib's network makes of people's portraits, kept beside them: it takes 84 ms for each, at each start otherwise.
#
# They are in a file of each person's folder, for the owner only, each by the digest of its picture. Whoever removes a
# person removes it too; what was of a picture that has gone goes with the next that is kept.

MAX_CACHE_BYTES = 4_000_000
"""Maximum size of a cache file in bytes; a portrait's features take 2600."""


class FeatureCache:
    """Computes the features of people's portraits, and caches them in each person's folder.

    An instance is a ``perception.dlib_people.Learner``: call it with a name and portraits.
    """

    def __init__(self, people: People, describe: DlibDescriber) -> None:
        self._people = people
        self._describe = describe

    def __call__(self, name: str, portraits: Sequence[Image]) -> list[Feature]:
        """Return the features of the portraits of the person ``name``, computed or from the cache.

        Raises the errors of the network that computes them.
        """
        home, model = self._people.folder / name, self._describe.model
        cached = _read_cache(home / FEATURES_FILE, model)
        found = {
            key: cached[key] if key in cached else self._describe(each, portrait_face_box(each))
            for each in portraits
            for key in [picture_digest(each).hex()]
        }
        if found.keys() != cached.keys():
            with suppress(OSError, PeopleError):  # no room, no rights, or they were removed meanwhile: nothing is lost
                self._write_cache(home, model, found)
        return [found[picture_digest(each).hex()] for each in portraits]

    def _write_cache(self, home: Path, model: str, found: Mapping[str, Feature]) -> None:
        """Write the features in ``found`` (by picture digest) whose pictures still exist in the folder ``home``.

        ``model`` identifies the network that computed the features.
        """
        with self._people.exclusive_access():
            there = {
                picture_digest(picture).hex()
                for path in picture_files(home)
                if (picture := read_picture(path)) is not None
            }
            features = {key: feature.tolist() for key, feature in found.items() if key in there}
            if not features:
                return
            new = home / f"{NEW_PREFIX}features"
            new.unlink(missing_ok=True)
            with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
                json.dump({"model": model, "features": features}, file)
            new.replace(home / FEATURES_FILE)


def _read_cache(path: Path, model: str) -> dict[str, Feature]:
    """Return the cached features of ``model`` by digest; empty for a damaged file, a link, or another model."""
    try:
        with open(path, encoding="utf-8", opener=_open_no_link) as file:
            told = json.loads(file.read(MAX_CACHE_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    features = told.get("features") if isinstance(told, dict) and told.get("model") == model else None
    if not isinstance(features, dict) or not all(map(_is_feature, features.values())):
        return {}
    return {key: np.array(values, np.float64) for key, values in features.items()}


def _open_no_link(path: str, flags: int) -> int:
    """Open a file that is not a symbolic link, without blocking."""
    return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK)


def _is_feature(values: object) -> bool:
    """Return True if the values are the numbers of one face's features."""
    return (
        isinstance(values, list)
        and len(values) == FEATURE_LENGTH
        and all(type(each) is float and isfinite(each) for each in values)
    )


def recogniser(
    interests: Interests,
    report: StatusCallback,
    *,
    camera: CameraKeys | None = None,
    drawn: Sequence[PersonConfig] = (),
) -> FaceRecogniser | None:
    """Return a recogniser of the user's people for a real ``camera``, or else of the simulated people in ``drawn``.

    Returns None if the mission does not use names. Problems with the pictures are reported at the first recognition.
    """
    if not interests.names:
        return None
    notices = list[DeviceStatus]()
    if camera is None:
        from missions.assembly.drawn_portraits import drawn_gallery  # noqa: PLC0415 - the metal imports no simulation

        found = drawn_gallery(drawn, notices.append)
    else:
        found = gallery(camera, notices.append)
    return _ReportingRecogniser(found, notices, report) if notices else found


class _ReportingRecogniser:
    """Recogniser that reports the problems with its pictures at its first use."""

    def __init__(self, recogniser: FaceRecogniser, notices: Sequence[DeviceStatus], report: StatusCallback) -> None:
        self._recogniser = recogniser
        self._notices = list(notices)
        self._report = report

    def match(self, image: Image, face: Box) -> FaceMatch | None:
        while self._notices:
            self._report(self._notices.pop(0))
        return self._recogniser.match(image, face)


def gallery(camera: CameraKeys, report: StatusCallback) -> FaceRecogniser:
    """Return the recogniser of the user's people; without usable pictures, all people are strangers.

    Unreadable pictures are reported and left out.
    """

    def report_error(error: PeopleError) -> None:
        report(DeviceStatus("camera", "fault", str(error), error.hint))

    people = people_of(camera)
    try:
        if people.restrict_access():
            report(
                DeviceStatus("camera", "fault", f"pictures of people in {people.folder} were readable by others: fixed")
            )
        portraits = people.portraits(report_error)
    except PeopleError as error:
        report(DeviceStatus("camera", "fault", f"people cannot be recognised: {error}", error.hint))
        return NullRecogniser()
    if not portraits:
        report(
            DeviceStatus("camera", "fault", "no people are known yet, so all are unknown", "mission person add NAME")
        )
        return NullRecogniser()
    if camera.identity.method == "sface":
        model = Path(camera.identity.model).expanduser()
        return SFaceRecogniser(model, YuNetFaceDetector(yunet_file(camera)), portraits)
    if camera.identity.method == "dlib":
        describe = DlibDescriber()
        return DlibRecogniser(portraits, describe, FeatureCache(people, describe))
    return PatchRecogniser(portraits)
