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

from config.defaults import own_files, unreadable_folders
from config.faults import InvalidFileError
from config.library import BEGINNING, SHEETS, SUFFIXES, UnknownNameError, find, kinds_of, shipped
from config.reading import open_regular, parse_object, read_regular_text
from config.units import UNITS, written
from config.world import load_world
from drivers.clock import Clock, SystemClock, time_of_day
from missions.control.commands import BadMessage, Command
from missions.language.document import declared_params
from missions.language.expressions import shown
from missions.language.param_types import Param
from missions.language.plan import Plan
from missions.library.drivers import load_robot
from missions.library.folders import checkup_file
from missions.library.people import People, folder
from missions.library.shipped import MOTIONS, TESTS, behaviour_files, find_mission, load_mission, shipped_missions
from missions.library.things import THINGS
from missions.library.vocabulary import found_beside, vocabulary
from missions.library.worlds import build_world
from missions.options import Option
from missions.plugins.pictures.plan import METRE, frame_of, plan
from missions.plugins.studio.wishes import RUN_OPTIONS, Library, Mission, World
from missions.trees.draw import drawing_of, first_values
from missions.trees.drawing import Box, to_json
from missions.trees.words import in_words

# A mission as it is offered to somebody who may run it: read with the leaves beside it, and its params for a form.


def load_with_own(name: str) -> Plan:
    """Return a mission, with the leaves in files beside it. Raises InvalidFileError or UnknownNameError."""
    return load_mission(name, leaves=vocabulary(behaviour_files(name), given=()))


def params_of(name: str) -> list[dict[str, object]]:
    """Return the params of a mission as a form has them. Raises InvalidFileError or UnknownNameError."""
    leaves = vocabulary(behaviour_files(name), given=())
    return [_param(each) for each in declared_params(find_mission(name), leaves, THINGS).values()]


def _param(param: Param) -> dict[str, object]:
    """Return a param as a form has it."""
    kind = param.type
    told: dict[str, object] = {
        "name": param.name,
        "kind": kind.kind,
        "default": None if not param.known else shown(param.default),
        "help": param.help,
    }
    if kind.kind != kind.of:
        told["of"] = kind.of
    if kind.of in UNITS:
        told["units"] = list(UNITS[kind.of])
    if kind.choices:
        told["choices"] = list(kind.choices)
    for side, bound in (("low", kind.low), ("high", kind.high)):
        if isfinite(bound):
            told[side] = written(bound, kind.of) if kind.of in UNITS else f"{bound:g}"
    return told


# A limit on the time of a piece of work, for a process whose main thread does nothing else.


class TimeLimitError(BaseException):
    """A piece of work takes too long. What handles all errors of the work must not handle this one."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
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

OFFERED = ("world", "simulate", "speed", "seed")
"""The options of `mission run` in the form that starts one."""

MAX_ENTRIES = 4096
"""Entries of lists that are cached."""

FILE_TIMEOUT = 5.0
"""Seconds that one file of a list may take: a mission of 10,000 steps takes 4 of them."""

LIST_TIMEOUT = 30.0
"""Seconds after which files of a list are left for the next time: the reader itself ends after twice as many."""

READ = (*SUFFIXES, *SHEETS, ".py")
"""The suffixes of files on which a mission, a robot or a world may depend."""

MOST_DRAWN = 200
"""Nodes of a mission that a list draws."""


def names_of(kind: str) -> Mapping[str, Path]:
    """Return the files of a kind (missions, robots, worlds) by their names: the user's own first, then the shipped."""
    known = _shipped(kind)
    return {**_own(kind, known, []), **known}


def _shipped(kind: str) -> Mapping[str, Path]:
    if kind != "missions":
        return shipped(kind)
    return {name: path for name, path in shipped_missions().items() if find_mission(name) == path}  # none beside


