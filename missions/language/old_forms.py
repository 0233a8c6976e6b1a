"""Old forms: longer forms of the mission language in a file, rewritten into newer ones with the same meaning.

====================================================  ==============================
old form                                              new form
====================================================  ==============================
``succeed`` with ``while: C``                         ``check: C``
``succeed`` with ``while: C``, ``retry: forever``     ``wait_until: C``
``fail`` without a reason, with ``if: C``             ``check: not (C)``
a ``race`` of a behaviour and ``wait: 5 s``           the behaviour with ``for: 5 s``
====================================================  ==============================

All other characters of the file stay. A form that has comments inside, or that could mean something else, is left.
"""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from config.diagnostics import SourceText
from config.units import parse_quantity
from config.yaml_nodes import Listing, Mapping, Node, Scalar, compose
from missions.language.expressions import ExpressionError, parse
from missions.language.kinds import STATE_KINDS

MAX_REWRITES = 1000
"""Maximum number of rewrites in one file."""


class Rewrite(NamedTuple):
    """Rewrite of one old form: its ``line`` in the file, the ``new`` word, and the ``text`` of the whole file after."""

    line: int
    new: str
    text: str


def rewrite_old_forms(name: str, text: str) -> tuple[str, list[Rewrite]]:
    """Return a mission's text with all old forms rewritten, and the rewrites in order.

    ``name`` is the name of the file in errors. Raises InvalidFileError for a text that is not YAML.
    """
    done: list[Rewrite] = []
    while len(done) < MAX_REWRITES:
        root = compose(SourceText(name, text))
        tree = root.get("tree") if isinstance(root, Mapping) else None
        lines = _Lines(text, _positive_params(root))
        found = next(_rewrites(lines, tree, ()), None) if tree is not None else None
        if found is None:
            break
        done.append(found)
        text = found.text
    return text, done


class _Lines:
    """Lines of a mission file with their line ends, and functions to find and replace a YAML node in them.

    ``times`` are the params of the mission whose lower bound is a duration above 0.
    """

    def __init__(self, text: str, times: frozenset[str]) -> None:
        self.text = text
        self.times = times
        self.lines = text.splitlines(keepends=True)
        self._starts = [0]
        for line in self.lines:
            self._starts.append(self._starts[-1] + len(line))

    def start(self, node: Node) -> int:
        """Return the index of the first character of a node in the text."""
        return self._starts[node.mark.line - 1] + node.mark.column - 1

    def end(self, node: Scalar) -> int | None:
        """Return the index after a scalar; None if the scalar is not on one line as written."""
        start = self.start(node)
        for written in (node.text, f'"{node.text}"', f"'{node.text}'"):
            if self.text.startswith(written, start):
                return start + len(written)
        return None

    def replaced(self, start: int, end: int, new: str) -> str:
        """Return the text with ``new`` in place of the characters from index ``start`` to ``end``."""
        return self.text[:start] + new + self.text[end:]


def _rewrites(lines: _Lines, node: Node, siblings: Sequence[Node], parent: str = "") -> Iterator[Rewrite]:
    """Yield the rewrites of a node and of those below it.

    ``parent`` is the word of the node above, such as "sequence", and ``siblings`` are its children.
    """
    if isinstance(node, Listing):
        for item in node.items:
            yield from _rewrites(lines, item, node.items, parent)
    elif isinstance(node, Mapping):
        yield from _conditions(lines, node, siblings, parent)
        yield from _race(lines, node)
        for key, value in node.entries:
            yield from _rewrites(lines, value, (), key.text)


def _conditions(lines: _Lines, node: Mapping, siblings: Sequence[Node], parent: str) -> Iterator[Rewrite]:
    """Yield the rewrite of a condition: ``succeed`` with ``while``, or ``fail`` with ``if``."""
    entries = node.entries
    if len(entries) < 2:
        return
    (word, value), (modifier, condition) = entries[:2]
    if not (isinstance(value, Scalar) and value.value is None and isinstance(condition, Scalar)):
        return
    start, at, end = lines.start(word), lines.start(condition), lines.end(condition)
    if end is None or condition.value is None or "#" in lines.text[start:at]:
        return
    if (word.text, modifier.text) == ("succeed", "while"):
        waiting = _waiting_end(lines, entries[2:], end) if _is_always_known(condition) else None
        new = "check" if waiting is None else "wait_until"
        text = f"{new}: {lines.text[at:end]}"
        yield Rewrite(word.mark.line, new, lines.replaced(start, end if waiting is None else waiting, text))
    elif (word.text, modifier.text) == ("fail", "if") and _leads_on(node, siblings, parent):
        text = f"check: {_negated(condition, lines.text[at:end])}"
        yield Rewrite(word.mark.line, "check", lines.replaced(start, end, text))


def _waiting_end(lines: _Lines, further: Sequence[tuple[Scalar, Node]], end: int) -> int | None:
    """Return the index after ``retry: forever`` if that follows a condition, which ends at index ``end``."""
    if not further or further[0][0].text != "retry":
        return None
    count = further[0][1]
    if not isinstance(count, Scalar) or count.value != "forever" or "#" in lines.text[end : lines.start(count)]:
        return None
    return lines.end(count)


def _is_always_known(condition: Scalar) -> bool:
    """Return whether a condition reads no sensor.

    A sensor may not report. A ``retry`` then waits longer than a ``wait_until``, so such a condition is not rewritten.
    """
    try:
        reads = parse(_expression_text(condition)).reads
    except ExpressionError:
        return False
    return all(read.name not in STATE_KINDS for read in reads)


def _expression_text(condition: Scalar) -> str:
    """Return a condition without ``${}`` around it."""
    hole = re.fullmatch(r"\s*\$\{(.*)\}\s*", condition.text, re.DOTALL)
    return hole[1] if hole else condition.text


