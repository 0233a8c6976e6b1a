"""Old forms: longer forms of the mission language in a file, rewritten into newer ones with the same meaning.

====================================================  ==============================
old form                                              new form
====================================================  ==============================
``succeed`` with ``while: C``                         ``check: C``
``succeed`` with ``while: C``, ``retry: forever``     ``wait_until: C``
``fail`` without a reason, with ``if: C``             ``check: not (C)``
a ``race`` of a behaviour and ``wait: 5 s``           the behaviour with ``for: 5 s``
====================================================  ==============================

All other characters of the file stay. A form that has comments inside, or that could mean something else, is left. In
the tick in which the time is over, a ``race`` whose ``wait`` comes second ticks the behaviour once more; ``for`` does
not.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from config.diagnostics import InvalidFileError, SourceText
from config.units import parse_quantity
from config.yaml_nodes import Listing, Mapping, Node, Scalar, compose
from missions.language.expressions import ExpressionError, parse
from missions.language.kinds import STATE_KINDS
from missions.language.nodes import COMPOSITES, FINALLY, FOR_EACH, RECOVER, SWITCHES, WAIT_FOR

MAX_REWRITES = 1000
"""Maximum number of rewrites in one file."""


class Rewrite(NamedTuple):
    """Rewrite of one old form: its ``line`` in the file, the ``new`` word, and the ``text`` of the whole file after.

    ``entries`` are the keys and values that the node of the old form, ``old``, has in the new text.
    """

    line: int
    new: str
    text: str
    old: Mapping
    entries: Sequence[tuple[str, Node]]


def rewrite_old_forms(
    name: str, text: str, accepts: Callable[[str], bool] = lambda _: True
) -> tuple[str, list[Rewrite]]:
    """Return a mission's text with its old forms rewritten, and the rewrites in order.

    ``name`` is the name of the file in errors. A rewrite is left out unless ``accepts`` returns True for the text of
    the file after it. Raises InvalidFileError for a text that is not YAML.
    """
    done: list[Rewrite] = []
    while len(done) < MAX_REWRITES:
        root = compose(SourceText(name, text))
        tree = root.get("tree") if isinstance(root, Mapping) else None
        lines = _Lines(text, _positive_params(root))
        candidates = _rewrites(lines, tree, (), ()) if tree is not None else ()
        found = next((each for each in candidates if _is_exact(each, root) and accepts(each.text)), None)
        if found is None:
            break
        done.append(found)
        text = found.text
    return text, done


def _is_exact(rewrite: Rewrite, root: Node) -> bool:
    """Return whether the text of a rewrite has the data of the old text, ``root``, except in the old form.

    A node with an alias has more than one place, and is left.
    """
    try:
        after = compose(SourceText("", rewrite.text))
    except InvalidFileError:
        return False
    places = sum(each is rewrite.old for each in _nodes(root))
    return places == 1 and _data(after, None) == _data(root, rewrite)


def _nodes(node: Node) -> Iterator[Node]:
    """Yield a node and all nodes below it."""
    yield node
    for each in [value for _, value in node.entries] if isinstance(node, Mapping) else getattr(node, "items", ()):
        yield from _nodes(each)


def _data(node: Node, rewrite: Rewrite | None) -> object:
    """Return the data of a node, with keys in their order; with ``rewrite``, as it is after that."""
    if isinstance(node, Scalar):
        return repr(node.value)
    if isinstance(node, Listing):
        return [_data(each, rewrite) for each in node.items]
    entries: Iterable[tuple[str, Node]] = ((key.text, value) for key, value in node.entries)
    if rewrite is not None and node is rewrite.old:
        entries = rewrite.entries
    return tuple((key, _data(value, rewrite)) for key, value in entries)


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


def _rewrites(lines: _Lines, node: Node, siblings: Sequence[Node], above: tuple[str, ...]) -> Iterator[Rewrite]:
    """Yield the rewrites of a node and of those below it.

    ``above`` are the keys of the nodes around it, such as "while"; the last is the word of its parent, such as
    "sequence". ``siblings`` are the children of the parent.
    """
    if isinstance(node, Listing):
        for item in node.items:
            yield from _rewrites(lines, item, node.items, above)
    elif isinstance(node, Mapping):
        yield from _conditions(lines, node, siblings, above)
        around = (*above, *node.keys())
        if SUSPENDING.isdisjoint(around):
            yield from _race(lines, node)
        for key, value in node.entries:
            if key.text in NODE_KEYS or above[-1:] == ("cases",):
                yield from _rewrites(lines, value, (), (*around, key.text))


NODE_KEYS = frozenset(
    {*COMPOSITES, *SWITCHES, "cases", "default", FOR_EACH, "do", WAIT_FOR, RECOVER, FINALLY},
)
"""Keys whose values are nodes, or contain nodes; all else is data, which may look like a node."""


SUSPENDING = frozenset({"reactive_sequence", "reactive_selector", "reactive_switch", "while", "until", WAIT_FOR})
"""Words around which a ``race`` is left: with a silent sensor, they treat a ``wait`` and a ``for`` differently."""


def _conditions(lines: _Lines, node: Mapping, siblings: Sequence[Node], above: tuple[str, ...]) -> Iterator[Rewrite]:
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
        text = lines.replaced(start, end if waiting is None else waiting, f"{new}: {lines.text[at:end]}")
        yield _rewrite(node, new, text, condition, 2 if waiting is None else 3)
    elif (word.text, modifier.text) == ("fail", "if") and _leads_on(node, siblings, above):
        negated = _negated(condition)
        quote = lines.text[at] if condition.quoted else ""
        text = lines.replaced(start, end, f"check: {quote}{negated}{quote}")
        yield _rewrite(node, "check", text, Scalar(condition.mark, negated, negated), 2)


def _rewrite(node: Mapping, new: str, text: str, value: Node, count: int) -> Rewrite:
    """Return the rewrite of a node with the key ``new``, and this value, in place of its first ``count`` keys."""
    entries = [(new, value), *((key.text, each) for key, each in node.entries[count:])]
    return Rewrite(node.mark.line, new, text, node, entries)


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


def _leads_on(node: Mapping, siblings: Sequence[Node], above: tuple[str, ...]) -> bool:
    """Return whether a ``fail`` with ``if`` can become a ``check``, which succeeds where the ``fail`` is skipped.

    In a sequence with another child that is never skipped, both have the same effect.
    """
    others = [other for other in siblings if other is not node]
    modifiers = {key.text for key, _ in node.entries} - {"fail", "if", "name"}
    in_sequence = above[-1:] in (("sequence",), ("reactive_sequence",))
    return in_sequence and not modifiers and not all(map(_can_be_skipped, others))


def _can_be_skipped(node: Node) -> bool:
    """Return whether a node has an ``if``, or a node below it has one, so that it may be skipped."""
    return any(isinstance(each, Mapping) and each.get("if") is not None for each in _nodes(node))


def _negated(condition: Scalar) -> str:
    """Return the negation of a condition."""
    text = _expression_text(condition).strip()
    found = re.fullmatch(r"not\s+(\w+(?:\.\w+)?)", text)
    return found[1] if found else f"not ({text})"


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
    inside = _node_entries(behaviour)
    if inside and not _can_be_skipped(behaviour) and isinstance(wait, Mapping):
        text = _without_race(lines, key, behaviour, wait)
        if text is not None:
            found = _rewrite(node, "for", text, wait.entries[0][1], 1)
            yield found._replace(entries=[*inside, *found.entries])


def _node_entries(node: Node) -> list[tuple[str, Node]]:
    """Return the keys and values of a node; a word alone is a key without a value."""
    if isinstance(node, Scalar):
        return [(node.text, Scalar(node.mark, "", None))] if isinstance(node.value, str) and not node.quoted else []
    return [(word.text, each) for word, each in node.entries] if isinstance(node, Mapping) else []


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


def _without_race(lines: _Lines, key: Scalar, behaviour: Node, wait: Mapping) -> str | None:
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
    first_line = ours[0][behaviour.mark.column - 1 :]
    if isinstance(behaviour, Scalar):
        first_line = f"{behaviour.text}:{first_line.removeprefix(behaviour.text)}"
    head = lines.lines[key.mark.line - 1][: key.mark.column - 1] + first_line
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
