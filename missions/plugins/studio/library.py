"""Missions, robots and worlds that the studio's page can start, as `mission list` and `mission check` show them.

The studio offers only files of the library, the user's own by name, and files in the folder where it was started. No
command can name another file.
"""

import hashlib
import re
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from math import inf
from pathlib import Path

from config.defaults import load_defaults, unreadable_folders, user_files
from config.diagnostics import InvalidFileError
from config.file_io import open_regular, parse_object, read_regular_text
from config.library import (
    DEFAULT_ROBOT,
    MAX_HEAD_BYTES,
    SHEET_SUFFIXES,
    SUFFIXES,
    UnknownNameError,
    find_file,
    kinds_of,
    shipped_files,
)
from config.units import UNITS
from config.world import load_world
from drivers.clock import Clock, SystemClock, time_of_day
from missions.control.commands import BadMessage, ClientCommand
from missions.language.document import declared_params
from missions.language.expressions import format_value
from missions.language.lists import list_text
from missions.language.param_types import BOUNDS, Param
from missions.language.plan import Plan
from missions.library.drivers import load_robot
from missions.library.folders import checkup_file
from missions.library.lookups import LOOKUPS
from missions.library.people import People, people_folder
from missions.library.shipped import MOTIONS, TEST_SUFFIX, behaviour_files, find_mission, load_mission, shipped_missions
from missions.library.vocabulary import behaviour_files_beside, load_leaves
from missions.library.worlds import build_world
from missions.options import Option
from missions.plugins.pictures.plan import UNITS_PER_METRE, plan_frame, plan_svg
from missions.plugins.studio.studio_commands import RUN_OPTIONS, LibraryQuery, MissionQuery, WorldQuery
from missions.trees.drawing import TreeBox, to_json
from missions.trees.drawing_builder import drawing_of, first_values
from missions.trees.value_text import value_text

# A mission for the form that starts it: loaded with the behaviours beside it, and its params as fields.


def load_with_behaviours(name: str) -> Plan:
    """Load a mission with the behaviours in files beside it. Raises InvalidFileError or UnknownNameError."""
    return load_mission(name, leaves=load_leaves(behaviour_files(name), required_files=()))


def params_of(name: str) -> list[dict[str, object]]:
    """Return the parameters of a mission as form fields. Raises InvalidFileError or UnknownNameError."""
    leaves = load_leaves(behaviour_files(name), required_files=())
    return [_param(each) for each in declared_params(find_mission(name), leaves, LOOKUPS).values()]


def _param(param: Param) -> dict[str, object]:
    kind = param.type
    field: dict[str, object] = {
        "name": param.name,
        "kind": kind.kind,
        "default": None if not param.has_value else _text(param.default),
        "help": param.help,
    }
    if kind.kind != kind.member_type:
        field["of"] = kind.member_text if kind.entries else kind.member_type
    if kind.member_type in UNITS:
        field["units"] = list(UNITS[kind.member_type])
    if kind.choices:
        field["choices"] = list(kind.choices)
    return field | {side: text for side, text in zip(BOUNDS, kind.bound_texts, strict=True) if text}


def _text(value: object) -> str:
    """Return the default value of a param as text, as a user writes it in the form."""
    return list_text(value) if isinstance(value, list) else format_value(value)


# Time limit of a piece of work in a process whose main thread has no other task.


class TimeLimitError(BaseException):
    """Work exceeded its time limit. A BaseException, so that handlers of the work's own errors do not catch it."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise TimeLimitError in the body of the context after ``seconds``.

    It uses SIGALRM, so it works in the main thread only, and has no limit in other threads.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(*_: object) -> None:
        raise TimeLimitError

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


Json = dict[str, object]

FORM_OPTIONS = ("world", "simulate", "speed", "seed")
"""Options of `mission run` in the form that starts a run."""

MAX_ENTRIES = 4096
"""Maximum number of list entries (missions, robots and worlds) in the cache."""

FILE_TIMEOUT = 5.0
"""Seconds allowed for reading one file of a list; a mission of 10,000 steps takes 4 s."""

LIST_TIMEOUT = 30.0
"""Seconds of work on one list; its remaining files are read at the next request.

