"""What comes over a fleet's wire may be anything: what is not exactly a message changes nothing."""

import json
from dataclasses import asdict, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import ManualClock
from missions.codec import CodecError
from missions.plugins.fleet.line import MOST_ROBOTS, Roster
from missions.plugins.fleet.words import MAX_BYTES, Address, RobotState, Stop, address_in, as_bytes, key, read, read_ask

STATE = RobotState(session="01ab23cd", number=3, robot="turtlebot2", parts=("base",), battery=0.5, task_state="RUNNING")
WHERE = key("home", "state", "anna/0123abcd")


def test_a_state_is_read_as_it_was_written() -> None:
    assert read(RobotState, as_bytes(STATE)) == STATE


@pytest.mark.parametrize(
    "wrong",
    [
        {"number": "3"}, {"number": True}, {"number": 3.5}, {"number": 10**400}, {"battery": "full"}, {"battery": True},
        {"parts": "base"}, {"parts": [1]}, {"parts": ["x"] * 5000}, {"task_state": "DREAMING"}, {"free": 1},
        {"robot": "\x1b[2Jgone"}, {"robot": "a\nb"}, {"robot": "x" * 1001}, {"robot": None}, {"robot": "\ud800"},
        {"colour": "red"}, {"farewell": "yes"}, {"x": [1.0]}, {"stopped": {"by": "me"}},
    ],
)  # fmt: skip
def test_a_message_that_is_not_exactly_of_its_form_is_refused_whole(wrong: dict[str, Any]) -> None:
    with pytest.raises(CodecError):
        read(RobotState, json.dumps(asdict(STATE) | wrong).encode())


@pytest.mark.parametrize(
    "data", [b"", b"[]", b"null", b"{}", b"\xff\xfe", b'{"number": NaN}', b"[" * 100_000, b" " * (MAX_BYTES + 1)]
)
def test_what_is_no_message_is_refused(data: bytes) -> None:
    for reading in (lambda: read(RobotState, data), lambda: read_ask(data)):
        with pytest.raises(CodecError):
            reading()


def test_infinity_is_no_place() -> None:
    with pytest.raises(CodecError):
        read(RobotState, as_bytes(STATE).replace(b'"x":null', b'"x":Infinity'))


@pytest.mark.parametrize(
    "place", ["anna", "anna/xyz", "../0123abcd", "*/0123abcd", "an\x1b[2J/0123abcd", "Anna/0123abcd"]
)
def test_a_key_whose_name_is_none_is_of_nobody(place: str) -> None:
    roster = Roster(ManualClock())
    roster.token(key("home", "here", place), alive=True)
    roster.told(key("home", "state", place), as_bytes(STATE))
    assert roster.members() == {}


@given(st.binary(max_size=300), st.text(max_size=80))
def test_bytes_by_chance_change_nothing_and_raise_nothing(data: bytes, where: str) -> None:
    roster = Roster(ManualClock())
    roster.told(WHERE, data)
    roster.token(where, alive=True)
    assert roster.members() == {}
    with pytest.raises(CodecError):
        read_ask(data)


def test_what_is_asked_has_its_word() -> None:
    assert read_ask(b'{"do": "stop", "by": "anna"}') == Stop(by="anna")
    for wrong in (b'{"do": "fly"}', b'{"do": ["stop"]}', b'{"do": "stop", "now": true}', b'{"by": "anna"}'):
        with pytest.raises(CodecError):
            read_ask(wrong)


def test_a_robot_is_online_offline_once_it_said_so_and_broken_where_it_did_not() -> None:
    roster, address = Roster(ManualClock()), Address("anna", "0123abcd")
    token = key("home", "here", str(address))

    def connection() -> str:
        return roster.members()[address].connection

    roster.token(token, alive=True)
    assert (connection(), roster.members()[address].online) == ("ONLINE", False)
    roster.told(WHERE, as_bytes(STATE))
    assert roster.members()[address].state == STATE
    roster.token(token, alive=False)
    assert connection() == "CONNECTIONBROKEN"
    roster.token(token, alive=True)
    assert roster.members()[address].state is None, "what it told before it went says nothing of now"
    roster.told(WHERE, as_bytes(replace(STATE, farewell=True)))
    roster.token(token, alive=False)
    assert connection() == "OFFLINE"


def test_states_that_come_late_are_dropped_and_a_new_start_counts_anew() -> None:
    roster = Roster(ManualClock())
    for state in (
        STATE,
        replace(STATE, number=2, mission="old"),
        replace(STATE, session="beef", number=0, mission="new"),
    ):
        roster.told(WHERE, as_bytes(state))
    found = roster.members()[address_in(WHERE)].state
    assert found is not None
    assert found.mission == "new"


def test_no_more_robots_are_kept_than_there_is_room_for() -> None:
    roster = Roster(ManualClock())
    for number in range(MOST_ROBOTS + 10):
        roster.token(key("home", "here", f"r{number}/{number:08x}"), alive=True)
    assert len(roster.members()) == MOST_ROBOTS
    roster.token(key("home", "here", f"r0/{0:08x}"), alive=False)
    roster.token(key("home", "here", f"r9999/{9999:08x}"), alive=True)
    assert Address("r9999", f"{9999:08x}") in roster.members()
    assert Address("r0", f"{0:08x}") not in roster.members()
