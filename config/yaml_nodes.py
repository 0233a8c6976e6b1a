"""YAML parser with positions: a small tree of nodes that know their line number and column.

The tree is built from the parser's events with a stack of our own, which bounds depth, aliases and duplicate keys. All
words except ``true``, ``false``, ``null`` and numbers are texts, as in the core of YAML 1.2. (In YAML 1.1, ``on`` and
``yes`` are booleans and ``12:30`` is a number in base 60.)
"""

import math
import re
from collections.abc import Iterator
from dataclasses import field, replace
from errno import EFBIG
from pathlib import Path
from typing import Any, NoReturn

import yaml

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText, add_diagnostic, mark_at
from config.file_io import read_regular, record_read
from config.syntax import events, forbidden_character, problem_line, syntax_diagnostic
from drivers.api.fast_dataclass import dataclass

MAX_BYTES = 1_000_000
MAX_DEPTH = 60
MAX_NODES = 50_000
MAX_REPAIRED_ERRORS = 8
"""Number of syntax errors in one file after which parsing stops."""

Plain = str | int | float | bool | None


@dataclass(slots=True)
class Scalar:
    """YAML word, number or text: ``text`` as written, ``value`` as parsed."""

    mark: Mark
    text: str
    value: Plain
    quoted: bool = False


@dataclass(slots=True)
class Listing:
    """YAML sequence (a list) with the positions of its items."""

    mark: Mark
    items: "list[Node]" = field(default_factory=list)


@dataclass(slots=True)
class Mapping:
    """YAML mapping in the order of the file; keys are scalars and unique.

    ``torn`` is true if a line of the file could not be read, so that keys may be missing.
    """

    mark: Mark
    entries: "list[tuple[Scalar, Node]]" = field(default_factory=list)
    torn: bool = False

    def get(self, key: str) -> "Node | None":
        """Return the value of ``key``, or None."""
        return next((value for name, value in self.entries if name.text == key), None)

    def keys(self) -> Iterator[str]:
        """Return the keys as written."""
        return (name.text for name, _ in self.entries)


Node = Scalar | Listing | Mapping


