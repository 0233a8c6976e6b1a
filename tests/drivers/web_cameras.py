"""Stand-ins for cameras in the network, on loopback: each answers its connections by a function of the test."""

import socket
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Thread
from types import TracebackType
from typing import Self

import cv2
import numpy as np

BOUNDARY = b"frame"

OK = b"HTTP/1.1 200 OK\r\n"

MJPEG = OK + b"Content-Type: multipart/x-mixed-replace; boundary=" + BOUNDARY + b"\r\n\r\n"
"""The head of a stream."""


def jpeg(level: int, size: tuple[int, int] = (64, 48)) -> bytes:
    """Return a picture of one grey level, but for a light corner."""
    image = np.full((size[1], size[0], 3), level, np.uint8)
    image[:8, :8] = 250
    return cv2.imencode(".jpg", image)[1].tobytes()


def part(picture: bytes) -> bytes:
    """Return a picture as a part of a stream."""
    head = b"--%s\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % (BOUNDARY, len(picture))
    return head + picture + b"\r\n"


def answer(body: bytes, kind: str = "image/jpeg", status: str = "200 OK", *heads: str) -> bytes:
    """Return a whole answer."""
    lines = [f"HTTP/1.1 {status}", f"Content-Type: {kind}", f"Content-Length: {len(body)}", *heads, "", ""]
    return "\r\n".join(lines).encode() + body


class Connection:
    """One connection to a stand-in: ``request`` is what was asked, ``number`` counts from 0."""

    def __init__(self, peer: socket.socket, number: int, ending: Event) -> None:
        self.number = number
        self.request = b""
        self._peer = peer
        self._ending = ending

    def read(self) -> None:
        """Read the request."""
        while b"\r\n\r\n" not in self.request:
            data = self._peer.recv(4096)
            if not data:
                raise ConnectionResetError
            self.request += data

    def send(self, data: bytes) -> None:
        """Send bytes."""
        self._peer.sendall(data)

    def pause(self, seconds: float) -> None:
        """Send nothing for so long, or until the stand-in is closed, which ends the connection."""
        if self._ending.wait(seconds):
            raise ConnectionAbortedError

    def stream(self, rate: float = 50.0, count: int = 1_000_000) -> None:
        """Send pictures of levels that change, at a rate a second."""
        for number in range(count):
            self.send(part(jpeg(20 + number % 200)))
            self.pause(1 / rate)


class WebCamera:
    """Listens on a port of loopback until it is closed. ``tls`` wraps its connections; ``asks`` is for HTTP."""

    def __init__(
        self,
        answer: Callable[[Connection], None],
        *,
        port: int = 0,
        asks: bool = True,
        tls: Callable[[socket.socket], socket.socket] = lambda peer: peer,
    ) -> None:
        self._answer = answer
        self._asks = asks
        self._tls = tls
        self._socket = socket.create_server(("127.0.0.1", port))
        self.port: int = self._socket.getsockname()[1]
        self.connections: list[Connection] = []
        self._peers: list[socket.socket] = []
        self._ending = Event()
        self._threads = [Thread(target=self._listen)]
        self._threads[0].start()

    @property
    def url(self) -> str:
        """Its address, without a path."""
        return f"http://127.0.0.1:{self.port}"

    def close(self) -> None:
        """End all connections, and listen no more."""
        self._ending.set()
        for each in (self._socket, *self._peers):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        for thread in self._threads:
            thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _listen(self) -> None:
        while not self._ending.is_set():
            try:
                peer = self._socket.accept()[0]
            except OSError:
                return
            self._peers.append(peer)
            connection = Connection(peer, len(self.connections), self._ending)
            self.connections.append(connection)
            thread = Thread(target=self._serve, args=(connection, peer))
            self._threads.append(thread)
            thread.start()

    def _serve(self, connection: Connection, peer: socket.socket) -> None:
        try:
            connection._peer = self._tls(peer)
            if self._asks:
                connection.read()
            self._answer(connection)
        except (OSError, ValueError):
            pass
        finally:
            connection._peer.close()
            peer.close()
