"""Robots in a fleet over Zenoh: seen by all, stopped and released by anybody, within this computer or by keys."""

import socket
import ssl
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from config.diagnostics import InvalidFileError
from config.fleet import FleetKeys, load_fleet
from drivers.clock import ManualClock, SystemClock
from missions.plugins.fleet.fleet_robot import Telemetry
from missions.plugins.fleet.member import FleetMember, RobotInfo
from missions.plugins.fleet.messages import Address, RobotState, decode_message, zenoh_key
from missions.plugins.fleet.operator import Operator
from missions.plugins.fleet.zenoh_session import open_session
from missions.plugins.fleet.zenoh_transport import Roster, ZenohTransport
from missions.plugins.tasks.fleet_latch import LATCH_FILE, FleetLatch
from missions.plugins.tasks.task import TaskError
from tests.certificates import authority, certificate
from tests.missions.service.fleets import CountingBody, at, free_port, local_fleet, member, router
from tests.waiting import wait_until

ANNA, BOB = Address("anna", "0000000a"), Address("bob", "0000000b")


@pytest.fixture(scope="module")
def fleet() -> Iterator[FleetKeys]:
    port = free_port()
    with router(port):
        yield local_fleet(port)


def state(operator: Operator, address: Address) -> RobotState:
    found = operator.members()[address].state
    assert found is not None
    return found


@pytest.mark.real_time
def test_members_are_listed_with_telemetry_and_connection(fleet: FleetKeys, tmp_path: Path) -> None:
    body = CountingBody()
    with at(replace(fleet, robots=("anna", "carl"))) as operator, member(fleet, "anna", tmp_path, body):
        with member(fleet, "bob", tmp_path, CountingBody(), number=BOB.number):
            wait_until(lambda: sum(each.is_online for each in operator.members().values()) == 2)
            assert {each.connection for each in operator.members().values()} == {"ONLINE"}
            assert (state(operator, ANNA).robot, state(operator, ANNA).parts) == ("turtlebot2", ("base", "voice"))
            body.telemetry = Telemetry(runs=True, mission="patrol", battery=0.42, x=1.5, y=-2.0, heading=0.1, age=0.3)
            wait_until(lambda: state(operator, ANNA).mission == "patrol")
            assert (state(operator, ANNA).battery, state(operator, ANNA).x) == (0.42, 1.5)
        wait_until(lambda: operator.members()[BOB].connection == "OFFLINE")
        assert operator.missing_robots() == ["carl"]


@pytest.mark.real_time
def test_late_operator_learns_of_broken_connections(fleet: FleetKeys, tmp_path: Path) -> None:
    roster = Roster(SystemClock())
    with member(fleet, "anna", tmp_path, CountingBody()):
        with closing(ZenohTransport(open_session(fleet, mode="client"), fleet.fleet, roster)) as line:
            line.announce(BOB, lambda *_: None, lambda *_: None, lambda: b"{}")
            with at(fleet) as operator:
                wait_until(lambda: BOB in operator.members())
        with at(fleet) as operator:
            answers, silent = operator.stop()
            assert operator.members()[BOB].connection == "CONNECTIONBROKEN"
    assert (list(answers), silent) == ([ANNA], [str(BOB)])


@pytest.mark.real_time
def test_stop_is_confirmed_by_each_robot_and_survives_a_restart(fleet: FleetKeys, tmp_path: Path) -> None:
    bodies = {"anna": CountingBody(), "bob": CountingBody()}
    with at(fleet) as operator, ExitStack() as robots:
        robots.enter_context(member(fleet, "anna", tmp_path, bodies["anna"]))
        with member(fleet, "bob", tmp_path, bodies["bob"], number=BOB.number):
            answers, silent = operator.stop()
            assert ({ANNA, BOB}, silent) == (set(answers), [])
            assert all(answer.ok and answer.reason == "stopped (base)" for answer in answers.values())
            wait_until(lambda: state(operator, BOB).stopped == operator.by)
            assert not state(operator, BOB).free
        with member(fleet, "bob", tmp_path, bodies["bob"], number=BOB.number):
            wait_until(lambda: operator.members()[BOB].is_online and state(operator, BOB).stopped)
            assert bodies["bob"].said[-1] == f"stop by {operator.by}", "what runs at a start stands still too"
            answers = operator.release(["bob"], resume=True)
            assert {address: answer.ok for address, answer in answers.items()} == {BOB: True}
            assert bodies["bob"].said[-1] == f"release by {operator.by} and resume"
        assert bodies["anna"].said == [f"stop by {operator.by}"]


