"""The declarations of leaves in words: for the catalogue, the JSON Schema and the pages of docs."""

import inspect
import math
from dataclasses import replace

from behaviours.leaf import Argument, Leaf
from config.units import EXAMPLES, UNITS, quantity_text

EXAMPLE_VALUES: dict[str, object] = {
    "text": "Hello",
    "number": 1,
    "count": 3,
    "flag": True,
    "value": 1,
    "outcomes": ["running", "success"],
    "object": "red ball",
    "joint": "elbow",
    "joints": "left_arm",
    "new move": "my_wave",
    "file": "bell.wav",
    "face": "${person}",
    "phrases": ["yes", "no"],
    "head": "lidar_mast",
    "arm": "right_arm",
}
"""A value of each kind that has no unit, as a mission writes it."""


def summary(leaf: type[Leaf]) -> str:
    """Return the first line of what a leaf says of itself."""
    return (inspect.getdoc(leaf) or "").partition("\n")[0]


def details(leaf: type[Leaf]) -> str:
    """Return what a leaf says of itself after the first line: when it runs, succeeds and fails."""
    return (inspect.getdoc(leaf) or "").partition("\n")[2].strip()


def sentence(words: str) -> str:
    """Begin words with a capital and end them with a full stop."""
    return f"{words[:1].upper()}{words[1:]}."


def kind_text(argument: Argument) -> str:
    """Say what an argument takes: "length (m, cm, mm)"."""
    if argument.choices:
        return f"one of {', '.join(argument.choices)}"
    units = f" ({', '.join(UNITS[argument.kind])})" if argument.kind in UNITS else ""
    return ("two of " if argument.span else "") + argument.kind + units + (" by joint" if argument.by_joint else "")


def default_data(argument: Argument) -> object:
    """Return a default as a mission would write it, as plain data: "0.2 m/s", ["-60 deg", "60 deg"], 3."""
    default = argument.default
    if argument.kind not in UNITS or argument.by_joint or default is None:
        return list(default) if isinstance(default, tuple) else default
    if argument.span:
        return [quantity_text(value, argument.kind) for value in default]
    return quantity_text(default, argument.kind)


def default_text(argument: Argument) -> str:
    """Write a default as a mission would."""
    default = default_data(argument)
    if default is None or default in ("", [], {}):
        return "nothing"
    if isinstance(default, bool):
        return str(default).lower()
    return f"[{', '.join(default)}]" if isinstance(default, list) else str(default)


def bounds_text(argument: Argument) -> str:
    """Say between what an argument must lie: "0.01 m/s to 0.7 m/s"; nothing where anything goes."""

    def show(bound: float) -> str:
        return quantity_text(bound, argument.kind) if argument.kind in UNITS else f"{bound:g}"

    if math.isinf(argument.low):
        return "" if math.isinf(argument.high) else f"at most {show(argument.high)}"
    low = show(argument.low)
    return f"at least {low}" if math.isinf(argument.high) else f"{low} to {show(argument.high)}"


def requirements_text(argument: Argument) -> str:
    """Say all that a value must be: "speed (m/s, cm/s, mm/s), 0.01 m/s to 0.7 m/s; default 0.2 m/s"."""
    limits = bounds_text(argument)
    default = "must be given" if argument.required else f"default {default_text(argument)}"
    return kind_text(argument) + (f", {limits}" if limits else "") + f"; {default}"


def example_value(argument: Argument) -> object:
    """Return a value for an argument, as plain data: its default, or a common one of its kind."""
    if not argument.required:
        return default_data(argument)
    if argument.by_joint:
        return {"elbow": example_value(replace(argument, by_joint=False))}
    if argument.choices:
        return argument.choices[0]
    if argument.kind not in UNITS:
        common = EXAMPLE_VALUES.get(argument.kind)
        return min(common, argument.high) if isinstance(common, int) else common
    return [quantity_text(0, argument.kind), EXAMPLES[argument.kind]] if argument.span else EXAMPLES[argument.kind]
