"""Colours, tables and live lines with rich; control codes within texts are escaped."""

import sys
from collections.abc import Iterable
from typing import TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.live import Live
from rich.segment import Segment
from rich.text import Text

from missions.cli.printable import make_printable, unwrap_stream


class PrintableConsole(Console):
    """A rich console that passes its own control codes to the terminal and escapes those within texts."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Return the segments to write, with the control codes inside their texts escaped."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=make_printable(segment.text))


def console(out: TextIO | None = None, *, highlight: bool = False, soft_wrap: bool = False) -> PrintableConsole:
    """Return a console that writes to ``out``, or to stdout."""
    return PrintableConsole(file=unwrap_stream(out or sys.stdout), highlight=highlight, soft_wrap=soft_wrap)


def echo(text: str, style: str, *more: str) -> None:
    """Print a line on stdout: ``text`` in the given style, then ``more``."""
    console(soft_wrap=True).print(Text.assemble((text, style), *more))


class LiveLines:
    """Lines on a terminal in colour, with a live line below them that ``stop`` removes."""

    is_live = True

    def __init__(self, out: TextIO) -> None:
        self._console = console(out, soft_wrap=True)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)

    def start(self) -> None:
        """Start showing the live line; other output appears above it."""
        self._live.start()

    def stop(self) -> None:
        """Remove the live line; the lines above it stay."""
        self._live.stop()

    def print(self, *parts: str | tuple[str, str]) -> None:
        """Write a line of texts, each plain or with a style."""
        self._console.print(Text.assemble(*parts))

    def show(self, line: str) -> None:
        """Replace the live line, cut off at the width of the terminal."""
        self._live.update(Text(line, no_wrap=True, overflow="ellipsis"), refresh=True)