def test_release_of_an_unseen_stop_is_refused(fleet: FleetKeys, tmp_path: Path) -> None:
    with at(fleet) as one, at(fleet) as other, member(fleet, "anna", tmp_path, CountingBody()):
        one.stop()
        wait_until(lambda: one.members()[ANNA].is_online and state(one, ANNA).stops == 1)
        seen = dict(one.members())
        other.stop()
        one.roster.members = lambda: seen  # type: ignore[method-assign]
        answers = one.release([], resume=False)
    assert not answers[ANNA].ok
    assert "the last one is 2" in answers[ANNA].reason


def test_invalid_latch_file_counts_as_stopped(fleet: FleetKeys, tmp_path: Path) -> None:
    (tmp_path / "anna").mkdir()
    (tmp_path / "anna" / LATCH_FILE).write_text("{", encoding="utf-8")
    with at(fleet) as operator, member(fleet, "anna", tmp_path, CountingBody()):
        operator.discover()
        assert "cannot be read" in state(operator, ANNA).stopped


@pytest.mark.parametrize(
    "odd",
    [
        Telemetry(battery=nan), Telemetry(x=inf, y=-inf, heading=nan), Telemetry(x=1e300, age=nan),
        Telemetry(mission="gr\u00fc\u00df\x1b[2J\n\u200d"), Telemetry(stopped="x" * 5000),
        Telemetry(x=cast("float", "1"), battery=True),
    ],
)  # fmt: skip
def test_invalid_telemetry_is_omitted_from_the_state(odd: Telemetry, tmp_path: Path) -> None:
    body, told = CountingBody(), list[bytes]()
    body.telemetry = odd
    line = SimpleNamespace(publish_state=told.append, announce=lambda *_: None, close=lambda: None)
    clock = ManualClock()
    robot = FleetMember(
        RobotInfo(ANNA, "kobuki"), cast("ZenohTransport", line), Roster(clock), body, FleetLatch(tmp_path), clock=clock
    )
    robot.run_once()
    seen = decode_message(RobotState, told[0])
    assert (seen.battery, seen.x, seen.age) == (None, None, None)
    assert seen.mission in {"", "gr\u00fc\u00df[2J"}


def test_robots_with_the_same_number_are_reported_and_take_no_tasks(
    fleet: FleetKeys, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        at(fleet) as operator,
        member(fleet, "anna", tmp_path / "one", CountingBody()) as one,
        member(fleet, "anna", tmp_path / "two", CountingBody()) as two,
    ):
        wait_until(lambda: one.is_duplicate and two.is_duplicate)
        wait_until(lambda: operator.members()[ANNA].state is not None and not state(operator, ANNA).free)
        assert "another robot has the same number 0000000a" in caplog.text
        one.run_once()
        two._publish(two._state)
        one._publish(one._state)
        wait_until(lambda: operator.roster.is_duplicate(ANNA))
        _, silent = operator.stop()
        assert silent == [f"{ANNA}, a number shared by two robots"]


