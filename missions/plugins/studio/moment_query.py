"""State at one moment of a record: tree, variables, robot, parts, and picture."""

import base64
from collections.abc import Callable, Mapping, Sequence
from math import cos, sin
from typing import Any

from missions.control.commands import ClientCommand
from missions.control.picture_feed import percepts_in
from missions.control.state_feed import MAX_SCAN_POINTS
from missions.executive.event_reporter import percept_event
from missions.executive.events import VariableSet
from missions.plugins.records.recording.record_list import ChunkedRecord
from missions.plugins.records.recording.tagged_values import decode_view, from_json
from missions.plugins.records.recording.validation import parse_message, reject_malformed
from missions.plugins.records.replay.frames import STAMP_TOLERANCE
from missions.plugins.studio.record_queries import messages, path_of, pose_in
from missions.plugins.studio.studio_commands import MomentQuery
from missions.trees.drawing import ACTIVE
from missions.trees.value_text import variable_text

Json = dict[str, object]

CHANGE_TOPICS = ("/nodes", "/feedback", "/variables", "/state/base")
"""Topics of a record with changes: the state at a moment needs all their messages until then."""

LATEST_TOPICS = ("/percepts", "/state/head", "/state/arm", "/state/devices", "/scan")
"""Topics of a record with complete states: the state at a moment needs only the last message before it."""

PART_FIGURES: Mapping[str, Mapping[str, str]] = {
    "base": {**{name: name for name in ("x", "y", "heading", "speed", "turn")}, "battery": "battery_percent"},
    "head": {"pan": "pan", "tilt": "tilt"},
}
"""Fields of each part in the answer to `moment`, with the names of their values in recorded messages."""


def answer_moment(command: ClientCommand) -> Json:
    """Return the answer to the command `moment`: the state of a recorded run at one time."""
    if not isinstance(command, MomentQuery):
        raise TypeError(command.word)
    opened, time = ChunkedRecord(path_of(command.name)), command.t
    spans = list(opened.chunks_before(time))
    piece = opened.excerpt(spans[-1][0], spans[0][1]) if spans else opened.excerpt(0, 0)
    changed: dict[str, list[object]] = {}
    variables: Json = {}
    places: list[list[float]] = []
    newest: dict[str, bytes] = {}
    with reject_malformed(piece.path):
        for topic, _, data in messages(piece, frozenset({*CHANGE_TOPICS, *LATEST_TOPICS}), time):
            newest[topic] = data
            if topic not in CHANGE_TOPICS:
                continue
            message = parse_message(data)
            if topic == "/state/base":
                places = pose_in(message) or places
            elif topic == "/variables":
                event = from_json(message, VariableSet)
                value = None if event.value is None else variable_text(event)
                variables[f"{event.scope} {event.name}".lstrip()] = value
            elif topic == "/nodes":
                changed[message["node"]] = [message["status"], message["reason"], message["t"]]
            elif changed.get(message["node"], [""])[0] in ACTIVE:
                changed[message["node"]][1] = message["reason"]
        now: dict[str, Any] = {topic: parse_message(data) for topic, data in newest.items()}
        percept = now.get("/percepts")
        return {
            "t": time,
            "changed": changed,
            "variables": variables,
            "percept": percept and percept_event(decode_view(percept), percept["t"]).as_dict(),
            "pose": places[0][1:] if places else None,
            "parts": _parts(now),
            "joints": _joints(now),
            "scan": _scan(now["/scan"]) if "/scan" in now else [],
            "picture": _picture(opened, time, spans),
        }


HANDLERS: Mapping[str, Callable[[ClientCommand], Json]] = {"moment": answer_moment}
"""Handlers of commands, by the command's word: here only `moment`."""


def _parts(now: Mapping[str, Any]) -> list[Json]:
    """Return the state of each part of the robot; ``now`` has the last message of each topic."""
    devices = now.get("/state/devices", {"devices": {}})["devices"]
    found: list[Json] = []
    for part in dict.fromkeys((*devices, *(part for part in PART_FIGURES if f"/state/{part}" in now))):
        health, state = devices.get(part, {}), now.get(f"/state/{part}", {})
        values = {name: state.get(entry) for name, entry in PART_FIGURES.get(part, {}).items()}
        detail = health.get("detail", "")
        entry = {
            "part": part,
            "level": "ERROR" if not health.get("online", True) else "WARN" if detail else "OK",
            "values": {name: value for name, value in values.items() if isinstance(value, int | float)},
        }
        found.append({**entry, "detail": detail, "hint": health.get("hint", "")})
    return found


def _joints(now: Mapping[str, Any]) -> Json:
    """Return the state of the joints; ``now`` has the last message of each topic."""
    joints = now.get("/state/arm", {"joints": {}})["joints"]
    found = {name: [each.get(field) for field in ("position", "load", "temperature")] for name, each in joints.items()}
    return {name: each for name, each in found.items() if all(isinstance(value, int | float) for value in each)}


def _scan(message: Mapping[str, Any]) -> list[list[float]]:
    """Return the points of a range scan in the frame of the robot."""
    ranges, start = message["ranges"], message["start_angle"]
    step = (message["end_angle"] - start) / max(1, len(ranges) - 1)
    seen = [(ranges[at], start + at * step) for at in range(0, len(ranges), max(1, len(ranges) // MAX_SCAN_POINTS))]
    return [[round(far * cos(bearing), 3), round(far * sin(bearing), 3)] for far, bearing in seen if far > 0]


def _picture(opened: ChunkedRecord, time: float, spans: Sequence[tuple[int, int]]) -> Json | None:
    """Return the latest picture up to a time in seconds, with its detections; None if there is none.

    ``spans`` are the parts of the record to search, the latest first, each as a range of chunk indices.
    """
    for first, last in spans:
        piece = opened.excerpt(first, last)
        frames = [(stamp, jpeg) for stamp, jpeg in piece.frames() if stamp <= time + STAMP_TOLERANCE]
        if frames:
            stamp, jpeg = frames[-1]
            views = (view for _, view in piece.views() if view.looked is not None)
            view = next((view for view in views if abs((view.looked or 0.0) - stamp) <= STAMP_TOLERANCE), None)
            found = [] if view is None else percepts_in(view)
            width, height = _jpeg_size(jpeg)
            coded = base64.b64encode(jpeg).decode()
            return {"t": stamp, "width": width, "height": height, "jpeg": coded, "found": found}
    return None


def _jpeg_size(jpeg: bytes) -> tuple[int, int]:
    """Return the width and height of a JPEG; (0, 0) if the data is not a JPEG."""
    at = 2
    while at + 9 < len(jpeg) and jpeg[at] == 0xFF:
        kind, length = jpeg[at + 1], int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            return int.from_bytes(jpeg[at + 7 : at + 9], "big"), int.from_bytes(jpeg[at + 5 : at + 7], "big")
        at += 2 + length
    return 0, 0
