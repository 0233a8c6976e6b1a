"""Reading a section of a file by the keys that a class declares: values, defaults, and mistakes at their places."""

from collections.abc import Iterable
from typing import Any, TypeVar

from config.faults import Mark, one_of
from config.fields import Fields
from config.marked import Listing, Node, Scalar
from config.marked import Mapping as MarkedMapping
from drivers.api.keys import PERCENT, Key, Mistake, declared

K = TypeVar("K")

Path = tuple[str | int, ...]
"""Where something stands in a section: words, and places in lists."""


def read_keys(fields: Fields, cls: type[K]) -> K:
    """Read a section whose keys ``cls`` declares, and note every mistake; harmless values stand where one is.

    What ``cls`` finds beyond each key (its ``mistakes``) is noted where the keys that it is about are right.
    """
    found = _read(fields, cls)
    fields.done()
    note_mistakes(fields, getattr(found, "mistakes", tuple)())
    return found


def note_mistakes(fields: Fields, mistakes: Iterable[Mistake]) -> None:
    """Note what was found in a section beyond its single keys, each where it stands in the file."""
    for each in mistakes:
        about = each.about or ((),)
        if any(path[: len(part)] == part or part[: len(path)] == path for part in about for path in fields.wrong):
            continue  # what is wrong by itself was told
        place = _place(fields.node, each.at, named=each.named)
        if place is None and each.otherwise:
            place = _place(fields.node, each.otherwise, named=False)
        hint = each.hint or (one_of(each.seen, each.known) if each.known else "")
        fields.fault(place or _nearest(fields.node, each.at), each.message, hint)


def _read(fields: Fields, cls: type[K]) -> K:
    """Read the keys, and keep in ``fields.wrong`` where those are that are wrong by themselves."""
    values: dict[str, Any] = {}
    for each in declared(cls):
        if each.form == "rest":
            values[each.field] = _rest(fields, each, {other.word for other in declared(cls)})
            continue
        inside: list[Path] = []
        before = len(fields.faults)
        values[each.field] = _value(fields, each, inside)
        if len(fields.faults) > before:
            fields.wrong += [(each.word, *path) for path in inside] or [(each.word,)]
    return cls(**values)


def _value(fields: Fields, key: Key, inside: list[Path]) -> object:
    """Read one key; ``inside`` takes where something is wrong in a section below it."""
    if key.form in ("section", "named", "texts", "lists"):
        return _section(fields, key, inside)
    if key.form == "items":
        return _items(fields, key, inside)
    if not key.required and fields.node_of(key.word) is None:
        return key.default
    if key.form in ("number", "integer", "quantity"):
        return _number(fields, key)
    match key.form:
        case "choice":
            return fields.choice(key.word, key.among)
        case "flag":
            return fields.flag(key.word, default=False)
        case "span":
            return fields.span(key.word, key.dimension)
        case "triple":
            return fields.position(key.word, (0.0, 0.0, 0.0))
        case "spans":
            return _spans(fields, key)
    return fields.text(key.word)


def _number(fields: Fields, key: Key) -> float:
    """Read a number, plain or with a unit."""
    if key.form == "integer":
        low, high = (None if bound is None else int(bound) for bound in (key.low, key.high))
        return fields.integer(key.word, low=low, high=high)
    if key.form == "number":
        return fields.number(key.word, low=key.low, high=key.high)
    if key.dimension == PERCENT:
        least, most = (None if bound is None else bound / 100 for bound in (key.low, key.high))
        return round(100 * fields.quantity(key.word, "share", low=least, high=most), 6)
    return fields.quantity(key.word, key.dimension, low=key.low, high=key.high)


def _section(fields: Fields, key: Key, inside: list[Path]) -> object:
    """Read a section, or one whose keys are names; None, or the default, where there is none."""
    section = fields.section(key.word, required=key.required)
    if key.form == "section" and key.of is not None:
        if section is None:
            return _harmless(fields, key.of) if key.required else key.default
        return _whole(section, key.of, inside, ())
    if section is None:
        return {} if key.required else key.default
    if key.form == "named" and key.of is not None:
        return {
            name.text: _whole(_named(section, key, name.text, node), key.of, inside, (name.text,))
            for name, node in section.entries()
        }
    if key.form == "lists":
        return {name.text: _texts(node) for name, node in section.entries()}
    return {name.text: _text(section, name.text, node) for name, node in section.entries()}