def _own(kind: str, known: Mapping[str, Path], faults: list[str]) -> Mapping[str, Path]:
    """Return the user's own files of a kind; one whose name is ``known`` of another file goes by its path.

    A folder that cannot be read, or a file of defaults with errors, is told in ``faults`` and hides no other files.
    """
    found: dict[str, Path] = {}
    try:
        here = (path for path in sorted(Path().iterdir()) if path.suffix in SUFFIXES and not path.name.endswith(TESTS))
        found |= {path.name: path for path in here if path.is_file() and kind in kinds_of(path)}
    except OSError as error:
        faults.append(f"{Path().absolute()} cannot be read: {error.strerror}")
    try:
        for name, path in own_files(kind).items():
            found.setdefault(str(path) if name in known else name, path)
        faults += unreadable_folders(kind)
    except (OSError, InvalidFileError) as error:
        faults.append(str(error)[:2000])
    return found


def check_name(kind: str, name: str) -> str:
    """Return a name, if it is one of those that there are. Raises BadMessage."""
    if name in names_of(kind) or (kind == "missions" and name in {full.rpartition("/")[2] for full in names_of(kind)}):
        return name
    raise BadMessage("bad_file", f"there is no {kind.removesuffix('s')} '{name[:80]}' here", f"mission list {kind}")


def library(command: Command) -> Json:
    """Answer `library`."""
    known = {kind: _shipped(kind) for kind in MAKES}
    faults: list[str] = []
    own = {kind: _own(kind, known[kind], faults) for kind in MAKES}
    places = {path.parent for files in own.values() for path in files.values()}
    files = _edition(path for place in sorted(places) for path in _below(place) if path.suffix in READ)
    edition = _edition([checkup_file(), *_below(folder())], files + "".join(faults))
    if isinstance(command, Library) and command.edition == edition:
        return {"edition": edition}
    _try_behaviours(own["missions"].values())
    clock = SystemClock()
    lists: dict[str, object] = {}
    for kind in MAKES:
        entries = [_listed(kind, name, path, files, clock) for name, path in own[kind].items()]
        entries += [_listed(kind, name, path, "", clock) for name, path in known[kind].items()]
        lists[kind] = entries
        if any(entry.get("unread") for entry in entries):
            edition += "+"  # so that the list is asked for again: what was read by then is cached
    more: Json = {
        "motions": [f"motions/{name}" for name in MOTIONS.values()],
        "people": _people(),
        "checkup": _checkup(),
        "options": {name: _offered(RUN_OPTIONS[name]) for name in OFFERED},
    }
    return {"edition": edition, "trouble": "\n".join(dict.fromkeys(faults)), **lists, **more}


def _offered(option: Option) -> Json:
    """Return an option as the form has it; an infinite default is none."""
    default = None if option.default == inf else option.default
    bounds = {"low": option.low, "high": option.high}
    return {"help": option.help, "default": default, "among": list(option.among), **bounds}


def mission(command: Command) -> Json:
    """Answer `mission`."""
    name = check_name("missions", command.name if isinstance(command, Mission) else "")
    found = load_with_own(name)
    return {
        "name": name,
        "title": found.mission,
        "summary": found.summary,
        "file": found.source.name,
        "parts": sorted(found.tree.parts),
        "params": params_of(name),
        "drawing": to_json(drawing_of(found)),
        "first": {key: in_words(value) for key, value in first_values(found).items()},
    }


def world(command: Command) -> Json:
    """Answer `world`."""
    name = check_name("worlds", command.name if isinstance(command, World) else "")
    config = load_world(find("worlds", name))
    built = build_world(config)
    frame = frame_of(built)
    return {
        "svg": plan(config.name, built, config.summary),
        "metre": METRE,
        "width": frame.width,
        "height": frame.height,
        "x": frame.x,
        "y": frame.y,
        "heading": frame.heading,
    }


DOES: Mapping[str, Callable[[Command], Json]] = {"library": library, "mission": mission, "world": world}
"""What does each command."""


def _below(place: Path) -> Iterator[Path]:
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
        vocabulary(found_beside(beside), given=())


