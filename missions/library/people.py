"""The people whom the robot knows: their pictures, each in a folder of its name, which nobody else may read.

Nothing else is kept of them but what a network has made of these pictures (``missions.assembly.gallery``), and that
goes with them. Somebody is a folder with pictures (``missions.library.people``); whatever else is there belongs to
somebody else, and is left alone.
"""

import fcntl
import os
import re
import stat
import tempfile
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from shlex import quote

from drivers.api.sensor_sections import CameraKeys
from missions.library.folders import data_folder
from perception.api import UNKNOWN, Image
from perception.people import MAX_PICTURES, MAX_PICTURES_TOGETHER, MIN_PICTURES

# Pictures of one person in a folder: for their owner only, and all that are added or none.
#
# A picture is a file such as ``001.png``. Nothing else in the folder is touched, and no link is followed. Other
# programs may add and remove meanwhile: what has gone between listing and reading is not there.

NEW_PREFIX = ".new-"
"""How the names of folders begin whose pictures are not all there yet."""

FEATURES_FILE = ".features.json"
"""What a network has made of the pictures in a folder: see ``missions.assembly.gallery``."""

MAX_PIXELS, MAX_PICTURE_BYTES = 4_000_000, 16_000_000
"""Pixels and bytes of a picture: a portrait is of some 300 x 300."""

_NAME = re.compile(r"([0-9]{3,})\.png")


def picture_files(folder: Path) -> dict[Path, os.stat_result]:
    """Return the pictures in a folder, each with what the disk knows of it. Raises OSError."""
    found = {}
    with suppress(FileNotFoundError, NotADirectoryError):
        for path in sorted(folder.iterdir()):
            with suppress(FileNotFoundError):
                status = path.lstat()
                if _NAME.fullmatch(path.name) and stat.S_ISREG(status.st_mode):
                    found[path] = status
    return found


def read_picture(path: Path) -> Image | None:
    """Return a picture; None for a file that is none, or too large for a portrait. Raises OSError."""
    if path.stat().st_size > MAX_PICTURE_BYTES:
        return None
    from drivers.pictures.decode import decode_picture  # noqa: PLC0415 - most commands read no picture

    return decode_picture(path.read_bytes(), MAX_PIXELS)


def picture_digest(portrait: Image) -> bytes:
    """Return by what a picture is known again: the SHA-256 of its size and pixels."""
    return sha256(str(portrait.shape).encode() + portrait.tobytes()).digest()


def store_pictures(portraits: Sequence[Image], folder: Path) -> None:
    """Add pictures to a folder, which need not be there, for their owner only. Raises OSError, and then adds none."""
    with ExitStack() as undone:
        new = Path(tempfile.mkdtemp(dir=folder.parent, prefix=NEW_PREFIX))  # for its owner only, as what is in it
        undone.callback(delete_pictures, new)
        for number, portrait in enumerate(portraits, start=_last_in(folder) + 1):
            _write_picture(new / f"{number:03}.png", portrait)
        if folder.is_dir() and not folder.is_symlink():
            for path in picture_files(new):
                undone.callback(path.rename(folder / path.name).unlink, missing_ok=True)
            new.rmdir()
        else:
            new.rename(folder)
        undone.pop_all()


def delete_pictures(folder: Path) -> int:
    """Delete the pictures in a folder and what was made of them; and it too when nothing is left in it.

    Return how many there were. Raises OSError.
    """
    pictures = picture_files(folder)
    for path in (folder / FEATURES_FILE, *pictures):
        path.unlink(missing_ok=True)
    with suppress(OSError):  # there is something else in it, or it has gone
        folder.rmdir()
    return len(pictures)


def _last_in(folder: Path) -> int:
    """Return the highest number in a folder, also of what is a picture by name only: that must not be written over."""
    names = (path.name for path in folder.iterdir()) if folder.is_dir() else ()
    return max((int(found[1]) for name in names if (found := _NAME.fullmatch(name))), default=0)


def _write_picture(path: Path, picture: Image) -> None:
    """Write a picture, and wait until it is on the disk."""
    import cv2  # noqa: PLC0415 - as above

    done, data = cv2.imencode(".png", picture)
    if not done:
        raise OSError(0, "a picture that cannot be encoded")
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data.tobytes())
        file.flush()
        os.fsync(file.fileno())


MAX_NAME_LENGTH = 60
"""Letters of a name: also of four bytes each they make the name of a folder."""

JOINERS = "\u200c\u200d"
"""Invisible signs that part and join letters in Persian and Indian names."""

NAME_SIGNS = frozenset(" -_'\u2019." + JOINERS)
"""Signs of a name beside letters, their marks and digits."""


