"""A robot of a fleet whose disk or wire fails at the worst moment: it stays stopped, and stays in the fleet."""

import os
from pathlib import Path

import pytest

from drivers.clock import ManualClock
from missions.service.fleet.latch import FleetLatch
from missions.service.fleet.member import Member, Own
from missions.service.fleet.roster import Roster
from missions.service.fleet.words import Address, Answer, Met
from tests.missions.service.fleets import CountingBody
from tests.missions.service.test_fleet_operator import Fleet


def test_a_robot_is_stopped_until_its_release_is_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    latch, seen = FleetLatch(tmp_path), list[bool]()
    number, keep = latch.stop("me")
    assert keep() == ""
    monkeypatch.setattr(os, "fsync", lambda _: seen.append(latch.stopped))
    assert latch.release(number)
    assert all(seen)
    assert seen
    assert not latch.stopped
    again = FleetLatch(tmp_path)
    again.load()
    assert not again.stopped


def test_a_robot_stays_in_its_fleet_when_an_answer_cannot_be_sent(tmp_path: Path) -> None:
    clock, answers = ManualClock(), list[Answer]()
    own = Own(Address("anna", "0000000a"), "note")
    member = Member(own, Fleet(), Roster(clock), CountingBody(), FleetLatch(tmp_path), clock=clock)

    def cut(_: Answer) -> None:
        raise OSError("the session is closed")

    member._asked(Met(), cut)
    member._asked(Met(), answers.append)
    member.turn()
    assert answers == [Answer()]
