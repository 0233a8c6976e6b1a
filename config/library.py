"""Lookup of files by name, in the folders that ship with MissionTree and in the user's own, or by path."""

import os
import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

from config.diagnostics import closest, did_you_mean
from config.file_io import open_regular
from config.units import quoted_value, with_article

HERE = Path(__file__).parent

LISTED_KINDS = ("missions", "robots", "worlds", "gestures", "controllers", "objects")
"""Kinds of files that `mission list` shows."""

DEFAULT_ROBOT = "turtlebot2_arm"
DEFAULT_WORLD = "living_room"
"""Default world of commands. ``DEFAULT_ROBOT`` is their default robot."""

SUFFIXES = (".yaml", ".yml")

SHEET_SUFFIXES = (".csv", ".xls", ".xlsx", ".ods")
"""Suffixes of spreadsheets with moves or gaits."""

OWN_ROBOT = "mine"
"""Name for ``--robot`` that stands for this computer's own robot."""

MAX_LISTED_NAMES = 5
"""Maximum number of names listed in a suggestion."""


class UnknownNameError(LookupError):
    """Unknown name of a mission, robot, world or other file; the message lists suggestions."""


def shipped_files(kind: str) -> dict[str, Path]:
    """Return the shipped files of a kind (``robots``, ``gestures``, ``worlds``, ``controllers``) by name."""
    return {path.stem: path for path in sorted((HERE / kind).glob("*.yaml"))}


def find_file(kind: str, name: str, *, library: dict[str, Path] | None = None, folder: Path = Path()) -> Path:
    """Return the file for ``name``: in the library, as a path relative to ``folder``, or among the user's own.

    Raises UnknownNameError with a suggestion, or with the kind of the file if it is the wrong one.
    """
    known = shipped_files(kind) if library is None else library
    if name in known:
        return known[name]
    path = folder / name
    if is_file(path):
        if wrong := wrong_kind_error(kind, path):
            raise UnknownNameError(wrong)
        return path
    own = _find_user_file(kind, name)
    if own is not None:
        return own
    with suppress(OSError):  # a name that is too long
        if path.is_dir() and (wrong := _foreign_file_error(kind, path)):
            raise UnknownNameError(wrong)
    hint = _hint(kind, folder, name, known)
    if path.suffix in (*SUFFIXES, ".mcap"):
        wrong = "not a regular file" if os.path.lexists(path) else "no such file"
        raise UnknownNameError(f"{quoted_value(str(path))}: {wrong}" + (f"; {hint}" if hint else ""))
    missing = "".join(f"; {each}" for each in _missing_folder_notes(kind) if each)
    raise UnknownNameError(
        f"unknown {kind.removesuffix('s')} {quoted_value(name)}; {hint or _all_names_text(kind, known)}{missing}"
    )


def _hint(kind: str, folder: Path, name: str, known: Collection[str]) -> str:
    """Return a suggestion for an unknown name, or an empty text."""
    if Path(name).suffix in SUFFIXES:
        return (
            _similar_file(kind, folder, name)
            or _similar_spelling(kind, folder, name)
            or _similar_name(kind, Path(name).stem, known)
        )
    return (
        _similar_file(kind, folder, name) or _similar_name(kind, name, known) or _similar_spelling(kind, folder, name)
    )


def _find_user_file(kind: str, name: str) -> Path | None:
    """Return the user's own file of that name, or None. Raises UnknownNameError."""
    from config.defaults import DEFAULTS_FILE, config_folder, load_defaults, user_files  # noqa: PLC0415 - few names are not in the library

    if kind == "robots" and name == OWN_ROBOT:
        mine = load_defaults().robot
        if not mine or mine == OWN_ROBOT:
            raise UnknownNameError(
                "no default robot is set on this computer: set one with `mission robot use NAME`, "
                "or make one with `mission robot new`"
            )
        try:
            return find_file(kind, str(Path(mine).expanduser()) if "/" in mine else mine)
        except UnknownNameError as error:
            where = f"{config_folder() / DEFAULTS_FILE}: 'robot': {error}"
            cure = "set another with `mission robot use NAME`, or none with `mission robot use --none`"
            raise UnknownNameError(f"{where}; {cure}") from None
    return user_files(kind).get(name)


def _missing_folder_notes(kind: str) -> list[str]:
    """Return notes on the user's folders that are missing or unreadable, since the name may have been in one."""
    from config.defaults import DEFAULTS_FILE, config_folder, missing_folders, unreadable_folders  # noqa: PLC0415 - rarely needed

    missing = missing_folders()
    notes = [f"{config_folder() / DEFAULTS_FILE} names missing folders: {', '.join(missing)}"] if missing else []
    return [*notes, *unreadable_folders(kind)]


