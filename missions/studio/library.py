"""What there is to run, and on what, as the page shows it: the catalogue that `mission list` and `check` read.

Over the studio, missions, robots and worlds are those of the library, and the files in the folder in which it was
started: no command leads elsewhere.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from config.faults import InvalidFileError
from config.library import SUFFIXES, UnknownNameError, find, kinds_of, shipped
from config.world import load_world
from drivers.clock import time_of_day
from missions.library.drivers import load_robot
from missions.library.folders import checkup_file
from missions.library.forms import load_with_own, params_of
from missions.library.people import People, folder
from missions.library.shipped import TESTS, shipped_missions
from missions.library.worlds import build_world
from missions.studio.commands import Command
from missions.studio.form import BadMessage
from missions.studio.wishes import Mission, World
from missions.views.pictures.draw import drawing_of
from missions.views.pictures.drawing import Box
from missions.views.pictures.plan import METRE, frame_of, plan
from missions.views.pictures.tree_json import to_json

Json = dict[str, object]

MOTIONS = tuple(
    f"motions/{name}"
    for name in (
        "forward", "spin_left", "spin_right", "square", "triangle", "back_and_forth", "circle_anticlockwise",
        "circle_clockwise",
    )
)  # fmt: skip
"""The motions of the TurtleBot course, in the order of their numbers."""


MOST_DRAWN = 200
"""Nodes of a mission that a list draws."""


def names_of(kind: str) -> Mapping[str, Path]:
    """Return the files of a kind (missions, robots, worlds) that there are, by their names: ours, then the user's."""
    known = shipped_missions() if kind == "missions" else shipped(kind)
    own = (path for path in sorted(Path().iterdir()) if path.suffix in SUFFIXES and not path.name.endswith(TESTS))
    return {**known, **{path.name: path for path in own if path.is_file() and kind in kinds_of(path)}}


def check_name(kind: str, name: str) -> str:
    """Return a name, if it is one of those that there are. Raises BadMessage."""
    if name in names_of(kind) or (kind == "missions" and name in {full.rpartition("/")[2] for full in names_of(kind)}):
        return name
    raise BadMessage("bad_file", f"there is no {kind.removesuffix('s')} '{name[:80]}' here", f"mission list {kind}")


def library(command: Command) -> Json:
    """Answer `library`."""
    del command
    return {
        "missions": [_mission(name, path, path.stat().st_mtime_ns) for name, path in names_of("missions").items()],
        "robots": [_summary(name, path, load_robot) for name, path in names_of("robots").items()],
        "worlds": [_summary(name, path, load_world) for name, path in names_of("worlds").items()],
        "motions": list(MOTIONS),
        "people": _people(),
        "checkup": _checkup(),
    }


def mission(command: Command) -> Json:
    """Answer `mission`."""
    name = check_name("missions", command.name if isinstance(command, Mission) else "")
    found = load_with_own(name)
    return {
        "name": name,
        "summary": found.summary,
        "file": found.source.name,
        "parts": sorted(found.tree.parts),
        "params": params_of(name),
        "drawing": to_json(drawing_of(found)),
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


@lru_cache(maxsize=512)
def _mission(name: str, path: Path, changed: int) -> Json:
    """Return what the list says of a mission, as it was when it was ``changed``; one that is wrong says why."""
    del path, changed
    try:
        found = load_with_own(name)
    except (InvalidFileError, UnknownNameError) as error:
        return {"name": name, "summary": "", "parts": [], "trouble": str(error)[:2000]}
    parts, shape = sorted(found.tree.parts), list(_depths(drawing_of(found).root))[:MOST_DRAWN]
    return {"name": name, "summary": found.summary, "parts": parts, "shape": shape}


def _depths(box: Box, depth: int = 0) -> Iterator[int]:
    """Yield how deep each node stands, in the order of the file."""
    yield depth
    for child in box.children:
        yield from _depths(child, depth + 1)


def _summary(name: str, path: Path, load: Callable[[Path], object]) -> Json:
    try:
        return {"name": name, "summary": str(getattr(load(path), "summary", ""))}
    except InvalidFileError as error:
        return {"name": name, "summary": "", "trouble": str(error)[:2000]}


def _people() -> list[str]:
    """Return the names of those whom the robot knows."""
    with suppress(Exception):  # of a folder that cannot be read: a form without names
        return [each.name for each in People(folder()).known()]
    return []


def _checkup() -> Json | None:
    """Return what `mission doctor` found last; None where it was not asked yet."""
    try:
        found = json.loads(checkup_file().read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        what = f"cannot be read: {error}"
        ailing = {"part": "check-up", "about": "its file", "what": what, "verdict": "fault", "cure": "mission doctor"}
        return {"at": time_of_day().isoformat(timespec="seconds"), "robot": "", "ailing": [ailing]}
    return found if isinstance(found, dict) else None
