"""The one way to colours, tables and lines that move: consoles whose texts hold nothing that a terminal obeys."""

import sys
from collections.abc import Iterable
from typing import TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

from missions.views.printable import printable, terminal


class PrintableConsole(Console):
    """A console of rich: its own codes reach the terminal, those within texts are written out."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Return what is to be written, each text of it made printable."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))


def console(out: TextIO | None = None, *, highlight: bool = False, soft_wrap: bool = False) -> PrintableConsole:
    """Return a console on ``out``, or on stdout."""
    return PrintableConsole(file=terminal(out or sys.stdout), highlight=highlight, soft_wrap=soft_wrap)


def echo(text: str, style: str, *more: str) -> None:
    """Print a line on stdout: ``text`` in that style, and ``more`` behind it."""
    console(soft_wrap=True).print(Text.assemble((text, style), *more))
