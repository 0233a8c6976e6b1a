"""What dlib's network makes of people's portraits, kept beside them: it takes 84 ms for each, at each start otherwise.

They are in a file of each person's folder, for the owner only, each by the digest of its picture. Whoever removes a
person removes it too; what was of a picture that has gone goes with the next that is kept.
"""

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import isfinite
from pathlib import Path

import numpy as np

from missions.library.people import People, PeopleError
from missions.library.portraits import FEATURES, NEW, digest, files_in, read
from perception.api import Image
from perception.crops import face_in
from perception.dlib_people import LENGTH, DlibDescriber, Feature

MOST_BYTES = 4_000_000
"""Bytes of a file that is read: a picture's numbers are 2600."""


class Features:
    """Makes features of portraits, those alone that are not kept: a ``perception.dlib_people.Learner``."""

    def __init__(self, people: People, describe: DlibDescriber) -> None:
        self._people = people
        self._describe = describe

    def __call__(self, name: str, portraits: Sequence[Image]) -> list[Feature]:
        """Return the features of the portraits of somebody; raises what ``describe`` does."""
        home, model = self._people.where / name, self._describe.model
        kept = _kept(home / FEATURES, model)
        found = {
            key: kept[key] if key in kept else self._describe(each, face_in(each))
            for each in portraits
            for key in [digest(each).hex()]
        }
        if found.keys() != kept.keys():
            with suppress(OSError, PeopleError):  # no room, no rights, or they were removed meanwhile: nothing is lost
                self._keep(home, model, found)
        return [found[digest(each).hex()] for each in portraits]

    def _keep(self, home: Path, model: str, found: Mapping[str, Feature]) -> None:
        """Write those of pictures that are still there."""
        with self._people.alone():
            there = {digest(picture).hex() for path in files_in(home) if (picture := read(path)) is not None}
            features = {key: feature.tolist() for key, feature in found.items() if key in there}
            if not features:
                return
            new = home / f"{NEW}features"
            new.unlink(missing_ok=True)
            with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
                json.dump({"model": model, "features": features}, file)
            new.replace(home / FEATURES)


def _kept(path: Path, model: str) -> dict[str, Feature]:
    """Return what is kept of ``model``, by digest: nothing where the file is damaged, a link, or another model's."""
    try:
        with open(path, encoding="utf-8", opener=_unfollowed) as file:
            told = json.loads(file.read(MOST_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    features = told.get("features") if isinstance(told, dict) and told.get("model") == model else None
    if not isinstance(features, dict) or not all(map(_whole, features.values())):
        return {}
    return {key: np.array(values, np.float64) for key, values in features.items()}


def _unfollowed(path: str, flags: int) -> int:
    """Open what is no link, and wait for nobody."""
    return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK)


def _whole(values: object) -> bool:
    """Whether these are the numbers of one feature."""
    return (
        isinstance(values, list)
        and len(values) == LENGTH
        and all(type(each) is float and isfinite(each) for each in values)
    )
