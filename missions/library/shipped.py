"""Missions of MissionTree by name, and loading of missions into checked plans."""

import os
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf
from config.library import SUFFIXES, UnknownNameError, find_file, is_file, wrong_kind_error
from missions.language.claims import TargetRobot
from missions.language.document import load_plan
from missions.language.plan import Plan
from missions.library.lookups import LOOKUPS
from missions.library.vocabulary import behaviour_files_beside, real_path

MISSIONS_FOLDER = Path(__file__).parents[1]

TEST_SUFFIX = ".test.yaml"
"""Suffix of files with tests of a mission."""


MOTIONS = {
    "1": "forward",
    "2": "spin_left",
    "3": "spin_right",
    "4": "square",
    "5": "triangle",
    "6": "back_and_forth",
    "7": "circle_anticlockwise",
    "8": "circle_clockwise",
}
"""Motions of the TurtleBot course by number: missions in the folder ``motions``."""


MISSION_NAME = re.compile(r"[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)?")
"""Pattern of mission names that can be requested over a network: library names, no paths."""


@cache
def shipped_missions() -> dict[str, Path]:
    """Return the files of MissionTree's missions by name; names in a subfolder have the form "motions/square"."""
    return {
        str(path.relative_to(MISSIONS_FOLDER).with_suffix("")): path
        for path in mission_files(MISSIONS_FOLDER.rglob("*.yaml"))
    }


def mission_files(files: Iterable[Path]) -> list[Path]:
    """Return the mission files among ``files`` in order, without test files."""
    return [path for path in sorted(files) if not path.name.endswith(TEST_SUFFIX) and path.is_file()]


def find_mission(name: str, beside: Path = Path()) -> Path:
    """Return the file of a mission: one in the folder ``beside``, or a name of the library.

    The suffix is optional. A library mission in a subfolder can be named without the folder if that is unique, and an
    exercise of the TurtleBot course by its number. Raises config.library.UnknownNameError with a suggestion.
    """
    for path in (beside / name, *(beside / f"{name}{suffix}" for suffix in SUFFIXES)):
        if path.suffix in SUFFIXES and is_file(path) and not wrong_kind_error("missions", path):
            return path
    library = shipped_missions()
    name = MOTIONS.get(name, name)
    if name.isdecimal():
        raise UnknownNameError(f"unknown mission '{name}'; motions of the course go from 1 to 8: mission list motions")
    short = [path for full, path in library.items() if full.rpartition("/")[2] == name]
    if len(short) == 1:
        return short[0]
    return find_file("missions", name, library=library, folder=beside)


def behaviour_files(name: str, given_files: Iterable[Path] = ()) -> list[Path]:
    """Return the behaviour files for a mission: ``given_files``, then those in its own folder.

    Raises UnknownNameError.
    """
    files = list(given_files)
    known = {*map(real_path, files)}
    return files + [path for path in behaviour_files_beside(find_mission(name)) if real_path(path) not in known]


def load_mission(
    name: str,
    *,
    params: Mapping[str, str] | None = None,
    complete: bool = False,
    robot: TargetRobot | None = None,
    leaves: Mapping[str, type[Leaf]] = LEAVES,
) -> Plan:
    """Read and check a mission by name or path; return its plan.

    ``params`` are values as texts; with ``complete``, a param without a value is an error. ``robot`` is the robot to
    check for. ``leaves`` are the available leaves; ``missions.library.vocabulary`` loads more than those of
    MissionTree.

    Raises UnknownNameError, or InvalidFileError with all errors.
    """
    return load_plan(
        find_mission(name),
        leaves,
        LOOKUPS,
        find_mission=find_mission,
        params=params,
        complete=complete,
        robot=robot,
    )


def is_known_mission(mission: str) -> bool:
    """Return whether the library has a mission of this name; names from a network never lead to a path."""
    try:
        return bool(MISSION_NAME.fullmatch(mission) and find_mission(mission, Path(os.devnull)))
    except UnknownNameError:
        return False
