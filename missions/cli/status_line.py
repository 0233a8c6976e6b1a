"""A line that is shown again and again in one place of a terminal."""

import sys

import click

from missions.views.printable import printable, terminal

WIDTH = 78
"""Columns of such a line: a longer one would wrap, and could not be written over."""


def show_over(line: str, *, err: bool = False) -> None:
    """Show ``line``, as far as it fits, in the place of the one before; on stderr if ``err``."""
    click.echo(f"\r\x1b[K{printable(line)[:WIDTH]}", nl=False, file=terminal(sys.stderr if err else sys.stdout))
