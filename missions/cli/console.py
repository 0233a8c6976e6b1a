"""Colours, tables and lines that move, by rich: consoles whose texts hold nothing that a terminal obeys."""

import sys
from collections.abc import Iterable
from typing import TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.live import Live
from rich.segment import Segment
from rich.text import Text

from missions.cli.printable import make_printable, unwrap_stream


class PrintableConsole(Console):
    """A console of rich: its own codes reach the terminal, those within texts are written out."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Return what is to be written, each text of it made printable."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=make_printable(segment.text))


def console(out: TextIO | None = None, *, highlight: bool = False, soft_wrap: bool = False) -> PrintableConsole:
    """Return a console on ``out``, or on stdout."""
    return PrintableConsole(file=unwrap_stream(out or sys.stdout), highlight=highlight, soft_wrap=soft_wrap)


def echo(text: str, style: str, *more: str) -> None:
    """Print a line on stdout: ``text`` in that style, and ``more`` behind it."""
    console(soft_wrap=True).print(Text.assemble((text, style), *more))


class LiveLines:
    """Lines of a terminal with their colours, and the one below them, which goes with ``stop``."""

    is_live = True

    def __init__(self, out: TextIO) -> None:
        self._console = console(out, soft_wrap=True)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)

    def start(self) -> None:
        """Begin to show the line below, and what others print, above it."""
        self._live.start()

    def stop(self) -> None:
        """End that."""
        self._live.stop()

    def print(self, *parts: str | tuple[str, str]) -> None:
        """Write a line of texts, each with its style or plain."""
        self._console.print(Text.assemble(*parts))

    def show(self, line: str) -> None:
        """Draw the line below, cut off where the terminal ends."""
        self._live.update(Text(line, no_wrap=True, overflow="ellipsis"), refresh=True)
