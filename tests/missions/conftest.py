"""What a test that failed has left running is ended with it, lest the next one be blamed for it."""

import signal
from collections.abc import Iterator

import pytest

from tests.missions.command import Process


@pytest.fixture(autouse=True)
def _ended() -> Iterator[None]:
    before = set(Process.running)
    yield
    for process in Process.running - before:
        process.end(signal.SIGKILL)
