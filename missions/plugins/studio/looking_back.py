"""Records of runs, looked at piece by piece: none is read whole, but small ones to compare them or report of them."""

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from math import inf
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from drivers.clock import SystemClock
from missions.control.commands import BadMessage, Command
from missions.control.outlet import UNWRITTEN
from missions.plugins.records.comparison.runs import IncomparableError, compared
from missions.plugins.records.comparison.words import as_json
from missions.plugins.records.recording.faults import MAX_TIME, message_in, understanding
from missions.plugins.records.recording.items import EVENTS
from missions.plugins.records.recording.listing import Opened, about, ended, entry
from missions.plugins.records.recording.read import Record, began_at, open_record
from missions.plugins.records.replay.frames import SAME
from missions.plugins.records.report.page import page
from missions.plugins.records.report.summary import MOST_PICTURES, study
from missions.plugins.records.ring import records_in, shown_folder
from missions.plugins.studio import wishes
from missions.trees.drawing import ACTIVE, to_json

if TYPE_CHECKING:  # it needs mcap
    from missions.plugins.records.recording.container import Message

Json = dict[str, object]

BUDGET = 0.25
"""Seconds of work on one piece of a record; what comes behind it is in the next."""

TOLD = frozenset({*EVENTS.values(), "/feedback", "/state/base"})
"""The topics that a piece of a record is told of."""

MOST_PLACES = 2000
"""Places of the base's way in one piece."""

LARGEST_WHOLE = 200_000_000
"""Bytes of a record that is made a report of, or compared: that reads it whole."""


def listed(command: Command) -> Json:
    """Answer `records`."""
    del command
    return {"folder": str(shown_folder()), "records": [entry(path) for path in records_in(shown_folder())]}


def record(command: Command) -> Json:
    """Answer `record`."""
    if not isinstance(command, wishes.Record):
        raise TypeError(command.word)
    opened = Opened(path_of(command.name))
    first = bisect_left(opened.chunks, command.start, key=lambda chunk: chunk[0])
    clock, last, gathered = SystemClock(), first, _Gathered()
    for start, *_ in opened.chunks[first:]:
        if start > max(command.start, opened.chunks[first][0]) and clock.now() >= BUDGET:
            break  # never between chunks that begin at once: the next piece would begin with the first of them again
        gathered.add(opened.piece(last, last + 1))
        last += 1
    told = {**about(opened.record), "until": opened.until, **gathered.told()}
    if first == 0:
        told |= {**ended(opened.end()), "drawing": to_json(opened.record.drawing())}
    if last < len(opened.chunks):
        told["more"] = opened.chunks[last][0]
    return told


def report(name: str) -> str:
    """Return the report of a record, as a page. Raises BadMessage for one that is too large."""
    return page(study(_whole(name, f"mission record report {quote(str(path_of(name)))}"), most_pictures=MOST_PICTURES))


def compare(command: Command) -> Json:
    """Answer `compare`."""
    if not isinstance(command, wishes.Compare):
        raise TypeError(command.word)
    names = command.name, command.other
    hint = f"mission record compare {' '.join(quote(str(path_of(name))) for name in names)}"
    try:
        return dict(as_json(compared(*(_whole(name, hint) for name in names))))
    except IncomparableError as error:
        raise BadMessage("bad_record", str(error)) from error


DOES: Mapping[str, Callable[[Command], Json]] = {"records": listed, "record": record, "compare": compare}
"""What does each command."""


def messages(piece: Record, topics: frozenset[str], time: float = inf) -> "Iterator[Message]":
    """Yield what was told on topics up to a time: nothing else of the piece is read."""
    latest = began_at(piece.head) + (time + SAME) * 1e9
    return (message for message in piece.container.messages(topics) if message.time <= latest)


def _whole(name: str, hint: str) -> Record:
    """Return a record that is read whole. Raises BadMessage for one that is too large for that."""
    path = path_of(name)
    if (size := path.stat().st_size) > LARGEST_WHOLE:
        told = f"{path}: {size / 1e6:.0f} MB are too much for this in the studio (at most {LARGEST_WHOLE / 1e6:.0f})"
        raise BadMessage("bad_record", told, hint)
    return open_record(path)


def path_of(name: str) -> Path:
    """Return the record of a name. Raises BadMessage for what is none of those that are listed."""
    found = next((path for path in records_in(shown_folder()) if path.name == name), None)
    if found is None:
        raise BadMessage("no_such_record", f"there is no record '{name[:80]}' in {shown_folder()}")
    return found


class _Gathered:
    """What pieces tell together."""

    def __init__(self) -> None:
        self._lanes: dict[str, list[list[object]]] = {}
        self._log: list[object] = []
        self._failures: list[float] = []
        self._trail: list[list[float]] = []

    def add(self, piece: Record) -> None:
        """Take in a piece, which comes behind the others."""
        with understanding(piece.path):
            found = [(message.topic, message_in(message.data)) for message in messages(piece, TOLD)]
            for topic, told in sorted(found, key=lambda each: float(each[1]["t"])):
                t = round(told["t"], 4)
                if topic == "/nodes":
                    self._lanes.setdefault(told["node"], []).append([t, told["status"], told["reason"]])
                    self._failures += [t] if told["status"] == "failure" else []
                elif topic == "/feedback":
                    lane = self._lanes.setdefault(told["node"], [])
                    if not lane or lane[-1][1] in ACTIVE:
                        lane.append([t, lane[-1][1] if lane else "running", told["reason"]])
                elif topic == "/state/base":
                    self._trail += place_in(told)
                elif (event := piece.event(topic, told)) is not None and not isinstance(event, UNWRITTEN):
                    self._log.append(event.as_dict())

    def told(self) -> Json:
        """Return it as an answer has it."""
        places = [place for before, place in pairwise([[], *self._trail]) if place[1:] != before[1:]]
        step = max(1, len(places) // MOST_PLACES)
        return {"lanes": self._lanes, "log": self._log, "failures": self._failures, "trail": places[::step]}


def place_in(told: Mapping[str, Any]) -> list[list[float]]:
    """Return when the base was where, if a message tells that."""
    found = [told[name] for name in ("t", "x", "y", "heading")]
    known = told["quality"] == "good" and all(isinstance(each, int | float) and abs(each) < MAX_TIME for each in found)
    return [[round(each, 3) for each in found]] if known else []
