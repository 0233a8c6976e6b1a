"""JPEG pictures from a byte stream (MJPEG), with or without the headers that HTTP servers send between pictures.

Only complete pictures are returned: a truncated one is dropped when the next one begins.
"""

import re
import select
import socket
from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

from drivers.api import Image
from drivers.camera.causes import cause_of_error, source_error
from drivers.camera.opencv import VideoFeed
from drivers.pictures.decode import SKIPPED_PICTURE, decode_picture

MAX_PICTURE_BYTES = 32_000_000
"""Maximum bytes of a JPEG picture; longer data is not a picture."""

JPEG_START = b"\xff\xd8\xff"
"""First bytes of a JPEG."""

_EOI, _SOI, _SOS = 0xD9, 0xD8, 0xDA
_SEGMENTLESS_MARKERS = frozenset({0x01, *range(0xD0, 0xD8)})
"""Markers of a JPEG that have no segment."""

_THUMBNAIL_MARKERS = frozenset({0xE1, 0xE2})
"""Markers of JPEG segments that may contain another picture: a thumbnail."""

_SCAN_END = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
"""Pattern of the end of scan data in a JPEG: 0xff that is followed by neither 0 nor a restart marker."""


class JpegFinder:
    """Finds JPEG pictures in chunks of a byte stream."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._position = 0  # up to here the picture at the beginning is read
        self._is_in_scan = False

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield the pictures that ``data`` completes."""
        self._data += data
        while self._find_start():
            end = self._find_end()
            if end is None:
                if len(self._data) <= MAX_PICTURE_BYTES:
                    return
                self._drop(len(JPEG_START))
            elif end > 0:
                yield bytes(self._data[:end])
                self._drop(end)
            else:
                self._drop(-end)

    def _find_start(self) -> bool:
        """Drop the bytes before the next picture; return False if the data contains no start of a picture."""
        if self._position:
            return True
        place = self._data.find(JPEG_START)
        if place < 0:
            self._drop(max(0, len(self._data) - len(JPEG_START) + 1))
            return False
        self._drop(place)
        self._position = 2
        return True

    def _drop(self, count: int) -> None:
        del self._data[:count]
        self._position, self._is_in_scan = 0, False

    def _find_end(self) -> int | None:
        """Return the end of the JPEG that begins the buffer; None if it is incomplete.

        A negative result is the number of bytes to drop, because the picture is damaged.
        """
        data = self._data
        while True:
            if self._is_in_scan:
                found = _SCAN_END.search(data, self._position)
                if found is None:
                    self._position = max(self._position, len(data) - 1)
                    return None
                self._position, self._is_in_scan = found.start(), False
            while self._position + 1 < len(data) and data[self._position] == data[self._position + 1] == 0xFF:
                self._position += 1  # padding
            if self._position + 4 > len(data) and not (
                self._position + 2 <= len(data) and data[self._position + 1] == _EOI
            ):
                return None
            if data[self._position] != 0xFF or data[self._position + 1] == _SOI:
                return -self._position
            marker = data[self._position + 1]
            if marker == _EOI:
                return self._position + 2
            end = self._position + (
                2
                if marker in _SEGMENTLESS_MARKERS
                else 2 + int.from_bytes(data[self._position + 2 : self._position + 4])
            )
            other = -1 if marker in _THUMBNAIL_MARKERS else data.find(JPEG_START, self._position, end)
            if other > 0:
                return -other  # this one was torn
            if end > len(data):
                return None
            self._position, self._is_in_scan = end, marker == _SOS


# A camera that is read by TCP, as ``rpicam-vid --listen`` sends it: JPEG after JPEG, or a stream for FFmpeg.

ANSWER_TIMEOUT = 5.0
"""Seconds to wait for the connection to a tcp address, and for further data."""

MAX_BACKLOG_BYTES = 4_000_000
"""Number of bytes after which reading stops, even if more have arrived; older pictures in these bytes are skipped."""

_READ_SIZE = 262144


class TcpFeed:
    """A ``drivers.camera.reader_process.BlockingFeed`` of a tcp address, such as ``tcp://127.0.0.1:8888``.

    It opens only one connection. A sender such as ``rpicam-vid`` accepts only one, and exits when that is closed.
    """

    def __init__(self, name: str, source: str) -> None:
        self._name = name
        self._source = source
        self._socket: socket.socket | None = None
        self._finder = JpegFinder()
        self._video_feed: VideoFeed | None = None

    def start(self) -> float | None:
        """Connect, and detect the format by the first bytes; return None, as for any live source.

        Raises NotConnected with the reason.
        """
        try:
            parts = urlsplit(self._source)
            place = parts.hostname, parts.port
            connection = self._socket = None if None in place else socket.create_connection(place, ANSWER_TIMEOUT)
            begin = (
                b"" if connection is None else connection.recv(len(JPEG_START), socket.MSG_PEEK | socket.MSG_WAITALL)
            )
        except (OSError, ValueError) as error:
            self.stop()
            raise source_error(self._name, self._source, cause_of_error(error, self._source)) from error
        if connection is None:
            raise source_error(self._name, self._source, ("has no host or no port", "tcp://HOST:8888"))
        self._finder = JpegFinder()
        if begin == JPEG_START:
            return None
        connection.setblocking(True)
        self._video_feed = VideoFeed(self._name, self._source, connection=connection.fileno())
        return self._video_feed.start()

    def grab(self, is_needed: Callable[[], bool]) -> Image | None:
        if self._video_feed is not None:
            return self._video_feed.grab(is_needed)
        while found := self._read_pictures():
            if not is_needed():
                return SKIPPED_PICTURE
            image = decode_picture(found[-1])
            if image is not None:
                return image
        return None

    def stop(self) -> None:
        film, self._video_feed = self._video_feed, None
        if film is not None:
            film.stop()
        connection, self._socket = self._socket, None
        if connection is not None:
            connection.close()

    def _read_pictures(self) -> list[bytes]:
        """Return the next pictures, oldest first; an empty list at the end of the stream."""
        found, size = list[bytes](), 0
        while self._socket is not None:
            if found and (size > MAX_BACKLOG_BYTES or not select.select([self._socket], [], [], 0)[0]):
                break
            try:
                data = self._socket.recv(_READ_SIZE)
            except OSError:
                data = b""
            if not data:
                self.stop()
            found += self._finder.feed(data)
            size += len(data)
        return found
