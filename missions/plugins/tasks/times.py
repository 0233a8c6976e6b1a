"""When a task is due: times of day and repetitions as people say them, in the local time of a place.

All else than ``wall_clock`` is computed from what is handed in, in seconds (Unix). Where the clocks go forward, a time
that is left out is the moment at which they do; where they go back, a time that comes twice is the first of the two.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta, tzinfo
from pathlib import Path
from zoneinfo import ZoneInfo

from config.faults import did_you_mean
from config.units import in_dimension, seen, written
from drivers.clock import time_of_day

DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")

SHORTEST = 1.0
"""Seconds from one repetition to the next, at least."""

MAX_INTERVAL = 366 * 24 * 3600.0
"""Seconds from one repetition to the next, at most: a year."""

_DATE_AND_TIME = re.compile(r"([0-9]{4}-[0-9]{2}-[0-9]{2})[ T]+([0-9]{1,2}:[0-9]{2})")


@dataclass(frozen=True, slots=True)
class Every:
    """A repetition: each ``period`` seconds; or where that is 0, each day, or one ``day`` of the week (0 is Monday).

    ``at`` is the time of day then. Its text can be read again.
    """

    period: float = 0.0
    day: int | None = None
    at: time = time()

    def __str__(self) -> str:
        if self.period:
            return f"{self.period:.12g} s"
        return f"{'day' if self.day is None else DAYS[self.day]} {self.at:%H:%M}"


def wall_clock() -> float:
    """Return the time of day, in seconds (Unix)."""
    return time_of_day().timestamp()


def read_every(text: str, begin: float, zone: tzinfo, at: str = "") -> Every:
    """Read "30 min", "day", "monday" or "day 18:00"; without a time of day it is that of ``begin``.

    Or that of ``at``, as ``read_at`` has read it: ``begin`` may be later, where the clocks leave that time out.
    Raises ValueError that says what is wrong.
    """
    word, _, clock = text.strip().lower().partition(" ")
    if word == "day" or word in DAYS:
        wanted = clock.strip() or at.strip()[-5:].strip(" T")
        when = _read_time(wanted) if wanted else datetime.fromtimestamp(begin, zone).time()
        return Every(day=None if word == "day" else DAYS.index(word), at=when.replace(second=0, microsecond=0))
    try:
        period = in_dimension(text, "duration")
    except ValueError as error:
        hint = did_you_mean(word, ("day", *DAYS)) or "such as '30 min', 'day' or 'monday 18:00'"
        raise ValueError(f"{seen(text)} is no repetition: {hint}") from error
    if period < SHORTEST:
        raise ValueError(f"{seen(text)} is too often: at least {written(SHORTEST, 'duration')}")
    if period > MAX_INTERVAL:
        raise ValueError(f"{seen(text)} is too seldom: at most a year, {MAX_INTERVAL / 3600:g} h")
    return Every(period=period)


def first_time(every: Every, begin: float, zone: tzinfo) -> float:
    """Return when a repetition that begins at ``begin`` is due for the first time."""
    return begin if every.period else _next_day(every, begin, zone, itself=True)


def next_time(every: Every, due: float, now: float, zone: tzinfo) -> float:
    """Return when what was ``due`` then is due again: the first time after that and after ``now``.

    So what was missed meanwhile is not made up for.
    """
    if not every.period:
        return _next_day(every, max(due, now), zone)
    steps = max(1, int((now - due) // every.period) + 1)
    while (found := due + steps * every.period) <= max(due, now):  # rounding may leave it one step short
        steps += 1
    return found


def drawn_in(every: Every, due: float, now: float, zone: tzinfo) -> float:
    """Return when a repetition comes that is to come at ``due``: sooner, if the clock was put back meanwhile.

    It is never further ahead than the next one of a repetition that begins ``now``.
    """
    return min(due, now + every.period if every.period else _next_day(every, now, zone))


def read_at(text: str, now: float, zone: tzinfo) -> float:
    """Read "18:00", the next such time after ``now``; or "2026-12-24 18:00", once.

    Raises ValueError that says what is wrong.
    """
    found = _DATE_AND_TIME.fullmatch(text.strip())
    if found is None:
        return _next_day(Every(at=_read_time(text.strip())), now, zone)
    try:
        day = date.fromisoformat(found[1])
    except ValueError as error:
        raise ValueError(f"{seen(text)} is no date: {error}") from error
    due = _moment(day, _read_time(found[2]), zone)
    if due <= now:
        raise ValueError(f"{seen(text)} is over: it is {datetime.fromtimestamp(now, zone):%Y-%m-%d %H:%M} now")
    return due


def local_zone(environment: Mapping[str, str] = os.environ) -> tzinfo:
    """Return the time zone of this machine: that of TZ, else of /etc/localtime, else UTC."""
    name = environment.get("TZ", "").removeprefix(":")
    try:
        if name:
            return ZoneInfo(name)
        with Path("/etc/localtime").open("rb") as file:
            return ZoneInfo.from_file(file, key="local")
    except (OSError, ValueError, LookupError):
        return UTC


def _read_time(text: str) -> time:
    found = re.fullmatch("([0-9]{1,2}):([0-9]{2})", text)
    if found is None or int(found[1]) > 23 or int(found[2]) > 59:
        raise ValueError(f"{seen(text)} is no time of day: such as '18:00', or '2026-12-24 18:00'")
    return time(int(found[1]), int(found[2]))


def _next_day(every: Every, after: float, zone: tzinfo, *, itself: bool = False) -> float:
    """Return the first time of a daily or weekly repetition that comes ``after``, or is ``itself`` that."""
    day = datetime.fromtimestamp(after, zone).date() - timedelta(days=1)
    while True:
        if every.day in (None, day.weekday()):
            found = _moment(day, every.at, zone)
            if found > after or (itself and found == after):
                return found
        day += timedelta(days=1)


def _moment(day: date, at: time, zone: tzinfo) -> float:
    """Return a local time in seconds: the first, where it comes twice; the end of the gap, where it never comes."""
    local = datetime.combine(day, at, zone)
    # In a gap the first reading counts as before the change and the second as after it: they change places.
    early, late = sorted(local.replace(fold=fold).timestamp() for fold in (0, 1))
    if datetime.fromtimestamp(late, zone).replace(tzinfo=None) == datetime.combine(day, at) or early == late:
        return early
    before = datetime.fromtimestamp(early, zone).utcoffset()
    while late - early > 0.5:  # the change lies between them, at a whole second
        middle = (early + late) / 2
        if datetime.fromtimestamp(middle, zone).utcoffset() == before:
            early = middle
        else:
            late = middle
    return float(round(late))
