"""Packet code of ROBOTIS' ``dynamixel-sdk`` on our bus, for comparison with our own.

Only its packet code is used. The bus keeps its own line, timing and retries, since the SDK's port handler polls the
line, waits at least 16 ms for a lost reply, and discards late ones.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, Literal

from dynamixel_sdk import COMM_SUCCESS, PacketHandler

from drivers.servos import wire, wire2
from drivers.servos.codec import CODECS, Codec
from drivers.servos.units import Protocol
from drivers.servos.wire import Packet

_STUFFED = b"\xff\xff\xfd"

_HANDLERS: Mapping[int, Any] = MappingProxyType({1: PacketHandler(1.0), 2: PacketHandler(2.0)})
"""The SDK's packet code for each protocol; it is stateless."""


class _BufferPort:
    """In-memory port handler for the SDK's packet code."""

    def __init__(self, waiting: bytes = b"") -> None:
        self.is_using = False
        self.written = b""
        self.read_count = 0
        self.is_exhausted = False
        self._data = waiting

    def clearPort(self) -> None:  # noqa: N802 - the vendor's name
        """Do nothing: the port holds no earlier packet."""

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        """Store a complete packet."""
        self.written = bytes(packet)
        return len(packet)

    def readPort(self, count: int) -> bytes:  # noqa: N802
        """Return the next bytes, at most ``count``."""
        found = self._data[self.read_count : self.read_count + count]
        self.read_count += len(found)
        return found

    def isPacketTimeout(self) -> bool:  # noqa: N802
        """Return True, the end of the data; the SDK calls this only while a packet is incomplete."""
        self.is_exhausted = True
        return True


def frame(protocol: Literal[1, 2], servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return a request framed by the SDK. Raises ValueError if it cannot frame it.

    Version 4.1.0 loses the bytes that it stuffs into a packet of protocol 2.0 (``addStuffing`` makes a longer list, and
    its caller sends the old one): no servo understands such a packet.
    """
    if protocol == 1:
        packet = [0xFF, 0xFF, servo, len(parameters) + 2, instruction, *parameters, 0]
    else:
        if _STUFFED in bytes((instruction,)) + parameters:
            raise ValueError(f"the vendor's code cannot send {_STUFFED.hex(' ')} in a packet; take framing: own")
        size = len(parameters) + 3
        packet = [0xFF, 0xFF, 0xFD, 0, servo, size & 0xFF, size >> 8, instruction, *parameters, 0, 0]
    port = _BufferPort()
    possible = 0 <= servo <= wire.BROADCAST and len(parameters) <= wire2.MAX_PARAMETERS
    if not possible or _HANDLERS[protocol].txPacket(port, packet) != COMM_SUCCESS:
        raise ValueError(f"the vendor's code takes no packet of {len(parameters)} parameters to servo {servo}")
    return port.written


class SdkPacketParser(wire.PacketParser):
    """Finds replies in a stream with the SDK's packet code, which parses all buffered bytes again for each chunk.

    The SDK's code skips packets that cannot be replies, such as echoes of requests: in protocol 2.0 all packets that
    are not a status, in 1.0 packets with an error byte above 7F.
    """

    def feed(self, data: bytes) -> list[Packet]:
        """Add ``data``; return the packets that it completes, in order, with those of a wrong checksum marked."""
        self._buffer += data
        found = []
        while self._buffer:
            port = _BufferPort(bytes(self._buffer))
            frame, result = self._read_frame(port)  # its length on the wire
            self._skip(port.read_count - len(frame))
            if port.is_exhausted:
                break
            packet = self._make_packet(frame, intact=result == COMM_SUCCESS and self._is_complete(frame))
            found.append(packet)
            if packet.intact:
                del self._buffer[: len(frame)]
            else:
                self.damaged_packets += 1
                self._skip(1)
        return found

    def _is_complete(self, frame: list[int]) -> bool:
        """True if the frame is as long as a reply must be: the SDK accepts any length."""
        return frame[3] >= 2

    def _read_frame(self, port: _BufferPort) -> tuple[list[int], int]:
        frame, result = _HANDLERS[1].rxPacket(port)
        return frame, result

    def _make_packet(self, frame: list[int], *, intact: bool) -> Packet:
        return Packet(frame[2], frame[4], bytes(frame[5:-1]), intact)


class SdkPacketParser2(SdkPacketParser):
    """SDK packet parser for protocol 2.0."""

    def _is_complete(self, frame: list[int]) -> bool:
        return frame[5] | frame[6] << 8 >= 4

    def _read_frame(self, port: _BufferPort) -> tuple[list[int], int]:
        frame, result = _HANDLERS[2].rxPacket(port, False)
        return frame, result

    def _make_packet(self, frame: list[int], *, intact: bool) -> Packet:
        end = (frame[5] | frame[6] << 8) + 5  # the vendor's code has removed the stuffing, and corrects the length
        return Packet(frame[4], frame[7], bytes(frame[8:end]), intact)


SDK_CODECS: Mapping[Protocol, Codec] = MappingProxyType(
    {
        1: replace(CODECS[1], frame=partial(frame, 1), parser=SdkPacketParser),
        2: replace(CODECS[2], frame=partial(frame, 2), parser=SdkPacketParser2),
        "STS": replace(CODECS["STS"], frame=partial(frame, 1), parser=SdkPacketParser),
    }
)
"""Codecs with the SDK's packet code; STS servos use that of protocol 1.0."""
