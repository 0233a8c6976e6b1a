"""How a board of rosserial reads: byte by byte, with its order of doing things and its limits of time."""

from collections.abc import Iterator

from drivers.arduino.wire import HEADER, Frame

FRAME_TIME = 0.02
"""Seconds in which a frame must be complete."""


class Ear:
    """Reads what comes; frames of more than ``buffer`` bytes, and those with wrong sums, are lost."""

    def __init__(self, buffer: int) -> None:
        self._buffer = buffer
        self._frame = bytearray()
        self._began = 0.0

    def hear(self, data: bytes, now: float) -> Iterator[Frame | None]:
        """Yield the frames that are complete at time ``now``, and None for each header that was none."""
        if self._frame and now - self._began > FRAME_TIME:
            self._frame.clear()
        for byte in data:
            frame = self._frame
            if not frame:
                self._began = now
            frame.append(byte)
            size = len(frame)
            if size == 1 and byte != HEADER[0]:
                frame.clear()
            elif size == 2 and byte != HEADER[1]:
                frame.clear()
                yield None
            elif size == 5 and (sum(frame[2:5]) % 256) != 255:
                frame.clear()
            elif size > 7 and size == 8 + int.from_bytes(frame[2:4], "little"):
                topic, body = int.from_bytes(frame[5:7], "little"), bytes(frame[7:-1])
                sound = sum(frame[5:]) % 256 == 255 and len(body) <= self._buffer
                frame.clear()
                if sound:
                    yield Frame(topic, body)