def _listed(kind: str, name: str, path: Path, edition: str, clock: Clock) -> Json:
    """Return the entry of a file in a list, whatever that file is like, and with a time limit of its own.

    Files whose turn comes when ``LIST_TIMEOUT`` is over by the ``clock`` are left for the next time.
    """
    key = (kind, name, path, edition)
    if key in _entries:
        return _entries[key]
    if clock.now() >= LIST_TIMEOUT:
        return {"name": name, "summary": "", "parts": [], "trouble": "not read yet: others take long", "unread": True}
    try:
        with limited(FILE_TIMEOUT):
            found = MAKES[kind](name, path, edition)
    except TimeLimitError:
        trouble = f"it takes more than {FILE_TIMEOUT:g} s to read\n  try: mission check {path if edition else name}"
        found = {"name": name, "summary": "", "parts": [], "trouble": trouble}
        if not edition:  # a file that ships is never that long: the computer was busy
            return {**found, "unread": True}
    except Exception as error:  # it hides none of the others
        trouble = f"it cannot be read: {type(error).__name__}: {error}"[:2000]
        found = {"name": name, "summary": "", "parts": [], "trouble": trouble}
    if "trouble" in found and edition:
        found = {**_entry(kind, name, path, edition), **found}
    while len(_entries) >= MAX_ENTRIES:
        del _entries[next(iter(_entries))]
    _entries[key] = found
    return found


_entries: dict[tuple[str, str, Path, str], Json] = {}
"""Entries by kind, name, file and the edition of all files on which they may depend: the newest ones."""


def _mission(name: str, path: Path, edition: str) -> Json:
    """Return a mission's entry in the list, with its errors if it has some.

    ``edition`` is that of the files on which it depends; empty for a shipped mission.
    """
    told = _entry("missions", name, path, edition)
    try:
        found = load_with_own(name)
    except (InvalidFileError, UnknownNameError) as error:
        return {**told, "summary": "", "parts": [], "trouble": str(error)[:2000]}
    parts, shape = sorted(found.tree.parts), list(_depths(drawing_of(found).root))[:MOST_DRAWN]
    return {**told, "summary": found.summary, "parts": parts, "shape": shape}


def _entry(kind: str, name: str, path: Path, edition: str) -> Json:
    """Return how a file is called in a list; a file of the user's by its own heading, and with its edition."""
    if not edition:
        return {"name": name}
    title = path.stem
    with suppress(OSError, ValueError), open_regular(path) as file:
        text = (file.read(BEGINNING) or b"").decode("utf-8-sig", errors="replace")
        heading = re.search(rf"^{kind.removesuffix('s')}:[ \t]+(\S.*?)[ \t]*(#.*)?$", text, re.MULTILINE)
        title = heading[1].strip("'\"") if heading else title
    return {"name": name, "title": title[:80], "file": str(path), "own": True, "edition": _edition([path])}


def _depths(box: Box, depth: int = 0) -> Iterator[int]:
    """Yield how deep each node stands, in the order of the file."""
    yield depth
    for child in box.children:
        yield from _depths(child, depth + 1)


def _robot(name: str, path: Path, edition: str) -> Json:
    return _summary("robots", name, path, edition, load_robot)


def _world(name: str, path: Path, edition: str) -> Json:
    return _summary("worlds", name, path, edition, load_world)


def _summary(kind: str, name: str, path: Path, edition: str, load: Callable[[Path], object]) -> Json:
    told = _entry(kind, name, path, edition)
    try:
        return {**told, "summary": str(getattr(load(path), "summary", ""))}
    except InvalidFileError as error:
        return {**told, "summary": "", "trouble": str(error)[:2000]}


MAKES: Mapping[str, Callable[[str, Path, str], Json]] = {"missions": _mission, "robots": _robot, "worlds": _world}
"""What makes an entry of each list: of a name, its file, and the edition of all files on which it may depend."""


def _people() -> list[str]:
    """Return the names of those whom the robot knows."""
    with suppress(Exception):  # of a folder that cannot be read: a form without names
        return [each.name for each in People(folder()).known()]
    return []


def _checkup() -> Json | None:
    """Return what `mission doctor` found last; None where it was not asked yet."""
    try:
        return parse_object(read_regular_text(checkup_file()))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        what = f"cannot be read: {error}"
        ailing = {"part": "check-up", "about": "its file", "what": what, "verdict": "fault", "cure": "mission doctor"}
        return {"at": time_of_day().isoformat(timespec="seconds"), "robot": "", "ailing": [ailing]}
