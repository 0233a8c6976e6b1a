"""What a file is, a mission, a world, a robot, by the keys that it holds; and what to type for it."""

import re
from collections.abc import Mapping
from pathlib import Path

from config.reading import open_regular
from config.units import article

KEYS: Mapping[str, str] = {
    "mission": "missions",
    "tests": "tests",
    "world": "worlds",
    "robot": "robots",
    "gesture": "gestures",
    "gait": "gaits",
    "controller": "controllers",
    "object": "objects",
}
"""The key that each kind of file must have, and the kind."""

USES: Mapping[str, str] = {
    "missions": "mission run {0}",
    "tests": "mission test {0}",
    "worlds": "mission world show {0}, or mission run MISSION --world {0}",
    "robots": "mission run MISSION --simulate --robot {0}",
    "gestures": "write `gesture: {0}` in a mission",
    "gaits": "mission gait show {0}",
    "controllers": "mission controller show {0}",
    "objects": "write `find_object: {0}` in a mission",
    "records": "mission replay {0}",
}
"""What to type for a file of each kind."""

RECORD = b"\x89MCAP0"
"""What a record begins with."""

BEGINNING = 65_536
"""Bytes in which the keys are looked for."""


def wrong_kind(asked: str, path: Path) -> str:
    """Say what a file is where it is clearly of another kind than the one ``asked`` for; nothing where it may be."""
    found = kinds_of(path)
    if not found or asked in found or (asked == "moves" and "gestures" in found):
        return ""
    use = USES[found[0]].format(path)
    return f"{path} is {article(found[0].removesuffix('s'))}: {use}"


def kinds_of(path: Path) -> list[str]:
    """Return the kinds of which a file can be, by its keys in their order; none where it says nothing of that."""
    try:
        with open_regular(path) as file:
            data = file.read(BEGINNING) or b""
    except (OSError, ValueError):
        return []
    if data.startswith(RECORD):
        return ["records"]
    keys = re.findall(r"^([a-z]+):(?=\s|$)", data.decode("utf-8-sig", errors="replace"), re.MULTILINE)
    return [KEYS[key] for key in keys if key in KEYS]
