"""The connections of the studio: nobody who has not signed in shuts out who has, or who comes with the right token."""

import asyncio
import resource
import socket
import ssl
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin

from drivers.clock import ManualClock, SystemClock
from missions.plugins.studio import connections
from missions.plugins.studio.connections import (
    HANDSHAKE_TIMEOUT,
    MAX_CONNECTIONS,
    MAX_CONNECTIONS_PER_ADDRESS,
    MIN_CONNECTIONS,
    RESERVED_DESCRIPTORS,
    SIGN_IN_TIMEOUT,
    AuthLevel,
    ClientConnection,
    ConnectionAcceptor,
    network_of,
)
from tests.cases import each
from tests.missions.command import Process
from tests.missions.studio.attacks import ATTACKS, MANY, attack, client_hello, plain, raw, request, said
from tests.missions.studio.running import simulated_run
from tests.missions.studio.serving import Served, studio

FEW_DESCRIPTORS = 256


@pytest.fixture
def visit() -> Iterator[Callable[..., ClientConnection]]:
    """Make connections; what is at their other end is closed after the test."""
    with ExitStack() as ends:

        def made(network: str = "192.0.2.1", standing: AuthLevel = AuthLevel.STRANGER) -> ClientConnection:
            here, there = socket.socketpair()
            ends.callback(here.close)
            ends.callback(there.close)
            return ClientConnection(here, network, standing)

        yield made