def _items(fields: Fields, key: Key, inside: list[Path]) -> tuple[object, ...]:
    """Read a list of sections."""
    cls, nodes = key.of, fields.items(key.word, required=key.required)
    if cls is None or (not nodes and not key.required):
        return ()
    found = []
    for place, node in enumerate(nodes):
        one = Fields(fields.source, node, fields.faults, what=key.each)
        if not isinstance(node, MarkedMapping):  # which was told just now
            inside.append((place,))
        found.append(_whole(one, cls, inside, (place,)))
    return tuple(found)


def _rest(fields: Fields, key: Key, words: set[str]) -> dict[str, float]:
    """Read what stands beside the other keys; values in a form of their own are for whoever knows that."""
    others = [(name, node) for name, node in fields.entries() if name.text not in words]
    if not key.dimension:
        return {}
    found = {}
    for name, node in others:
        before = len(fields.faults)
        found[name.text] = fields.measure(node, name.text, key.dimension)
        if len(fields.faults) > before:
            fields.wrong.append((name.text,))
    return found


def _whole(section: Fields, cls: type, inside: list[Path], at: Path) -> object:
    """Read a section below another; ``inside`` takes where something is wrong in it, below ``at``."""
    before = len(section.faults)
    found: object = read_keys(section, cls)
    inside += [(*at, *path) for path in section.wrong]
    if len(section.faults) > before and not section.wrong:
        inside.append(at)
    return found


def _named(section: Fields, key: Key, name: str, node: Node) -> Fields:
    return Fields(section.source, node, section.faults, what=f"{key.each or key.word} '{name}'")


def _harmless(fields: Fields, cls: type) -> object:
    """Return what an empty section holds, without a word about what it lacks."""
    empty = Fields(fields.source, MarkedMapping(Mark()), [], what="")
    return _read(empty, cls)


def _text(section: Fields, name: str, node: Node) -> str:
    """Read a text under a name; an empty one is for its class to judge."""
    if isinstance(node, Scalar):
        return "" if node.value is None else node.text
    section.fault(node.mark, f"'{name}' needs a text")
    return ""


def _texts(node: Node) -> tuple[str, ...]:
    """Read a list of texts; an empty one, and what is no list, is for its class to judge."""
    items = node.items if isinstance(node, Listing) else []
    return tuple(item.text if isinstance(item, Scalar) else "" for item in items)


def _spans(fields: Fields, key: Key) -> tuple[tuple[float, float], ...]:
    """Read pairs of angles, anticlockwise: ``[[100 deg, 120 deg], [170 deg, -170 deg]]``."""
    found = []
    for node in fields.items(key.word):
        ends = node.items if isinstance(node, Listing) else []
        if len(ends) != 2:
            hint = f"{key.word}: [[100 deg, 120 deg]]"
            fields.fault(node.mark, f"'{key.word}' needs pairs of angles, anticlockwise", hint)
            continue
        first, second = (fields.measure(end, key.word, key.dimension) for end in ends)
        found.append((first, second))
    return tuple(found)


def _place(node: Node, at: Path, *, named: bool) -> Mark | None:
    """Return where a path leads to in a section, to the value or to its name; None where the file has no such thing."""
    for place, step in enumerate(at):
        if isinstance(node, MarkedMapping):
            entry = next((entry for entry in node.entries if entry[0].text == step), None)
            if entry is None:
                return None
            if named and place == len(at) - 1:
                return entry[0].mark
            node = entry[1]
        elif isinstance(node, Listing) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
        else:
            return None
    return node.mark


def _nearest(node: Node, at: Path) -> Mark:
    """Return the mark of what is around a path that the file lacks."""
    return next(mark for end in range(len(at), -1, -1) if (mark := _place(node, at[:end], named=False)) is not None)
