"""What recorders keep of members that no method is written for."""

from typing import Protocol

import pytest

from drivers.api import Base
from drivers.api.marks import command, commands
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from missions.plugins.testing.recorders import RecordedBase


class Horned(Base, Protocol):
    """A base with members for which no recorder has a method."""

    @property
    def loud(self) -> bool: ...

    @command("after")
    def honk(self, seconds: float, *, times: int = 1) -> None: ...

    @command("after")
    def hush(self) -> None: ...

    def pitch(self) -> float: ...


class RecordedHorned(RecordedBase):
    protocol = Horned


def test_recorder_stores_undeclared_commands_and_answers_no_queries() -> None:
    base: Horned = (recorder := RecordedHorned(ManualClock(1.0)))
    base.honk(0.5, times=2)
    base.hush()
    assert recorder.commands == [("honk", 0.5, 2), "hush"]
    assert recorder.times == [1.0, 1.0]
    recorder.trouble = NotConnected("gone")
    with pytest.raises(NotConnected, match="gone"):
        base.hush()
    with pytest.raises(NotConnected, match="its pitch is not set"):
        base.pitch()
    with pytest.raises(NotConnected, match="its loud is not set"):
        _ = base.loud
    recorder.pitch = lambda: 440.0  # type: ignore[attr-defined] # as a test may
    assert base.pitch() == 440.0
    with pytest.raises(AttributeError, match="RecordedHorned has no 'honck'"):
        _ = recorder.honck
    assert commands(Horned) - commands(Base) == {"honk", "hush"}
