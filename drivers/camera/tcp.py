"""A camera that is read by TCP, as ``rpicam-vid --listen`` sends it: JPEG after JPEG, or a stream for FFmpeg."""

import select
import socket
from collections.abc import Callable
from urllib.parse import urlsplit

from drivers.api import Image
from drivers.camera.causes import missing, of_error
from drivers.camera.jpegs import BEGIN, JpegFinder
from drivers.camera.opencv import VideoFeed
from drivers.pictures.decode import UNWANTED, decoded

ANSWER_TIMEOUT = 5.0
"""Seconds that a camera has to take the connection, and to send more."""

LATE = 4_000_000
"""Bytes that are read on while more lies ready, to get to the newest picture."""

_BLOCK = 262144


class TcpFeed:
    """A ``drivers.camera.reader_process.BlockingFeed`` of an address of tcp.

    It has one connection: such a sender takes no second one, and ends with the first.
    """

    def __init__(self, name: str, source: str) -> None:
        self._name = name
        self._source = source
        self._socket: socket.socket | None = None
        self._finder = JpegFinder()
        self._film: VideoFeed | None = None

    def start(self) -> float | None:
        """Connect, and look at the first bytes. Raises NotConnected with the reason."""
        try:
            parts = urlsplit(self._source)
            place = parts.hostname, parts.port
            connection = self._socket = None if None in place else socket.create_connection(place, ANSWER_TIMEOUT)
            begin = b"" if connection is None else connection.recv(len(BEGIN), socket.MSG_PEEK | socket.MSG_WAITALL)
        except (OSError, ValueError) as error:
            self.stop()
            raise missing(self._name, self._source, of_error(error, self._source)) from error
        if connection is None:
            raise missing(self._name, self._source, ("names no host, or no port", "tcp://HOST:8888"))
        self._finder = JpegFinder()
        if begin == BEGIN:
            return None
        connection.setblocking(True)
        self._film = VideoFeed(self._name, self._source, connection=connection.fileno())
        return self._film.start()

    def grab(self, wanted: Callable[[], bool]) -> Image | None:
        """Return the next picture that can be decoded; None when there is no more: see BlockingFeed."""
        if self._film is not None:
            return self._film.grab(wanted)
        while found := self._read():
            if not wanted():
                return UNWANTED
            image = decoded(found[-1])
            if image is not None:
                return image
        return None

    def stop(self) -> None:
        """Close the connection."""
        film, self._film = self._film, None
        if film is not None:
            film.stop()
        connection, self._socket = self._socket, None
        if connection is not None:
            connection.close()

    def _read(self) -> list[bytes]:
        """Return the pictures that come next, oldest first; none at the end."""
        found, size = list[bytes](), 0
        while self._socket is not None:
            if found and (size > LATE or not select.select([self._socket], [], [], 0)[0]):
                break
            try:
                data = self._socket.recv(_BLOCK)
            except OSError:
                data = b""
            if not data:
                self.stop()
            found += self._finder.feed(data)
            size += len(data)
        return found
