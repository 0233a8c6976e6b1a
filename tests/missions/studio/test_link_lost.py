"""What comes between a driver and the studio: the base is at rest soon, and nothing that was held up moves it again."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import pytest
from websockets.sync.client import connect

from missions.control.messages import PROTOCOL_VERSION
from tests.missions.lone_base import LoneBase
from tests.missions.studio.running import REST, run_of, seconds_to_rest
from tests.missions.studio.serving import Client, Served, studio
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time


class Proxy:
    """Passes on what a driver sends to the studio, and what comes back, while it is let; then holds it."""

    def __init__(self, port: int) -> None:
        self.flows = Event()
        self.flows.set()
        self.driver, self._here = socket.socketpair()
        self._studio = socket.create_connection(("127.0.0.1", port))
        self._threads = [
            Thread(target=self._pass, args=ends, daemon=True)
            for ends in ((self._here, self._studio), (self._studio, self._here))
        ]
        for thread in self._threads:
            thread.start()

    def _pass(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                self.flows.wait()
                sink.sendall(data)

    def close(self) -> None:
        self.flows.set()
        for end in (self._here, self._studio):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for end in (self._here, self._studio, self.driver):
            end.close()


@contextmanager
def driver(served: Served, proxy: Proxy) -> Iterator[Client]:
    """Somebody who speaks to the studio by way of a proxy."""
    headers = {"Authorization": f"Bearer {served.operator}"}
    with connect(
        f"ws://{served.host}/ws", sock=proxy.driver, additional_headers=headers, compression=None, close_timeout=0.1
    ) as opened:
        client = Client(opened)
        client.send(do="hello", version=str(PROTOCOL_VERSION))
        yield client


def test_base_rests_when_access_links_are_renewed(tmp_path: Path) -> None:
    with run_of(tmp_path) as (process, base), studio() as served, ExitStack() as clients:
        other, client = (clients.enter_context(served.client(served.operator)) for _ in range(2))
        run = str(process.process.pid)
        client.hear_of(run)
        assert client.ask("take", run=run)["result"]["yours"]

        def pushed_on() -> bool:
            client.drive(run)
            return base.seen().moving

        wait_until(pushed_on, pause=0.02)
        since = base.seen().heard_at
        assert other.ask("revoke")["ok"]
        assert seconds_to_rest(base, since) < REST


def test_base_rests_when_the_drivers_connection_stalls(served: Served, tmp_path: Path) -> None:
    with run_of(tmp_path) as (process, base):
        for way in ("a proxy that stalls", "a half-open socket"):
            with closing(Proxy(served.port)) as proxy, driver(served, proxy) as client:
                held_up(way, client, proxy, str(process.process.pid), base)


def held_up(way: str, client: Client, proxy: Proxy, run: str, base: LoneBase) -> None:
    """Drive, and have all that comes and goes held up on its way."""
    client.hear_of(run)
    wait_until(lambda: client.ask("take", run=run)["result"]["yours"])  # once who drove before is known to have gone

    def pushed_on() -> bool:
        client.drive(run)
        return base.seen().moving

    wait_until(pushed_on, pause=0.02)
    proxy.flows.clear()
    since = base.seen().heard_at
    if way == "a half-open socket":
        proxy.driver.shutdown(socket.SHUT_RDWR)  # of which the studio hears nothing
    else:
        wait_until(lambda: not pushed_on())  # it goes on to push all the while
    rest = seconds_to_rest(base, since)
    assert rest < REST, way
    wait_until(lambda: base.seen().heard_at > since + rest + REST)  # by then all that is held up is too old
    base.seen(forget=True)
    proxy.flows.set()
    wait_until(lambda: base.seen().heard_at > since + rest + 2 * REST)
    assert base.seen().top == 0.0, way