def is_file(path: Path) -> bool:
    """Return True if a path is a regular file that can be accessed."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long, a folder that may not be read, a zero in the name
        return False


def _similar_file(kind: str, folder: Path, name: str) -> str:
    """Return a suggestion for a file with another suffix, or in the folder of its kind."""
    bare = name.removesuffix(".yaml").removesuffix(".yml")
    for there in [f"{inside}{bare}{suffix}" for inside in ("", f"{kind}/") for suffix in SUFFIXES if Path(bare).name]:
        if is_file(folder / there):
            return wrong_kind_error(kind, folder / there) or f"did you mean the file '{there}'?"
    return ""


def _similar_spelling(kind: str, folder: Path, name: str) -> str:
    """Return a suggestion for a file beside ``name`` with a similar name."""
    bare = name.removesuffix(".yaml").removesuffix(".yml")
    spelt = {each.stem: each.name for each in _neighbour_files(folder / name) if kind in kinds_of(each)}
    close = closest(Path(bare).name, spelt)
    return f"did you mean the file '{Path(name).with_name(spelt[close])}'?" if close else ""


def _neighbour_files(path: Path) -> list[Path]:
    try:
        return [each for each in sorted(path.parent.iterdir()) if each.suffix in SUFFIXES]
    except (OSError, ValueError):  # no such folder, or one that may not be read
        return []


def _similar_name(kind: str, name: str, known: Collection[str]) -> str:
    """Return a suggestion for the closest name in the library, or for the names that contain ``name``."""
    if hint := did_you_mean(name, known):
        return hint
    holding = [each for each in known if len(name) > 2 and name.lower() in each.lower()]
    if len(holding) == 1:
        return f"did you mean '{holding[0]}'?"
    more = f"; `mission list {kind}` has more" if len(holding) > MAX_LISTED_NAMES and kind in LISTED_KINDS else ""
    return f"did you mean one of {', '.join(holding[:MAX_LISTED_NAMES])}?{more}" if holding else ""


def _all_names_text(kind: str, known: Collection[str]) -> str:
    if len(known) > MAX_LISTED_NAMES and kind in LISTED_KINDS:
        return f"`mission list {kind}` has all"
    return f"known are: {', '.join(known)}"


KIND_KEYS: Mapping[str, str] = {
    "mission": "missions",
    "tests": "tests",
    "world": "worlds",
    "robot": "robots",
    "gesture": "gestures",
    "gait": "gaits",
    "controller": "controllers",
    "object": "objects",
}
"""Kind of file by the top-level key that identifies it."""

KIND_USES: Mapping[str, str] = {
    "missions": "mission run {0}",
    "tests": "mission test {0}",
    "worlds": "mission show {0}, or mission run MISSION --world {0}",
    "robots": "mission run MISSION --simulate --robot {0}",
    "gestures": "write `gesture: {0}` in a mission",
    "gaits": "mission show {0}",
    "controllers": "mission controller show {0}",
    "objects": "write `find_object: {0}` in a mission",
    "records": "mission record replay {0}",
}
"""Command, or line of a mission, that uses a file of each kind."""

RECORD_MAGIC = b"\x89MCAP0"
"""First bytes of a record, which is an MCAP file."""

MAX_HEAD_BYTES = 65_536
"""Number of bytes at the start of a file that are searched for keys."""


MOVEMENT_FORMS = ("pypot", "motion", "roboplus")
"""Names of the movement formats of other programs that we can read."""

CALIBRATION_FORMS = ("lerobot",)
"""Names of the servo calibration formats of other programs that we can read."""


def wrong_kind_error(expected: str, path: Path) -> str:
    """Return the kind and usage of a file that is not of the ``expected`` kind, or an empty text."""
    found = kinds_of(path)
    if not found:
        return _foreign_file_error(expected, path)
    if expected in found or (expected == "moves" and "gestures" in found):
        return ""
    use = KIND_USES[found[0]].format(path)
    return f"{path} is {with_article(found[0].removesuffix('s'))}: {use}"


def _foreign_file_error(expected: str, path: Path) -> str:
    """Return the description and usage of a file of another program, or an empty text if it may be one of ours."""
    from config.foreign_files import read_plain_data, recognise_file  # noqa: PLC0415 - most files are ours

    if path.suffix.lower() in SHEET_SUFFIXES:
        return (
            "" if expected == "moves" else f"{path} is a spreadsheet: mission servo play {path} --robot FILE --dry-run"
        )
    found = recognise_file(path)
    if found is not None:
        meant = found.form in {"moves": MOVEMENT_FORMS, "calibrations": CALIBRATION_FORMS}.get(expected, ())
        return "" if meant else f"{path} is {found.description}: {found.usage.format(path)}"
    by_name = path.suffix.lower() in (*SUFFIXES, ".json")
    if expected == "records" or path.is_dir() or by_name or isinstance(read_plain_data(path), Mapping):
        return ""
    sheet = (
        f"a table of a movement has to end in {', '.join(SHEET_SUFFIXES)}"
        if expected == "moves"
        else "see `mission --help`"
    )
    return f"{path} is not recognised: files of MissionTree end in .yaml; {sheet}"


def kinds_of(path: Path) -> list[str]:
    """Return the possible kinds of a file by its top-level keys, in their order."""
    try:
        with open_regular(path) as file:
            data = file.read(MAX_HEAD_BYTES) or b""
    except (OSError, ValueError):
        return []
    if data.startswith(RECORD_MAGIC):
        return ["records"]
    keys = re.findall(r"^([a-z]+):(?=\s|$)", data.decode("utf-8-sig", errors="replace"), re.MULTILINE)
    return [KIND_KEYS[key] for key in keys if key in KIND_KEYS]
