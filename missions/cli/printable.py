"""Text that is safe to print: control codes are escaped.

Names, reasons and texts come from missions, records, tasks and networks. An escape code among them could set colours,
clear the screen or forge lines; a change of the writing direction could disguise a name.
"""

import codecs
import io
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TextIO, cast

import click

# Tables on a terminal: rows below headings, each column as wide as its widest cell.


def format_columns(
    headings: Sequence[str], rows: Sequence[Sequence[str]], *, left: frozenset[str] = frozenset()
) -> str:
    """Return a table as text; columns are right-aligned, except those whose heading is in ``left``."""
    widths = [max(len(row[number]) for row in (headings, *rows)) for number in range(len(headings))]
    lines = []
    for row in (headings, *rows):
        cells = [
            word.ljust(width) if heading in left else word.rjust(width)
            for word, width, heading in zip(row, widths, headings, strict=True)
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


_CONTROL_CODES = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]|\r(?!\n)")
"""C0 and C1 control codes except tab and newline, line separators, and codes of the writing direction."""


def make_printable(text: str) -> str:
    """Return a text with its control codes escaped as in JSON, so that JSON text keeps its meaning."""
    return _CONTROL_CODES.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def make_all_printable(data: Any) -> Any:
    """Return JSON data with every text in it made printable."""
    match data:
        case str():
            return make_printable(data)
        case list():
            return [make_all_printable(each) for each in data]
        case dict():
            return {make_all_printable(key): make_all_printable(each) for key, each in data.items()}
        case _:
            return data


class PrintableStream:
    """A text stream that escapes control codes; all other members are those of the stream ``raw``."""

    def __init__(self, raw: TextIO) -> None:
        self.raw = raw

    def write(self, text: str) -> int:
        """Write a text with its control codes escaped."""
        return self.raw.write(make_printable(text))

    def writelines(self, lines: Any) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.raw, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.raw)


def unwrap_stream(stream: TextIO) -> TextIO:
    """Return the stream inside a PrintableStream, for callers that write control codes of their own.

    Other streams are returned unchanged.
    """
    return stream.raw if isinstance(stream, PrintableStream) else stream


@contextmanager
def use_printable_streams() -> Iterator[None]:
    """Escape control codes in everything that this process prints on stdout and stderr within the context."""
    before = sys.stdout, sys.stderr
    for stream in before:
        if isinstance(stream, io.TextIOWrapper):
            # A character that the terminal cannot encode must not raise. click replaces an ASCII terminal's stream.
            ascii_only = codecs.lookup(stream.encoding).name == "ascii"
            stream.reconfigure(encoding="utf-8" if ascii_only else stream.encoding, errors="replace")
    sys.stdout, sys.stderr = (cast(TextIO, PrintableStream(stream)) for stream in before)
    try:
        yield
    finally:
        for name, stream in zip(("stdout", "stderr"), before, strict=True):
            if getattr(sys, name) is not None:  # stdout may be closed by its reader
                setattr(sys, name, stream)


# A line that is printed over itself on a terminal.

LINE_WIDTH = 78
"""Columns of an overwritten line; a longer one would wrap."""


def overwrite_line(line: str, *, err: bool = False) -> None:
    """Replace the current line of stdout, or of stderr, by ``line``, cut to ``LINE_WIDTH``."""
    click.echo(
        f"\r\x1b[K{make_printable(line)[:LINE_WIDTH]}", nl=False, file=unwrap_stream(sys.stderr if err else sys.stdout)
    )
