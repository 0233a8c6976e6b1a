"""``--studio``: a studio in a process of its own beside a run or the task server."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from missions.cli.session import RunSession
from missions.plugins.studio.options import StudioOptions

END_TIMEOUT = 5.0
"""Seconds for the studio to end before it is killed. Its end stops no run, since runs are processes of their own."""


@contextmanager
def serving_studio() -> Iterator[None]:
    """Serve a studio in a process of its own inside the context; it ends with this process, even after a crash.

    It prints its links on stderr. If it cannot start, it prints the reason, and the caller goes on without a studio.
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
    """Return the context that serves a studio during a run; it does nothing without ``--studio``."""
    del options, session
    return serving_studio()