It is half of ``WORK_TIMEOUT``, after which the worker process is ended.
"""

DEPENDENCY_SUFFIXES = (*SUFFIXES, *SHEET_SUFFIXES, ".py")
"""Suffixes of files on which a mission, a robot or a world may depend."""

MAX_SHAPE_NODES = 200
"""Maximum number of nodes drawn for a mission in a list."""


def files_by_name(kind: str) -> Mapping[str, Path]:
    """Return the files of a kind (missions, robots, worlds) by name: the user's own first, then the shipped."""
    known = _shipped_files(kind)
    return {**_own_files(kind, known, []), **known}


def _shipped_files(kind: str) -> Mapping[str, Path]:
    if kind != "missions":
        return shipped_files(kind)
    return {
        name: path for name, path in shipped_missions().items() if find_mission(name) == path
    }  # without files beside it


def _own_files(kind: str, known: Mapping[str, Path], faults: list[str]) -> Mapping[str, Path]:
    """Return the user's own files of a kind by name; by path if the library ``known`` has a file of that name.

    An unreadable folder or a faulty defaults file is reported in ``faults``; other files are still listed.
    """
    found: dict[str, Path] = {}
    try:
        here = (
            path for path in sorted(Path().iterdir()) if path.suffix in SUFFIXES and not path.name.endswith(TEST_SUFFIX)
        )
        found |= {path.name: path for path in here if path.is_file() and kind in kinds_of(path)}
    except OSError as error:
        faults.append(f"{Path().absolute()} cannot be read: {error.strerror}")
    try:
        for name, path in user_files(kind).items():
            found.setdefault(str(path) if name in known else name, path)
        faults += unreadable_folders(kind)
    except (OSError, InvalidFileError) as error:
        faults.append(str(error)[:2000])
    return found


def check_name(kind: str, name: str) -> str:
    """Return ``name`` if it is the name of a file of this kind that the studio can use. Raises BadMessage otherwise."""
    if name in files_by_name(kind) or (
        kind == "missions" and name in {full.rpartition("/")[2] for full in files_by_name(kind)}
    ):
        return name
    raise BadMessage("bad_file", f"there is no {kind.removesuffix('s')} '{name[:80]}' here", f"mission list {kind}")


def answer_library(command: ClientCommand) -> Json:
    """Return the answer to the command `library`: the lists of missions, robots, worlds and people."""
    known = {kind: _shipped_files(kind) for kind in ENTRY_MAKERS}
    faults: list[str] = []
    own = {kind: _own_files(kind, known[kind], faults) for kind in ENTRY_MAKERS}
    places = {path.parent for files in own.values() for path in files.values()}
    files = _edition(
        path for place in sorted(places) for path in _paths_below(place) if path.suffix in DEPENDENCY_SUFFIXES
    )
    edition = _edition([checkup_file(), *_paths_below(people_folder())], files + "".join(faults))
    if isinstance(command, LibraryQuery) and command.edition == edition:
        return {"edition": edition}
    _try_behaviours(own["missions"].values())
    clock = SystemClock()
    lists: dict[str, object] = {}
    for kind in ENTRY_MAKERS:
        entries = [_list_entry(kind, name, path, files, clock) for name, path in own[kind].items()]
        entries += [_list_entry(kind, name, path, "", clock) for name, path in known[kind].items()]
        lists[kind] = entries
        if any(entry.get("unread") for entry in entries):
            edition += "+"  # so that the page requests the list again; finished files are cached by then
    more: Json = {
        "motions": [f"motions/{name}" for name in MOTIONS.values()],
        "people": _people_names(),
        "checkup": _last_checkup(),
        "robot": _default_robot(),
        "options": {name: _option_json(RUN_OPTIONS[name]) for name in FORM_OPTIONS},
    }
    return {"edition": edition, "trouble": "\n".join(dict.fromkeys(faults)), **lists, **more}


