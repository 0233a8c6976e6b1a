"""Declarations of leaves as text, for the catalogue, the JSON Schema and the docs."""

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
    "condition": "battery.percent > 20",
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
"""An example value for each kind of argument without a unit, as written in a mission."""


def summary(leaf: type[Leaf]) -> str:
    """Return the first line of a leaf's docstring."""
    return (inspect.getdoc(leaf) or "").partition("\n")[0]


def details(leaf: type[Leaf]) -> str:
    """Return a leaf's docstring after the first line: when it runs, succeeds and fails."""
    return (inspect.getdoc(leaf) or "").partition("\n")[2].strip()


def sentence(words: str) -> str:
    """Return ``words`` with a capital first letter and a full stop at the end."""
    return f"{words[:1].upper()}{words[1:]}."


def kind_text(argument: Argument) -> str:
    """Return the kind of an argument as text: "length (m, cm, mm)"."""
    if argument.choices:
        return f"one of {', '.join(argument.choices)}"
    units = f" ({', '.join(UNITS[argument.kind])})" if argument.kind in UNITS else ""
    return ("two of " if argument.span else "") + argument.kind + units + (" by joint" if argument.by_joint else "")


def default_data(argument: Argument) -> object:
    """Return the default of an argument in mission notation as plain data: "0.2 m/s", ["-60 deg", "60 deg"], 3."""
    default = argument.default
    if argument.kind not in UNITS or argument.by_joint or default is None:
        return list(default) if isinstance(default, tuple) else default
    if argument.span:
        return [quantity_text(value, argument.kind) for value in default]
    return quantity_text(default, argument.kind)


def default_text(argument: Argument) -> str:
    """Return the default of an argument in mission notation as text."""
    default = default_data(argument)
    if default is None or default in ("", [], {}):
        return "nothing"
    if isinstance(default, bool):
        return str(default).lower()
    return f"[{', '.join(default)}]" if isinstance(default, list) else str(default)


def bounds_text(argument: Argument) -> str:
    """Return the bounds of an argument: "0.01 m/s to 0.7 m/s"; empty without bounds."""

    def show(bound: float) -> str:
        return quantity_text(bound, argument.kind) if argument.kind in UNITS else f"{bound:g}"

    if math.isinf(argument.low):
        return "" if math.isinf(argument.high) else f"at most {show(argument.high)}"
    low = show(argument.low)
    return f"at least {low}" if math.isinf(argument.high) else f"{low} to {show(argument.high)}"


def requirements_text(argument: Argument) -> str:
    """Return an argument's kind, bounds, default: "length (m, cm, mm), 0.1 m to 2 m; default 0.5 m"."""
    limits = bounds_text(argument)
    default = "must be given" if argument.required else f"default {default_text(argument)}"
    return kind_text(argument) + (f", {limits}" if limits else "") + f"; {default}"


def example_value(argument: Argument) -> object:
    """Return an example value of an argument as plain data: its default, or a common value of its kind."""
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
