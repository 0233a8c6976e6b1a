"""Headings of a sheet: the name of a joint, or of the times, and the unit that stands behind it."""

import re
from collections.abc import Collection
from typing import NamedTuple

UNITS = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°", "º", "grad"), "deg"),
    **dict.fromkeys(("rad", "rads", "radian", "radians"), "rad"),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden"), "s"),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds", "millisekunde", "millisekunden"), "ms"),
}
"""Units as people write them, English and German, and what each means."""

TIME = "time"
"""The heading of the column that says when a row is, in seconds unless it says another unit."""

TIME_NAMES = (TIME, "t", "zeit", "timestamp", "seconds", "sekunden")
"""Names of such columns; all but the first need their unit."""

_BRACKETS = re.compile(r"(.*?)\s*[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]\s*")
_BEHIND = re.compile(r"(.*?)(?:[\s_,;:/.-]+(?:in\s+)?([A-Za-z]+)|\s*([°º]))\s*")


class Heading(NamedTuple):
    """A heading taken apart: ``unit`` is deg, rad, s or ms, as written for one that is none of these, or empty."""

    name: str
    unit: str


def heading_of(text: str, names: Collection[str] = ()) -> Heading:
    """Take a heading apart; one that is among the ``names`` has no unit."""
    if text in names:
        return Heading(text, "")
    if found := _BRACKETS.fullmatch(text):
        unit = found[2].lower().rstrip(".")
        return Heading(found[1].strip(), UNITS.get(unit, unit))
    if found := _BEHIND.fullmatch(text):
        unit = UNITS.get((found[2] or found[3]).lower(), "")
        if unit in ("deg", "rad") or (unit and found[1].strip().lower() in TIME_NAMES):
            return Heading(found[1].strip(" _,;:/.-"), unit)
    return Heading(text, "")


def joint_called(name: str, joints: Collection[str]) -> str:
    """Return the joint that a heading means, in whatever case and with whatever between its words; empty for none."""
    if name in joints:
        return name
    spelt = {joint.lower(): joint for joint in joints}
    return spelt.get(re.sub(r"[\s./-]+", "_", name.strip()).lower(), "")


def time_unit(text: str) -> str:
    """Return the unit of a column of times, s or ms; empty for any other column."""
    name, unit = heading_of(text)
    if name.lower() == TIME and unit in ("", "s", "ms"):
        return unit or "s"
    return unit if name.lower() in TIME_NAMES and unit in ("s", "ms") else ""


def is_unit(text: str) -> bool:
    """Say whether a cell is the name of a unit, with or without brackets."""
    return text.strip("()[]{}<> .").lower() in UNITS