def _default_robot() -> str:
    """Return the name of the robot that is simulated if the form names none."""
    with suppress(InvalidFileError):
        return load_defaults().robot or DEFAULT_ROBOT
    return DEFAULT_ROBOT


def _option_json(option: Option) -> Json:
    """Return an option as a form field. An infinite default becomes None, since JSON has no infinity."""
    default = None if option.default == inf else option.default
    bounds = {"low": option.low, "high": option.high}
    return {"help": option.help, "default": default, "among": list(option.among), **bounds}


def answer_mission(command: ClientCommand) -> Json:
    """Return the answer to the command `mission`: summary, params, drawing and needed parts of a mission."""
    name = check_name("missions", command.name if isinstance(command, MissionQuery) else "")
    found = load_with_behaviours(name)
    return {
        "name": name,
        "title": found.mission,
        "summary": found.summary,
        "file": found.source.name,
        "parts": sorted(found.tree.parts),
        "params": params_of(name),
        "drawing": to_json(drawing_of(found)),
        "first": {key: value_text(value) for key, value in first_values(found).items()},
    }


def answer_world(command: ClientCommand) -> Json:
    """Return the answer to the command `world`: a world's floor plan, and the pose of the odometry's origin in it."""
    name = check_name("worlds", command.name if isinstance(command, WorldQuery) else "")
    config = load_world(find_file("worlds", name))
    built = build_world(config)
    frame = plan_frame(built)
    return {
        "svg": plan_svg(config.name, built, config.summary),
        "metre": UNITS_PER_METRE,
        "width": frame.width,
        "height": frame.height,
        "x": frame.x,
        "y": frame.y,
        "heading": frame.heading,
    }


HANDLERS: Mapping[str, Callable[[ClientCommand], Json]] = {
    "library": answer_library,
    "mission": answer_mission,
    "world": answer_world,
}
"""Handlers of the commands about the library, by command word."""


def _paths_below(place: Path) -> Iterator[Path]:
    """Yield the paths in a folder and its subfolders; nothing if it cannot be read."""
    with suppress(OSError):
        for path in sorted(place.iterdir()):
            yield path
            with suppress(OSError):
                yield from sorted(path.iterdir()) if path.is_dir() else ()


def _edition(paths: Iterable[Path], before: str = "") -> str:
    """Return a text that changes when one of the files at ``paths`` is added, changed or removed.

    It also changes with the text ``before``.
    """
    digest = hashlib.sha256(before.encode())
    for path in paths:
        with suppress(OSError):
            found = path.stat()
            digest.update(f"{path}\0{found.st_mtime_ns} {found.st_size} {found.st_ino}\0".encode(errors="replace"))
    return digest.hexdigest()[:16]


def _try_behaviours(missions: Iterable[Path]) -> None:
    """Import the behaviour files beside the missions, once for each folder.

    Without this, a behaviour file that hangs would use up the time limit of every mission in its folder.
    """
    for beside in {path.parent: path for path in missions}.values():
        load_leaves(behaviour_files_beside(beside), required_files=())


def _list_entry(kind: str, name: str, path: Path, edition: str, clock: Clock) -> Json:
    """Return the list entry of a file, read within ``FILE_TIMEOUT``; the entry of an invalid file has its errors.

    ``edition`` is a text that changes with the files on which this file depends; an entry of the same edition is
    cached. A file whose turn comes after ``LIST_TIMEOUT`` by ``clock`` is left unread until the next request.
    """
    key = (kind, name, path, edition)
    if key in _entries:
        return _entries[key]
    if clock.now() >= LIST_TIMEOUT:
        return {
            "name": name,
            "summary": "",
            "parts": [],
            "trouble": "not read yet; other files take long",
            "unread": True,
        }
    try:
        with time_limit(FILE_TIMEOUT):
            found = ENTRY_MAKERS[kind](name, path, edition)
    except TimeLimitError:
        trouble = f"it takes more than {FILE_TIMEOUT:g} s to read\n  try: mission check {path if edition else name}"
        found = {"name": name, "summary": "", "parts": [], "trouble": trouble}
        if not edition:  # a shipped file is never that long: the computer was busy
            return {**found, "unread": True}
    except Exception as error:  # an error in one file must not hide the others
        trouble = f"it cannot be read: {type(error).__name__}: {error}"[:2000]
        found = {"name": name, "summary": "", "parts": [], "trouble": trouble}
    if "trouble" in found and edition:
        found = {**_base_entry(kind, name, path, edition), **found}
    while len(_entries) >= MAX_ENTRIES:
        del _entries[next(iter(_entries))]
    _entries[key] = found
    return found


