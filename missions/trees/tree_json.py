"""Drawings as JSON, and back: for other programs, for pages and records, and for a view of a running mission."""

from collections.abc import Mapping, Sequence
from typing import TypeVar

from missions.trees.drawing import SIGNS, Badge, Box, Drawing, Status

FORMAT = "missiontree-tree/1"
"""What such a file says of itself; the number grows when a reader of the old form would go wrong."""

T = TypeVar("T")


def to_json(drawing: Drawing) -> dict[str, object]:
    """Return a drawing as plain JSON: what ``schema`` describes."""
    return {
        "format": FORMAT,
        "mission": drawing.mission,
        "summary": drawing.summary,
        "file": drawing.file,
        "time": drawing.time,
        "tree": _box_to_json(drawing.root),
    }


def from_json(data: Mapping[str, object]) -> Drawing:
    """Return the drawing that ``to_json`` wrote. Raises ValueError that says what is wrong with other data."""
    found = data.get("format")
    if found != FORMAT:
        raise ValueError(f"no tree dump that can be read here: its format is {found!r}, not {FORMAT!r}")
    root = _box_from_json(_member(data, "tree", dict))
    mission, summary, file = (_member(data, name, str) for name in ("mission", "summary", "file"))
    return Drawing(mission, summary, file, root, _seconds(data, "time"))


def _box_to_json(box: Box) -> dict[str, object]:
    return {
        "key": box.key,
        "kind": box.kind,
        "symbol": box.symbol,
        "name": box.name,
        "title": box.title,
        "said": box.said,
        "arguments": dict(box.arguments),
        "modifiers": [
            {
                "key": badge.key,
                "kind": badge.kind,
                "text": badge.text,
                "line": badge.line,
                "status": badge.status,
                "reason": badge.reason,
            }
            for badge in box.badges
        ],
        "file": box.file,
        "line": box.line,
        "status": box.status,
        "reason": box.reason,
        "since": box.since,
        "mission": box.mission,
        "as": box.keep_as,
        "case": box.case,
        "folded": box.folded,
        "children": [_box_to_json(child) for child in box.children],
    }


def _box_from_json(data: Mapping[str, object]) -> Box:
    arguments = _member(data, "arguments", dict)
    return Box(
        _member(data, "key", str),
        _member(data, "kind", str),
        _member(data, "name", str),
        _member(data, "symbol", str),
        _member(data, "file", str),
        _member(data, "line", int),
        said=_member(data, "said", str),
        arguments={name: _member(arguments, name, str) for name in arguments},
        badges=tuple(map(_badge_from_json, _objects(data, "modifiers"))),
        keep_as=_member(data, "as", str),
        case=_member(data, "case", str),
        mission=_member(data, "mission", str),
        status=_status(data),
        reason=_member(data, "reason", str),
        since=_seconds(data, "since"),
        children=tuple(map(_box_from_json, _objects(data, "children"))),
        folded=_member(data, "folded", int),
    )


def _badge_from_json(data: Mapping[str, object]) -> Badge:
    key, kind, text = (_member(data, name, str) for name in ("key", "kind", "text"))
    return Badge(key, kind, text, _member(data, "line", int), _status(data), _member(data, "reason", str))


def _member(data: Mapping[str, object], name: str, kind: type[T]) -> T:
    value = data.get(name)
    if not isinstance(value, kind):
        raise ValueError(f"tree dump: '{name}' must be {kind.__name__}, got {repr(value)[:60]}")
    return value


def _objects(data: Mapping[str, object], name: str) -> Sequence[Mapping[str, object]]:
    items = _member(data, name, list)
    return [_member({name: item}, name, dict) for item in items]


def _seconds(data: Mapping[str, object], name: str) -> float | None:
    value = data.get(name)
    if value is None or isinstance(value, int | float):
        return value
    raise ValueError(f"tree dump: '{name}' must be seconds or null, got {repr(value)[:60]}")


def _status(data: Mapping[str, object]) -> Status:
    word = _member(data, "status", str)
    for status in SIGNS:
        if word == status:
            return status
    raise ValueError(f"tree dump: 'status' must be one of {', '.join(SIGNS)}, got {word[:60]!r}")


def schema() -> dict[str, object]:
    """Return the JSON Schema of tree dumps, which says what each member means."""
    key = _text("Its place in the tree: the root is 1, the root's second child 1.2. Modifiers have a place too.")
    status = {"enum": list(SIGNS), "description": "What it does at that moment; idle where the tree does not run."}
    reason = _text("Why it failed, or what it waits for; empty where there is nothing to say.")
    line = {"type": "integer", "minimum": 1, "description": "The line of the file on which it stands."}
    modifier = {
        "key": key,
        "kind": _text("The word of the modifier, such as timeout."),
        "text": _text("Its value, as the file has it."),
        "line": line,
        "status": status,
        "reason": reason,
    }
    node = {
        "key": key,
        "kind": _text("The word of the behaviour, such as sequence or drive."),
        "symbol": _text("The sign of its kind."),
        "name": _text("The name that events have; its kind, where the file gives it none."),
        "title": _text("What a person reads first."),
        "said": _text("What stands behind the word, where that is one value: then it is the one argument too."),
        "arguments": {
            "type": "object",
            "additionalProperties": {"type": "string"},
            "description": "What the file says of its arguments, in the order of the file; defaults are left out.",
        },
        "modifiers": _list("modifier", "The modifiers beside it, the outermost first."),
        "file": _text("The file in which it stands."),
        "line": line,
        "status": status,
        "reason": reason,
        "since": _seconds_or_null("Since when it has had its status."),
        "mission": _text("The mission that it runs; empty where it is no sub-mission."),
        "as": _text("The variable that keeps its result, if any."),
        "case": _text("The case for which a switch chooses it; empty where its parent is no switch."),
        "folded": {"type": "integer", "minimum": 0, "description": "How many nodes below it are left out."},
        "children": _list("node", "The nodes below it, in the order of the file."),
    }
    tree = {
        "format": {"const": FORMAT},
        "mission": _text("The name of the mission."),
        "summary": _text("What the mission does, in a line."),
        "file": _text("Its file; that of a shipped mission as it lies in the package."),
        "time": _seconds_or_null("The moment of a run that the statuses are of."),
        "tree": {"$ref": "#/$defs/node"},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "The tree of a MissionTree mission, as pictures show it",
        **_object(tree),
        "$defs": {"node": _object(node), "modifier": _object(modifier)},
    }


def _object(members: Mapping[str, object]) -> dict[str, object]:
    return {"type": "object", "properties": dict(members), "required": list(members), "additionalProperties": False}


def _text(description: str) -> dict[str, object]:
    return {"type": "string", "description": description}


def _list(of: str, description: str) -> dict[str, object]:
    return {"type": "array", "items": {"$ref": f"#/$defs/{of}"}, "description": description}


def _seconds_or_null(description: str) -> dict[str, object]:
    return {"type": ["number", "null"], "description": f"{description} Seconds from the start of the run."}