def _leads_on(node: Mapping, siblings: Sequence[Node], parent: str) -> bool:
    """Return whether a ``fail`` with ``if`` can become a ``check``, which succeeds where the ``fail`` is skipped.

    In a sequence with another child that is never skipped, both have the same effect.
    """
    others = [other for other in siblings if other is not node]
    modifiers = {key.text for key, _ in node.entries} - {"fail", "if", "name"}
    never_skipped = any(not isinstance(other, Mapping) or other.get("if") is None for other in others)
    return parent in ("sequence", "reactive_sequence") and not modifiers and never_skipped


def _negated(condition: Scalar, written: str) -> str:
    """Return the negation of a condition, in the same quotes as ``written``, its text in the file."""
    text = _expression_text(condition)
    found = re.fullmatch(r"not\s+(\w+(?:\.\w+)?)", text.strip())
    new = found[1] if found else f"not ({text.strip()})"
    return f"{written[0]}{new}{written[0]}" if condition.quoted else new


def _race(lines: _Lines, node: Mapping) -> Iterator[Rewrite]:
    """Yield the rewrite of a race between a behaviour and a known time, written as a block."""
    if not node.entries or node.entries[0][0].text != "race" or node.get("name") is not None:
        return
    key, value = node.entries[0]
    if not isinstance(value, Listing) or len(value.items) != 2:
        return
    waits = [item for item in value.items if _is_long_wait(item, lines.times)]
    if len(waits) != 1:
        return
    (wait,), behaviour = waits, next(item for item in value.items if item is not waits[0])
    if isinstance(behaviour, Mapping) and behaviour.get("for") is None and isinstance(wait, Mapping):
        text = _without_race(lines, key, behaviour, wait)
        if text is not None:
            yield Rewrite(key.mark.line, "for", text)


def _is_long_wait(item: Node, times: frozenset[str]) -> bool:
    """Return whether a node is a ``wait`` alone, for a time that is certainly above 0: a quantity, or one of ``times``.

    A ``wait`` of 0 s ends at once, but ``for: 0 s`` is an error.
    """
    if not isinstance(item, Mapping) or [*item.keys()] != ["wait"]:
        return False
    time = item.entries[0][1]
    return isinstance(time, Scalar) and (_is_positive(time) or time.text.removeprefix("${").removesuffix("}") in times)


def _is_positive(node: Node | None) -> bool:
    """Return whether a node is a quantity above 0."""
    quantity = parse_quantity(node.text) if isinstance(node, Scalar) else None
    return quantity is not None and quantity > 0


def _positive_params(root: Node) -> frozenset[str]:
    """Return the names of the params of a mission whose ``low`` is above 0."""
    params = root.get("params") if isinstance(root, Mapping) else None
    entries = params.entries if isinstance(params, Mapping) else []
    return frozenset(
        name.text for name, value in entries if isinstance(value, Mapping) and _is_positive(value.get("low"))
    )


def _without_race(lines: _Lines, key: Scalar, behaviour: Mapping, wait: Mapping) -> str | None:
    """Return the text with the behaviour in place of the race, and ``for`` beside it; None if that is not possible."""
    first, second = sorted((behaviour, wait), key=lambda node: node.mark.line)
    dash = _dash_column(lines, first)
    if dash is None or _dash_column(lines, second) != dash or not re.fullmatch(r"race:\s*", _rest(lines, key)):
        return None
    if first.mark.line <= key.mark.line or second.mark.line <= first.mark.line:
        return None
    between = lines.lines[key.mark.line : first.mark.line - 1]
    block = lines.lines[first.mark.line - 1 : _block_end(lines, second, dash)]
    halves = block[: second.mark.line - first.mark.line], block[second.mark.line - first.mark.line :]
    ours, theirs = halves if first is behaviour else halves[::-1]
    shift = behaviour.mark.column - key.mark.column
    moved = [line for line in ours[1:] if line.strip()]
    if any(between) or len(theirs) != 1 or any(len(line) - len(line.lstrip(" ")) < shift for line in moved):
        return None
    head = lines.lines[key.mark.line - 1][: key.mark.column - 1] + ours[0][behaviour.mark.column - 1 :]
    body = [line[shift:] if line.strip() else line for line in ours[1:]]
    time = theirs[0][wait.mark.column - 1 :].removeprefix("wait")
    new = [head, *body, " " * (key.mark.column - 1) + "for" + time]
    before, after = lines.lines[: key.mark.line - 1], lines.lines[first.mark.line - 1 + len(block) :]
    return "".join([*before, *(_with_line_end(line, lines) for line in new[:-1]), new[-1], *after])


def _with_line_end(line: str, lines: _Lines) -> str:
    """Return a line with a line end like those of the file; the last line of a file may have none."""
    return line if line.endswith(("\n", "\r")) else line + ("\r\n" if "\r\n" in lines.text else "\n")


def _rest(lines: _Lines, key: Scalar) -> str:
    """Return the text of a key's line, from the key to the end of the line."""
    return lines.lines[key.mark.line - 1][key.mark.column - 1 :]


def _dash_column(lines: _Lines, node: Node) -> int | None:
    """Return the column (from 0) of the dash before a node that begins an item of a list; None if there is none."""
    before = lines.lines[node.mark.line - 1][: node.mark.column - 1]
    return len(before) - len(before.lstrip(" ")) if before.strip() == "-" else None


def _block_end(lines: _Lines, item: Node, dash: int) -> int:
    """Return the number of the last line of a list's item whose dash is at column ``dash``."""
    end = number = item.mark.line
    for line in lines.lines[item.mark.line :]:
        number += 1
        if line.strip():
            if len(line) - len(line.lstrip(" ")) <= dash:
                break
            end = number
    return end
