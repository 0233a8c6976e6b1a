"""Connections to a studio by those who have no token, many at a time."""

import socket
import ssl
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from itertools import count
from threading import Event, Thread

from missions.plugins.studio.connections import MAX_CONNECTIONS
from tests.missions.studio.serving import PATIENCE, Served
from tests.waiting import wait_until

MANY = MAX_CONNECTIONS + 50
"""Connections that one attack holds."""


def plain(served: Served) -> socket.socket:
    found = socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE)
    found.setblocking(False)
    return found


def said(served: Served, data: bytes) -> socket.socket:
    """Connect and say something, by TLS where the studio speaks it."""
    found = socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE)
    if served.trusting is not None:
        found = served.trusting.wrap_socket(found, server_hostname="127.0.0.1")
    found.sendall(data)
    return found


def request(served: Served, path: str, *headers: str) -> bytes:
    return "\r\n".join((f"GET {path} HTTP/1.1", f"Host: {served.host}", *headers, "", "")).encode()


@cache
def client_hello() -> bytes:
    """Return how TLS begins."""
    out, context = ssl.MemoryBIO(), ssl.create_default_context()
    with suppress(ssl.SSLWantReadError):
        context.wrap_bio(ssl.MemoryBIO(), out, server_hostname="robot.example").do_handshake()
    return out.read()


def raw(served: Served, data: bytes) -> socket.socket:
    found = plain(served)
    with suppress(OSError):
        found.send(data)
    return found


def half_closed(served: Served) -> socket.socket:
    found = plain(served)
    found.shutdown(socket.SHUT_WR)
    return found


def reset(served: Served) -> socket.socket:
    found = plain(served)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    found.close()
    return found


def quick(served: Served, data: bytes) -> socket.socket:
    """Say something; who is hung up on meanwhile has made its room."""
    with suppress(OSError):
        return said(served, data)
    return socket.socket()


UPGRADE = ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13")
KEY = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="

ATTACKS: Mapping[str, Callable[[Served], socket.socket]] = {
    "say nothing": plain,
    "begin a handshake of TLS": lambda served: raw(served, client_hello()),
    "begin half a handshake of TLS": lambda served: raw(served, client_hello()[:7]),
    "say nonsense": lambda served: raw(served, b"\0\xff" * 100),
    "close their half": half_closed,
    "reset": reset,
    "finish the handshake and say nothing": lambda served: quick(served, b""),
    "begin a header": lambda served: quick(served, request(served, "/", "X: ")[:-4]),
    "ask without a token": lambda served: quick(served, request(served, "/")),
    "ask with a wrong token": lambda served: quick(served, request(served, "/?token=wrong")),
    "announce a body": lambda served: quick(served, request(served, "/", "Content-Length: 1000000")),
    "ask again and again and read nothing": lambda served: quick(served, request(served, "/") * 50),
    "open a websocket without a token": lambda served: quick(served, request(served, "/ws", *UPGRADE, KEY)),
    "open half a websocket": lambda served: quick(served, request(served, "/ws", *UPGRADE)),
}
"""What those do who have not signed in."""


@contextmanager
def attack(served: Served, make: Callable[[Served], socket.socket], many: int = MANY) -> Iterator[None]:
    """Hold connections, and open each anew that the studio closes."""
    ending, held = Event(), list[socket.socket]()

    def hold() -> None:
        for number in count():
            if ending.is_set():
                return
            with suppress(OSError):
                held.append(make(served))
            if len(held) > many:
                held.pop(0).close()
            if number >= many:
                ending.wait(0.002)

    threads = [Thread(target=hold), Thread(target=hold)]
    for thread in threads:
        thread.start()
    try:
        wait_until(lambda: len(held) >= many // 2)
        yield
    finally:
        ending.set()
        for thread in threads:
            thread.join()
        for each in held:
            each.close()
