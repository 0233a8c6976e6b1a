"""Text as it may go to a terminal: with nothing in it that a terminal obeys.

Names, reasons and texts come from missions, records, tasks and networks. An escape code among them would set colours,
clear the screen or forge lines; a change of the direction of writing would show a name as another one.
"""

import codecs
import io
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TextIO, cast

import click

# Tables on a terminal: rows of words under their headings, each column as wide as it must be.


def format_columns(
    headings: Sequence[str], rows: Sequence[Sequence[str]], *, left: frozenset[str] = frozenset()
) -> str:
    """Return lines with the headings above; columns are aligned to the right but those named in ``left``."""
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
"""Control codes of both sets but tab and new line, separators of lines, and what turns the direction of writing."""


def make_printable(text: str) -> str:
    """Return a text with every code that a terminal obeys written out, as JSON does it, which stays the same JSON."""
    return _CONTROL_CODES.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def make_all_printable(data: Any) -> Any:
    """Return what was read from JSON with every text in it made printable."""
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
    """A text stream that writes out what a terminal would obey; in all else it is the stream ``raw``."""

    def __init__(self, raw: TextIO) -> None:
        self.raw = raw

    def write(self, text: str) -> int:
        """Write a text, made printable."""
        return self.raw.write(make_printable(text))

    def writelines(self, lines: Any) -> None:
        """Write texts, made printable."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.raw, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.raw)


def unwrap_stream(stream: TextIO) -> TextIO:
    """Return the stream behind a printable one, for who writes codes of our own and makes all else printable."""
    return stream.raw if isinstance(stream, PrintableStream) else stream


@contextmanager
def use_printable_streams() -> Iterator[None]:
    """Have all that this process prints made printable: ours, that of libraries, and errors."""
    before = sys.stdout, sys.stderr
    for stream in before:
        if isinstance(stream, io.TextIOWrapper):
            # A terminal that has no sign for what we print is no reason to stop; of ASCII, click makes a stream anew.
            ascii_only = codecs.lookup(stream.encoding).name == "ascii"
            stream.reconfigure(encoding="utf-8" if ascii_only else stream.encoding, errors="replace")
    sys.stdout, sys.stderr = (cast(TextIO, PrintableStream(stream)) for stream in before)
    try:
        yield
    finally:
        for name, stream in zip(("stdout", "stderr"), before, strict=True):
            if getattr(sys, name) is not None:  # the reader of our output may have gone
                setattr(sys, name, stream)


# A line that is shown again and again in one place of a terminal.

LINE_WIDTH = 78
"""Columns of such a line: a longer one would wrap, and could not be written over."""


def overwrite_line(line: str, *, err: bool = False) -> None:
    """Show ``line``, as far as it fits, in the place of the one before; on stderr if ``err``."""
    click.echo(
        f"\r\x1b[K{make_printable(line)[:LINE_WIDTH]}", nl=False, file=unwrap_stream(sys.stderr if err else sys.stdout)
    )