@pytest.fixture
def enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have so many descriptors that they do not matter."""
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1 << 20, 1 << 20))


def is_ended(visit: ClientConnection) -> bool:
    """Return whether its own end hears that it was hung up on."""
    visit.raw_socket.setblocking(False)
    try:
        return visit.raw_socket.recv(1) == b""
    except BlockingIOError:
        return False


@each(
    ("address", "network"),
    [
        (("192.0.2.1", 5000), "192.0.2.1"),
        (("::1", 5000, 0, 0), "::/64"),
        (("2001:db8::1", 5000, 0, 0), "2001:db8::/64"),
        (("2001:db8::ffff:ffff", 5001, 0, 0), "2001:db8::/64"),
        (("2001:db8:0:1::1", 5000, 0, 0), "2001:db8:0:1::/64"),
        (("fe80::1%eth0", 5000, 0, 2), "fe80::/64"),
        (("::ffff:192.0.2.1", 5000, 0, 0), "192.0.2.1"),
    ],
)
def test_all_addresses_of_a_home_count_as_one(address: tuple[object, ...], network: str) -> None:
    assert network_of(address) == network


@pytest.mark.usefixtures("enough")
def test_of_one_address_the_oldest_stranger_goes(visit: Callable[..., ClientConnection]) -> None:
    there = ConnectionAcceptor(lambda _: asyncio.Protocol())
    made = [visit() for _ in range(MAX_CONNECTIONS_PER_ADDRESS + 2)]
    other = visit("192.0.2.9")
    assert there.admit(other)
    assert all(there.admit(each) for each in made)
    assert [is_ended(each) for each in (other, *made[:3])] == [False, True, True, False]


@pytest.mark.usefixtures("enough")
def test_signed_in_connections_are_never_evicted(
    visit: Callable[..., ClientConnection],
) -> None:
    there = ConnectionAcceptor(lambda _: asyncio.Protocol())
    inside = [visit(standing=AuthLevel.SIGNED_IN) for _ in range(20)]
    assert all(there.admit(each) for each in inside)
    assert all(there.admit(visit(f"192.0.2.{number % 250}")) for number in range(3 * MAX_CONNECTIONS))
    assert all(there.admit(visit()) for _ in range(2 * MAX_CONNECTIONS_PER_ADDRESS))
    assert not any(map(is_ended, inside))
    assert len(there.connections) <= MAX_CONNECTIONS


@pytest.mark.usefixtures("enough")
def test_when_all_have_signed_in_one_more_is_refused(visit: Callable[..., ClientConnection]) -> None:
    there = ConnectionAcceptor(lambda _: asyncio.Protocol())
    inside = [visit(standing=AuthLevel.SIGNED_IN) for _ in range(MAX_CONNECTIONS)]
    assert all(there.admit(each) for each in inside)
    assert not there.admit(visit())
    inside[7].raw_socket.close()
    assert there.admit(visit())
    assert there.admit(visit())  # in the place of the one before


@pytest.mark.usefixtures("enough")
def test_address_with_most_connections_is_evicted_first(visit: Callable[..., ClientConnection]) -> None:
    there = ConnectionAcceptor(lambda _: asyncio.Protocol())
    alone = [visit(f"198.51.100.{number}") for number in range(10)]
    floods = [visit(f"192.0.2.{number % 2}") for number in range(5 * MAX_CONNECTIONS)]
    assert all(there.admit(each) for each in (*alone, *floods))
    assert not any(map(is_ended, alone))
    assert not is_ended(floods[-1])


@pytest.mark.usefixtures("enough")
def test_connections_with_a_cookie_are_evicted_last(visit: Callable[..., ClientConnection]) -> None:
    there = ConnectionAcceptor(lambda _: asyncio.Protocol())
    with_cookie = [visit(standing=AuthLevel.VISITOR) for _ in range(20)]
    assert all(there.admit(each) for each in with_cookie)
    assert all(there.admit(visit()) for _ in range(3 * MAX_CONNECTIONS_PER_ADDRESS))
    assert not any(map(is_ended, with_cookie))
    more = [
        visit(standing=AuthLevel.VISITOR) for _ in range(2 * MAX_CONNECTIONS_PER_ADDRESS)
    ]  # whoever has a stolen one
    assert all(there.admit(each) for each in more)
    assert is_ended(with_cookie[0])
    assert there.admit(visit("192.0.2.9"))


@pytest.mark.usefixtures("enough")
def test_connection_without_sign_in_times_out(visit: Callable[..., ClientConnection]) -> None:
    there = ConnectionAcceptor(lambda _: asyncio.Protocol(), clock=(clock := ManualClock()))
    made = [visit(standing=standing) for standing in AuthLevel]
    assert all(there.admit(each) for each in made)
    clock.advance(SIGN_IN_TIMEOUT + 1.0)
    late = visit()
    assert there.admit(late)
    there.close_late()
    assert [is_ended(each) for each in (*made, late)] == [True, False, False, False]


@each(("limit", "used", "room"), [(1024, 80, 200), (256, 80, 112), (256, 200, 8), (64, 60, 8), (-1, 80, 200)])
def test_file_descriptors_are_reserved(limit: int, used: int, room: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resource, "getrlimit", lambda _: (limit, limit))
        patch.setattr(connections, "_open_descriptors", lambda: used)
        assert ConnectionAcceptor(lambda _: asyncio.Protocol(), clock=ManualClock())._capacity() == room
    assert (RESERVED_DESCRIPTORS, MIN_CONNECTIONS, MAX_CONNECTIONS) == (64, 8, 200)


# --- attacks, with somebody who is in, and somebody who comes --------------------------------------------------------


@pytest.fixture(scope="module")
def by_tls(certificate: tuple[Path, Path]) -> Iterator[Served]:
    trusting = ssl.create_default_context(cafile=certificate[0])
    with studio("--certificate", str(certificate[0]), "--key", str(certificate[1]), trusting=trusting) as found:
        yield found


@pytest.fixture(scope="module")
def run(by_tls: Served, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    """A run that both studios see."""
    del by_tls
    with simulated_run(tmp_path_factory.mktemp("run")) as found:
        yield found


def stops_all(served: Served, run: Process) -> None:
    """Stop by one who has just come, and let the run go on."""
    name = str(run.process.pid)
    with served.client(served.operator) as client:
        client.hear_of(name)
        assert client.ask("stop")["result"]["stopped"][name]["parts"]
        stopped = client.ask("stop")["result"]["stopped"]
        assert f"{name}@2" not in stopped
        assert client.ask("release", run=name, stop=stopped[name]["stops"])["ok"]


@pytest.mark.real_time
@pytest.mark.parametrize("what", ATTACKS)
def test_while_many_do_this_pages_come_in_and_stop_works(by_tls: Served, run: Process, what: str) -> None:
    name = str(run.process.pid)
    with by_tls.client(by_tls.viewer) as inside:
        inside.hear_of(name)
        with attack(by_tls, ATTACKS[what]):
            assert inside.ask("stop")["result"]["stopped"][name]["parts"]
            assert [by_tls.get("/", Authorization=f"Bearer {by_tls.viewer}")[0] for _ in range(5)] == [200] * 5
            assert by_tls.get(f"/?token={by_tls.operator}")[0] == 303
            stops_all(by_tls, run)
            assert inside.ask("stop")["ok"]
        assert inside.ask("stop")["ok"]


@pytest.mark.real_time
def test_unfinished_handshake_times_out(by_tls: Served) -> None:
    clock = SystemClock()
    with plain(by_tls) as silent, raw(by_tls, client_hello()) as begun:
        for each in (silent, begun):
            each.setblocking(True)
            with suppress(OSError):
                while each.recv(4096):
                    pass
    assert HANDSHAKE_TIMEOUT - 1.0 < clock.now() < 3 * HANDSHAKE_TIMEOUT


@pytest.mark.real_time
def test_with_few_descriptors_64_are_left_and_a_new_run_is_stopped(by_tls: Served, tmp_path: Path) -> None:
    pid = by_tls.process.process.pid
    before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (FEW_DESCRIPTORS, before[1]))
    try:
        with by_tls.client(by_tls.viewer) as inside, attack(by_tls, plain, 2 * FEW_DESCRIPTORS):
            assert len([*Path(f"/proc/{pid}/fd").iterdir()]) <= FEW_DESCRIPTORS - RESERVED_DESCRIPTORS + MIN_CONNECTIONS
            with simulated_run(tmp_path) as run:
                inside.hear_of(str(run.process.pid))
                stopped = inside.ask("stop")["result"]["stopped"]
                assert stopped[str(run.process.pid)]["parts"]
                stops_all(by_tls, run)
    finally:
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)


@pytest.mark.real_time
def test_signed_in_clients_stay_connected_during_a_connection_flood(by_tls: Served) -> None:
    with ExitStack() as inside:
        clients = [inside.enter_context(by_tls.client(by_tls.viewer)) for _ in range(20)]
        with attack(by_tls, plain, 2 * MANY):
            for client in clients:
                assert client.ask("stop")["ok"]


@each("token", ["", "?token=", "?token=wrong", "?proof=", "?proof=00"])
def test_no_websocket_opens_without_a_token(by_tls: Served, token: str) -> None:
    with pytest.raises(InvalidStatus):
        by_tls.open_websocket(f"/ws{token}", origin=Origin(f"https://{by_tls.host}"))


def test_anonymous_request_is_answered_once_and_closed(served: Served) -> None:
    with said(served, request(served, "/") + request(served, f"/?token={served.operator}")) as stranger:
        answer = b""
        while data := stranger.recv(4096):
            answer += data
    assert answer.count(b"HTTP/1.1") == 1
    assert b"connection: close" in answer.lower()
