"""Files of a rerun: the original files where they still exist, changed or not, else those in the record.

A record may come from anyone. Python code is run only if the user names it, or trusts the code in the record.
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
"""Folders in a record whose files a rerun does not need: worlds and tests, since their effect on the robot is recorded.
"""

NEW_FILES_FOLDER = "new"
"""Folder for files that a mission writes during a rerun."""

FOLDERS_BY_KIND: Mapping[str, tuple[str, ...]] = {
    "gesture": ("gesture/", "move/"),
    "move": ("move/", "gesture/"),
    "gait": ("gait/",),
    "controller": ("controller/",),
    "object": ("object/",),
}
"""Folders of the record in which a rerun looks for a file of each kind, in this order."""


class RerunFiles:
    """Files that a rerun uses: the original files, or the recorded ones, which are unpacked into ``folder``.

    An original file is used as it is now, if it still exists. With ``recorded``, only recorded files are used. Files
    that a mission writes go into ``folder`` too. ``code`` are the user's Python files with leaves. Without them, the
    recorded Python files are used, but only if ``trusted``.
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
        """Write the recorded files, and create the folder for new ones.

        Raises InvalidRecordError for two files of one name, OSError.
        """
        (self._folder / NEW_FILES_FOLDER).mkdir(parents=True, exist_ok=True)
        for name, data in self._files.items():
            path = self._unpacked_path(name)
            if path.exists():
                raise InvalidRecordError(f"two files of the record have the same name: {name}")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

    def foreign_code(self) -> Sequence[str]:
        """Return a line with size and origin for each recorded Python file that a rerun would execute."""
        names = () if self._code else self._header.behaviours
        return [
            f"{name}, {len(self._files.get(name, b''))} bytes, from {self._header.paths.get(name, 'an unknown folder')}"
            for name in names
        ]

    def changed_files(self) -> Iterator[str]:
        """Yield a line for each recorded file whose original has changed or is missing now."""
        for name, data in self._files.items():
            path = self._header.paths.get(name)
            if path is None or name.startswith(IGNORED_PREFIXES):
                continue
            if not is_file(Path(path)):
                yield f"{path} no longer exists"
            elif not _has_content(Path(path), data):
                yield f"{path} has changed since the run"

    def robot(self) -> RobotConfig:
        """Return the robot of the run.

        Raises InvalidFileError, or UnknownNameError if neither file nor name is found.
        """
        name = next((name for name in self._files if name.startswith("robot/")), None)
        return load_robot(find_file("robots", self._header.robot) if name is None else self._path_of(name))

    def plan(self, robot: RobotConfig, mission: str | None = None) -> Plan:
        """Return the recorded mission, or ``mission``, with the recorded params.

        Raises InvalidFileError with all errors in it, or UnknownNameError.
        """
        path = self._path_of(self._header.file) if mission is None else find_mission(mission)
        return load_plan(
            path,
            load_leaves(self._leaves()),
            self._lookups(),
            find_mission=self._find_mission,
            params=self._header.params,
            complete=True,
            robot=target_of(robot),
        )

    def display_name(self, file: str) -> str:
        """Return the name of a mission file as shown to the user."""
        path = Path(file)
        return f"{path.relative_to(self._folder)} as recorded" if path.is_relative_to(self._folder) else file

    def _leaves(self) -> Sequence[Path]:
        """Return the Python files with leaves that the rerun may execute."""
        recorded = self._header.behaviours if self._trusted else ()
        return self._code or [self._unpacked_path(name) for name in recorded]

    def _path_of(self, name: str) -> Path:
        """Return the path to read a recorded file from: the original file if it still exists, else the unpacked one."""
        today = Path(self._header.paths.get(name, ""))
        return self._unpacked_path(name) if self._recorded or not is_file(today) else today

    def _unpacked_path(self, name: str) -> Path:
        """Return the unpacked path of a recorded file; always inside the folder."""
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
        """Return for each kind of file the function that finds a file by its name.

        Moves that a mission records get paths in the folder for new files.
        """
        held = {kind: partial(self._find_thing, LOOKUPS[kind], holders) for kind, holders in FOLDERS_BY_KIND.items()}
        new = {"new move": lambda name: new_move_file(str(self._folder / NEW_FILES_FOLDER / Path(name).name))}
        return {**LOOKUPS, **held, **new, "file": Path}  # paths are only passed on

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
        """Return the unpacked file that a mission refers to as ``name``, with or without its suffix; else None.

        It is searched in these ``folders`` of the record.
        """
        held = [PurePosixPath(each) for holder in folders for each in self._files if each.startswith(holder)]
        wanted = PurePosixPath(name).name
        fitting = [each for each in held if each.name == wanted] + [each for each in held if each.stem == wanted]
        return self._unpacked_path(str(fitting[0])) if fitting else None


def _has_content(path: Path, data: bytes) -> bool:
    """Return whether the file at ``path`` exists, and its content is ``data``."""
    try:
        return read_regular(path, len(data)) == data
    except OSError:
        return False