class PeopleError(RuntimeError):
    """Something that cannot be done with people's pictures: the message says what, ``hint`` what to type next."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


ProblemListener = Callable[[PeopleError], None]
"""A listener that hears of pictures that are left out."""


@dataclass(frozen=True, slots=True)
class KnownPerson:
    """Somebody whom the robot knows: how many pictures there are, and since when (seconds since 1970) the first."""

    name: str
    pictures: int
    since: float


def people_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return where pictures of people are kept: among the user's data."""
    return data_folder(environment) / "people"


def proper_name(name: str) -> str:
    """Return a name as it is kept. Raises PeopleError for what cannot be anybody's."""
    found = unicodedata.normalize("NFC", name).strip()
    if found.casefold() == UNKNOWN:
        raise PeopleError(f"'{UNKNOWN}' is what strangers are called", hint="choose another name")
    fits = all(letter in NAME_SIGNS or unicodedata.category(letter)[0] in "LMN" for letter in found)
    if not (fits and found[:1].isalpha() and len(found) <= MAX_NAME_LENGTH):
        hint = f"first a letter of any script, then letters, digits, spaces and - _ ' . up to {MAX_NAME_LENGTH} in all"
        raise PeopleError(f"{name!r:.80} cannot be a name", hint=hint)
    return found


class People:
    """The pictures in one folder. Nothing is touched before it is asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def known_people(self) -> list[KnownPerson]:
        """Return who is known, by name. Raises PeopleError for a folder that cannot be read."""
        return [
            KnownPerson(name, len(files), min(status.st_mtime for status in files.values()))
            for name, files in self._files().items()
        ]

    def find(self, name: str) -> str | None:
        """Return the name of somebody as it is kept, however it is capitalised; None for nobody. Raises PeopleError."""
        return next((each for each in self._files() if _comparison_key(each) == _comparison_key(name)), None)

    def portraits(self, on_problem: ProblemListener) -> dict[str, list[Image]]:
        """Return the pictures of everybody of whom there are enough to learn from, by name.

        Of somebody with many pictures some are taken, spread over all of them: what learns them compares each with
        each. ``told`` hears of that, of each file that is no picture, and of each person of whom there are too few, or
        for whom there is no room. Raises PeopleError for a folder that cannot be read.
        """
        found = {}
        for name, files in self._select_files(on_problem).items():
            portraits = [portrait for path in files if (portrait := _read_or_report(path, on_problem)) is not None]
            if len(portraits) >= MIN_PICTURES:
                found[name] = portraits
            elif portraits:
                what = f"{name}: {len(portraits)} pictures are too few to know somebody by: it takes {MIN_PICTURES}"
                on_problem(PeopleError(what, hint=f"mission person add {quote(name)}"))
        return found

    def select_new(self, name: str, portraits: Sequence[Image]) -> list[Image]:
        """Return which of some pictures ``add`` would keep: each once, and none that is there. Raises as it does."""
        kept = self.find(name) or proper_name(name)
        whose = {
            picture_digest(portrait): who
            for who, files in self._files().items()
            for path in files
            if (portrait := _read_or_report(path, lambda _: None)) is not None
        }
        found = {picture_digest(portrait): portrait for portrait in portraits}
        others = [whose[each] for each in found if whose.get(each, kept) != kept]
        if others:
            hint = f"leave it out, or first: mission person remove {quote(others[0])}"
            raise PeopleError(f"nothing was kept: one of the pictures of {kept} is {others[0]}'s already", hint=hint)
        fresh = [portrait for each, portrait in found.items() if each not in whose]
        count = len(fresh) + list(whose.values()).count(kept)
        if count < MIN_PICTURES:
            hint = f"it takes {MIN_PICTURES} at least"
            raise PeopleError(f"too few pictures of {kept}: {count}, where each counts once", hint=hint)
        return fresh

    def add(self, name: str, portraits: Sequence[Image]) -> str:
        """Keep pictures of somebody, beside those that are there; return the name as it is kept.

        A picture that is there already is not kept again. Raises PeopleError for a picture of somebody else's, too few
        pictures, and what cannot be written; then none is kept.
        """
        fresh = self.select_new(name, portraits)
        kept = self.find(name) or proper_name(name)
        try:
            with self.exclusive_access():
                if fresh:
                    store_pictures(fresh, self.folder / kept)
        except OSError as error:
            hint = f"df -h {self.folder}  (is there room?)"
            raise PeopleError(f"{self.folder / kept}: nothing was kept: {error.strerror}", hint=hint) from error
        self.restrict_access()
        return kept

    def remove(self, name: str) -> int:
        """Delete somebody's pictures, and the folder if there is nothing else in it; return how many there were.

        Raises PeopleError for somebody who is not known, and what cannot be deleted.
        """
        kept = self.find(name)
        if kept is None:
            known = ", ".join(self._files()) or "nobody"
            raise PeopleError(f"nobody is called '{name}'", hint=f"known: {known}")
        home = self.folder / kept
        try:
            with self.exclusive_access():
                return delete_pictures(home)
        except OSError as error:
            raise PeopleError(f"{home}: {error.strerror}", hint=f"ls -l {home}  (what is left there?)") from error

    @contextmanager
    def exclusive_access(self) -> Iterator[None]:
        """Make the folder, keep others from changing it meanwhile, and clear away what one that was killed has left."""
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        number = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            with suppress(OSError):  # a network's disk may know no locks: there only one may add at a time
                fcntl.flock(number, fcntl.LOCK_EX)
            for left in self._folders():
                if left.name.startswith(NEW_PREFIX) or _is_left_over(left):
                    delete_pictures(left)
            yield
        finally:
            os.close(number)

    def restrict_access(self) -> bool:
        """Take the rights of others away from the folder and the pictures in it, and say whether anybody had some.

        Where nobody is known nothing is touched. Raises PeopleError where it cannot be: these are pictures of people.
        """
        everybody = self._files()
        folders = [self.folder, *(self.folder / name for name in everybody)] if everybody else []
        changed = False
        try:
            for path in (*folders, *(file for files in everybody.values() for file in files)):
                with suppress(FileNotFoundError):
                    changed |= _restrict_file(path)
        except OSError as error:
            raise PeopleError(
                f"{self.folder}: others may read these pictures of people, and that cannot be changed: {error.strerror}",
                hint=f"sudo chown -R $USER {self.folder}",
            ) from error
        return changed

    def _select_files(self, on_problem: ProblemListener) -> dict[str, list[Path]]:
        """Return the files to learn from, and tell of what is left out."""
        everybody = {name: list(files) for name, files in self._files(on_problem).items()}
        late = list(everybody)[MAX_PICTURES_TOGETHER // MIN_PICTURES :]
        if late:
            on_problem(PeopleError(f"{len(late)} people are left out, {late[0]} to {late[-1]}: there is room for "
                             f"{MAX_PICTURES_TOGETHER // MIN_PICTURES}", hint="mission person remove NAME"))  # fmt: skip
        share = min(MAX_PICTURES, MAX_PICTURES_TOGETHER // max(1, len(everybody) - len(late)))
        for name, files in everybody.items():
            if len(files) > share and name not in late:
                on_problem(PeopleError(f"{name}: {share} of {len(files)} pictures are used, spread over all of them"))
                everybody[name] = [files[place * len(files) // share] for place in range(share)]
        return {name: files for name, files in everybody.items() if name not in late}

    def _files(self, on_problem: ProblemListener = lambda _: None) -> dict[str, dict[Path, os.stat_result]]:
        """Return the files of everybody of whom there are any. Raises PeopleError."""
        found = {}
        for home in self._folders():
            try:
                files = {} if home.name.startswith(".") else picture_files(home)
            except OSError as error:
                on_problem(PeopleError(f"{home}: {error.strerror}, and is left out", hint=f"ls -ld {home}"))
                continue
            if files:
                found[home.name] = files
        return found

    def _folders(self) -> list[Path]:
        """Return all folders in ours, links to some not among them. Raises PeopleError."""
        try:
            return sorted(path for path in self.folder.iterdir() if path.is_dir() and not path.is_symlink())
        except FileNotFoundError:
            return []
        except OSError as error:
            raise PeopleError(f"{self.folder}: {error.strerror}", hint=f"ls -ld {self.folder}") from error


def _is_left_over(home: Path) -> bool:
    """Whether somebody's pictures were deleted by hand, and what a network made of them was not."""
    with suppress(OSError):
        return (home / FEATURES_FILE).is_file() and not picture_files(home)
    return False


