"""The files that a record is decided again with: today's where they are still there, else those that it holds.

A record may come from anybody. Python is never run because a record says so, nor from where it says: only what the user
names, or what the record holds once the user trusts it.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePosixPath

from config.file_io import read_regular
from config.library import UnknownNameError, find_file, is_file
from config.robot import RobotConfig
from missions.language.check_context import Lookup
from missions.language.document import load_plan
from missions.language.plan import Plan
from missions.library.drivers import load_robot
from missions.library.lookups import LOOKUPS, new_move_file
from missions.library.private_files import path_inside
from missions.library.shipped import find_mission
from missions.library.target import target_of
from missions.library.vocabulary import load_leaves
from missions.plugins.records.recording.record_header import RecordHeader
from missions.plugins.records.recording.validation import InvalidRecordError

IGNORED_PREFIXES = ("world/", "test/")
"""What the decisions do not depend on: a record knows what the robot was told, not why."""

NEW_FILES_FOLDER = "new"
"""The folder for what is written when a mission is decided again."""

FOLDERS_BY_KIND: Mapping[str, tuple[str, ...]] = {
    "gesture": ("gesture/", "move/"),
    "move": ("move/", "gesture/"),
    "gait": ("gait/",),
    "controller": ("controller/",),
    "object": ("object/",),
}
"""Where the files of each kind of thing are among those of a record."""


class RerunFiles:
    """The files of a record, unpacked into ``folder``, beside those of today.

    ``recorded`` takes them all from the record. What a mission writes when it is decided again goes into ``folder``.
    ``code`` are files of the user's with leaves of their own; without any, those of the record are run, but only if
    ``trusted``.
    """

    def __init__(
        self,
        header: RecordHeader,
        files: Mapping[str, bytes],
        folder: Path,
        *,
        recorded: bool = False,
        code: Sequence[Path] = (),
        trusted: bool = False,
    ) -> None:
        self._header = header
        self._files = files
        self._folder = folder
        self._recorded = recorded
        self._code = code
        self._trusted = trusted

    def unpack(self) -> None:
        """Write the record's files, and make room for what missions write.

        Raises InvalidRecordError for a file that would take the place of another, OSError.
        """
        (self._folder / NEW_FILES_FOLDER).mkdir(parents=True, exist_ok=True)
        for name, data in self._files.items():
            path = self._unpacked_path(name)
            if path.exists():
                raise InvalidRecordError(f"two files of the record go by one name: {name}")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

    def foreign_code(self) -> Sequence[str]:
        """Return a line for each file of Python of the record, which deciding it again would run: size, and origin."""
        names = () if self._code else self._header.behaviours
        return [
            f"{name}, {len(self._files.get(name, b''))} bytes, of {self._header.paths.get(name, 'nobody knows where')}"
            for name in names
        ]

    def changed_files(self) -> Iterator[str]:
        """Say of each file that is another today, or gone, what has become of it."""
        for name, data in self._files.items():
            path = self._header.paths.get(name)
            if path is None or name.startswith(IGNORED_PREFIXES):
                continue
            if not is_file(Path(path)):
                yield f"{path} is gone since"
            elif not _has_content(Path(path), data):
                yield f"{path} has changed since"

    def robot(self) -> RobotConfig:
        """Return the robot. Raises InvalidFileError, or UnknownNameError where neither file nor name helps."""
        name = next((name for name in self._files if name.startswith("robot/")), None)
        return load_robot(find_file("robots", self._header.robot) if name is None else self._path_of(name))

    def plan(self, robot: RobotConfig, mission: str | None = None) -> Plan:
        """Return the mission, or another one, with the params of the record.

        Raises InvalidFileError with all that is wrong with it, or UnknownNameError.
        """
        path = self._path_of(self._header.file) if mission is None else find_mission(mission)
        return load_plan(
            path,
            load_leaves(
                self._code or ([self._unpacked_path(name) for name in self._header.behaviours] if self._trusted else [])
            ),
            self._lookups(),
            find_mission=self._find_mission,
            params=self._header.params,
            complete=True,
            robot=target_of(robot),
        )

    def display_name(self, file: str) -> str:
        """Return the name of a file that a mission was read from, for people."""
        path = Path(file)
        return f"{path.relative_to(self._folder)} as recorded" if path.is_relative_to(self._folder) else file

    def _leaves(self) -> Sequence[Path]:
        """Return the files with leaves of the user's own that may be run."""
        recorded = self._header.behaviours if self._trusted else ()
        return self._code or [self._unpacked_path(name) for name in recorded]

    def _path_of(self, name: str) -> Path:
        """Return where a file of the record is to be read: today's place of it, unless it is not there."""
        today = Path(self._header.paths.get(name, ""))
        return self._unpacked_path(name) if self._recorded or not is_file(today) else today

    def _unpacked_path(self, name: str) -> Path:
        """Return where a file of the record is unpacked; nothing in a name leads out of the folder."""
        return self._folder / path_inside(name)

    def _find_mission(self, name: str, beside: Path) -> Path:
        found = self._recorded_file(("mission/",), name)
        if found is not None and self._recorded:
            return found
        try:
            return find_mission(name, beside)
        except UnknownNameError:
            if found is None:
                raise
            return found

    def _lookups(self) -> Mapping[str, Lookup]:
        """Return how things are found; what is recorded anew is not written over what was recorded then."""
        held = {kind: partial(self._find_thing, LOOKUPS[kind], holders) for kind, holders in FOLDERS_BY_KIND.items()}
        new = {"new move": lambda name: new_move_file(str(self._folder / NEW_FILES_FOLDER / Path(name).name))}
        return {**LOOKUPS, **held, **new, "file": Path}  # files are only handed on

    def _find_thing(self, look_up: Lookup, folders: tuple[str, ...], name: str) -> object:
        found = self._recorded_file(folders, name)
        if found is not None and self._recorded:
            return look_up(str(found))
        try:
            return look_up(name)
        except LookupError:
            if found is None:
                raise
            return look_up(str(found))

    def _recorded_file(self, folders: tuple[str, ...], name: str) -> Path | None:
        """Return the file of the record that a mission means by ``name``, which may be that of the file or its stem."""
        held = [PurePosixPath(each) for holder in folders for each in self._files if each.startswith(holder)]
        wanted = PurePosixPath(name).name
        fitting = [each for each in held if each.name == wanted] + [each for each in held if each.stem == wanted]
        return self._unpacked_path(str(fitting[0])) if fitting else None


def _has_content(path: Path, data: bytes) -> bool:
    """Say whether a file holds ``data`` and no more."""
    try:
        return read_regular(path, len(data)) == data
    except OSError:
        return False
