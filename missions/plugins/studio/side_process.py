"""A studio beside a run, or beside the server of tasks: ``--studio``."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from missions.cli.session import RunSession
from missions.plugins.studio.options import StudioOptions

END_TIMEOUT = 5.0
"""Seconds that the studio has to end; then it is killed, which stops no run."""


@contextmanager
def serving_studio() -> Iterator[None]:
    """Serve a studio, in a process of its own, while this is entered; it ends with this process, however that ends.

    It says its links on stderr. One that cannot be served says why, and the command goes on without.
    """
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
            studio.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            studio.kill()
            studio.wait()


def studio_beside(options: StudioOptions, session: RunSession) -> AbstractContextManager[None]:
    """Serve a studio while a run goes on."""
    del options, session
    return serving_studio()
