"""Values in flow style that YAML splits at a comma, such as ``{on: random(0, 2)}``: one error for each.

A text is split as well if keys with spaces and without values follow it: ``{help: shelf 1, shelf 2 or office}``.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import takewhile

from config.diagnostics import Mark
from config.units import quoted_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar

Report = Callable[[Mark, str, str], object]
"""Function that reports an error: its place, a message and a hint."""

IsSplit = Callable[[str, str], bool]
"""Function that returns whether a text is a part of a value that goes on with the part after it.

The second text is empty for the end of the value.
"""


def _has_open_bracket(text: str, _part: str) -> bool:
    """Return whether ``text`` has an opening bracket without the closing one."""
    return text.count("(") > text.count(")")


def join_split_values(node: Node, report: Report, is_split: IsSplit = _has_open_bracket) -> Node:
    """Return ``node`` with the parts of each split value joined, so that the nodes around it can be read."""
    if isinstance(node, Mapping):
        entries: list[tuple[Scalar, Node]] = []
        place = 0
        while place < len(node.entries):
            key, value = node.entries[place]
            parts = [part for part, _ in takewhile(lambda entry: _is_empty(entry[1]), node.entries[place + 1 :])]
            value, count = _join(value, parts, report, is_split)
            is_prose = any(" " in part.text for part in parts) and parts[-1].mark.line == value.mark.line
            if not count and is_prose and not _is_empty(value):
                value, count = _join(value, parts, report, lambda _, part: bool(part))
            entries.append((key, join_split_values(value, report, is_split)))
            place += 1 + count
        return replace(node, entries=entries)
    if isinstance(node, Listing):
        items: list[Node] = []
        place = 0
        while place < len(node.items):
            item, rest = node.items[place], node.items[place + 1 :]
            if isinstance(item, Mapping) and item.entries:
                key, value = item.entries[-1]
                value, count = _join(value, rest, report, is_split)
                item = replace(item, entries=[*item.entries[:-1], (key, value)])
            else:
                item, count = _join(item, rest, report, is_split)
            items.append(join_split_values(item, report, is_split))
            place += 1 + count
        return replace(node, items=items)
    return node


def _is_empty(node: Node) -> bool:
    return isinstance(node, Scalar) and node.value is None and not node.text


def _join(node: Node, rest: Sequence[Node], report: Report, is_split: IsSplit) -> tuple[Node, int]:
    """Return ``node`` joined with the nodes of ``rest`` that continue it, and the number of these nodes."""
    if not isinstance(node, Scalar) or node.quoted:
        return node, 0
    text, count = node.text, 0
    for part in rest:
        if not isinstance(part, Scalar) or part.quoted or not is_split(text, part.text):
            break
        text, count = f"{text}, {part.text}", count + 1
    if not count or is_split(text, ""):
        return node, 0
    quoted = f"'{text}'" if '"' in text else f'"{text}"'
    message = f"{quoted_value(text)} is split at its comma in {{...}} or [...]"
    report(node.mark, message, f"put quotes around it: {quoted}")
    return replace(node, text=text, value=text), count
