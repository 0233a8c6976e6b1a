"""Schemas of the values in a mission file, by kind, such as a quantity; an expression ``${...}`` is always allowed.

``errorMessage``, ``defaultSnippets`` and ``markdownDescription`` are extensions of the YAML language server, which
other validators ignore. Patterns use only syntax common to Python and JavaScript.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from behaviours.leaf import Argument, Leaf
from config.units import EXAMPLES, UNITS, with_article
from missions.language.arguments import OUTCOMES, SWITCH_WORDS
from missions.language.kinds import CONSTANTS, RESERVED_WORDS, STATE_KINDS
from missions.language.operators import FUNCTIONS
from missions.library.catalogue import (
    bounds_text,
    default_data,
    details,
    example_value,
    requirements_text,
    sentence,
    summary,
)

Schema = dict[str, Any]

Things = Mapping[str, Mapping[str, str]]
"""Names that missions can use: for each kind ("gesture", "mission") the names with their summaries."""

HOLE = r"\$\{"
SCALAR = ["string", "number", "boolean"]

_UNSIGNED = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_ABOVE_ZERO = r"(?=[0-9.]*[1-9])"
_RESERVED_NAMES = sorted({*RESERVED_WORDS, *STATE_KINDS, *CONSTANTS, *FUNCTIONS})

# A Python identifier: letters of any alphabet, underscores, and digits except at the start.
_SIGNS = r"\s!-/:-@\[-\^`{-~"
NAME: Schema = {
    "type": "string",
    "pattern": rf"^(?!(?:{'|'.join(_RESERVED_NAMES)})$)[^{_SIGNS}0-9][^{_SIGNS}]*$",
    "errorMessage": "needs a plain word such as last_seen, that means nothing else in expressions",
}
"""Schema of the name of a param or a variable."""

LIST_MEMBER: Schema = {"type": [*SCALAR, "object"], "additionalProperties": {"type": SCALAR}}
"""Schema of a member of a list: a plain value, or a mapping of plain values."""

_PHRASE: Schema = {"type": SCALAR, "pattern": r"[^\s!-@\[-`{-~]"}
PHRASES: Schema = {
    "type": [*SCALAR, "array"],
    "pattern": _PHRASE["pattern"],
    "items": _PHRASE,
    "minItems": 1,
    "errorMessage": "needs a phrase, or a list of them, in words",
}
"""Schema of the phrases that a leaf listens for."""

EXPRESSION: Schema = {
    "type": SCALAR,
    "pattern": r"\S",
    "errorMessage": "needs an expression, such as face.seen",
    "examples": ["face.seen", "battery.percent > 20"],
}

_SPECIAL_KINDS: Mapping[str, Schema] = {
    "phrases": PHRASES,
    "condition": EXPRESSION,
    "face": {"type": ["string", "null"], "pattern": HOLE, "errorMessage": "needs a face, such as ${person}"},
}
"""Schemas for the kinds of arguments that have a form of their own, such as a list of phrases."""


def quantity_schema(dimension: str, limits: str = "", *, negative: bool = False, zero: bool = True) -> Schema:
    """Return the schema of a quantity of a ``dimension``.

    ``limits`` are only mentioned in the error message: the pattern checks just the sign, and whether 0 is allowed.
    """
    number = ("[-+]?" if negative else r"\+?") + ("" if zero else _ABOVE_ZERO) + _UNSIGNED
    units = UNITS[dimension]
    message = f"needs {with_article(dimension)} such as '{EXAMPLES[dimension]}' (units: {', '.join(units)})"
    return {
        "type": "string",
        "pattern": rf"^\s*{number}\s*(?:{'|'.join(map(_escape_pattern, units))})\s*$|{HOLE}",
        "errorMessage": message + (f", {limits}" if limits else ""),
    }


def name_schema(kind: str, names: Mapping[str, str], *, computed: bool = True) -> Schema:
    """Return the schema of a name of a ``kind``, such as "gesture": one of ``names``, or the path of a file.

    Editors show the summary of each name. If ``computed`` is True, an expression is allowed too.
    """
    known = "|".join(_escape_pattern(name) for name in names)
    return {
        "type": "string",
        "pattern": f"^(?:{known})$|[./]" + (f"|{HOLE}" if computed else ""),
        "errorMessage": f"needs {with_article(kind)}, or the path of its file; known are: {', '.join(names)}",
        "defaultSnippets": [{"label": name, "body": name, "description": text} for name, text in names.items()],
    }


def argument_schema(argument: Argument, things: Things) -> Schema:
    """Return the schema of an argument of a leaf, with its help, and its default or an example."""
    text = f"{sentence(argument.help)} {sentence(requirements_text(argument))}"
    found = {"description": text, **value_schema(argument, things)}
    if not argument.required:
        default = default_data(argument)
        return {**found, "default": default} if _is_json(default) else found
    return found if "defaultSnippets" in found else {**found, "examples": [example_value(argument)]}


def value_schema(argument: Argument, things: Things) -> Schema:
    """Return the schema of the value of an argument of a leaf."""
    kind = argument.kind
    if argument.by_joint:
        return {
            "type": ["object", "string"],
            "additionalProperties": value_schema(replace(argument, by_joint=False), things),
            "minProperties": 1,
            "pattern": HOLE,
            "errorMessage": "needs joints, each with its value, such as {elbow: ...}",
        }
    if kind in _SPECIAL_KINDS:
        return _SPECIAL_KINDS[kind]
    if kind in UNITS:
        one = quantity_schema(kind, bounds_text(argument), negative=argument.low < 0, zero=argument.low <= 0)
    else:
        one = name_schema(kind, things[kind]) if kind in things else _plain_schema(argument)
    if not argument.span:
        return one
    return {
        "type": ["array", "string"],
        "items": one,
        "minItems": 2,
        "maxItems": 2,
        "pattern": HOLE,
        "errorMessage": f"needs two values, [low, high]; {kind} with its unit",
    }


def _plain_schema(argument: Argument) -> Schema:
    """Return the schema of the value of an argument that has no unit."""
    limits = bounds_text(argument)
    bounds = {"minimum": argument.low, "maximum": argument.high}
    limited = {word: bound for word, bound in bounds.items() if math.isfinite(bound)}
    match argument.kind:
        case "text":
            return {"type": SCALAR, "errorMessage": "needs a text"}
        case "object":
            message = "needs an object, such as red ball or big blue box, or the name of one"
            return {"type": "string", "pattern": r"\S", "errorMessage": message}
        case "number" | "count":
            what, number = ("a number", "number") if argument.kind == "number" else ("a whole number", "integer")
            message = f"needs {what}" + (f", {limits}" if limits else "")
            return {"type": [number, "string"], "pattern": HOLE, **limited, "errorMessage": message}
        case "flag":
            pattern = f"^(?:{'|'.join(SWITCH_WORDS)})$|{HOLE}"
            return {"type": ["boolean", "string"], "pattern": pattern, "errorMessage": "needs true or false"}
        case "choice":
            words = argument.choices
            known = "|".join(map(_escape_pattern, words))
            keywords = {"pattern": f"^(?:{known})$|{HOLE}", "errorMessage": f"needs one of {', '.join(words)}"}
            # Words that are booleans in YAML 1.1.
            return {"type": ["string", "boolean"] if SWITCH_WORDS.keys() & set(words) else "string", **keywords}
        case "new move" | "file":
            return {"type": SCALAR, "pattern": r"\S", "errorMessage": "needs a name, or the path of a file"}
        case "joint":
            return {"type": SCALAR, "pattern": r"\S", "errorMessage": "needs the name of a joint"}
        case "joints":
            message = "needs a joint, a group of them, or a list of names"
            names = {"items": {"type": SCALAR, "pattern": r"\S"}, "minItems": 1}
            return {"type": [*SCALAR, "array"], "pattern": r"\S", **names, "errorMessage": message}
        case "outcomes":
            return {
                "type": ["array", "string"],
                "items": {"enum": list(OUTCOMES)},
                "minItems": 1,
                "pattern": f"^(?:{'|'.join(OUTCOMES)})$|{HOLE}",
                "errorMessage": "needs a list of running, success and failure",
            }
    return {}


def _is_json(value: object) -> bool:
    """Return whether a default can be written in a mission; defaults of user leaves may be any Python object."""
    return isinstance(value, str | list | bool) or (isinstance(value, int | float) and math.isfinite(value))


def _escape_pattern(text: str) -> str:
    """Escape characters with a meaning in patterns; re.escape escapes more than JavaScript allows."""
    return re.sub(r"[.*+?^${}()|\[\]\\/]", r"\\\g<0>", text)


# Leaves in the schema: the value of each leaf, and its help.
#
# The two forms, a value and a mapping of named arguments, are separated by ``if`` rather than ``anyOf``: editors
# then report the error of the form that was written.


def leaf_value(leaf: type[Leaf], things: Things) -> Schema:
    """Return the schema of a leaf's value: nothing, its principal argument, or a mapping of named arguments."""
    found: Schema = {
        "description": summary(leaf),
        "markdownDescription": leaf_markdown(leaf),
        "if": {"type": "object"},
        "then": _arguments_schema(leaf, things),
        "else": _value_alone_schema(leaf, things),
    }
    snippets = _completions(leaf, things)
    return {**found, "defaultSnippets": snippets} if snippets else found


