"""What there is to run, and on what, as the page shows it: the catalogue that `mission list` and `check` read.

Over the studio, missions, robots and worlds are those of the library, the user's own by name, and the files in the
folder in which it was started: no command leads elsewhere.
"""

import hashlib
import re
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from math import inf, isfinite
from pathlib import Path

from config.defaults import unreadable_folders, user_files
from config.diagnostics import InvalidFileError
from config.file_io import open_regular, parse_object, read_regular_text
from config.library import (
    MAX_HEAD_BYTES,
    SHEET_SUFFIXES,
    SUFFIXES,
    UnknownNameError,
    find_file,
    kinds_of,
    shipped_files,
)
from config.units import UNITS, quantity_text
from config.world import load_world
from drivers.clock import Clock, SystemClock, time_of_day
from missions.control.commands import BadMessage, ClientCommand
from missions.language.document import declared_params
from missions.language.expressions import format_value
from missions.language.param_types import Param
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

# A mission as it is offered to somebody who may run it: read with the leaves beside it, and its params for a form.


def load_with_behaviours(name: str) -> Plan:
    """Return a mission, with the leaves in files beside it. Raises InvalidFileError or UnknownNameError."""
    return load_mission(name, leaves=load_leaves(behaviour_files(name), required_files=()))


def params_of(name: str) -> list[dict[str, object]]:
    """Return the params of a mission as a form has them. Raises InvalidFileError or UnknownNameError."""
    leaves = load_leaves(behaviour_files(name), required_files=())
    return [_param(each) for each in declared_params(find_mission(name), leaves, LOOKUPS).values()]


def _param(param: Param) -> dict[str, object]:
    """Return a param as a form has it."""
    kind = param.type
    told: dict[str, object] = {
        "name": param.name,
        "kind": kind.kind,
        "default": None if not param.has_value else format_value(param.default),
        "help": param.help,
    }
    if kind.kind != kind.member_type:
        told["of"] = kind.member_type
    if kind.member_type in UNITS:
        told["units"] = list(UNITS[kind.member_type])
    if kind.choices:
        told["choices"] = list(kind.choices)
    for side, bound in (("low", kind.low), ("high", kind.high)):
        if isfinite(bound):
            told[side] = quantity_text(bound, kind.member_type) if kind.member_type in UNITS else f"{bound:g}"
    return told


# A limit on the time of a piece of work, for a process whose main thread does nothing else.


class TimeLimitError(BaseException):
    """A piece of work takes too long. What handles all errors of the work must not handle this one."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise TimeLimitError in what is done within, once so many seconds are over; without a limit beside other threads.

    Only the main thread can be interrupted so, and it may have no other use for SIGALRM.
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
"""The options of `mission run` in the form that starts one."""

MAX_ENTRIES = 4096
"""Entries of lists that are cached."""

FILE_TIMEOUT = 5.0
"""Seconds that one file of a list may take: a mission of 10,000 steps takes 4 of them."""

LIST_TIMEOUT = 30.0
"""Seconds after which files of a list are left for the next time: the reader itself ends after twice as many."""

DEPENDENCY_SUFFIXES = (*SUFFIXES, *SHEET_SUFFIXES, ".py")
"""The suffixes of files on which a mission, a robot or a world may depend."""

MAX_SHAPE_NODES = 200
"""Nodes of a mission that a list draws."""


def files_by_name(kind: str) -> Mapping[str, Path]:
    """Return the files of a kind (missions, robots, worlds) by their names: the user's own first, then the shipped."""
    known = _shipped_files(kind)
    return {**_own_files(kind, known, []), **known}


def _shipped_files(kind: str) -> Mapping[str, Path]:
    if kind != "missions":
        return shipped_files(kind)
    return {name: path for name, path in shipped_missions().items() if find_mission(name) == path}  # none beside


