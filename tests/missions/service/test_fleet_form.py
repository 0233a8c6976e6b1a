"""What comes over a fleet's wire may be anything: what is not exactly a message changes nothing."""

import json
from dataclasses import asdict, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import ManualClock
from missions.codec import CodecError
from missions.plugins.fleet.messages import (
    MAX_MESSAGE_BYTES,
    Address,
    FleetStop,
    RobotState,
    address_of_key,
    decode_message,
    encode_message,
    read_request,
    zenoh_key,
)
from missions.plugins.fleet.zenoh_transport import MAX_ROBOTS, Roster

STATE = RobotState(session="01ab23cd", number=3, robot="turtlebot2", parts=("base",), battery=0.5, task_state="RUNNING")
WHERE = zenoh_key("home", "state", "anna/0123abcd")


def test_robot_state_round_trips() -> None:
    assert decode_message(RobotState, encode_message(STATE)) == STATE


@pytest.mark.parametrize(
    "wrong",
    [
        {"number": "3"}, {"number": True}, {"number": 3.5}, {"number": 10**400}, {"battery": "full"}, {"battery": True},
        {"parts": "base"}, {"parts": [1]}, {"parts": ["x"] * 5000}, {"task_state": "DREAMING"}, {"free": 1},
        {"robot": "\x1b[2Jgone"}, {"robot": "a\nb"}, {"robot": "x" * 1001}, {"robot": None}, {"robot": "\ud800"},
        {"colour": "red"}, {"farewell": "yes"}, {"x": [1.0]}, {"stopped": {"by": "me"}},
    ],
)  # fmt: skip
def test_message_with_a_wrong_field_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(CodecError):
        decode_message(RobotState, json.dumps(asdict(STATE) | wrong).encode())


@pytest.mark.parametrize(
    "data",
    [b"", b"[]", b"null", b"{}", b"\xff\xfe", b'{"number": NaN}', b"[" * 100_000, b" " * (MAX_MESSAGE_BYTES + 1)],
)
def test_malformed_message_is_refused(data: bytes) -> None:
    for reading in (lambda: decode_message(RobotState, data), lambda: read_request(data)):
        with pytest.raises(CodecError):
            reading()


def test_infinity_is_no_place() -> None:
    with pytest.raises(CodecError):
        decode_message(RobotState, encode_message(STATE).replace(b'"x":null', b'"x":Infinity'))


@pytest.mark.parametrize(
    "place", ["anna", "anna/xyz", "../0123abcd", "*/0123abcd", "an\x1b[2J/0123abcd", "Anna/0123abcd"]
)
def test_key_with_invalid_address_is_ignored(place: str) -> None:
    roster = Roster(ManualClock())
    roster.on_token(zenoh_key("home", "here", place), alive=True)
    roster.on_state(zenoh_key("home", "state", place), encode_message(STATE))
    assert roster.members() == {}


@given(st.binary(max_size=300), st.text(max_size=80))
def test_bytes_by_chance_change_nothing_and_raise_nothing(data: bytes, where: str) -> None:
    roster = Roster(ManualClock())
    roster.on_state(WHERE, data)
    roster.on_token(where, alive=True)
    assert roster.members() == {}
    with pytest.raises(CodecError):
        read_request(data)


def test_request_is_decoded_by_its_do_field() -> None:
    assert read_request(b'{"do": "stop", "by": "anna"}') == FleetStop(by="anna")
    for wrong in (b'{"do": "fly"}', b'{"do": ["stop"]}', b'{"do": "stop", "now": true}', b'{"by": "anna"}'):
        with pytest.raises(CodecError):
            read_request(wrong)


def test_connection_is_online_offline_or_broken() -> None:
    roster, address = Roster(ManualClock()), Address("anna", "0123abcd")
    token = zenoh_key("home", "here", str(address))

    def connection() -> str:
        return roster.members()[address].connection

    roster.on_token(token, alive=True)
    assert (connection(), roster.members()[address].is_online) == ("ONLINE", False)
    roster.on_state(WHERE, encode_message(STATE))
    assert roster.members()[address].state == STATE
    roster.on_token(token, alive=False)
    assert connection() == "CONNECTIONBROKEN"
    roster.on_token(token, alive=True)
    assert roster.members()[address].state is None, "what it told before it went says nothing of now"
    roster.on_state(WHERE, encode_message(replace(STATE, farewell=True)))
    roster.on_token(token, alive=False)
    assert connection() == "OFFLINE"


def test_delayed_states_of_a_robot_that_left_are_handled() -> None:
    """Zenoh keeps the order of one priority: a state may arrive after the end of the token that followed it."""
    roster, address = Roster(ManualClock()), Address("anna", "0123abcd")
    token = zenoh_key("home", "here", str(address))
    roster.on_token(token, alive=True)
    roster.on_state(WHERE, encode_message(STATE))
    roster.on_token(token, alive=False)
    roster.on_state(WHERE, encode_message(replace(STATE, number=STATE.number - 1)))
    assert roster.members()[address].connection == "CONNECTIONBROKEN"
    roster.on_state(WHERE, encode_message(replace(STATE, number=STATE.number + 1, farewell=True)))
    assert roster.members()[address].connection == "OFFLINE"
    roster.on_state(WHERE, encode_message(STATE))
    assert roster.members()[address].connection == "OFFLINE"
    roster.on_state(WHERE, encode_message(replace(STATE, number=STATE.number + 2)))
    assert roster.members()[address].connection == "ONLINE"


def test_late_states_are_dropped_and_a_new_session_restarts_numbers() -> None:
    roster = Roster(ManualClock())
    for state in (
        STATE,
        replace(STATE, number=2, mission="old"),
        replace(STATE, session="beef", number=0, mission="new"),
    ):
        roster.on_state(WHERE, encode_message(state))
    found = roster.members()[address_of_key(WHERE)].state
    assert found is not None
    assert found.mission == "new"


def test_number_of_robots_in_the_roster_is_limited() -> None:
    roster = Roster(ManualClock())
    for number in range(MAX_ROBOTS + 10):
        roster.on_token(zenoh_key("home", "here", f"r{number}/{number:08x}"), alive=True)
    assert len(roster.members()) == MAX_ROBOTS
    roster.on_token(zenoh_key("home", "here", f"r0/{0:08x}"), alive=False)
    roster.on_token(zenoh_key("home", "here", f"r9999/{9999:08x}"), alive=True)
    assert Address("r9999", f"{9999:08x}") in roster.members()
    assert Address("r0", f"{0:08x}") not in roster.members()
