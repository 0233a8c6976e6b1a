"""Fixtures of the tests of missions."""

import signal
from collections.abc import Iterator

import pytest

from tests.missions.command import Process
from tests.missions.testing.playing import play_here


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `mission test` play its cases in this process: a process of its own takes 0.8 s of CPU to start."""
    monkeypatch.setattr("missions.plugins.testing.commands.test.play_all", play_here)


@pytest.fixture(autouse=True)
def _ended() -> Iterator[None]:
    """End with a test that has failed what it has left running, lest the next one be blamed for it."""
    before = set(Process.running)
    yield
    for process in Process.running - before:
        process.end(signal.SIGKILL)
