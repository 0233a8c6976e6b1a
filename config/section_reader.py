"""Reader of a section by the keys that a class declares: values, defaults, and errors at their positions."""

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from config.diagnostics import InvalidFileError, Mark, SourceText, suggest_from
from config.fields import Fields, fields_of, value_of
from config.units import quoted_value
from config.yaml_nodes import Listing, Node, Scalar
from config.yaml_nodes import Mapping as MarkedMapping
from drivers.api.keys import PERCENT, Form, Key, KeyDiagnostic, declared_keys

K = TypeVar("K")

KeyPath = tuple[str | int, ...]
"""Path of a value in a section of a file: keys, and indices of lists."""


def read_keys(fields: Fields, cls: type[K]) -> K:
    """Read a section with the keys that ``cls`` declares, and add all errors; invalid values get placeholders.

    Errors between keys, which ``cls.diagnostics`` yields, are added if the keys involved are valid.
    """
    found = _read(fields, cls)
    fields.report_unknown_keys(getattr(cls, "unknown", ""))
    add_mistakes(fields, getattr(found, "diagnostics", tuple)())
    return found


def read_value(key: Key, text: str) -> Any:
    """Return the value of a key from a typed text. Raises ValueError with the error message."""
    try:
        fields = fields_of(SourceText("what was typed", f"{key.word}: {text}\n"), subject="it")
        node = fields.node_of(key.word)
        found = None if node is None else _value(fields, key, key.word, node, (key.word,))
    except InvalidFileError as error:
        raise ValueError(error.diagnostics[0].message) from None
    if fields.diagnostics:
        first = fields.diagnostics[0]
        raise ValueError(first.message + (f"; {first.suggestion}" if first.suggestion else ""))
    return found


def add_mistakes(fields: Fields, mistakes: Iterable[KeyDiagnostic]) -> None:
    """Add errors that involve several keys of a section, each at its position in the file."""
    for each in mistakes:
        about = each.about or ((),)
        if any(
            path[: len(part)] == part or part[: len(path)] == path for part in about for path in fields.wrong_places
        ):
            continue  # what is wrong by itself was told
        place = _mark_at(fields.node, each.at, named=each.marks_key)
        if place is None and each.fallback_at:
            place = _mark_at(fields.node, each.fallback_at, named=False)
        hint = each.hint or (suggest_from(each.unknown_word, each.known_words) if each.known_words else "")
        fields.add_error(place or nearest_mark(fields.node, each.at), each.message, hint)


def _read(fields: Fields, cls: type[K]) -> K:
    """Return a ``cls`` with the section's values; add the paths of invalid keys to ``fields.wrong_places``."""
    values: dict[str, Any] = {}
    for each in declared_keys(cls):
        if each.form == "rest":
            values[each.field] = _read_rest(fields, each, {other.word for other in declared_keys(cls)})
            continue
        node = fields.node_of(each.word, required=each.required, hint=each.help)
        if node is not None:
            values[each.field] = _value(fields, each, each.word, node, (each.word,))
            continue
        values[each.field] = _placeholder(fields, each) if each.required else each.default
        fields.wrong_places += [(each.word,)] if each.required else []
    return cls(**values)


def _value(fields: Fields, key: Key, word: str, node: Node, at: KeyPath) -> Any:
    """Return the value of a node at path ``at``; ``word`` is its name in messages."""
    faults, wrong = len(fields.diagnostics), len(fields.wrong_places)
    found = (
        _read_form(fields, key, word, node, at) if _has_form(key, node) else _add_form_error(fields, key, word, node)
    )
    if len(fields.diagnostics) > faults and len(fields.wrong_places) == wrong:
        fields.wrong_places.append(at)
    return found


def _read_form(fields: Fields, key: Key, word: str, node: Node, at: KeyPath) -> Any:
    match key.form:
        case "text":
            return node.text if isinstance(node, Scalar) else ""
        case "choice":
            return _read_choice(fields, key, word, node)
        case "number" | "integer":
            kind = int if key.form == "integer" else float
            low, high = (None if bound is None else kind(bound) for bound in (key.low, key.high))
            return fields.clamp(word, node.mark, kind(str(value_of(node))), low, high)
        case "quantity":
            return _read_quantity(fields, key, word, node)
        case "section":
            return _read_section(fields, key, key.each or f"'{word}'", node, at)
        case "either":
            return _value(fields, next(each for each in key.options if _may_have_form(each, node)), word, node, at)
    return _read_collection(fields, key, word, node, at)


def _read_collection(fields: Fields, key: Key, word: str, node: Node, at: KeyPath) -> Any:
    """Return the value of a node as the form of its key requires.

    That is a tuple for a list and for several quantities, and a dict for a mapping with free names; else the plain
    value.
    """
    items = node.items if isinstance(node, Listing) else []
    match key.form:
        case "span" | "vector":
            before = len(fields.diagnostics)
            found: Any = tuple(_read_quantity(fields, key, word, each) for each in items)
            if key.form == "span" and found[0] >= found[1] and len(fields.diagnostics) == before:
                fields.add_error(node.mark, f"'{word}': the first value must be below the second")
            return found
        case "list":
            return tuple(_read_item(fields, key, word, each, (*at, place)) for place, each in enumerate(items))
        case "named":
            entries = node.entries if isinstance(node, MarkedMapping) else []
            return {name.text: _read_item(fields, key, name.text, each, (*at, name.text)) for name, each in entries}
    return value_of(node)


def _read_item(fields: Fields, key: Key, word: str, node: Node, at: KeyPath) -> Any:
    inner = key.inner or key
    if inner.form != "section":
        return _value(fields, inner, word, node, at)
    named = f"{inner.each or key.word} '{word}'" if key.form == "named" else inner.each
    return _read_section(fields, inner, named, node, at)


