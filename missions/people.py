"""The people whom the robot knows: their pictures, each in a folder of its name, which nobody else may read.

Nothing else is kept of them: what recognises them is learnt anew from the pictures at each start.
"""

import os
import re
import shutil
import stat
import tempfile
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from perception.api import UNKNOWN, Image

FOLDER_RIGHTS, FILE_RIGHTS = 0o700, 0o600

_NAME = re.compile(r"[^\W_](?:[\w \-]*\w)?")
"""Letters and digits; spaces, '-' and '_' between them."""


class PeopleError(RuntimeError):
    """Something that cannot be done with people's pictures: the message says what, ``hint`` what to type next."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True, slots=True)
class Known:
    """Somebody whom the robot knows: how many pictures there are, and since when (seconds since 1970) the first."""

    name: str
    pictures: int
    since: float


def folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return where pictures of people are kept: among the user's data, as the XDG base directory specification says."""
    data = environment.get("XDG_DATA_HOME", "")
    return (Path(data) if Path(data).is_absolute() else Path.home() / ".local/share") / "missiontree/people"


def proper_name(name: str) -> str:
    """Return a name as it is kept. Raises PeopleError for what cannot be anybody's."""
    found = unicodedata.normalize("NFC", name).strip()
    if found.casefold() == UNKNOWN:
        raise PeopleError(f"'{UNKNOWN}' is what strangers are called", hint="choose another name")
    if len(found) > 60 or _NAME.fullmatch(found) is None:
        raise PeopleError(f"{name!r:.80} cannot be a name", hint="letters, digits, and spaces or '-' between them")
    return found


class People:
    """The pictures in one folder. Nothing is touched before it is asked for."""

    def __init__(self, where: Path) -> None:
        self.where = where

    def known(self) -> list[Known]:
        """Return who is known, by name. Raises PeopleError for a folder that cannot be read."""
        found = []
        for name in self._names():
            files = self._files(name)
            found.append(Known(name, len(files), min((file.stat().st_mtime for file in files), default=0.0)))
        return found

    def find(self, name: str) -> str | None:
        """Return the name of somebody as it is kept, however it is capitalised; None for nobody. Raises PeopleError."""
        wanted = proper_name(name).casefold()
        return next((each for each in self._names() if each.casefold() == wanted), None)

    def portraits(self, name: str) -> list[Image]:
        """Return somebody's pictures. Raises PeopleError for one that cannot be read."""
        found = []
        for file in self._files(name):
            image = cv2.imread(str(file), cv2.IMREAD_COLOR)
            if image is None:
                raise PeopleError(f"{file}: is no picture", hint=f'mission person remove "{name}", then add them anew')
            found.append(np.asarray(image, np.uint8))
        return found

    def all_portraits(self) -> dict[str, list[Image]]:
        """Return the pictures of everybody of whom there are any, by name. Raises PeopleError."""
        found = {each.name: self.portraits(each.name) for each in self.known()}
        return {name: portraits for name, portraits in found.items() if portraits}

    def add(self, name: str, portraits: Sequence[Image]) -> str:
        """Keep pictures of somebody, beside those that are there; return the name as it is kept. Raises PeopleError."""
        kept = self.find(name) or proper_name(name)
        home = self.where / kept
        try:
            for each in (self.where, home):
                each.mkdir(parents=True, exist_ok=True, mode=FOLDER_RIGHTS)
                each.chmod(
                    FOLDER_RIGHTS
                )  # mkdir's mode is cut by the umask, and says nothing of a folder that is there
            first = max((int(file.stem) for file in self._files(kept)), default=0) + 1
            for number, portrait in enumerate(portraits, start=first):
                _write(home / f"{number:03}.png", portrait)
        except OSError as error:
            raise PeopleError(f"{home}: {error.strerror}", hint=f"df -h {self.where}  (is there room?)") from error
        return kept

    def remove(self, name: str) -> int:
        """Delete somebody's pictures; return how many there were. Raises PeopleError for somebody who is not known."""
        kept = self.find(name)
        if kept is None:
            known = ", ".join(self._names()) or "nobody"
            raise PeopleError(f"nobody is called '{name}'", hint=f"known: {known}")
        count = len(self._files(kept))
        try:
            shutil.rmtree(self.where / kept)
        except OSError as error:
            raise PeopleError(f"{self.where / kept}: {error.strerror}: look what is left there") from error
        return count

    def shut(self) -> bool:
        """Take the rights of others away from the folder and all in it, and say whether anybody had some.

        Raises PeopleError where that cannot be: these are pictures of people.
        """
        open_ones = [path for path in self._all() if stat.S_IMODE(path.stat().st_mode) & 0o077]
        try:
            for path in open_ones:
                path.chmod(FOLDER_RIGHTS if path.is_dir() else FILE_RIGHTS)
        except OSError as error:
            raise PeopleError(
                f"{self.where}: others may read these pictures of people, and that cannot be changed: {error.strerror}",
                hint=f"sudo chown -R $USER {self.where}",
            ) from error
        return bool(open_ones)

    def _names(self) -> list[str]:
        try:
            return sorted(path.name for path in self.where.iterdir() if path.is_dir() and not path.is_symlink())
        except FileNotFoundError:
            return []
        except OSError as error:
            raise PeopleError(f"{self.where}: {error.strerror}", hint=f"ls -ld {self.where}") from error

    def _files(self, name: str) -> list[Path]:
        return sorted(file for file in (self.where / name).glob("*.png") if file.stem.isdigit())

    def _all(self) -> list[Path]:
        return [self.where, *self.where.rglob("*")] if self.where.is_dir() else []


def _write(path: Path, picture: Image) -> None:
    """Write a picture, whole or not at all, so that only its owner can read it at any time."""
    done, data = cv2.imencode(".png", picture)
    if not done:
        raise OSError(0, "a picture that cannot be encoded")
    number, name = tempfile.mkstemp(dir=path.parent, prefix=".new-")  # with the rights of FILE_RIGHTS
    part = Path(name)
    try:
        with os.fdopen(number, "wb") as file:
            file.write(data.tobytes())
            file.flush()
            os.fsync(file.fileno())
        part.chmod(FILE_RIGHTS)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
