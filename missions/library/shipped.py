"""The missions that ship with MissionTree, found by name, and the one way from a name to a checked plan."""

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
"""The end of the name of a file with tests of a mission."""


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
"""The motions of the TurtleBot course by their numbers in it: missions in the folder ``motions``."""


MISSION_NAME = re.compile(r"[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)?")
"""Names of missions that may be asked for over a network: those of the library, and no path."""


@cache
def shipped_missions() -> dict[str, Path]:
    """Return the shipped missions' files by name; those in a folder under the folder's name ("motions/square")."""
    return {
        str(path.relative_to(MISSIONS_FOLDER).with_suffix("")): path
        for path in mission_files(MISSIONS_FOLDER.rglob("*.yaml"))
    }


def mission_files(files: Iterable[Path]) -> list[Path]:
    """Return those of ``files`` that are missions, in order: their tests are not."""
    return [path for path in sorted(files) if not path.name.endswith(TEST_SUFFIX) and path.is_file()]


def find_mission(name: str, beside: Path = Path()) -> Path:
    """Return the file that ``name`` means: one in the folder ``beside``, else a name in the library.

    The name of a file needs no suffix. A mission in a folder of the library may be named without the folder, where that
    is unique, and a motion of the course by its number. Raises config.library.UnknownNameError with what may be meant.
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
    """Return the files of leaves for a mission, by its name or path: those ``given``, then those in its own folder.

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
    """Read and check a mission by name or path, for a ``robot``; ``complete`` asks for all its params.

    ``leaves`` are what it may be made of: missions.library.vocabulary finds more of them than ship with MissionTree.

    Raises UnknownNameError, or InvalidFileError with every mistake in it.
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
    """Return whether a library has a mission of this name; names from a network never lead to a path."""
    try:
        return bool(MISSION_NAME.fullmatch(mission) and find_mission(mission, Path(os.devnull)))
    except UnknownNameError:
        return False
