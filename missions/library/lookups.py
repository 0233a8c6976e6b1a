"""Lookups of library objects that missions name: gestures, moves, gaits, controllers, objects and files.

The reader of each kind of file is imported when it is first used, as a mission uses few kinds.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from config.diagnostics import InvalidFileError, SourceText, did_you_mean
from config.library import UnknownNameError, find_file, is_file, shipped_files
from config.units import quoted_value
from config.yaml_nodes import read_source
from drivers.api import Gesture
from drivers.api.gait import GaitKeys
from perception.api import ThingSpec

if TYPE_CHECKING:
    from behaviours.tracking.follow import RuleBases
    from config.object import ObjectConfig
    from missions.library.moves.record import NewMoveFile

T = TypeVar("T")

MAX_SHOWN_PATH = 400
"""Maximum number of characters of a file's path in a message."""


def find_gesture(name: str) -> Gesture:
    """Return a gesture by name or path. Raises LookupError with the known names, or the errors in its file."""
    from config.gesture import load_gesture  # noqa: PLC0415 - so here and below: see the module

    return _load(load_gesture, "gestures", name).movement


def find_move(name: str) -> Gesture:
    """Return a movement (gesture, recording or spreadsheet) by name or path.

    Raises LookupError with the known names, or the errors in its file.
    """
    from missions.library.moves.load import load_move  # noqa: PLC0415

    return _load(load_move, "moves", name, shipped_files("gestures"))


def find_gait(name: str) -> GaitKeys:
    """Return a gait by name or path. Raises LookupError with the known names, or the errors in its file."""
    from config.gesture import load_gait  # noqa: PLC0415

    return _load(load_gait, "gaits", name)


def new_move_file(name: str) -> "NewMoveFile":
    """Return the file into which a movement will be recorded. Raises LookupError for an invalid name."""
    from missions.library.moves.record import NewMoveFile  # noqa: PLC0415

    return NewMoveFile(name)


def find_controller(name: str) -> "RuleBases":
    """Return a controller's rule bases by name or path.

    Raises LookupError with the known names, or the errors in its file.
    """
    try:
        return _load(lambda path: _parse_rule_bases(read_source(path)), "controllers", name)
    except ValueError as error:
        raise LookupError(f"names controller '{name}', which has an error: {error}") from error


@lru_cache(maxsize=16)
def _parse_rule_bases(source: SourceText) -> "RuleBases":
    """Return the rule bases in the text of a controller file; cached, since parsing takes long."""
    from behaviours.tracking.follow import RuleBases  # noqa: PLC0415
    from config.controller import parse_controller  # noqa: PLC0415

    return RuleBases.from_mapping(parse_controller(source).values)


def find_object(name: str) -> ThingSpec:
    """Return an object by name or path, or by a phrase such as "red ball".

    Raises LookupError with the known names, or the errors in its file.
    """
    found = _load_object(name)
    return ThingSpec(found.name, found.colour, found.shape, found.size)


def _load_object(name: str) -> "ObjectConfig":
    from config.object import load_object, read_phrase  # noqa: PLC0415

    if name in shipped_files("objects") or Path(name).suffix in (".yaml", ".yml"):
        return _load(load_object, "objects", name)
    try:
        return read_phrase(name)
    except ValueError as error:
        # A single word is a name rather than a misspelt colour.
        close = "" if " " in name.strip() else did_you_mean(name, shipped_files("objects"))
        raise LookupError(f"needs an object: {error}" if not close else f"needs an object: {close}") from error


def existing_file(name: str) -> Path:
    """Return the path of an existing file. Raises LookupError."""
    if not is_file(path := Path(name)):
        raise LookupError(
            f"names a file that does not exist: {name if len(name) <= MAX_SHOWN_PATH else quoted_value(name)}"
        )
    return path


LOOKUPS: Mapping[str, Callable[[str], object]] = {
    "gesture": find_gesture,
    "move": find_move,
    "gait": find_gait,
    "new move": new_move_file,
    "controller": find_controller,
    "object": find_object,
    "file": existing_file,
}
"""Function that looks up a name, for each kind of argument that names an object."""


def _load(load: Callable[[Path], T], kind: str, name: str, library: dict[str, Path] | None = None) -> T:
    try:
        return load(find_file(kind, name, library=library))
    except UnknownNameError as error:
        raise LookupError(f"needs a {kind.removesuffix('s')}: {error}") from error
    except InvalidFileError as error:
        raise LookupError(f"names a {kind.removesuffix('s')} with errors: {error}") from error
