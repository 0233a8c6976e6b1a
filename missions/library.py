"""The missions that ship with MissionTree, found by name, and the one way from a name to a checked plan."""

from collections.abc import Mapping
from pathlib import Path

from behaviours.catalogue import LEAVES
from config.library import find
from missions.assembly.things import THINGS
from missions.language.document import load_plan
from missions.language.plan import Plan

HERE = Path(__file__).parent


def shipped_missions() -> dict[str, Path]:
    """Return the shipped missions' files by name."""
    return {path.stem: path for path in sorted(HERE.glob("*.yaml"))}


def find_mission(name: str) -> Path:
    """Return the file that ``name`` means. Raises config.library.UnknownNameError with the closest name."""
    return find("missions", name, library=shipped_missions())


def load_mission(
    name: str, *, params: Mapping[str, str] | None = None, robot: tuple[str, frozenset[str]] | None = None
) -> Plan:
    """Read and check a mission by name or path, for a robot with these parts.

    Raises UnknownNameError, or InvalidFileError with every mistake in it.
    """
    return load_plan(find_mission(name), LEAVES, THINGS, params=params, robot=robot)
