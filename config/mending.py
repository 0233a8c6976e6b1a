"""Reading on behind a mistake of syntax: its line is mended as it was meant, or left out, and the rest is read."""

import re
from collections.abc import Iterator

import yaml

from config.faults import Diagnostic, Mark, Source
from config.syntax import events, syntax_fault
from drivers.api.quick import dataclass

MAX_LENGTH = 20_000
"""Characters of a text that is mended: each try reads all of it."""

ODD_BLANKS = "\u00a0\u2007\u202f\u3000"
_LEADING = re.compile(rf"^[ {ODD_BLANKS}-]*[{ODD_BLANKS}]|^[ -]*\w+:[{ODD_BLANKS}]+")
_WORD_ALONE = re.compile(r"( *(?:- +)*\w+) *(#.*)?")
_WORDS = re.compile(r"( *(?:- +)*\w+) +([^\s:#-].*)")
_VALUE = re.compile(r"( *(?:- +)*\w+: +)(.+)")
_HOLE = re.compile(r"\$\{[^{}\"']*\}")
_BLOCK = re.compile(r" *(?:- +)*")


@dataclass(frozen=True, slots=True)
class Mended:
    """A text that can be read further. ``lines`` (from 1) are not as they were written.

    ``torn`` is whether something was left out or put where it may not belong: then little is sure of the rest.
    """

    text: str
    lines: frozenset[int]
    torn: bool


def plain_blanks(source: Source) -> tuple[str, list[Diagnostic]]:
    """Return the text with plain blanks where lines and values begin, and a fault for each line with others."""
    faults, lines = [], source.text.splitlines(keepends=True)
    for at, line in enumerate(lines):
        found = _LEADING.match(line)
        if found is not None and not found[0].isascii():
            lines[at] = re.sub(f"[{ODD_BLANKS}]", " ", found[0]) + line[found.end() :]
            odd = next(place for place, sign in enumerate(line) if sign in ODD_BLANKS)
            mark = Mark(at + 1, odd + 1)
            message = f"a blank that does not break (U+{ord(line[odd]):04X}), which YAML takes for a letter"
            faults.append(Diagnostic(source, mark, message, "write a plain blank", frozenset({at + 1})))
    return "".join(lines), faults


def mend(text: str, fault: Diagnostic, line: int) -> Mended | None:
    """Return the text mended so that it can be read furthest; None where nothing helps.

    ``fault`` is what was made of a mistake that the parser found in ``line``.
    """
    if len(text) > MAX_LENGTH:
        return None
    lines = text.splitlines()
    best, furthest = None, fault.mark.line
    for first, new, torn in _tries(lines, fault.mark.line - 1, min(line, len(lines)) - 1):
        changed = "\n".join([*lines[:first], *new, *lines[first + len(new) :]]) + "\n"
        next_one = _first_slip(changed)
        if next_one is None or next_one > furthest:
            best = Mended(changed, frozenset(range(first + 1, first + len(new) + 1)), torn)
            furthest = len(lines) + 1 if next_one is None else next_one
        if next_one is None:
            break
    return best


def _first_slip(text: str) -> int | None:
    """Return the line (from 1) of the first mistake of syntax; None where there is none."""
    try:
        for _ in events(text):
            pass
    except yaml.YAMLError as error:
        return syntax_fault(Source("", text), error).mark.line
    return None


def _tries(lines: list[str], begin: int, found: int) -> Iterator[tuple[int, list[str], bool]]:
    """Yield ways of mending: the first line that is written anew, the new lines, and whether the text is torn then.

    ``begin`` is the line of the mistake, ``found`` the one in which the parser found it (from 0).
    """
    places = list(dict.fromkeys(place for place in (begin, found, _above(lines, found)) if 0 <= place < len(lines)))
    for place in places:
        line = lines[place]
        quoted = _HOLE.sub(lambda hole: f'"{hole[0]}"', line)
        for new in (*_with_colon(line), quoted, f"{line}]", f"{line}}}"):
            if new != line:
                yield place, [new], False
    yield from ((begin, [lines[begin] + quote], True) for quote in "\"'" if begin < len(lines))
    for place in places:
        if _end(lines, place) == place + 1:
            yield from ((place, [" " * indent + lines[place].lstrip()], True) for indent in _indents(lines, place))
        yield place, [_VALUE.sub(lambda value: value[1] + "'" + value[2].replace("'", "''") + "'", lines[place])], True
    for place in places:
        yield place, [""] * (_end(lines, place) - place), True


def _with_colon(line: str) -> Iterator[str]:
    """Yield a line with the colon that it lacks."""
    if (alone := _WORD_ALONE.fullmatch(line)) is not None:
        yield f"{alone[1]}:"
    if (words := _WORDS.fullmatch(line)) is not None:
        yield f"{words[1]}: {words[2]}"


def _above(lines: list[str], place: int) -> int:
    """Return the last line before ``place`` with something in it; -1 where there is none."""
    return next((at for at in range(place - 1, -1, -1) if lines[at].strip()), -1)


def _end(lines: list[str], place: int) -> int:
    """Return the line behind the block that begins at ``place``: of lines that are indented further."""
    for at in range(place + 1, len(lines)):
        if lines[at].strip() and _indent(lines[at]) <= _indent(lines[place]):
            return at
    return len(lines)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip(" "))


def _indents(lines: list[str], place: int) -> list[int]:
    """Return the columns in which something begins in the lines above, those of the nearest first."""
    columns: dict[int, None] = {}
    for at in range(place - 1, max(-1, place - 10), -1):
        found = _BLOCK.match(lines[at])
        if lines[at].strip() and found is not None:
            columns[found.end()] = None
            columns[_indent(lines[at])] = None
    return list(columns)
