"""The schemas of the other files: tests, robots and worlds, made of what their readers ask for.

A reader is run over an example in which every part stands once, and asks for each of its keys, there or not.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from config.asked import Asked, Key, keys_asked
from config.controller import ControllerKeys
from config.faults import InvalidFileError, Source
from config.fields import fields_of
from config.gesture import GestureKeys
from config.marked import Listing, Node, Scalar
from config.marked import Mapping as Marked
from config.object import ObjectKeys
from config.units import written
from config.world import read_world
from missions.drivers import Table, robot_of
from missions.schema.examples import ROBOTS, TESTS, WORLDS
from missions.schema.keys import keys_schema
from missions.schema.robots import part_schemas
from missions.schema.values import HOLE, SCALAR, Schema, quantity
from missions.testing.suite import read_suite


def _read_tests(source: Source) -> object:
    return read_suite(fields_of(source, what="a test file"), Path())


KINDS: Mapping[str, tuple[str, Sequence[str], Callable[[Source], object]]] = {
    "tests": ("The tests of a mission.", TESTS, _read_tests),
    "robots": ("A robot: its parts, where they are plugged in, how far and fast they may go.", ROBOTS, robot_of),
    "worlds": ("A simulated world: a room, and what is in it.", WORLDS, read_world),
}
"""The kinds of files whose schema is made of examples: what each is, its examples, and its reader."""

DECLARED: Mapping[str, tuple[str, type]] = {
    "gestures": ("A gesture: where joints are, moment after moment.", GestureKeys),
    "controllers": ("A controller: the rules by which a behaviour tracks.", ControllerKeys),
    "objects": ("An object to look for.", ObjectKeys),
}
"""The kinds of files whose keys are declared: what each is, and the class of its keys."""


DRAFT = "http://json-schema.org/draft-07/schema#"
"""Which JSON Schema it is."""

ANYTHING: Schema = {"$comment": "in a form of its own"}
"""What is known of a value that the examples have, and of which nobody asked more."""


def file_schema(kind: str) -> Schema:
    """Return the JSON Schema (draft-07) of the files of a kind, one of ``KINDS`` or ``DECLARED``."""
    if kind in DECLARED:
        told, cls = DECLARED[kind]
        return {"$schema": DRAFT, "description": told, **keys_schema(cls)}
    about, examples, read = KINDS[kind]
    found: Schema = {}
    for example in examples:
        with keys_asked() as asked, suppress(InvalidFileError):
            read(Source(kind, example))
        found = _merged(found, _mapping(asked, next(iter(asked.values())).node))
    if kind == "robots":
        found["properties"] |= part_schemas(Table())
    if kind == "tests":  # what all cases have in common is of a case
        shared = found["properties"]["cases"]["items"]
        found["properties"]["with"] = {key: value for key, value in shared.items() if key != "required"}
    return {"$schema": DRAFT, "description": about, **found}


def _mapping(asked: Mapping[int, Asked], node: Node) -> Schema:
    """Return what a mapping of the example may hold: all that was asked of it."""
    found = asked.get(id(node))
    if found is None or not isinstance(node, Marked):
        return _any(asked, node)
    own = {name.text for name, _ in node.entries} if found.free else set()  # names that the example has chosen
    fixed = {name: key for name, key in found.keys.items() if name not in own}
    free: Schema | bool = found.free
    for name, value in node.entries if found.free else ():
        key = found.keys.get(name.text)
        known = _any(asked, value) if key is None else _value(asked, key, value)
        free = known if free is True else _merged_free(free, known)
    return {
        "type": "object",
        "properties": {name: _value(asked, key, node.get(name)) for name, key in fixed.items()},
        "additionalProperties": free,
        "required": [name for name, key in fixed.items() if key.required],
    }


def _any(asked: Mapping[int, Asked], node: Node | None) -> Schema:
    """Return what is known of a value that its reader looks at itself: what mappings, and those in a list, may hold."""
    if node is None:
        return {}
    if isinstance(node, Marked):
        if id(node) in asked:
            return {"if": {"type": "object"}, "then": _mapping(asked, node)}
        inside = {name.text: each for name, value in node.entries if (each := _any(asked, value)) != ANYTHING}
        named = {"type": "object", "properties": inside, "additionalProperties": True}
        return {"if": {"type": "object"}, "then": named} if inside else ANYTHING
    if isinstance(node, Listing) and (items := _items(asked, node)) not in ({}, ANYTHING):
        return {"if": {"type": "array"}, "then": {"items": items}}
    return ANYTHING


def _value(asked: Mapping[int, Asked], key: Key, node: Node | None) -> Schema:
    """Return what a key takes."""
    bounds = {"minimum": key.low, "maximum": key.high}
    match key.kind:
        case "text":
            return {"type": SCALAR, "pattern": r"\S", "errorMessage": "needs a text"}
        case "choice":
            return {"enum": list(key.among)}
        case "flag":
            return {"type": "boolean", "errorMessage": "needs true or false"}
        case "number" | "integer":
            return {"type": key.kind, **{word: bound for word, bound in bounds.items() if bound is not None}}
        case "quantity":
            return _quantity(key)
        case "span" | "position":
            count = 2 if key.kind == "span" else 3
            return {"type": "array", "items": _quantity(key), "minItems": count, "maxItems": count}
        case "section":
            return {"type": "object"} if node is None else _mapping(asked, node)
        case "list":
            return {"type": "array", "items": _items(asked, node)}
    return _any(asked, node)


def _items(asked: Mapping[int, Asked], node: Node | None) -> Schema:
    """Return what a list may hold: what its examples do, and words where one of them is a word."""
    items = node.items if isinstance(node, Listing) else []
    found: Schema = {}
    for item in items:
        one = {} if isinstance(item, Scalar) else _mapping(asked, item)
        found = found if one == ANYTHING else _merged(found, one)
    words = any(isinstance(item, Scalar) for item in items)
    return {"if": {"type": "object"}, "then": found} if found and words else found


def _quantity(key: Key) -> Schema:
    low, high = (None if bound is None else written(bound, key.dimension) for bound in (key.low, key.high))
    limits = f"{low} to {high}" if low and high else f"at least {low}" if low else f"at most {high}" if high else ""
    schema = quantity(key.dimension, limits, negative=key.low is None or key.low < 0, zero=not (key.low or 0) > 0)
    return {**schema, "pattern": schema["pattern"].removesuffix(f"|{HOLE}")}


def _merged(one: Schema, other: Schema) -> Schema:
    """Return what allows what either does: the keys of both, and what both require."""
    if not one or not other or one == other:
        return one or other
    if ANYTHING in (one, other):
        return ANYTHING
    if one.get("type") == other.get("type") == "object":
        if "properties" not in one or "properties" not in other:
            return one if "properties" in one else other
        names = dict.fromkeys([*one["properties"], *other["properties"]])
        both = {name: _merged(one["properties"].get(name, {}), other["properties"].get(name, {})) for name in names}
        required = [name for name in one.get("required", ()) if name in other.get("required", ())]
        free = _merged_free(one["additionalProperties"], other["additionalProperties"])
        return {"type": "object", "properties": both, "additionalProperties": free, "required": required}
    if one.get("type") == other.get("type") == "array":
        return {**one, "items": _merged(one.get("items", {}), other.get("items", {}))}
    if "then" in one and "then" in other:
        return {**one, "then": _merged(one["then"], other["then"])}
    if one.get("type") == other.get("type") and one.get("type") in ("integer", "number"):
        widest = {"minimum": min, "maximum": max}
        return {"type": one["type"], **{bound: of(one[bound], other[bound]) for bound, of in widest.items()}}
    if "enum" in one and "enum" in other:
        return {"enum": list(dict.fromkeys([*one["enum"], *other["enum"]]))}
    return {"anyOf": [one, other]}


def _merged_free(one: Schema | bool, other: Schema | bool) -> Schema | bool:
    """Return what keys that the file chooses may hold."""
    if isinstance(one, dict) and isinstance(other, dict):
        return _merged(one, other)
    return one if isinstance(one, dict) else other