def leaf_markdown(leaf: type[Leaf]) -> str:
    """Return a leaf's entry in the catalogue, as Markdown for an editor."""
    lines = [
        f"`{each.name}`: {each.help}\n  ({requirements_text(each)}{'; may stand alone' if each.principal else ''})"
        for each in leaf.arguments.values()
    ]
    parts = [summary(leaf), details(leaf), "\n".join(f"- {line}" for line in lines)]
    if leaf.drives:
        parts.append(f"Drives: {', '.join(sorted(leaf.drives))}.")
    if leaf.needs:
        parts.append(f"Needs: {', '.join(sorted(leaf.needs))}.")
    if leaf.output_doc:
        parts.append(f"`as` keeps {leaf.output_doc}.")
    return "\n\n".join(part for part in parts if part)


def is_complete_alone(leaf: type[Leaf]) -> bool:
    """Return whether a node may consist of the leaf's name alone, since none of its arguments is required."""
    return not leaf.open_ended and not any(argument.required for argument in leaf.arguments.values())


def _principal_argument(leaf: type[Leaf]) -> Argument | None:
    return next((argument for argument in leaf.arguments.values() if argument.principal), None)


def _arguments_schema(leaf: type[Leaf], things: Things) -> Schema:
    if leaf.open_ended:
        return {"propertyNames": NAME, "minProperties": 1}
    return {
        "properties": {argument.name: argument_schema(argument, things) for argument in leaf.arguments.values()},
        "required": [argument.name for argument in leaf.arguments.values() if argument.required],
        "additionalProperties": False,
    }


