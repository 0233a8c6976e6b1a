"""The schema of a section of a file, from the keys that a class declares; and what each takes, in words."""

from config.units import EXAMPLES, article, written
from drivers.api.keys import PERCENT, Key, declared
from missions.schema.values import HOLE, SCALAR, Schema, quantity


def keys_schema(cls: type) -> Schema:
    """Return the schema of a section with the keys of a class."""
    found = declared(cls)
    rest = next((key for key in found if key.form == "rest"), None)
    return {
        "type": "object",
        "properties": {key.word: described(key) for key in found if key is not rest},
        "additionalProperties": False if rest is None else _quantity(rest) if rest.dimension else True,
        "required": [key.word for key in found if key.required],
    }


def described(key: Key) -> Schema:
    """Return what a key takes, with its help, and its default."""
    schema = _value(key)
    told = " ".join(part for part in (key.help, default_told(key)) if part)
    return {"description": told, **schema} if told else schema


def default_told(key: Key) -> str:
    """Say what holds without a key; nothing where that is nothing."""
    if key.required:
        return "It must be given."
    shown = shown_default(key)
    return f"Without it: {shown}." if shown else ""


def shown_default(key: Key) -> str:
    """Return the default of a key as a file would have it; empty where there is none, or where it is a section's."""
    value = key.default
    if value is None or value in ("", ()) or key.of is not None or key.form in ("texts", "lists", "rest"):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_measured(key, each) for each in value)}]"
    return _measured(key, value) if isinstance(value, float) else str(value)


def bounds_told(key: Key) -> str:
    """Say between which bounds the values of a key are; nothing where there are none."""
    low, high = (None if bound is None else _measured(key, bound) for bound in (key.low, key.high))
    if low is not None and high is not None:
        return f"{low} to {high}"
    return f"at least {low}" if low is not None else f"at most {high}" if high is not None else ""


def takes(key: Key) -> str:
    """Say in words what a key takes."""
    unit = "a share" if key.dimension == PERCENT else article(key.dimension) if key.dimension else ""
    among = ", ".join(f"`{word}`" for word in key.among)
    return {
        "text": "a text",
        "choice": among,
        "flag": "`true` or `false`",
        "number": "a number",
        "integer": "a whole number",
        "quantity": unit,
        "span": f"two of {unit}: [low, high]",
        "triple": f"three of {unit}: [x, y, z]",
        "spans": f"a list of pairs of {unit}",
        "section": "a section",
        "named": "sections, each under a name",
        "texts": "texts, each under a name",
        "lists": "lists of texts, each under a name",
        "items": "a list of sections",
        "rest": f"{unit}, under any name" if unit else "in a form of its own, under any name",
    }[key.form]


def _measured(key: Key, value: float) -> str:
    if key.dimension == PERCENT:
        return f"{value:g} %"
    return written(value, key.dimension) if key.dimension else f"{value:g}"


_TEXT: Schema = {"type": SCALAR, "pattern": r"\S", "errorMessage": "needs a text"}


def _value(key: Key) -> Schema:
    if key.of is not None:
        inside = keys_schema(key.of)
        if key.form == "items":
            return {"type": "array", "items": inside, "minItems": 1 if key.required else 0}
        return inside if key.form == "section" else {"type": "object", "additionalProperties": inside}
    if key.form in ("span", "triple", "spans"):
        count = 3 if key.form == "triple" else 2
        several: Schema = {"type": "array", "items": _quantity(key), "minItems": count, "maxItems": count}
        return {"type": "array", "items": several} if key.form == "spans" else several
    match key.form:
        case "choice":
            return {"enum": list(key.among)}
        case "flag":
            return {"type": "boolean", "errorMessage": "needs true or false"}
        case "number" | "integer":
            limits = {"minimum": key.low, "maximum": key.high}
            return {"type": key.form, **{word: bound for word, bound in limits.items() if bound is not None}}
        case "quantity":
            return _quantity(key)
        case "texts":
            return {"type": "object", "additionalProperties": _TEXT}
        case "lists":
            return {"type": "object", "additionalProperties": {"type": "array", "items": _TEXT, "minItems": 1}}
    return _TEXT


def _quantity(key: Key) -> Schema:
    """Return what a quantity of a key looks like."""
    dimension = "share" if key.dimension == PERCENT else key.dimension
    schema = quantity(dimension, bounds_told(key), negative=key.low is None or key.low < 0, zero=not (key.low or 0) > 0)
    return {**schema, "pattern": schema["pattern"].removesuffix(f"|{HOLE}"), "examples": [EXAMPLES[dimension]]}
