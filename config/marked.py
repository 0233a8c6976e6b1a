"""YAML with positions: a small tree of nodes that know where in the file they stand.

Built from the parser's events with a stack of our own, so that depth, aliases and duplicate keys are under control,
and plain words stay words: only ``true``, ``false``, ``null`` and numbers are anything but text (YAML 1.2's core, not
1.1, where ``on`` and ``yes`` are booleans and ``12:30`` is a number in base 60).
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from config.faults import Fault, InvalidFileError, Mark, Source

MAX_BYTES = 1_000_000
MAX_DEPTH = 60
MAX_NODES = 50_000

Plain = str | int | float | bool | None


@dataclass(slots=True)
class Scalar:
    """A word, number or text; ``text`` as it was written, ``value`` as it is meant."""

    mark: Mark
    text: str
    value: Plain
    quoted: bool = False


@dataclass(slots=True)
class Listing:
    """A YAML sequence."""

    mark: Mark
    items: "list[Node]" = field(default_factory=list)


@dataclass(slots=True)
class Mapping:
    """A YAML mapping, in the order of the file; keys are scalars and unique."""

    mark: Mark
    entries: "list[tuple[Scalar, Node]]" = field(default_factory=list)

    def get(self, key: str) -> "Node | None":
        """Return the value of ``key``, None where it is missing."""
        return next((value for name, value in self.entries if name.text == key), None)

    def keys(self) -> Iterator[str]:
        """The keys as written."""
        return (name.text for name, _ in self.entries)


Node = Scalar | Listing | Mapping


def read_source(path: Path, name: str | None = None) -> Source:
    """Read a text file for ``compose``. Raises InvalidFileError: missing, too large, not UTF-8."""
    shown = name if name is not None else str(path)
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InvalidFileError([Fault(Source(shown, ""), Mark(), f"cannot be read: {reason}")]) from error
    if len(data) > MAX_BYTES:
        raise InvalidFileError([Fault(Source(shown, ""), Mark(), f"larger than {MAX_BYTES:,} bytes")])
    try:
        return Source(shown, data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        good = data[: error.start].decode("utf-8-sig", errors="replace")
        line, column = good.count("\n") + 1, len(good) - (good.rfind("\n") + 1) + 1
        source = Source(shown, data.decode("utf-8", errors="replace"))
        message = f"not UTF-8: byte 0x{data[error.start]:02x}"
        raise InvalidFileError([Fault(source, Mark(line, column), message, "save the file as UTF-8")]) from error


def compose(source: Source) -> Node:
    """Parse ``source`` into nodes. Raises InvalidFileError for anything that is not one plain YAML document."""
    composer = _Composer(source)
    try:
        for event in yaml.parse(source.text, Loader=_LOADER):
            composer.take(event)
    except _FatalFaultError:
        pass  # noted in composer.faults already
    except yaml.YAMLError as error:
        composer.faults.append(_syntax(source, error))
    if composer.faults:
        raise InvalidFileError(composer.faults)
    if composer.root is None:
        raise InvalidFileError([Fault(source, Mark(), "the file is empty")])
    return composer.root


# libyaml's parser is several times faster; PyYAML without it has the same events.
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_NUMBER = re.compile(r"[-+]?(\d[\d_]*)(\.\d*)?([eE][-+]?\d+)?|[-+]?\.\d+([eE][-+]?\d+)?")
_WORDS: dict[str, Plain] = {"true": True, "false": False, "null": None, "~": None, "": None}


class _FatalFaultError(Exception):
    """Raised to leave the parser's loop."""


