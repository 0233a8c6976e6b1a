"""Helpful messages for YAML syntax errors, and repairs that let the parser continue."""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import yaml

from config.diagnostics import SMART_QUOTES, Diagnostic, Mark, SourceText, mark_at
from drivers.api.fast_dataclass import dataclass

_FORBIDDEN = re.compile("[^\t\n\r -~\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that are not printable in YAML 1.1 (section 5.1 of the specification)."""

_INDENT = "indent with spaces"
_QUOTES = "put quotes around the text"
_ERRORS_BY_CONTEXT = {
    "while scanning a quoted scalar": ("unclosed quote", ""),
    "while scanning an alias": ("'*' cannot begin a text", _QUOTES),
    "while scanning an anchor": ("'&' cannot begin a text", _QUOTES),
    "while parsing a flow sequence": ("'[' needs a ',' between its values and a ']' at its end", ""),
    "while parsing a flow mapping": ("'{' needs a ',' between its values and a '}' at its end", ""),
    "while parsing a block mapping": ("unexpected indentation", "indent it like the lines around it"),
    "while parsing a block collection": ("unexpected indentation", "indent it like the lines around it"),
}
"""Message and hint for the usual YAML error in each context of the parser."""

_COLUMN_CONTEXTS = ("while parsing a block mapping", "while parsing a block collection")
"""Parser contexts in which the column of a key matters."""

_MARKED_CONTEXTS = ("while scanning", "while parsing a flow")
"""Parser contexts whose beginning is marked as the error, rather than the position where the parser stopped."""


# libyaml's parser is several times faster; PyYAML without it has the same events.
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def events(text: str) -> Iterator[Any]:
    """Yield the YAML parser's events for a text. Raises yaml.YAMLError at the first error."""
    yield from yaml.parse(text, Loader=_LOADER)


def forbidden_character(source: SourceText) -> Diagnostic | None:
    """Return a diagnostic for the first character that YAML does not allow, such as NUL or an escape code."""
    found = _FORBIDDEN.search(source.text)
    if found is None:
        return None
    message = f"a character that YAML does not allow: U+{ord(found[0]):04X}"
    return Diagnostic(source, mark_at(source.text, found.start()), message)


def syntax_diagnostic(source: SourceText, error: yaml.YAMLError) -> Diagnostic:
    """Return a diagnostic, with a helpful message, for an error of the YAML parser."""
    if not isinstance(error, yaml.MarkedYAMLError):
        return Diagnostic(source, Mark(), f"not YAML: {error}")
    problem, context = error.problem or "cannot be read", error.context or ""
    mark = _mark(error.problem_mark) or _mark(error.context_mark) or Mark()
    line = source.line(mark.line)
    found = _common_error(source, line, mark, problem)
    if found is not None:
        return found
    if problem == "could not find expected ':'" and (begin := _mark(error.context_mark)) is not None:
        if (dash := _dash_without_space(source, begin.line)) is not None:
            return dash
        word, _, rest = source.line(begin.line)[begin.column - 1 :].strip().partition(" ")
        return Diagnostic(
            source, replace(begin, length=len(word)), f"'{word}' lacks a colon", f"write '{word}: {rest}'"
        )
    if problem.endswith("that cannot start any token"):
        return Diagnostic(source, mark, f"'{line[mark.column - 1 : mark.column]}' cannot begin a text", _QUOTES)
    if context in _COLUMN_CONTEXTS and (quote := _open_quote(source, mark.line)) is not None:
        return Diagnostic(source, quote, _ERRORS_BY_CONTEXT["while scanning a quoted scalar"][0])
    if context in _COLUMN_CONTEXTS and (under_dash := _under_dash(source, mark.line)) is not None:
        return under_dash
    if context in _COLUMN_CONTEXTS and (dash := _dash_without_space(source, mark.line)) is not None:
        return dash
    if context in _ERRORS_BY_CONTEXT:
        message, suggestion = _ERRORS_BY_CONTEXT[context]
        begin = _mark(error.context_mark) if context.startswith(_MARKED_CONTEXTS) else None
        return Diagnostic(source, begin or mark, message, suggestion)
    return Diagnostic(source, mark, f"not YAML: {problem}")


def problem_line(error: yaml.YAMLError) -> int:
    """Return the line (from 1) at which the parser stopped."""
    mark = error.problem_mark or error.context_mark if isinstance(error, yaml.MarkedYAMLError) else None
    return 1 if mark is None else mark.line + 1


def _common_error(source: SourceText, line: str, mark: Mark, problem: str) -> Diagnostic | None:
    """Return a diagnostic if a syntax error is a frequent one, such as a tab or a missing colon, else None."""
    if "\t" in line[: len(line) - len(line.lstrip())]:
        return Diagnostic(source, Mark(mark.line, line.index("\t") + 1), "a tab in the indentation", _INDENT)
    if "'\\t'" in problem or line[mark.column - 1 : mark.column] == "\t":
        return Diagnostic(source, mark, "a tab between words", "write spaces")
    bare = _bare_word_above(source, mark.line)
    if bare is not None:
        word, place = bare
        return Diagnostic(source, place, f"'{word}' has something beside it, so it needs a colon", f"write '- {word}:'")
    hole = _open_expression(line)
    if hole is not None:
        place = Mark(mark.line, hole.start() + 1, len(hole[0]))
        return Diagnostic(source, place, "'${...}' inside { } or [ ] needs quotes", f'write "{hole[0]}"')
    if problem.startswith("mapping values are not allowed"):
        if (under := _under_value(source, line, mark)) is not None:
            return under
        if ": " in line[: mark.column - 1]:
            plain = " (\" or ', no others)" if SMART_QUOTES.search(line) is not None else ""
            hint = f"put quotes{plain} around a text that contains ': '"
            return Diagnostic(source, mark, "a second ': ' in one value", hint)
        if (above := _key_above(source, mark.line)) is not None:
            return above
        hint = "the line above lacks a colon, or this one is indented too far"
        return Diagnostic(source, mark, "a colon is not expected here", hint)
    return None


def _key_above(source: SourceText, number: int) -> Diagnostic | None:
    """Return a diagnostic if the line above line ``number``, equally indented, has words but no colon, else None.

    Its first word should then be a key.
    """
    above, line = source.line(number - 1), source.line(number)
    word, _, rest = above.strip().partition(" ")
    alike = len(above) - len(above.lstrip()) == len(line) - len(line.lstrip())
    if not alike or not rest or ":" in above or not word.isidentifier():
        return None
    place = Mark(number - 1, above.index(word) + 1, len(word))
    return Diagnostic(source, place, f"'{word}' lacks a colon", f"write '{word}: {rest.strip()}'")


def _under_dash(source: SourceText, number: int) -> Diagnostic | None:
    """Return a diagnostic for a key that is in the column of the dashes above, or None.

    It should be indented under the last dash. The parser reports the error only at line ``number`` or at the next dash,
    since until then the key could belong to the enclosing mapping.
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


def _of_key(source: SourceText, mark: Mark, word: str, behind_dash: str) -> Diagnostic:
    hint = f"indent it by two more spaces, under '{behind_dash}'"
    above = (re.match(r"( *(?:- +)*)(\w+):", source.line(at)) for at in range(mark.line - 1, 0, -1))
    owner = next((found for found in above if found is not None and len(found[1]) < mark.column - 1), None)
    hint += f", or outdent it, to stand below '{owner[2]}'" if owner is not None else ""
    return Diagnostic(source, mark, f"'{word}' stands under the dash", hint)


def _under_value(source: SourceText, line: str, mark: Mark) -> Diagnostic | None:
    """Return a diagnostic for a key that is indented below a key that already has a value, else None.

    An example is ``timeout`` under ``say: Hello``.
    """
    key = re.match(r"( *)(\w+):(?=\s|$)", line)
    above = re.match(r"( *(?:- +)*)(\w+): +[^\s#|>]", source.line(mark.line - 1))
    if key is None or above is None or len(key[1]) <= len(above[1]):
        return None
    place = Mark(mark.line, len(key[1]) + 1, len(key[2]))
    hint = f"outdent it, to stand below '{above[2]}'"
    return Diagnostic(
        source, place, f"'{key[2]}' is indented further than '{above[2]}', which has its value already", hint
    )


def _open_quote(source: SourceText, number: int) -> Mark | None:
    """Return the mark of a quote at or above line ``number`` that is not closed on its own line; None without one.

    The next quote in the file would close it.
    """
    for at in range(number, 0, -1):
        quote = re.match(r" *(?:- +)*(?:[^\s:\"'][^:\"']*: +)?(\"(?:[^\"\\]|\\.)*|'[^']*)(\"|')?", source.line(at))
        if quote is not None and quote[2] is None:
            return Mark(at, quote.start(1) + 1)
    return None


def _open_expression(line: str) -> re.Match[str] | None:
    """Return the match of a ``${...}`` without quotes inside brackets or braces of its line; None without one."""
    for hole in re.finditer(r"\$\{[^{}]*\}", line):
        before = line[: hole.start()]
        if before.count('"') % 2 == 0 and before.count("'") % 2 == 0 and re.search(r"(?:^|[\s:,\[{-])[\[{]", before):
            return hole
    return None


def _dash_without_space(source: SourceText, number: int) -> Diagnostic | None:
    """Return a diagnostic for a line that begins with a dash and a letter (``-nod``), or None.

    The lines searched are line ``number`` and those above it with the same indentation; the first such line is
    reported.
    """
    line = source.line(number)
    column, found = len(line) - len(line.lstrip()), None
    while number > 0 and (not line.strip() or len(line) - len(line.lstrip()) == column):
        if re.match(r"\s*-[^\W\d]", line) is not None:
            found = Diagnostic(
                source,
                Mark(number, column + 1),
                "a dash without a space after it",
                f"write '- {line.strip()[1:]}'",
            )
        number -= 1
        line = source.line(number)
    return found


def _bare_word_above(source: SourceText, number: int) -> tuple[str, Mark] | None:
    """Return the word of the most frequent error, and its position; None if line ``number`` does not have this error.

    The error is ``- find_face`` with ``timeout: 5 s`` under it, instead of ``- find_face:``.
    """
    key = re.match(r"\s*(?=\w+:(\s|$))", source.line(number))
    if key is None:
        return None
    while number > 1:
        number -= 1
        line = source.line(number)
        if line.strip() and not line.lstrip().startswith("#"):
            found = re.match(r"(\s*- +)(\w+)\s*(#.*)?$", line)
            if found is None or key.end() <= found[1].index("-"):
                return None
            return found[2], Mark(number, len(found[1]) + 1, len(found[2]))
    return None


def _mark(mark: yaml.Mark | None) -> Mark | None:
    return None if mark is None else Mark(mark.line + 1, mark.column + 1)


# Reading on behind a mistake of syntax: its line is mended as it was meant, or left out, and the rest is read.

MAX_REPAIR_LENGTH = 20_000
"""Maximum length of a text to repair, since each try parses all of it."""

ODD_SPACES = "\u00a0\u2007\u202f\u3000"
_LEADING = re.compile(rf"^[ {ODD_SPACES}-]*[{ODD_SPACES}]|^[ -]*\w+:[{ODD_SPACES}]+")
_WORD_ALONE = re.compile(r"( *(?:- +)*\w+) *(#.*)?")
_WORDS = re.compile(r"( *(?:- +)*\w+) +([^\s:#-].*)")
_VALUE = re.compile(r"( *(?:- +)*\w+: +)(.+)")
_EXPRESSION = re.compile(r"\$\{[^{}\"']*\}")
_BLOCK = re.compile(r" *(?:- +)*")


@dataclass(frozen=True, slots=True)
class RepairedText:
    """Text that the parser can read further; ``lines`` (from 1) were changed.

    ``torn`` is true if something was left out or may be in the wrong place, so that later errors are doubtful.
    """

    text: str
    lines: frozenset[int]
    torn: bool


def replace_odd_spaces(source: SourceText) -> tuple[str, list[Diagnostic]]:
    """Return the text with plain spaces at the beginning of lines and values, and an error for each line changed."""
    faults, lines = [], source.text.splitlines(keepends=True)
    for at, line in enumerate(lines):
        found = _LEADING.match(line)
        if found is not None and not found[0].isascii():
            lines[at] = re.sub(f"[{ODD_SPACES}]", " ", found[0]) + line[found.end() :]
            odd = next(place for place, sign in enumerate(line) if sign in ODD_SPACES)
            mark = Mark(at + 1, odd + 1)
            message = f"a non-breaking space (U+{ord(line[odd]):04X}), which YAML treats as a letter"
            faults.append(Diagnostic(source, mark, message, "write a normal space", frozenset({at + 1})))
    return "".join(lines), faults


def repair(text: str, fault: Diagnostic, line: int) -> RepairedText | None:
    """Return the repair after which the text can be read furthest, or None.

    ``fault`` is the diagnostic of the error that the parser found in ``line``.
    """
    if len(text) > MAX_REPAIR_LENGTH:
        return None
    lines = text.splitlines()
    best, furthest = None, fault.mark.line
    for first, new, torn in _repair_candidates(lines, fault.mark.line - 1, min(line, len(lines)) - 1):
        changed = "\n".join([*lines[:first], *new, *lines[first + len(new) :]]) + "\n"
        next_one = _first_error_line(changed)
        if next_one is None or next_one > furthest:
            best = RepairedText(changed, frozenset(range(first + 1, first + len(new) + 1)), torn)
            furthest = len(lines) + 1 if next_one is None else next_one
        if next_one is None:
            break
    return best


def _first_error_line(text: str) -> int | None:
    """Return the line (from 1) of the first syntax error, or None."""
    try:
        for _ in events(text):
            pass
    except yaml.YAMLError as error:
        return syntax_diagnostic(SourceText("", text), error).mark.line
    return None


def _repair_candidates(lines: list[str], begin: int, found: int) -> Iterator[tuple[int, list[str], bool]]:
    """Yield possible repairs: first changed line, new lines, and whether the text is then torn.

    ``begin`` is the line of the error, ``found`` the line in which the parser found it (from 0).
    """
    places = list(dict.fromkeys(place for place in (begin, found, _above(lines, found)) if 0 <= place < len(lines)))
    for place in places:
        line = lines[place]
        quoted = _EXPRESSION.sub(lambda hole: f'"{hole[0]}"', line)
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
    """Yield the possible repairs of a line that lacks a colon."""
    if (alone := _WORD_ALONE.fullmatch(line)) is not None:
        yield f"{alone[1]}:"
    if (words := _WORDS.fullmatch(line)) is not None:
        yield f"{words[1]}: {words[2]}"


def _above(lines: list[str], place: int) -> int:
    """Return the index of the last non-empty line before line ``place``, or -1."""
    return next((at for at in range(place - 1, -1, -1) if lines[at].strip()), -1)


def _end(lines: list[str], place: int) -> int:
    """Return the index of the line after the block of deeper indented lines under line ``place``."""
    for at in range(place + 1, len(lines)):
        if lines[at].strip() and _indent(lines[at]) <= _indent(lines[place]):
            return at
    return len(lines)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip(" "))


def _indents(lines: list[str], place: int) -> list[int]:
    """Return the columns at which text begins in the lines above, nearest lines first."""
    columns: dict[int, None] = {}
    for at in range(place - 1, max(-1, place - 10), -1):
        found = _BLOCK.match(lines[at])
        if lines[at].strip() and found is not None:
            columns[found.end()] = None
            columns[_indent(lines[at])] = None
    return list(columns)