@pytest.mark.real_time
def test_hostile_questions_are_refused_and_change_nothing(fleet: FleetKeys, tmp_path: Path) -> None:
    body = CountingBody()
    with at(fleet) as operator, member(fleet, "anna", tmp_path, body):
        operator.discover()
        before = state(operator, ANNA)
        session: Any = open_session(fleet, mode="client")
        try:
            for kind in ("stop", "ask"):
                for data in (
                    b"",
                    b"\xff",
                    b'{"do":"stop","by":7}',
                    b'{"do":"release","stop":1}',
                    b"[" * 9999,
                    b"x" * 99999,
                ):
                    replies = list(session.get(zenoh_key(fleet.fleet, kind, str(ANNA)), payload=data, timeout=5.0))
                    assert len(replies) == 1, data[:20]
                    assert replies[0].ok is not None
                    assert b'"ok":false' in replies[0].ok.payload.to_bytes()
            session.put(zenoh_key(fleet.fleet, "state", str(ANNA)), b'{"session": 1}')
            session.put(f"missiontree/0/{fleet.fleet}/state/{ANNA}", b"{}")
        finally:
            session.close()
        assert body.said == []
        assert replace(state(operator, ANNA), number=0, age=None) == replace(before, number=0, age=None)


@pytest.mark.parametrize(
    ("endpoint", "why"),
    [
        ("tcp/0.0.0.0:7450", "open to the network"), ("tcp/192.168.1.5:7450", "open to the network"),
        ("tcp/robot.local:7450", "open to the network"), ("tls/0.0.0.0:7450", "needs the keys"),
        ("ws/127.0.0.1:7450", "not an endpoint"), ("7450", "not an endpoint"), ("tcp/127.0.0.1", "not an endpoint"),
    ],
)  # fmt: skip
def test_without_keys_nothing_leaves_this_computer(endpoint: str, why: str, tmp_path: Path) -> None:
    for word in ("listen", "connect"):
        with pytest.raises(TaskError, match=why) as refused:
            open_session(FleetKeys(**{word: (endpoint,)}))  # type: ignore[arg-type]
        assert "docs/fleet.md" in refused.value.hint
        file = tmp_path / "fleet.yaml"
        file.write_text(f"{word}: ['{endpoint}']\n", encoding="utf-8")
        with pytest.raises(InvalidFileError, match=why):
            load_fleet(file)


def test_with_keys_of_one_authority_robots_meet_and_a_stranger_does_not(tmp_path: Path) -> None:
    for each in ("fleet", "other"):
        authority(tmp_path, each)
    port = free_port()
    keys = {each: _certificate(tmp_path, each, "fleet") for each in ("anna", "desk")}
    stranger = _certificate(tmp_path, "stranger", "other")
    where = (f"tls/127.0.0.1:{port}",)
    with ExitStack() as closed:
        session = open_session(replace(keys["anna"], listen=where))
        line = closed.enter_context(closing(ZenohTransport(session, "trial", Roster(SystemClock()))))
        line.announce(ANNA, lambda *_: None, lambda *_: None, lambda: b"{}")
        met = Roster(SystemClock())
        fleet = replace(keys["desk"], connect=where)
        closed.enter_context(closing(desk := ZenohTransport(open_session(fleet), "trial", met)))
        desk.subscribe()
        wait_until(lambda: ANNA in met.members())
        for shown in (None, stranger):
            with pytest.raises((ssl.SSLError, ConnectionError)):
                _knock(port, shown)
        _knock(port, keys["desk"])


def _knock(port: int, shown: FleetKeys | None) -> None:
    """Connect with a certificate, and hear nothing wrong for a while. Raises OSError where one is not let in."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    if shown is not None:
        context.load_cert_chain(shown.certificate, shown.private_key)
    plain = socket.create_connection(("127.0.0.1", port), timeout=5.0)
    with context.wrap_socket(plain) as connection:
        connection.settimeout(0.5)
        with suppress(TimeoutError):
            connection.recv(1)


def _certificate(folder: Path, name: str, signer: str) -> FleetKeys:
    ca, own, private_key = certificate(folder, name, signer)
    return FleetKeys(fleet="trial", ca=ca, certificate=own, private_key=private_key)