def _own_files(kind: str, known: Mapping[str, Path], faults: list[str]) -> Mapping[str, Path]:
    """Return the user's own files of a kind; one whose name is ``known`` of another file goes by its path.

    A folder that cannot be read, or a file of defaults with errors, is told in ``faults`` and hides no other files.
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
    """Return a name, if it is one of those that there are. Raises BadMessage."""
    if name in files_by_name(kind) or (
        kind == "missions" and name in {full.rpartition("/")[2] for full in files_by_name(kind)}
    ):
        return name
    raise BadMessage("bad_file", f"there is no {kind.removesuffix('s')} '{name[:80]}' here", f"mission list {kind}")


def answer_library(command: ClientCommand) -> Json:
    """Answer `answer_library`."""
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
            edition += "+"  # so that the list is asked for again: what was read by then is cached
    more: Json = {
        "motions": [f"motions/{name}" for name in MOTIONS.values()],
        "people": _people_names(),
        "checkup": _last_checkup(),
        "options": {name: _option_json(RUN_OPTIONS[name]) for name in FORM_OPTIONS},
    }
    return {"edition": edition, "trouble": "\n".join(dict.fromkeys(faults)), **lists, **more}


def _option_json(option: Option) -> Json:
    """Return an option as the form has it; an infinite default is none."""
    default = None if option.default == inf else option.default
    bounds = {"low": option.low, "high": option.high}
    return {"help": option.help, "default": default, "among": list(option.among), **bounds}


def answer_mission(command: ClientCommand) -> Json:
    """Answer `answer_mission`."""
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
    """Answer `answer_world`."""
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
"""What does each command."""


def _paths_below(place: Path) -> Iterator[Path]:
    """Yield what is in a folder and in the folders of it; nothing for one that cannot be read."""
    with suppress(OSError):
        for path in sorted(place.iterdir()):
            yield path
            with suppress(OSError):
                yield from sorted(path.iterdir()) if path.is_dir() else ()


def _edition(paths: Iterable[Path], before: str = "") -> str:
    """Return a text that is another one once a file was added, changed or removed."""
    digest = hashlib.sha256(before.encode())
    for path in paths:
        with suppress(OSError):
            found = path.stat()
            digest.update(f"{path}\0{found.st_mtime_ns} {found.st_size} {found.st_ino}\0".encode(errors="replace"))
    return digest.hexdigest()[:16]


def _try_behaviours(missions: Iterable[Path]) -> None:
    """Import the behaviours beside missions once: one that hangs costs its time once, and not that of each mission."""
    for beside in {path.parent: path for path in missions}.values():
        load_leaves(behaviour_files_beside(beside), required_files=())


def _list_entry(kind: str, name: str, path: Path, edition: str, clock: Clock) -> Json:
    """Return the entry of a file in a list, whatever that file is like, and with a time limit of its own.

    Files whose turn comes when ``LIST_TIMEOUT`` is over by the ``clock`` are left for the next time.
    """
    key = (kind, name, path, edition)
    if key in _entries:
        return _entries[key]
    if clock.now() >= LIST_TIMEOUT:
        return {"name": name, "summary": "", "parts": [], "trouble": "not read yet: others take long", "unread": True}
    try:
        with time_limit(FILE_TIMEOUT):
            found = ENTRY_MAKERS[kind](name, path, edition)
    except TimeLimitError:
        trouble = f"it takes more than {FILE_TIMEOUT:g} s to read\n  try: mission check {path if edition else name}"
        found = {"name": name, "summary": "", "parts": [], "trouble": trouble}
        if not edition:  # a file that ships is never that long: the computer was busy
            return {**found, "unread": True}
    except Exception as error:  # it hides none of the others
        trouble = f"it cannot be read: {type(error).__name__}: {error}"[:2000]
        found = {"name": name, "summary": "", "parts": [], "trouble": trouble}
    if "trouble" in found and edition:
        found = {**_base_entry(kind, name, path, edition), **found}
    while len(_entries) >= MAX_ENTRIES:
        del _entries[next(iter(_entries))]
    _entries[key] = found
    return found


_entries: dict[tuple[str, str, Path, str], Json] = {}
"""Entries by kind, name, file and the edition of all files on which they may depend: the newest ones."""


def _mission_entry(name: str, path: Path, edition: str) -> Json:
    """Return a mission's entry in the list, with its errors if it has some.

    ``edition`` is that of the files on which it depends; empty for a shipped mission.
    """
    told = _base_entry("missions", name, path, edition)
    try:
        found = load_with_behaviours(name)
    except (InvalidFileError, UnknownNameError) as error:
        return {**told, "summary": "", "parts": [], "trouble": str(error)[:2000]}
    parts, shape = sorted(found.tree.parts), list(_depths(drawing_of(found).root))[:MAX_SHAPE_NODES]
    return {**told, "summary": found.summary, "parts": parts, "shape": shape}


def _base_entry(kind: str, name: str, path: Path, edition: str) -> Json:
    """Return how a file is called in a list; a file of the user's by its own heading, and with its edition."""
    if not edition:
        return {"name": name}
    title = path.stem
    with suppress(OSError, ValueError), open_regular(path) as file:
        text = (file.read(MAX_HEAD_BYTES) or b"").decode("utf-8-sig", errors="replace")
        heading = re.search(rf"^{kind.removesuffix('s')}:[ \t]+(\S.*?)[ \t]*(#.*)?$", text, re.MULTILINE)
        title = heading[1].strip("'\"") if heading else title
    return {"name": name, "title": title[:80], "file": str(path), "own": True, "edition": _edition([path])}


def _depths(box: TreeBox, depth: int = 0) -> Iterator[int]:
    """Yield how deep each node stands, in the order of the file."""
    yield depth
    for child in box.children:
        yield from _depths(child, depth + 1)


def _robot_entry(name: str, path: Path, edition: str) -> Json:
    return _summary_entry("robots", name, path, edition, load_robot)


def _world_entry(name: str, path: Path, edition: str) -> Json:
    return _summary_entry("worlds", name, path, edition, load_world)


def _summary_entry(kind: str, name: str, path: Path, edition: str, load: Callable[[Path], object]) -> Json:
    told = _base_entry(kind, name, path, edition)
    try:
        return {**told, "summary": str(getattr(load(path), "summary", ""))}
    except InvalidFileError as error:
        return {**told, "summary": "", "trouble": str(error)[:2000]}


ENTRY_MAKERS: Mapping[str, Callable[[str, Path, str], Json]] = {
    "missions": _mission_entry,
    "robots": _robot_entry,
    "worlds": _world_entry,
}
"""What makes an entry of each list: of a name, its file, and the edition of all files on which it may depend."""


def _people_names() -> list[str]:
    """Return the names of those whom the robot knows."""
    with suppress(Exception):  # of a folder that cannot be read: a form without names
        return [each.name for each in People(people_folder()).known_people()]
    return []


def _last_checkup() -> Json | None:
    """Return what `mission doctor` found last; None where it was not asked yet."""
    try:
        return parse_object(read_regular_text(checkup_file()))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        what = f"cannot be read: {error}"
        ailing = {"part": "check-up", "about": "its file", "what": what, "verdict": "fault", "cure": "mission doctor"}
        return {"at": time_of_day().isoformat(timespec="seconds"), "robot": "", "ailing": [ailing]}
