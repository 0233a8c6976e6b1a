"""Arguments that name a thing, a file or a mission: what finds it."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from missions.language.nodes import MISSION
from missions.language.notes import Notes
from missions.language.values import Convert, shown


def finder(notes: Notes, kind: str) -> Convert | None:
    """Return what finds the things of a kind by their names, and raises LookupError; None for what is no thing."""
    folder = Path(notes.source.name).parent
    if kind == "file":
        return partial(_file, notes.things.get(kind, Path), folder)
    if kind == MISSION:
        return lambda value: notes.words.find_mission(shown(value), folder)
    return partial(_find, notes.things[kind]) if kind in notes.things else None


def _find(lookup: Callable[[str], object], value: object) -> object:
    return lookup(shown(value))


def _file(lookup: Callable[[str], object], folder: Path, value: object) -> object:
    """Return the file at a path that goes from the mission's folder."""
    return lookup(str(folder / shown(value)))