_entries: dict[tuple[str, str, Path, str], Json] = {}
"""Cache of list entries, by kind, name, file, and the edition of the files on which an entry depends."""


def _mission_entry(name: str, path: Path, edition: str) -> Json:
    """Return the list entry of the mission ``name``, or its name with the errors of its file.

    ``edition`` is a text that changes with the files on which the mission depends; empty for a shipped mission.
    """
    entry = _base_entry("missions", name, path, edition)
    try:
        found = load_with_behaviours(name)
    except (InvalidFileError, UnknownNameError) as error:
        return {**entry, "summary": "", "parts": [], "trouble": str(error)[:2000]}
    parts, shape = sorted(found.tree.parts), list(_depths(drawing_of(found).root))[:MAX_SHAPE_NODES]
    return {**entry, "summary": found.summary, "parts": parts, "shape": shape}


def _base_entry(kind: str, name: str, path: Path, edition: str) -> Json:
    """Return the fields that list entries of all kinds have.

    They are the name and, for a user's own file (one with an ``edition``), its title, path and edition.
    """
    if not edition:
        return {"name": name}
    title = path.stem
    with suppress(OSError, ValueError), open_regular(path) as file:
        text = (file.read(MAX_HEAD_BYTES) or b"").decode("utf-8-sig", errors="replace")
        heading = re.search(rf"^{kind.removesuffix('s')}:[ \t]+(\S.*?)[ \t]*(#.*)?$", text, re.MULTILINE)
        title = heading[1].strip("'\"") if heading else title
    return {"name": name, "title": title[:80], "file": str(path), "own": True, "edition": _edition([path])}


def _depths(box: TreeBox, depth: int = 0) -> Iterator[int]:
    """Yield the depth of each node of a drawn tree, in the order of the file; ``depth`` is the depth of ``box``."""
    yield depth
    for child in box.children:
        yield from _depths(child, depth + 1)


def _robot_entry(name: str, path: Path, edition: str) -> Json:
    return _summary_entry("robots", name, path, edition, load_robot)


def _world_entry(name: str, path: Path, edition: str) -> Json:
    return _summary_entry("worlds", name, path, edition, load_world)


def _summary_entry(kind: str, name: str, path: Path, edition: str, load: Callable[[Path], object]) -> Json:
    entry = _base_entry(kind, name, path, edition)
    try:
        return {**entry, "summary": str(getattr(load(path), "summary", ""))}
    except InvalidFileError as error:
        return {**entry, "summary": "", "trouble": str(error)[:2000]}


ENTRY_MAKERS: Mapping[str, Callable[[str, Path, str], Json]] = {
    "missions": _mission_entry,
    "robots": _robot_entry,
    "worlds": _world_entry,
}
"""Functions that make the entry of each list, from a name, its file, and the edition of its dependencies."""


def _people_names() -> list[str]:
    with suppress(Exception):  # an unreadable folder gives a form without names
        return [each.name for each in People(people_folder()).known_people()]
    return []


def _last_checkup() -> Json | None:
    """Return the last result of `mission doctor`; None if there is none."""
    try:
        return parse_object(read_regular_text(checkup_file()))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        what = f"cannot be read: {error}"
        ailing = {"part": "check-up", "about": "its file", "message": what, "verdict": "fault", "fix": "mission doctor"}
        return {"at": time_of_day().isoformat(timespec="seconds"), "robot": "", "ailing": [ailing]}
