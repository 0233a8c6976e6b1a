"""A broker: MQTT 3.1.1 (OASIS, sections 2 and 3) as far as a client needs it that publishes with QoS 1.

It runs on loopback, on a thread of its own, and may misbehave.
"""

import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from threading import Thread
from typing import Literal

Manners = Literal["good", "refuses", "silent", "hangs up"]


@dataclass
class Broker:
    """What it has heard: the topic, text and quality of each notice, and who connected with which password."""

    port: int = 0
    manners: Manners = "good"
    published: list[tuple[str, str, int]] = field(default_factory=list)
    users: list[tuple[str, str]] = field(default_factory=list)
    goodbyes: int = 0

    def talk(self, line: socket.socket) -> None:
        """Answer one client until it goes."""
        while (packet := read_packet(line)) is not None:
            kind, flags, body = packet
            match kind:
                case 1:
                    self.users.append(credentials(body))
                    line.sendall(bytes([0x20, 2, 0, 5 if self.manners == "refuses" else 0]))
                case 3 if self.manners == "hangs up":
                    return
                case 3:
                    topic, rest = text(body)
                    self.published.append((topic, rest[2:].decode(), flags >> 1 & 3))
                    if self.manners == "good":
                        line.sendall(bytes([0x40, 2]) + rest[:2])
                case 14:
                    self.goodbyes += 1
                    return


def read_packet(line: socket.socket) -> tuple[int, int, bytes] | None:
    """Read one control packet: its kind, its flags and what it holds; None at the end."""
    first = line.recv(1)
    if not first:
        return None
    length = shift = 0
    while True:
        byte = line.recv(1)[0]
        length |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            break
    body = b""
    while len(body) < length:
        body += line.recv(length - len(body))
    return first[0] >> 4, first[0] & 0x0F, body


def text(data: bytes) -> tuple[str, bytes]:
    """Read a text behind its length; return it and what comes next."""
    end = 2 + int.from_bytes(data[:2], "big")
    return data[2:end].decode(), data[end:]


def credentials(body: bytes) -> tuple[str, str]:
    """Read user and password of a CONNECT: behind protocol, level, flags, seconds, and the client's name."""
    protocol, rest = text(body)
    assert (protocol, rest[0]) == ("MQTT", 4)
    flags, (_, rest) = rest[1], text(rest[4:])
    user, rest = text(rest) if flags & 0x80 else ("", rest)
    password, _ = text(rest) if flags & 0x40 else ("", rest)
    return user, password


@contextmanager
def small_broker(manners: Manners = "good") -> Iterator[Broker]:
    """Have a broker on a free port of loopback."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        broker = Broker(listening.getsockname()[1], manners)
        ending = False

        def serve() -> None:
            while True:
                line, _ = listening.accept()
                with line:
                    if ending:
                        return
                    line.settimeout(20.0)
                    with suppress(OSError):
                        broker.talk(line)

        thread = Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield broker
        finally:
            ending = True
            socket.create_connection(("127.0.0.1", broker.port)).close()
            thread.join()