def _comparison_key(name: str) -> str:
    """Return what is the same for all ways to write a name: capitals, composed letters, joiners that are not seen."""
    seen = "".join(letter for letter in name.strip() if letter not in JOINERS)
    return unicodedata.normalize("NFC", seen.casefold())


def _read_or_report(path: Path, on_problem: ProblemListener) -> Image | None:
    """Return a picture, None for one that has just been removed; for one that cannot be read too, and tell of it."""
    try:
        found = read_picture(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        on_problem(PeopleError(f"{path}: {error.strerror}, and is left out", hint=f"ls -l {path}"))
        return None
    if found is None:
        on_problem(PeopleError(f"{path}: is no portrait, and is left out", hint=f"rm {quote(str(path))}"))
    return found


def _restrict_file(path: Path) -> bool:
    """Take the rights of others away from a file or folder, and say whether they had some. Raises OSError."""
    rights = stat.S_IMODE(path.stat().st_mode)
    if not rights & 0o077:
        return False
    path.chmod(rights & 0o700)
    return True


def people_of(camera: CameraKeys | None) -> People:
    """Return the people whom a robot knows: in the folder that its ``camera`` section names, else in the user's."""
    named = "" if camera is None else camera.identity.people
    return People(Path(named).expanduser() if named else people_folder())
