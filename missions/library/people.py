"""Pictures of people that the robot knows, in a private folder for each person.

The only other data of a person are features that a network computed from the pictures (``missions.assembly.gallery``);
they are deleted together. A person is a folder with pictures; other files are left alone.
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

# Pictures of one person in a folder: private, and all new ones are added or none.
#
# Picture files are named such as ``001.png``. Other files are not touched, and links are not followed. Other
# programs may add and remove files: a file that disappears between listing and reading is skipped.

NEW_PREFIX = ".new-"
"""Prefix of a person's folder while the pictures in it are not complete yet."""

FEATURES_FILE = ".features.json"
"""File with the features that a network computed from the pictures in a person's folder, stored since this takes long.
"""

MAX_PIXELS, MAX_PICTURE_BYTES = 4_000_000, 16_000_000
"""Maximum pixels and bytes of a picture; a portrait has about 300 x 300 pixels."""

_NAME = re.compile(r"([0-9]{3,})\.png")


def picture_files(folder: Path) -> dict[Path, os.stat_result]:
    """Return the pictures in a folder with their file status. Raises OSError."""
    found = {}
    with suppress(FileNotFoundError, NotADirectoryError):
        for path in sorted(folder.iterdir()):
            with suppress(FileNotFoundError):
                status = path.lstat()
                if _NAME.fullmatch(path.name) and stat.S_ISREG(status.st_mode):
                    found[path] = status
    return found


def read_picture(path: Path) -> Image | None:
    """Return a picture; None if the file is not a picture, or too large for a portrait. Raises OSError."""
    if path.stat().st_size > MAX_PICTURE_BYTES:
        return None
    from drivers.pictures.decode import decode_picture  # noqa: PLC0415 - most commands read no picture

    return decode_picture(path.read_bytes(), MAX_PIXELS)


def picture_digest(portrait: Image) -> bytes:
    """Return a key that identifies a picture: the SHA-256 of its shape and pixels."""
    return sha256(str(portrait.shape).encode() + portrait.tobytes()).digest()


def store_pictures(portraits: Sequence[Image], folder: Path) -> None:
    """Add pictures to a private folder, created if missing: all of them, or none. Raises OSError."""
    with ExitStack() as undo:
        new = Path(tempfile.mkdtemp(dir=folder.parent, prefix=NEW_PREFIX))  # private, like its contents
        undo.callback(delete_pictures, new)
        for number, portrait in enumerate(portraits, start=_last_in(folder) + 1):
            _write_picture(new / f"{number:03}.png", portrait)
        if folder.is_dir() and not folder.is_symlink():
            for path in picture_files(new):
                undo.callback(path.rename(folder / path.name).unlink, missing_ok=True)
            new.rmdir()
        else:
            new.rename(folder)
        undo.pop_all()


def delete_pictures(folder: Path) -> int:
    """Delete the pictures in a folder and their features, and the folder if it is empty then.

    Return the number of pictures. Raises OSError.
    """
    pictures = picture_files(folder)
    for path in (folder / FEATURES_FILE, *pictures):
        path.unlink(missing_ok=True)
    with suppress(OSError):  # not empty, or removed already
        folder.rmdir()
    return len(pictures)


def _last_in(folder: Path) -> int:
    """Return the highest picture number in a folder, also of files that are pictures by name only."""
    names = (path.name for path in folder.iterdir()) if folder.is_dir() else ()
    return max((int(found[1]) for name in names if (found := _NAME.fullmatch(name))), default=0)


def _write_picture(path: Path, picture: Image) -> None:
    import cv2  # noqa: PLC0415 - as above

    is_encoded, data = cv2.imencode(".png", picture)
    if not is_encoded:
        raise OSError(0, "a picture that cannot be encoded")
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data.tobytes())
        file.flush()
        os.fsync(file.fileno())


MAX_NAME_LENGTH = 60
"""Maximum letters of a person's name; with four bytes each, they fit into the name of a folder."""

JOINERS = "\u200c\u200d"
"""Invisible characters that separate and join letters in Persian and Indic names of people."""

NAME_SIGNS = frozenset(" -_'\u2019." + JOINERS)
"""Characters allowed in a person's name in addition to letters, marks and digits."""


class PeopleError(RuntimeError):
    """A failed operation on pictures of people; ``hint`` is the command to type."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


ProblemListener = Callable[[PeopleError], None]
"""Function that is called with a problem of the stored pictures, such as a file that is not a picture."""


@dataclass(frozen=True, slots=True)
class KnownPerson:
    """A person that the robot knows: number of pictures, and the time of the first one (Unix time)."""

    name: str
    pictures: int
    since: float


def people_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for pictures of people, in the user's data folder."""
    return data_folder(environment) / "people"


