"""A robot of a fleet whose disk or wire fails at the worst moment: it stays stopped, and stays in the fleet."""

import errno
import json
import os
import stat
from pathlib import Path
from threading import enumerate as enumerate_threads

import pytest

from drivers.clock import ManualClock
from missions.plugins.fleet.member import STOP_QUIET_RANGE, FleetMember, RobotInfo
from missions.plugins.fleet.messages import Address, FleetAnswer, FleetStop, ListPeers
from missions.plugins.fleet.zenoh_transport import Roster
from missions.plugins.tasks.fleet_latch import FleetLatch
from tests.missions.service.fleets import CountingBody
from tests.missions.service.test_fleet_operator import Fleet


def test_robot_stays_latched_until_the_release_is_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    latch, seen = FleetLatch(tmp_path), list[bool]()
    number, keep = latch.stop("me")
    assert keep() == ""
    monkeypatch.setattr(os, "fsync", lambda _: seen.append(latch.is_latched))
    assert latch.release(number)
    assert all(seen)
    assert seen
    assert not latch.is_latched
    again = FleetLatch(tmp_path)
    again.load()
    assert not again.is_latched


def test_unreadable_latch_file_counts_as_stopped(tmp_path: Path) -> None:
    (tmp_path / "folder").write_text("a file in the way", encoding="utf-8")
    latch = FleetLatch(tmp_path / "folder")
    latch.load()
    assert latch.is_latched
    assert "cannot be read (NotADirectoryError)" in latch.by


def test_stop_that_cannot_be_written_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(number: int) -> None:
        if stat.S_ISDIR(os.fstat(number).st_mode):
            raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", full)
    _, keep = FleetLatch(tmp_path).stop("me")
    assert keep() == "; a restart will release it: Input/output error"


def test_member_continues_after_an_answer_cannot_be_sent(tmp_path: Path) -> None:
    clock, answers = ManualClock(), list[FleetAnswer]()
    own = RobotInfo(Address("anna", "0000000a"), "note")
    member = FleetMember(own, Fleet(), Roster(clock), CountingBody(), FleetLatch(tmp_path), clock=clock)

    def cut(_: FleetAnswer) -> None:
        raise OSError("the session is closed")

    member._queue_request(ListPeers(), cut)
    member._queue_request(ListPeers(), answers.append)
    member.run_once()
    assert answers == [FleetAnswer()]


class Told(Fleet):
    """A line that keeps what is told."""

    def __init__(self) -> None:
        super().__init__()
        self.states: list[bytes] = []

    def publish_state(self, state: bytes) -> None:
        self.states.append(state)


class Watching(CountingBody):
    """Notes which threads there are when it is stopped."""

    def stop(self, by: str) -> tuple[bool, str]:
        self.said += [each.name for each in enumerate_threads()]
        return super().stop(by)


def test_robot_stops_before_the_latch_is_written_and_publishes_later(tmp_path: Path) -> None:
    clock, line, body, answers = ManualClock(), Told(), Watching(), list[FleetAnswer]()
    own = RobotInfo(Address("anna", "0000000a"), "note")
    member = FleetMember(own, line, Roster(clock), body, FleetLatch(tmp_path), clock=clock)
    member._handle_stop(FleetStop(by="me", press="1"), answers.append)
    assert [answer.ok for answer in answers] == [True]
    assert "keep the stop" not in body.said
    member.run_once()
    assert line.states == [], "fifty that tell fifty others at once hold up each other's confirmations"
    clock.advance(STOP_QUIET_RANGE[1])
    member.run_once()
    assert [json.loads(state)["stopped"] for state in line.states] == ["me"]


def test_stop_is_stored_even_if_the_robot_cannot_be_stopped(tmp_path: Path) -> None:
    class Broken(CountingBody):
        def stop(self, by: str) -> tuple[bool, str]:
            raise OSError(by)

    clock = ManualClock()
    own = RobotInfo(Address("anna", "0000000a"), "note")
    member = FleetMember(own, Told(), Roster(clock), Broken(), FleetLatch(tmp_path), clock=clock)
    with pytest.raises(OSError, match="me"):
        member._handle_stop(FleetStop(by="me"), lambda _: None)
    for thread in enumerate_threads():
        if thread.name == "keep the stop":
            thread.join()
    again = FleetLatch(tmp_path)
    again.load()
    assert again.by == "me"


def test_repeated_stops_do_not_prevent_state_publishing(tmp_path: Path) -> None:
    clock, line = ManualClock(), Told()
    own = RobotInfo(Address("anna", "0000000a"), "note")
    member = FleetMember(own, line, Roster(clock), CountingBody(), FleetLatch(tmp_path), clock=clock)
    for number in range(40):
        member._handle_stop(FleetStop(by="me", press=str(number)), lambda _: None)
        clock.advance(0.05)
        member.run_once()
    assert [json.loads(state)["stopped"] for state in line.states][:1] == ["me"]
    assert len(line.states) > 2