def _read_section(fields: Fields, key: Key, what: str, node: Node, at: KeyPath) -> Any:
    """Return the nested section, called ``what`` in messages."""
    faults = len(fields.diagnostics)
    section = Fields(fields.source, node, fields.diagnostics, subject=what, torn=fields.torn)
    found: Any = read_keys(section, key.of or object)
    fields.wrong_places += [(*at, *path) for path in section.wrong_places]
    if len(fields.diagnostics) > faults and not section.wrong_places:
        fields.wrong_places.append(at)
    return found


def _has_form(key: Key, node: Node) -> bool:
    """Return True if a node has the form that a key declares; quantities and most sections are checked later."""
    value = value_of(node)
    match key.form:
        case "text":
            return isinstance(node, Scalar) and _is_text(node, blank=key.blank)
        case "choice" if key.wrong:
            return isinstance(node, Scalar) and node.text in key.among
        case "flag":
            return isinstance(value, bool)
        case "number" | "integer":
            real = isinstance(value, int | float if key.form == "number" else int)
            return real and not isinstance(value, bool)
        case "span" | "vector":
            return isinstance(node, Listing) and len(node.items) in key.sizes
        case "list":
            return isinstance(node, Listing)
        case "named":
            return isinstance(node, MarkedMapping)
        case "either":
            return any(_may_have_form(each, node) for each in key.options)
        case "section" if key.wrong:
            return isinstance(node, MarkedMapping)
    return True


def _is_text(node: Scalar, *, blank: bool) -> bool:
    """Return True if a scalar is a text; with ``blank``, spaces count as a text."""
    return node.value is not None or bool(node.text) if blank else node.value is not None and bool(node.text.strip())


def _may_have_form(key: Key, node: Node) -> bool:
    """Return True if the type of the node (scalar, list or mapping) fits the form of the key."""
    kind = {"list": Listing, "vector": Listing, "span": Listing, "named": MarkedMapping, "section": MarkedMapping}
    return isinstance(node, kind.get(key.form, Scalar))


FORM_TEXTS: Mapping[Form, str] = {
    "text": "a text",
    "choice": "a word",
    "flag": "true or false",
    "number": "a plain number",
    "integer": "a whole number",
    "quantity": "a quantity",
    "span": "two values: [low, high]",
    "vector": "a list",
    "list": "a list",
    "named": "a mapping of names to values",
    "section": "a mapping of keys to values",
}
"""Description of each form of a value, such as "a plain number", for error messages."""


def _add_form_error(fields: Fields, key: Key, word: str, node: Node) -> Any:
    """Add an error for a value without the form of its key, and return a placeholder."""
    mark, needs = node.mark, FORM_TEXTS.get(key.form, "")
    if key.form == "vector" and isinstance(node, Listing) and node.items:
        mark, needs = (mark if key.wrong else node.items[0].mark), "three lengths: [x, y, z]"
    if key.form == "either":
        needs = ", or ".join(FORM_TEXTS[each.form] for each in key.options)
    message = key.wrong.replace("{}", word) or f"'{word}' needs {needs}"
    fields.add_error(mark, message, key.hint.replace("{}", word), sure=key.form in ("flag", "number", "integer"))
    return _placeholder(fields, key)


def _placeholder(fields: Fields, key: Key) -> Any:
    zeros = (0.0,) * next(iter(key.sizes), 0)
    if key.form == "section":
        empty = Fields(fields.source, MarkedMapping(Mark()), [], subject="")
        return _read(empty, key.of or object)
    if key.form == "either":
        return _placeholder(fields, key.options[0])
    plain: Mapping[Form, Any] = {"text": "", "flag": False, "integer": 0, "list": (), "named": {}}
    return key.among[0] if key.form == "choice" else zeros or plain.get(key.form, 0.0)


def _read_choice(fields: Fields, key: Key, word: str, node: Node) -> str:
    """Return the word in a node if the key allows it; else add an error and return the first allowed word."""
    text = node.text if isinstance(node, Scalar) else ""
    if text not in key.among:
        hint = "; ".join(filter(None, (suggest_from(text, key.among), key.hint)))
        fields.add_error(node.mark, f"'{word}' cannot be {quoted_value(value_of(node))}", hint, sure=True)
        return key.among[0]
    return text


def _read_quantity(fields: Fields, key: Key, word: str, node: Node) -> float | str:
    """Return the quantity in a node in SI units, or a word that the key allows instead."""
    if isinstance(node, Scalar) and node.text in key.among:
        return node.text
    if key.dimension != PERCENT:
        return fields.measure(node, word, key.dimension, low=key.low, high=key.high)
    low, high = (None if bound is None else bound / 100 for bound in (key.low, key.high))
    return round(100 * fields.measure(node, word, "share", low=low, high=high), 6)


def _read_rest(fields: Fields, key: Key, words: set[str]) -> dict[str, float]:
    """Return the quantities, by name, of all keys that are not in ``words``."""
    others = [(name, node) for name, node in fields.entries() if name.text not in words]
    if not key.dimension:
        return {}
    found = {}
    for name, node in others:
        before = len(fields.diagnostics)
        found[name.text] = fields.measure(node, name.text, key.dimension)
        if len(fields.diagnostics) > before:
            fields.wrong_places.append((name.text,))
    return found


def _mark_at(node: Node, at: KeyPath, *, named: bool) -> Mark | None:
    """Return the mark of the value at a path, or of its name if ``named``; None if the file does not have the path."""
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


def nearest_mark(node: Node, at: KeyPath) -> Mark:
    """Return the mark at a path, or that of the closest enclosing node in the file."""
    return next(mark for end in range(len(at), -1, -1) if (mark := _mark_at(node, at[:end], named=False)) is not None)
