"""A studio beside another command: ``mission run --studio``, ``mission serve --studio``."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import click

FAREWELL = 5.0
"""Seconds that the studio has to end; then it is killed, which stops no run."""

studio_option = click.option("--studio", is_flag=True, help="Serve the page of `mission studio` meanwhile.")


@contextmanager
def studio_beside(*, wanted: bool) -> Iterator[None]:
    """Serve a studio, in a process of its own, while this is entered; it ends with this process, however that ends.

    It says its links on stderr. One that cannot be served says why, and the command goes on without.
    """
    if not wanted:
        yield
        return
    reading, writing = os.pipe()
    command = [sys.executable, "-m", "missions", "studio", "--leash", str(reading)]
    studio = subprocess.Popen(  # noqa: S603 - ourselves
        command, stdin=subprocess.DEVNULL, stdout=sys.stderr, pass_fds=(reading,), start_new_session=True
    )
    os.close(reading)
    try:
        yield
    finally:
        os.close(writing)
        try:
            studio.wait(FAREWELL)
        except subprocess.TimeoutExpired:
            studio.kill()
            studio.wait()
