"""Computation of statistics from a record."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from missions.executive.events import NodeChanged
from missions.executive.tick_record import Answer, TickRecord
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.recording.tagged_values import from_json
from missions.plugins.records.recording.validation import MAX_SECONDS, check_time, parse_message, reject_malformed
from missions.plugins.records.statistics.figures import RunKind, Stats, Times, WireFigures
from missions.plugins.records.statistics.nodes import node_figures

TICK_LATE, TICK_WORK = "tick: late", "tick: at work"
PICTURE_SEARCH, PICTURE_TO_PERCEPTS = "picture: searched in", "picture to percepts"

MOTION_COMMANDS = frozenset({("base", "drive"), ("head", "look"), ("arm", "move")})
"""Commands that start a motion, as (part, method): reaction times are measured up to them."""

_COUNTERS: Any = Mapping[str, Mapping[str, int]]

BASE_COMMAND = ("base", "command")
"""Device and operation under which the bus statistics count commands to the base.

Such a command waits for the next report of the base, so this delay is part of the base's reaction time. Commands to
other parts do not wait.
"""

DURATION_PREFIX, TIME_SUFFIX = "longest_", "_us"
"""Prefix of maximum times, and suffix of times, in counter names; see ``drivers.transport.history``."""


def compute_stats(record: RunRecord) -> Stats:
    """Return the statistics of a record. Raises InvalidRecordError."""
    head, moments = record.header, record.tick_records
    ticks = [moment for moment in moments if moment.kind == "tick"]
    start = record.cut_start or 0.0
    seen, devices = _read_messages(record)
    wires = dict(_wire_figures(devices, since_begin=record.cut_start is None))
    end = record.run_end()
    real = head.simulate != "fast"
    return Stats(
        RunKind(head.mission, head.robot, head.simulate),
        records=1,
        results=Counter({"not recorded" if end is None else end.result: 1}),
        seconds=max(0.0, record.end_time - start),
        ticks=len(ticks),
        overruns=sum(int((each.late + each.spent) * head.rate) for each in ticks) if real else 0,
        nodes=node_figures(
            record.drawing(),
            [event for event in record.events if isinstance(event, NodeChanged)],
            moments,
            start=start,
            until=record.end_time,
        ),
        delays={
            name: times
            for name, times in (
                (TICK_LATE, _times([each.late for each in ticks] if real else [])),
                (TICK_WORK, _times([each.spent for each in ticks])),
                *_picture_times(seen, real=real),
                *_reaction_times(ticks, wires.get(BASE_COMMAND), real=real),
            )
            if len(times)
        },
        wires=wires,
        counts=dict(_counter_totals(devices, since_begin=record.cut_start is None)),
    )


def _read_messages(record: RunRecord) -> tuple[list[tuple[float, float, float]], list[Mapping[str, Mapping[str, int]]]]:
    """Return two lists: report time, stamp and search time (s) of each view, and the device counters over time."""
    seen: list[tuple[float, float, float]] = []
    devices: list[Mapping[str, Mapping[str, int]]] = []
    for message in record.container.messages(frozenset({"/percepts", "/state/devices"})):
        with reject_malformed(record.path):
            data: Any = parse_message(message.data)
            if message.topic == "/state/devices":
                counters = {name: device["counters"] for name, device in data["devices"].items()}
                devices.append(from_json(counters, _COUNTERS))
            elif data["looked"] is not None:
                seen.append((data["t"], check_time(data["looked"]), check_time(data["spent"])))
    return seen, devices


def _picture_times(seen: Sequence[tuple[float, float, float]], *, real: bool) -> Iterator[tuple[str, Times]]:
    yield PICTURE_SEARCH, _times([spent for _, _, spent in seen] if real else [])
    yield PICTURE_TO_PERCEPTS, _times([t - stamp for t, stamp, _ in seen])


def _reaction_times(
    ticks: Sequence[TickRecord], waits: WireFigures | None, *, real: bool
) -> Iterator[tuple[str, Times]]:
    """Yield the reaction times (s) to pictures of each actuator, each with a title such as "picture to head command".

    A reaction time is the age of a picture when the first command based on it was sent. ``waits`` are the bus
    statistics of base commands, whose mean delay is added. ``real`` is True for a run in real time.
    """
    ages: dict[str, list[float]] = {}
    newest: dict[str, float] = {}
    for moment in ticks:
        sent_at = moment.t + (moment.spent if real else 0.0)  # upper bound: commands are sent during the tick
        for part, stamp in _commands_after_look(moment.answers).items():
            if stamp > newest.get(part, float("-inf")):
                newest[part] = stamp
                ages.setdefault(part, []).append(sent_at - stamp)
    for part, times in sorted(ages.items()):
        waited = waits.mean if waits is not None and part == BASE_COMMAND[0] else 0.0
        yield f"picture to {part} {'on the wire' if real else 'command'}", _times(times) + waited


def _commands_after_look(answers: Sequence[Answer]) -> Mapping[str, float]:
    """Return for each part that was sent a motion command the time (s) of the newest picture known to the leaf.

    It is the time of the newest picture in the replies of perception before the command. Commands before any such reply
    are left out.
    """
    newest: float | None = None
    stamps_by_part: dict[str, float] = {}
    for part, what, _, value in answers:
        if part == "sight":
            stamps = [newest, *_stamps(value)]
            newest = max((stamp for stamp in stamps if stamp is not None), default=None)
        elif (part, what) in MOTION_COMMANDS and newest is not None and not isinstance(value, Exception):
            stamps_by_part.setdefault(part, newest)
    return stamps_by_part


def _stamps(value: object) -> Iterator[float]:
    """Yield the times (s) of pictures in a reply of perception, which is a stamp, a percept, or a sequence of these."""
    match value:
        case float() | int() if abs(value) < MAX_SECONDS:
            yield float(value)
        case tuple() | list():
            for each in value:
                yield from _stamps(each)
        case _ if isinstance(stamp := getattr(value, "stamp", None), float):
            yield stamp


def _wire_figures(
    devices: Sequence[Mapping[str, Mapping[str, int]]], *, since_begin: bool
) -> Iterator[tuple[tuple[str, str], WireFigures]]:
    for device, name, counted in _counter_growth(devices, since_begin=since_begin):
        if name.endswith(TIME_SUFFIX) and not name.startswith(DURATION_PREFIX):
            what = name.removesuffix(TIME_SUFFIX)
            if count := counted.get(f"{what}s", 0):
                longest = devices[-1][device].get(f"{DURATION_PREFIX}{name}", 0)
                yield (device, what), WireFigures(count, counted[name] / 1e6, longest / 1e6)


def _counter_totals(
    devices: Sequence[Mapping[str, Mapping[str, int]]], *, since_begin: bool
) -> Iterator[tuple[tuple[str, str], int]]:
    """Yield ((device, counter name), increase during the record) for the device counters that are plain numbers.

    Left out are times, values with a unit, and counters of operations, which have a time. With ``since_begin`` all
    counters began at 0.
    """
    for device, name, counted in _counter_growth(devices, since_begin=since_begin):
        if not name.endswith((TIME_SUFFIX, ")")) and f"{name.removesuffix('s')}{TIME_SUFFIX}" not in counted:
            yield (device, name), counted[name]


def _counter_growth(
    devices: Sequence[Mapping[str, Mapping[str, int]]], *, since_begin: bool
) -> Iterator[tuple[str, str, Mapping[str, int]]]:
    """Yield device, counter name, and the increases of all counters of that device, for each counter.

    With ``since_begin`` all counters began at 0; otherwise the first values in the record are subtracted.
    """
    if not devices:
        return
    for device, last in devices[-1].items():
        first = {} if since_begin else devices[0].get(device, {})
        counted = {name: count - first.get(name, 0) for name, count in last.items()}
        for name in counted:
            yield device, name, counted


def _times(values: Sequence[float]) -> Times:
    return np.asarray(values, dtype=np.float64)