def _value_alone_schema(leaf: type[Leaf], things: Things) -> Schema:
    """Return the schema of a leaf's value in its short form, such as 2 s in ``wait: 2 s``.

    A leaf without a short form needs an object, or takes no value.
    """
    principal = _principal_argument(leaf)
    if leaf.open_ended:
        return {"type": "object", "errorMessage": "needs names and values, such as {count: 1}"}
    if principal is None:
        message = f"needs its arguments by name: {', '.join(leaf.arguments)}" if leaf.arguments else "takes no argument"
        return {"type": "null" if is_complete_alone(leaf) else "object", "errorMessage": message}
    one = value_schema(principal, things)
    one.pop("defaultSnippets", None)  # they are with the leaf's word, where editors look for them
    return {"if": {"not": {"type": "null"}}, "then": one} if is_complete_alone(leaf) else one


def _completions(leaf: type[Leaf], things: Things) -> list[Schema]:
    """Return the values that an editor offers after the name of a leaf; empty if the leaf needs no value."""
    principal = _principal_argument(leaf)
    if leaf.open_ended:
        return [{"label": "names and values", "body": {"count": 1}}]
    if is_complete_alone(leaf):
        return []
    if principal is None:
        required = {argument.name: example_value(argument) for argument in leaf.arguments.values() if argument.required}
        return [{"label": ", ".join(required), "body": required}]
    if principal.kind in things:
        return list(name_schema(principal.kind, things[principal.kind])["defaultSnippets"])
    return [{"label": str(example_value(principal)), "body": example_value(principal)}]
