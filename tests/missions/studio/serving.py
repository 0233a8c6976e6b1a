"""A studio in a process of its own, and somebody who speaks to it: over HTTP, and by its websocket."""

import json
import os
import re
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from http.client import HTTPConnection, HTTPSConnection
from pathlib import Path
from ssl import SSLContext
from typing import Any

from websockets.sync.client import ClientConnection, connect

from missions.control.messages import PROTOCOL_VERSION
from missions.control.run_search import search_runs
from tests.missions.command import Process
from tests.missions.studio.proxy import plain_port

PATIENCE = 60.0
"""Seconds for an answer: machines are shared."""


class Served:
    """A studio that is served on this computer, with its tokens. It speaks TLS if ``trusting`` says whom to trust.

    ``websocket_port`` always speaks plain text.
    """

    def __init__(self, process: Process, trusting: SSLContext | None = None) -> None:
        self.process, self.trusting = process, trusting
        self.state, self.runtime = Path(os.environ["XDG_STATE_HOME"]), os.environ["XDG_RUNTIME_DIR"]
        line = process.wait_for_line(lambda line: line.startswith("to view"), seconds=PATIENCE)
        self.viewer = line.rpartition("token=")[2]
        self.operator = process.lines[0].rpartition("token=")[2]
        found = re.search(r":(\d+)/", line)
        assert found is not None
        self.port = self.websocket_port = int(found[1])

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    def get(self, path: str, **headers: str) -> tuple[int, Mapping[str, str], bytes]:
        connection = HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        if self.trusting is not None:
            connection = HTTPSConnection("127.0.0.1", self.port, timeout=PATIENCE, context=self.trusting)
        try:
            connection.putrequest("GET", path, skip_host="Host" in headers)
            for name, value in headers.items():
                connection.putheader(name, value)
            connection.endheaders()
            answer = connection.getresponse()
            return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
        finally:
            connection.close()

    def sign_in(self, token: str, path: str = "/") -> tuple[str, str]:
        """Return the cookie that a browser has by the link of a token, and where it is led to."""
        status, headers, _ = self.get(f"{path}?token={token}")
        assert status == 303
        return headers["set-cookie"].partition(";")[0], headers["location"]

    def cookie(self, token: str) -> str:
        return self.sign_in(token)[0]

    def page_socket(self, token: str) -> tuple[str, str]:
        """Return the cookie and the address by which the page opens its websocket."""
        cookie, where = self.sign_in(token)
        return cookie, f"ws://{self.host}/ws?{where.partition('?')[2]}"

    def open_websocket(self, path: str, *, port: int = 0, **options: Any) -> ClientConnection:
        """Return a websocket, opened by another ``port`` where that is not 0. Raises InvalidStatus if it is refused."""
        way = socket.create_connection(("127.0.0.1", port or self.websocket_port), timeout=PATIENCE)
        found: ClientConnection = connect(f"ws://{self.host}{path}", sock=way, **options)
        return found

    @contextmanager
    def client(self, token: str, *, hello: bool = True, port: int = 0) -> Iterator["Client"]:
        """Give a client, which comes by another ``port`` where that is not 0."""
        headers = {"Authorization": f"Bearer {token}"}
        options = {"additional_headers": headers, "max_size": None, "compression": None, "close_timeout": 0.5}
        with self.open_websocket("/ws", port=port, **options) as connection:
            client = Client(connection)
            if hello:
                client.send(do="hello", version=str(PROTOCOL_VERSION))
                client.welcome = client.hear(lambda told: told["say"] == "welcome")
            yield client


class Client:
    """A client of the websocket."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.welcome: Mapping[str, Any] = {}
        self.number = self.driven = 0
        self.stamps: dict[str, int] = {}  # of the newest state of each run

    def send(self, **command: object) -> None:
        self.socket.send(json.dumps(command))

    def ask(self, do: str, **members: object) -> Mapping[str, Any]:
        self.number += 1
        number = self.number
        self.send(do=do, id=number, **members)
        return self.hear(lambda told: told["say"] == "answer" and told.get("id") == number)

    def hear_of(self, run: str) -> None:
        """Wait until this run is among those that there are."""
        self.hear(lambda told: told["say"] == "runs" and any(each["run"] == run for each in told["runs"]))

    def hear(self, wanted: Callable[[Mapping[str, Any]], object]) -> Mapping[str, Any]:
        while not wanted(told := self._next(PATIENCE)):
            pass
        return told

    def catch_up(self) -> None:
        """Read all that has come."""
        with suppress(TimeoutError):
            while True:
                self._next(0.0)

    def drive(self, run: str, ahead: float = 1.0, left: float = 0.0, *, stamp: int | None = None) -> None:
        """Drive on by the newest state, or by one of a ``stamp``; begin to watch where no state has come."""
        if run not in self.stamps:
            self.send(do="watch", run=run)
            self.hear(lambda told: told["say"] == "scene" and told["run"] == run)
        self.catch_up()
        self.driven += 1
        stamp = self.stamps[run] if stamp is None else stamp
        self.send(do="drive", run=run, n=self.driven, stamp=stamp, ahead=ahead, left=left, pace=1.0)

    def _next(self, patience: float) -> Mapping[str, Any]:
        told: Mapping[str, Any] = json.loads(self.socket.recv(timeout=patience))
        state = told["state"] if told["say"] == "scene" else told
        if "stamp" in state:
            self.stamps[told["run"]] = state["stamp"]
        return told


@contextmanager
def studio(*more: str, trusting: SSLContext | None = None) -> Iterator[Served]:
    """Serve a studio until this is over. The runs that it began, which live on without it, are ended too."""
    process, before = (
        Process("studio", "--port", "0", "--record", *more),
        {each.key for each in search_runs().processes},
    )
    try:
        found = Served(process, trusting)
        with ExitStack() as ends:
            if trusting is not None:
                found.websocket_port = ends.enter_context(plain_port(found.port, trusting))
            yield found
    finally:
        process.process.terminate()
        process.end()
        for each in search_runs().processes:
            with suppress(OSError):
                if each.key not in before:
                    each.terminate(None)