class _Composer:
    """Turns parser events into nodes. ``faults`` gathers what is wrong; the fatal ones end the parse."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.faults: list[Fault] = []
        self.root: Node | None = None
        self._open: list[Mapping | Listing] = []
        self._keys: list[Scalar | None] = []  # the key that waits for its value, for each open collection
        self._anchors: dict[str, Node] = {}
        self._sizes: dict[int, int] = {}
        self._count = 0

    def take(self, event: Any) -> None:
        mark = _mark(event)
        match event:
            case yaml.ScalarEvent():
                quoted = bool(event.style)
                scalar = Scalar(mark, event.value, event.value if quoted else plain(event.value), quoted)
                self._anchor(event.anchor, scalar)
                self._add(scalar)
            case yaml.SequenceStartEvent() | yaml.MappingStartEvent():
                node: Mapping | Listing = Mapping(mark) if isinstance(event, yaml.MappingStartEvent) else Listing(mark)
                if len(self._open) >= MAX_DEPTH:
                    self._fatal(mark, f"nested more than {MAX_DEPTH} deep")
                self._open.append(node)
                self._keys.append(None)
                self._sizes[id(node)] = self._count
                self._anchor(event.anchor, node)
            case yaml.SequenceEndEvent() | yaml.MappingEndEvent():
                node = self._open.pop()
                self._keys.pop()
                self._sizes[id(node)] = self._count - self._sizes[id(node)] + 1
                self._add(node)
            case yaml.AliasEvent():
                self._alias(event.anchor, mark)
            case yaml.DocumentStartEvent() if self.root is not None:
                self._fatal(mark, "a second document begins here", "keep one mission in one file")
            case _:
                pass

    def _anchor(self, name: str | None, node: Node) -> None:
        if name is not None:
            self._anchors[name] = node

    def _alias(self, name: str | None, mark: Mark) -> None:
        node = self._anchors.get(name or "")
        if node is None:
            self._fatal(mark, f"unknown alias '*{name}'")
            return
        if any(node is outer for outer in self._open):
            self._fatal(mark, f"alias '*{name}' stands inside what it names")
        # An alias costs what it expands to: this is what makes a "YAML bomb" harmless.
        self._count += self._sizes.get(id(node), 1) - 1
        self._add(node, at=mark)

    def _add(self, node: Node, *, at: Mark | None = None) -> None:
        self._count += 1
        if self._count > MAX_NODES:
            self._fatal(at or node.mark, f"more than {MAX_NODES:,} nodes, aliases counted")
        if not self._open:
            self.root = node
            return
        parent, key = self._open[-1], self._keys[-1]
        if isinstance(parent, Listing):
            parent.items.append(node)
        elif key is None:
            self._keys[-1] = self._as_key(node, at or node.mark)
        else:
            if key.text in parent.keys():  # noqa: SIM118 - Mapping is ours: `in` would look for a node
                first = next(name for name, _ in parent.entries if name.text == key.text)
                self.faults.append(
                    Fault(self.source, key.mark, f"'{key.text}' stands here again (first at line {first.mark.line})")
                )
            parent.entries.append((key, node))
            self._keys[-1] = None

    def _as_key(self, node: Node, mark: Mark) -> Scalar:
        if isinstance(node, Scalar):
            return Scalar(mark, node.text, node.value, node.quoted)
        self.faults.append(
            Fault(self.source, mark, "a key must be a plain word", 'write "${...}" in quotes inside { } and [ ]')
        )
        return Scalar(mark, "?", None)

    def _fatal(self, mark: Mark, message: str, suggestion: str = "") -> None:
        self.faults.append(Fault(self.source, mark, message, suggestion))
        raise _FatalFaultError


def plain(text: str) -> Plain:
    """Return what an unquoted word means: a number, true, false, null, or the text itself."""
    if text in _WORDS:
        return _WORDS[text]
    if _NUMBER.fullmatch(text):
        digits = text.replace("_", "")
        try:
            return int(digits)
        except ValueError:
            return float(digits)
    return text


def _mark(event: Any) -> Mark:
    start, end = event.start_mark, event.end_mark
    if start is None:
        return Mark()
    length = end.column - start.column if end.line == start.line else 1
    return Mark(start.line + 1, start.column + 1, max(1, length))


def _syntax(source: Source, error: yaml.YAMLError) -> Fault:
    """Say what the parser stumbled on, in words that help."""
    if isinstance(error, yaml.reader.ReaderError):
        before = source.text[: error.position]
        mark = Mark(before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1)
        return Fault(source, mark, f"a character that YAML does not allow: {error.character!r}")
    where = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    mark = Mark(where.line + 1, where.column + 1) if where is not None else Mark()
    line = source.line(mark.line)
    problem = getattr(error, "problem", None) or str(error)
    if "\t" in line[: len(line) - len(line.lstrip())] or "'\\t'" in problem:
        column = line.find("\t") + 1 or mark.column
        return Fault(source, Mark(mark.line, column), "a tab in the indentation", "indent with blanks")
    bare = _bare_word_above(source, mark.line)
    if bare is not None:
        word, place = bare
        return Fault(source, place, f"'{word}' has something beside it, so it needs a colon", f"write '- {word}:'")
    suggestion = ""
    if "${" in line and ("{" in line.replace("${", "") or "[" in line):
        suggestion = 'inside { } and [ ], put quotes around "${...}"'
    elif ": " in line.partition(": ")[2]:
        suggestion = "put quotes around a text that contains ': '"
    return Fault(source, mark, f"not YAML: {problem}", suggestion)


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