def proper_name(name: str) -> str:
    """Return a person's name as it is stored: with composed letters (Unicode NFC), and no spaces around it.

    Raises PeopleError for an invalid name.
    """
    found = unicodedata.normalize("NFC", name).strip()
    if found.casefold() == UNKNOWN:
        raise PeopleError(f"'{UNKNOWN}' is reserved for strangers", hint="choose another name")
    fits = all(letter in NAME_SIGNS or unicodedata.category(letter)[0] in "LMN" for letter in found)
    if not (fits and found[:1].isalpha() and len(found) <= MAX_NAME_LENGTH):
        hint = f"first a letter of any script, then letters, digits, spaces and - _ ' . up to {MAX_NAME_LENGTH} in all"
        raise PeopleError(f"{name!r:.80} cannot be a name", hint=hint)
    return found


class People:
    """The known people whose pictures are in one folder, which is accessed only by the methods."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def known_people(self) -> list[KnownPerson]:
        """Return the known people by name. Raises PeopleError if the folder cannot be read."""
        return [
            KnownPerson(name, len(files), min(status.st_mtime for status in files.values()))
            for name, files in self._files().items()
        ]

    def find(self, name: str) -> str | None:
        """Return the stored form of a name, ignoring case; None if unknown. Raises PeopleError."""
        return next((each for each in self._files() if _comparison_key(each) == _comparison_key(name)), None)

    def portraits(self, on_problem: ProblemListener) -> dict[str, list[Image]]:
        """Return the pictures of each person with enough pictures for recognition, by name.

        If a person has many pictures, some are selected, evenly spread, since recognition compares all pairs.
        ``on_problem`` is called for such a selection, for each file that is not a picture, for each person with too few
        pictures, and for people who are left out because there are too many. Raises PeopleError if the folder cannot be
        read.
        """
        found = {}
        for name, files in self._select_files(on_problem).items():
            portraits = [portrait for path in files if (portrait := _read_or_report(path, on_problem)) is not None]
            if len(portraits) >= MIN_PICTURES:
                found[name] = portraits
            elif portraits:
                what = f"{name}: {len(portraits)} pictures are too few: at least {MIN_PICTURES} are needed"
                on_problem(PeopleError(what, hint=f"mission person add {quote(name)}"))
        return found

    def select_new(self, name: str, portraits: Sequence[Image]) -> list[Image]:
        """Return the pictures that ``add`` would store: without those already stored, and each once.

        Raises PeopleError if ``add`` would refuse them.
        """
        stored_name = self.find(name) or proper_name(name)
        whose = {
            picture_digest(portrait): who
            for who, files in self._files().items()
            for path in files
            if (portrait := _read_or_report(path, lambda _: None)) is not None
        }
        found = {picture_digest(portrait): portrait for portrait in portraits}
        others = [whose[each] for each in found if whose.get(each, stored_name) != stored_name]
        if others:
            hint = f"leave it out, or first: mission person remove {quote(others[0])}"
            raise PeopleError(
                f"nothing was stored: one of the pictures of {stored_name} is already stored for {others[0]}", hint=hint
            )
        fresh = [portrait for each, portrait in found.items() if each not in whose]
        count = len(fresh) + list(whose.values()).count(stored_name)
        if count < MIN_PICTURES:
            hint = f"at least {MIN_PICTURES} are needed"
            raise PeopleError(f"too few pictures of {stored_name}: {count}, where each counts once", hint=hint)
        return fresh

    def add(self, name: str, portraits: Sequence[Image]) -> str:
        """Store pictures of a person in addition to the present ones; return the stored form of the name.

        A stored picture is not stored again. Raises PeopleError for a picture of another person, for too few pictures,
        and for write errors; then none is stored.
        """
        fresh = self.select_new(name, portraits)
        stored_name = self.find(name) or proper_name(name)
        try:
            with self.exclusive_access():
                if fresh:
                    store_pictures(fresh, self.folder / stored_name)
        except OSError as error:
            hint = f"df -h {self.folder}  (is there room?)"
            raise PeopleError(
                f"{self.folder / stored_name}: nothing was stored: {error.strerror}", hint=hint
            ) from error
        self.restrict_access()
        return stored_name

    def remove(self, name: str) -> int:
        """Delete the pictures of a person, and the folder if it is empty then; return the number of pictures.

        Raises PeopleError for an unknown person, and for files that cannot be deleted.
        """
        stored_name = self.find(name)
        if stored_name is None:
            known = ", ".join(self._files()) or "none"
            raise PeopleError(f"no person is called '{name}'", hint=f"known: {known}")
        home = self.folder / stored_name
        try:
            with self.exclusive_access():
                return delete_pictures(home)
        except OSError as error:
            raise PeopleError(f"{home}: {error.strerror}", hint=f"ls -l {home}  (what is left there?)") from error

    @contextmanager
    def exclusive_access(self) -> Iterator[None]:
        """Create and lock the folder, and remove the remains of killed processes."""
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        number = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            with suppress(OSError):  # a network disk may not support locks: only one process may add at a time there
                fcntl.flock(number, fcntl.LOCK_EX)
            for leftover in self._folders():
                if leftover.name.startswith(NEW_PREFIX) or _is_left_over(leftover):
                    delete_pictures(leftover)
            yield
        finally:
            os.close(number)

    def restrict_access(self) -> bool:
        """Remove access rights of other users from the folder and its pictures; return whether there were any.

        Does nothing if no person is known. Raises PeopleError if the rights cannot be changed.
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
                f"{self.folder}: others may read these pictures of people, and it cannot be changed: {error.strerror}",
                hint=f"sudo chown -R $USER {self.folder}",
            ) from error
        return changed

    def _select_files(self, on_problem: ProblemListener) -> dict[str, list[Path]]:
        """Return the picture files for recognition by person; call ``on_problem`` if some are left out."""
        everybody = {name: list(files) for name, files in self._files(on_problem).items()}
        late = list(everybody)[MAX_PICTURES_TOGETHER // MIN_PICTURES :]
        if late:
            on_problem(PeopleError(f"{len(late)} people are left out, {late[0]} to {late[-1]}: there is room for "
                             f"{MAX_PICTURES_TOGETHER // MIN_PICTURES}",
                             hint="mission person remove NAME"))  # fmt: skip
        share = min(MAX_PICTURES, MAX_PICTURES_TOGETHER // max(1, len(everybody) - len(late)))
        for name, files in everybody.items():
            if len(files) > share and name not in late:
                on_problem(PeopleError(f"{name}: {share} of {len(files)} pictures are used, spread over all of them"))
                everybody[name] = [files[place * len(files) // share] for place in range(share)]
        return {name: files for name, files in everybody.items() if name not in late}

    def _files(self, on_problem: ProblemListener = lambda _: None) -> dict[str, dict[Path, os.stat_result]]:
        """Return the pictures of all people who have some. Raises PeopleError."""
        found = {}
        for home in self._folders():
            try:
                files = {} if home.name.startswith(".") else picture_files(home)
            except OSError as error:
                on_problem(PeopleError(f"{home}: {error.strerror}; it is skipped", hint=f"ls -ld {home}"))
                continue
            if files:
                found[home.name] = files
        return found

    def _folders(self) -> list[Path]:
        """Return all folders in the folder of people, without symbolic links. Raises PeopleError."""
        try:
            return sorted(path for path in self.folder.iterdir() if path.is_dir() and not path.is_symlink())
        except FileNotFoundError:
            return []
        except OSError as error:
            raise PeopleError(f"{self.folder}: {error.strerror}", hint=f"ls -ld {self.folder}") from error


def _is_left_over(home: Path) -> bool:
    """Return whether a folder has features but no pictures, as those were deleted by hand."""
    with suppress(OSError):
        return (home / FEATURES_FILE).is_file() and not picture_files(home)
    return False


def _comparison_key(name: str) -> str:
    """Return a key that is equal for all spellings of a name.

    Spellings can differ in upper and lower case, composed letters, and invisible joiners.
    """
    visible = "".join(letter for letter in name.strip() if letter not in JOINERS)
    return unicodedata.normalize("NFC", visible.casefold())


def _read_or_report(path: Path, on_problem: ProblemListener) -> Image | None:
    """Return the picture in a file; None if the file was just removed or is not a readable picture.

    Files that are not readable pictures are reported by ``on_problem``.
    """
    try:
        found = read_picture(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        on_problem(PeopleError(f"{path}: {error.strerror}; it is skipped", hint=f"ls -l {path}"))
        return None
    if found is None:
        on_problem(PeopleError(f"{path}: is not a portrait; it is skipped", hint=f"rm {quote(str(path))}"))
    return found


def _restrict_file(path: Path) -> bool:
    """Remove access rights of other users; return whether there were any. Raises OSError."""
    rights = stat.S_IMODE(path.stat().st_mode)
    if not rights & 0o077:
        return False
    path.chmod(rights & 0o700)
    return True


def people_of(camera: CameraKeys | None) -> People:
    """Return the people of a robot: in the folder of its ``camera`` section, or in the user's data folder."""
    folder_name = "" if camera is None else camera.identity.people
    return People(Path(folder_name).expanduser() if folder_name else people_folder())