def read_source(path: Path, name: str | None = None) -> SourceText:
    """Read a text file for ``compose``. Raises InvalidFileError: missing, too large, not UTF-8."""
    label = name if name is not None else str(path)
    try:
        data = read_regular(path, MAX_BYTES)
    except OSError as error:
        reason = error.strerror or str(error)
        reason = reason if error.errno == EFBIG else f"cannot be read: {reason}"
        raise InvalidFileError([Diagnostic(SourceText(label, ""), Mark(), reason)]) from error
    record_read(path, data)
    try:
        return SourceText(label, data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        good = data[: error.start].decode("utf-8-sig", errors="replace")
        fault = Diagnostic(
            SourceText(label, data.decode("utf-8-sig", errors="replace")),
            mark_at(good, len(good)),
            f"not UTF-8: byte 0x{data[error.start]:02x}",
            "save the file as UTF-8",
        )
        raise InvalidFileError([fault]) from error


def compose(source: SourceText, faults: list[Diagnostic] | None = None, *, empty_hint: str = "") -> Node:
    """Parse ``source`` into nodes. Raises InvalidFileError for anything but one plain YAML document.

    With ``faults``, errors after which the rest can still be read (a duplicate key, a missing colon) are added to it
    instead. ``empty_hint`` says what to write into an empty file.
    """
    if (forbidden := forbidden_character(source)) is not None:
        raise InvalidFileError([forbidden])
    text, found = source.text, list[Diagnostic]()
    if not text.isascii():
        from config.syntax import replace_odd_spaces  # noqa: PLC0415 - most files need no mending

        text, found = replace_odd_spaces(source)
    composer = _compose_text(source, text, found, mending=faults is not None)
    if composer.root is None:
        raise InvalidFileError(found or [Diagnostic(source, Mark(), "the file is empty", empty_hint)])
    collected: list[Diagnostic] = [] if faults is None else faults
    for each in (*found, *composer.faults):
        add_diagnostic(collected, each)
    if faults is None and collected:
        raise InvalidFileError(collected)
    return composer.root


def _compose_text(source: SourceText, text: str, found: list[Diagnostic], *, mending: bool) -> "_Composer":
    """Compose ``text``, and with ``mending`` repair syntax errors; the errors are added to ``found``.

    Raises InvalidFileError if that fails.
    """
    torn = False
    for _ in range(MAX_REPAIRED_ERRORS + 1):
        composer = _Composer(source, torn=torn)
        try:
            for event in events(text):
                composer.take(event)
        except _FatalFaultError:
            raise InvalidFileError([*found, *composer.faults]) from None
        except yaml.YAMLError as error:
            fault = syntax_diagnostic(SourceText(source.name, text), error)
            from config.syntax import repair  # noqa: PLC0415 - as above

            better = repair(text, fault, problem_line(error)) if mending else None
            if not torn:  # what follows from a line that was left out is no mistake
                found.append(
                    replace(fault, source=source, repaired_lines=frozenset() if better is None else better.lines)
                )
            if better is None:
                raise InvalidFileError([*composer.faults, *found]) from error
            text, torn = better.text, torn or better.torn
        else:
            return composer
    raise InvalidFileError(found)


_DIGITS = "[0-9]+(?:_[0-9]+)*"
_NUMBER = re.compile(rf"[-+]?(?:{_DIGITS}(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_WORDS: dict[str, Plain] = {"true": True, "false": False, "null": None, "~": None, "": None}


class _FatalFaultError(Exception):
    """Raised inside the composer to end the parse after a fatal error."""


@dataclass(slots=True)
class _OpenCollection:
    """YAML collection being read. ``key`` is waiting for its value; ``before`` is the number of nodes before it."""

    node: Mapping | Listing
    before: int
    anchor: str | None = None
    key: Scalar | None = None
    height: int = 1
    keys: dict[str, int] = field(default_factory=dict)
    """Line of the file of each key read so far."""


@dataclass(slots=True)
class _AnchoredNode:
    """YAML node with an anchor: number of nodes including itself, and nesting depth."""

    node: Node
    size: int = 1
    height: int = 0


class _Composer:
    """Builds nodes from parser events. Errors are collected in ``faults``; fatal errors end the parse."""

    def __init__(self, source: SourceText, *, torn: bool = False) -> None:
        self.source = source
        self._torn = torn
        self.faults: list[Diagnostic] = []
        self.root: Node | None = None
        self._open: list[_OpenCollection] = []
        self._anchors: dict[str, _AnchoredNode] = {}
        self._count = 0

    def take(self, event: Any) -> None:
        mark = _mark(event)
        match event:
            case yaml.ScalarEvent():
                self._no_tag(event.tag, mark)
                quoted = bool(event.style)
                scalar = Scalar(mark, event.value, event.value if quoted else plain_value(event.value), quoted)
                self._anchor(event.anchor, scalar)
                self._add(scalar, mark)
            case yaml.SequenceStartEvent() | yaml.MappingStartEvent():
                self._no_tag(event.tag, mark)
                mapping = isinstance(event, yaml.MappingStartEvent)
                node: Mapping | Listing = Mapping(mark, torn=self._torn) if mapping else Listing(mark)
                self._open.append(_OpenCollection(node, self._count, event.anchor))
                self._check_depth(mark, 0)
                self._anchor(event.anchor, node)
            case yaml.SequenceEndEvent() | yaml.MappingEndEvent():
                self._close(self._open.pop())
            case yaml.AliasEvent():
                self._alias(event.anchor, mark)
            case yaml.DocumentStartEvent() if self.root is not None:
                self._fatal(mark, "a second document begins here", "keep each in a file of its own")
            case _:
                pass

    def _no_tag(self, tag: str | None, mark: Mark) -> None:
        if tag is not None:
            hint = "put quotes around a text that begins with '!'"
            add_diagnostic(self.faults, Diagnostic(self.source, mark, "YAML tags are not supported", hint))

    def _check_depth(self, mark: Mark, more: int) -> None:
        if len(self._open) + more > MAX_DEPTH:
            self._fatal(mark, f"nested more than {MAX_DEPTH} deep")

    def _anchor(self, name: str | None, node: Node) -> None:
        if name is not None:
            self._anchors[name] = _AnchoredNode(node)

    def _close(self, closed: _OpenCollection) -> None:
        anchored = self._anchors.get(closed.anchor or "")
        if anchored is not None and anchored.node is closed.node:
            anchored.size, anchored.height = self._count - closed.before + 1, closed.height
        self._add(closed.node, closed.node.mark, height=closed.height)

    def _alias(self, name: str | None, mark: Mark) -> None:
        found = self._anchors.get(name or "")
        if found is None:
            self._fatal(mark, f"unknown alias '*{name}'", "put quotes around a text that begins with '*'")
        if any(found.node is outer.node for outer in self._open):
            self._fatal(mark, f"alias '*{name}' refers to itself")
        # An alias costs what it expands to: this is what makes a "YAML bomb" harmless.
        self._check_depth(mark, found.height)
        self._count += found.size - 1
        self._add(found.node, mark, height=found.height)

    def _add(self, node: Node, mark: Mark, *, height: int = 0) -> None:
        self._count += 1
        if self._count > MAX_NODES:
            self._fatal(mark, f"more than {MAX_NODES:,} nodes, including aliases")
        if not self._open:
            self.root = node
            return
        parent = self._open[-1]
        parent.height = max(parent.height, height + 1)
        if isinstance(parent.node, Listing):
            parent.node.items.append(node)
        elif parent.key is None:
            parent.key = self._as_key(node, mark)
        else:
            self._check_twice(parent, parent.key)
            parent.node.entries.append((parent.key, node))
            parent.key = None

    def _check_twice(self, parent: _OpenCollection, key: Scalar) -> None:
        if key.text in parent.keys:
            message = f"'{key.text}' is a duplicate key (first at line {parent.keys[key.text]})"
            add_diagnostic(self.faults, Diagnostic(self.source, key.mark, message))
        parent.keys.setdefault(key.text, key.mark.line)

    def _as_key(self, node: Node, mark: Mark) -> Scalar:
        if isinstance(node, Scalar):
            return Scalar(mark, node.text, node.value, node.quoted)
        hint = 'write "${...}" in quotes inside { } and [ ]'
        add_diagnostic(self.faults, Diagnostic(self.source, mark, "a key must be a plain word", hint))
        return Scalar(mark, "?", None)

    def _fatal(self, mark: Mark, message: str, suggestion: str = "") -> NoReturn:
        self.faults.append(Diagnostic(self.source, mark, message, suggestion))
        raise _FatalFaultError


def plain_value(text: str) -> Plain:
    """Return the value of an unquoted word: a number, true, false, null, or the text itself."""
    if text in _WORDS:
        return _WORDS[text]
    if not _NUMBER.fullmatch(text):
        return text
    digits = text.replace("_", "")
    number = float(digits)
    if not math.isfinite(number):  # nobody means that: it stays a word, which is no number where one is needed
        return text
    return int(digits) if digits.lstrip("-+").isdigit() else number


def _mark(event: Any) -> Mark:
    start, end = event.start_mark, event.end_mark
    if start is None:
        return Mark()
    length = end.column - start.column if end.line == start.line else 1
    return Mark(start.line + 1, start.column + 1, max(1, length))
