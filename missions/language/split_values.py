"""Values in flow style that YAML splits at a comma in brackets, such as ``{on: random(0, 2)}``: one error for each."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import takewhile

from config.yaml_nodes import Listing, Mapping, Node, Scalar

Report = Callable[[Scalar], None]
"""Function that is called with each split value, after its parts are joined."""


def join_split_values(node: Node, report: Report) -> Node:
    """Return ``node`` with the parts of each split value joined, so that the nodes around it can be read."""
    if isinstance(node, Mapping):
        entries: list[tuple[Scalar, Node]] = []
        place = 0
        while place < len(node.entries):
            key, value = node.entries[place]
            parts = takewhile(lambda entry: _is_empty(entry[1]), node.entries[place + 1 :])
            value, count = _join(value, [part for part, _ in parts], report)
            entries.append((key, join_split_values(value, report)))
            place += 1 + count
        return replace(node, entries=entries)
    if isinstance(node, Listing):
        items: list[Node] = []
        place = 0
        while place < len(node.items):
            item, rest = node.items[place], node.items[place + 1 :]
            if isinstance(item, Mapping) and item.entries:
                key, value = item.entries[-1]
                value, count = _join(value, rest, report)
                item = replace(item, entries=[*item.entries[:-1], (key, value)])
            else:
                item, count = _join(item, rest, report)
            items.append(join_split_values(item, report))
            place += 1 + count
        return replace(node, items=items)
    return node


def _is_empty(node: Node) -> bool:
    return isinstance(node, Scalar) and node.value is None and not node.text


def _join(node: Node, rest: Sequence[Node], report: Report) -> tuple[Node, int]:
    """Return ``node`` joined with the nodes of ``rest`` up to its closing bracket, and the number of these nodes."""
    if not isinstance(node, Scalar) or node.quoted or node.text.count("(") <= node.text.count(")"):
        return node, 0
    text = node.text
    for count, part in enumerate(rest, start=1):
        if not isinstance(part, Scalar) or part.quoted:
            break
        text = f"{text}, {part.text}"
        if text.count("(") == text.count(")"):
            joined = replace(node, text=text, value=text)
            report(joined)
            return joined, count
    return node, 0
