"""Schemas and descriptions of keys, from the classes that declare the keys of a file or section."""

from dataclasses import is_dataclass

from config.units import EXAMPLES, quantity_text, with_article
from config.yaml_nodes import plain_value
from drivers.api.keys import PERCENT, Key, declared_keys
from missions.plugins.schema.values import HOLE, SCALAR, Schema, quantity_schema


def keys_schema(cls: type) -> Schema:
    """Return the JSON Schema of a section of a file, with the keys that a class declares."""
    found = declared_keys(cls)
    rest = next((key for key in found if key.form == "rest"), None)
    return {
        "type": "object",
        "properties": {key.word: key_schema(key) for key in found if key is not rest},
        "additionalProperties": False if rest is None else _quantity_schema(rest) if rest.dimension else True,
        "required": [key.word for key in found if key.required],
    }


def key_schema(key: Key) -> Schema:
    """Return the schema of a key, with its help and default."""
    schema = _value_schema(key)
    description = " ".join(part for part in (key.help, default_text(key)) if part)
    return {"description": description, **schema} if description else schema


def default_text(key: Key) -> str:
    """Return a sentence with the default of a key, or that the key must be given; empty if the default is nothing."""
    if key.required:
        return "It must be given."
    shown = format_default(key)
    return f"Without it: {shown}." if shown else ""


def format_default(key: Key) -> str:
    """Return the default of a key as in a file; empty if there is none, or if it is a section."""
    value = key.default
    if value is None or value in ("", ()) or key.form in ("section", "list", "named", "rest") or is_dataclass(value):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_format_quantity(key, each) for each in value)}]"
    return _format_quantity(key, value) if isinstance(value, float) else str(value)


def bounds_text(key: Key) -> str:
    """Return the bounds of a key's values; empty if there are none."""
    low, high = (None if bound is None else _format_quantity(key, bound) for bound in (key.low, key.high))
    if low is not None and high is not None:
        return f"{low} to {high}"
    return f"at least {low}" if low is not None else f"at most {high}" if high is not None else ""


def value_text(key: Key) -> str:
    """Return a description of the values of a key."""
    unit = _unit_text(key)
    if key.form == "either":
        return "; or ".join(map(value_text, key.options))
    if key.inner is not None:
        several = _plural_text(key.inner)
        return f"{several}, each under a name" if key.form == "named" else f"a list of {several}"
    return {
        "text": "a text",
        "choice": ", ".join(f"`{word}`" for word in key.among),
        "flag": "`true` or `false`",
        "number": "a number",
        "integer": "a whole number",
        "quantity": ", ".join([unit, *(f"`{word}`" for word in key.among)]),
        "span": f"two of {unit}: [low, high]",
        "vector": f"{' or '.join(_AXES[size] for size in key.sizes)}, each {unit}",
        "section": "a section",
        "any": "a value of its own",
        "rest": f"{unit}, under any name" if unit else "in a form of its own, under any name",
    }[key.form]


_AXES = {2: "[x, y]", 3: "[x, y, z]"}


def _unit_text(key: Key) -> str:
    return "a share" if key.dimension == PERCENT else with_article(key.dimension) if key.dimension else ""


def _plural_text(key: Key) -> str:
    """Return a description of the members of a key whose value is a mapping or a list."""
    plural = {"text": "texts", "section": "sections", "integer": "whole numbers", "any": "values"}
    return (
        f"lists of {_plural_text(key.inner)}"
        if key.form == "list" and key.inner
        else plural.get(key.form, value_text(key))
    )


def _format_quantity(key: Key, value: float) -> str:
    if key.dimension == PERCENT:
        return f"{value:g} %"
    return quantity_text(value, key.dimension) if key.dimension else f"{value:g}"


def _value_schema(key: Key) -> Schema:
    match key.form:
        case "section":
            return keys_schema(key.of or object)
        case "list" if key.inner is not None:
            return {"type": "array", "items": _value_schema(key.inner), "minItems": int(key.required)}
        case "named" if key.inner is not None:
            return {"type": "object", "additionalProperties": _value_schema(key.inner)}
        case "either":
            return {"anyOf": [_value_schema(each) for each in key.options]}
        case "span" | "vector":
            least, most = min(key.sizes), max(key.sizes)
            return {"type": "array", "items": _quantity_schema(key), "minItems": least, "maxItems": most}
        case "quantity":
            return {"anyOf": [_choice_schema(key), _quantity_schema(key)]} if key.among else _quantity_schema(key)
    return _plain_schema(key)


def _plain_schema(key: Key) -> Schema:
    """Return the schema of a key's value that has no unit."""
    match key.form:
        case "choice":
            return _choice_schema(key)
        case "any":
            return {}
        case "flag":
            return {"type": "boolean", "errorMessage": "needs true or false"}
        case "number" | "integer":
            limits = {"minimum": key.low, "maximum": key.high}
            return {"type": key.form, **{word: bound for word, bound in limits.items() if bound is not None}}
    return {"type": SCALAR, "errorMessage": "needs a text"} | ({} if key.blank else {"pattern": r"\S"})


def _choice_schema(key: Key) -> Schema:
    """Return the schema of a key whose value is one of several words, even words that YAML reads as numbers."""
    others = [value for word in key.among if not isinstance(value := plain_value(word), str)]
    return {"enum": [*key.among, *others]}


def _quantity_schema(key: Key) -> Schema:
    """Return the schema of a key whose value is a quantity."""
    dimension = "share" if key.dimension == PERCENT else key.dimension
    schema = quantity_schema(
        dimension, bounds_text(key), negative=key.low is None or key.low < 0, zero=not (key.low or 0) > 0
    )
    return {**schema, "pattern": schema["pattern"].removesuffix(f"|{HOLE}"), "examples": [EXAMPLES[dimension]]}
