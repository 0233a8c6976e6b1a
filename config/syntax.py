"""What the YAML parser stumbled on, in words that help."""

import re

import yaml

from config.faults import Fault, Mark, Source, place_of

_FORBIDDEN = re.compile("[^\t\n\r -~\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What is not a printable character of YAML 1.1 (section 5.1 of its specification)."""

_INDENT = "indent with blanks"
_QUOTES = "put quotes around the text"
_SLIPS = {
    "while scanning a quoted scalar": ("a quote is opened here and not closed", ""),
    "while scanning an alias": ("'*' cannot begin a text", _QUOTES),
    "while scanning an anchor": ("'&' cannot begin a text", _QUOTES),
    "while parsing a flow sequence": ("'[' needs a ',' between its values and a ']' at its end", ""),
    "while parsing a flow mapping": ("'{' needs a ',' between its values and a '}' at its end", ""),
    "while parsing a block mapping": ("this line does not fit in here", "indent it as its neighbours"),
    "while parsing a block collection": ("this line does not fit in here", "indent it as its neighbours"),
}
"""What the parser was doing, and what the mistake mostly is then."""

_IN_COLUMNS = ("while parsing a block mapping", "while parsing a block collection")
"""Where what stands in one column decides."""

_BEGIN_THERE = ("while scanning", "while parsing a flow")
"""Where these begin is where to look, rather than where the parser gave up."""


def forbidden_character(source: Source) -> Fault | None:
    """Return the first character that may not stand in YAML at all, such as NUL or an escape code."""
    found = _FORBIDDEN.search(source.text)
    if found is None:
        return None
    message = f"a character that YAML does not allow: U+{ord(found[0]):04X}"
    return Fault(source, place_of(source.text, found.start()), message)


def syntax_fault(source: Source, error: yaml.YAMLError) -> Fault:
    """Say what the parser stumbled on."""
    if not isinstance(error, yaml.MarkedYAMLError):
        return Fault(source, Mark(), f"not YAML: {error}")
    problem, context = error.problem or "cannot be read", error.context or ""
    mark = _mark(error.problem_mark) or _mark(error.context_mark) or Mark()
    line = source.line(mark.line)
    found = _common_slip(source, line, mark, problem)
    if found is not None:
        return found
    if problem.endswith("that cannot start any token"):
        return Fault(source, mark, f"'{line[mark.column - 1 : mark.column]}' cannot begin a text", _QUOTES)
    if context in _IN_COLUMNS and (under_dash := _under_dash(source, mark.line)) is not None:
        return under_dash
    if context in _SLIPS:
        message, suggestion = _SLIPS[context]
        begin = _mark(error.context_mark) if context.startswith(_BEGIN_THERE) else None
        return Fault(source, begin or mark, message, suggestion)
    return Fault(source, mark, f"not YAML: {problem}")


def _common_slip(source: Source, line: str, mark: Mark, problem: str) -> Fault | None:
    """Recognise what people get wrong most often."""
    if "\t" in line[: len(line) - len(line.lstrip())]:
        return Fault(source, Mark(mark.line, line.index("\t") + 1), "a tab in the indentation", _INDENT)
    if "'\\t'" in problem or line[mark.column - 1 : mark.column] == "\t":
        return Fault(source, mark, "a tab between words", "write blanks")
    bare = _bare_word_above(source, mark.line)
    if bare is not None:
        word, place = bare
        return Fault(source, place, f"'{word}' has something beside it, so it needs a colon", f"write '- {word}:'")
    hole = _open_hole(line)
    if hole is not None:
        place = Mark(mark.line, hole.start() + 1, len(hole[0]))
        return Fault(source, place, "'${...}' inside { } or [ ] needs quotes", f'write "{hole[0]}"')
    if problem.startswith("mapping values are not allowed"):
        if ": " in line[: mark.column - 1]:
            return Fault(source, mark, "a second ': ' in one value", "put quotes around a text that contains ': '")
        hint = "the line above lacks a colon, or this one is indented too far"
        return Fault(source, mark, "a colon is not expected here", hint)
    return None


def _under_dash(source: Source, number: int) -> Fault | None:
    """Find a key in the column of the dashes above it, which is meant to stand beside what follows the last dash.

    The parser gives up there, or at the next dash: until then the key may belong to what is around the list.
    """
    line, key = source.line(number), None
    indent = len(line) - len(line.lstrip(" "))
    for at in range(number, 0, -1):
        found = re.match(r"( *)(- +)?(\w+):?(?=\s|$)", source.line(at))
        if found is None or len(found[1]) > indent or (at == number and found[2]):
            continue
        if len(found[1]) < indent:
            return None
        if found[2]:
            return None if key is None else _of_key(source, *key, found[3])
        key = Mark(at, indent + 1, len(found[3])), found[3]
    return None


def _of_key(source: Source, mark: Mark, word: str, behind_dash: str) -> Fault:
    hint = f"indent it by two more blanks, under '{behind_dash}'"
    return Fault(source, mark, f"'{word}' stands under the dash", hint)


def _open_hole(line: str) -> re.Match[str] | None:
    """Find a ``${...}`` without quotes inside brackets or braces of its own line."""
    for hole in re.finditer(r"\$\{[^{}]*\}", line):
        before = line[: hole.start()]
        if before.count('"') % 2 == 0 and before.count("'") % 2 == 0 and re.search(r"(?:^|[\s:,\[{-])[\[{]", before):
            return hole
    return None


def _bare_word_above(source: Source, number: int) -> tuple[str, Mark] | None:
    """Find the commonest slip: ``- find_face`` with ``timeout: 5 s`` under it, where ``- find_face:`` is meant."""
    if not re.match(r"\s*\w+:(\s|$)", source.line(number)):
        return None
    while number > 1:
        number -= 1
        line = source.line(number)
        if line.strip() and not line.lstrip().startswith("#"):
            found = re.match(r"(\s*- +)(\w+)\s*(#.*)?$", line)
            return (found[2], Mark(number, len(found[1]) + 1, len(found[2]))) if found else None
    return None


def _mark(mark: yaml.Mark | None) -> Mark | None:
    return None if mark is None else Mark(mark.line + 1, mark.column + 1)
