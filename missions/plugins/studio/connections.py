"""Connections of the studio: their limits, and the choice of connections to close for newer ones.

A connection counts towards the limits from ``accept``, before TLS, until its file descriptor is closed. To make room
for a newer connection, only one that has not signed in is closed.
"""

import asyncio
import ipaddress
import os
import resource
import socket
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from enum import IntEnum
from ssl import SSLContext
from typing import Any

from drivers.clock import Clock, SystemClock

# Reserve of file descriptors for a stop: without free descriptors, the studio can still search for runs.

RESERVED_DESCRIPTORS = 64
"""File descriptors reserved for stops: a folder, a file and a socket for each of several runs at the same time."""


class SpareDescriptors:
    """Reserve of open file descriptors, released while a stop needs them. Not thread-safe."""

    def __init__(self, count: int = RESERVED_DESCRIPTORS) -> None:
        self._count, self._lend_count = count, 0
        self._held: list[int] = []
        self._fill()

    @contextmanager
    def lend(self) -> Iterator[None]:
        """Release the reserved descriptors while the context is entered.

        If contexts overlap, the last one to end reserves the descriptors again.
        """
        self._lend_count += 1
        self.close()
        try:
            yield
        finally:
            self._lend_count -= 1
            if not self._lend_count:
                self._fill()

    def close(self) -> None:
        """Release the reserved descriptors at the end of the studio; they are not reserved again."""
        while self._held:
            os.close(self._held.pop())

    def _fill(self) -> None:
        try:
            while len(self._held) < self._count:
                self._held.append(os.open(os.devnull, os.O_RDONLY))
        except OSError:
            return  # not enough free now: keep these, and try again after the next stop


MAX_CONNECTIONS = 200
"""Maximum number of connections to the studio, if there are file descriptors for them."""

MAX_CONNECTIONS_PER_ADDRESS = 128
"""Maximum number of connections of one address that have not signed in."""

MIN_CONNECTIONS = 8
"""Number of connections that are allowed even if few descriptors are left."""

HANDSHAKE_TIMEOUT, CLOSING_TIMEOUT = 5.0, 1.0
"""Seconds for the TLS handshake, and for the TLS shutdown."""

SIGN_IN_TIMEOUT = 10.0
"""Seconds from ``accept`` within which a connection must sign in."""

LATE_CHECK_INTERVAL = 1.0
"""Seconds between two checks for connections that have not signed in in time."""

COUNT_INTERVAL = 0.1
"""Minimum time in seconds between two counts of this process's descriptors."""

RETRY_INTERVAL = 0.1
"""Seconds for which no connection is accepted after the process has run out of file descriptors."""


class AuthLevel(IntEnum):
    """Credentials that a connection has shown: none, a browser's cookie, or also a proof or a token."""

    STRANGER = 0
    VISITOR = 1
    SIGNED_IN = 2


@dataclass(slots=True, eq=False)
class ClientConnection:
    """An accepted connection. ``accepted_at`` is the time in seconds by the acceptor's clock.

    ``transport`` is None until TLS is established. ``network`` is the client's address; of IPv6, the first 64 bits.
    """

    raw_socket: socket.socket
    network: str
    auth_level: AuthLevel = AuthLevel.STRANGER
    transport: asyncio.Transport | None = None
    accepted_at: float = 0.0

    @property
    def is_open(self) -> bool:
        """Whether the connection's file descriptor is still open."""
        return self.raw_socket.fileno() >= 0

    def close(self) -> None:
        """Close the connection in any state; its descriptor is closed in the next iteration of the event loop."""
        if self.transport is not None:
            self.transport.abort()
        elif self.is_open:
            with suppress(OSError):  # the peer has closed it
                self.raw_socket.shutdown(socket.SHUT_RDWR)


ProtocolFactory = Callable[[ClientConnection], asyncio.Protocol]


@dataclass(slots=True)
class ConnectionAcceptor:
    """Accepts connections, with TLS if there is an ``ssl_context``, and creates an HTTP protocol for each of them.

    All methods must be called on one event loop.
    """

    protocol: ProtocolFactory
    ssl_context: SSLContext | None = None
    clock: Clock = field(default_factory=SystemClock)
    connections: list[ClientConnection] = field(default_factory=list)
    _tasks: set[asyncio.Task[None]] = field(default_factory=set)
    _other_descriptors: int = 0
    _count_at: float = float("-inf")

    def open(self, listener: socket.socket) -> None:
        """Accept the connections of a listening socket."""
        listener.setblocking(False)
        self._start_task(self._accept(listener))
        self._start_task(self._check_late())

    def close(self) -> None:
        """Stop accepting, and cancel pending handshakes."""
        for task in self._tasks:
            task.cancel()
        for visit in self.connections:
            if visit.transport is None:
                visit.close()

    async def wait_closed(self) -> None:
        """Wait until all asyncio tasks of this acceptor have ended."""
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _accept(self, listener: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, address = await loop.sock_accept(listener)
            except ConnectionError:
                continue  # already closed
            except OSError:  # out of descriptors or memory
                self._evict_one(self.connections)
                await asyncio.sleep(RETRY_INTERVAL)
                continue
            visit = ClientConnection(connection, network_of(address))
            if self.admit(visit):
                self._start_task(self._serve(visit))
            else:
                connection.close()
            await asyncio.sleep(0)  # one per loop iteration, so that existing connections are served first

    async def _check_late(self) -> None:
        while True:
            await asyncio.sleep(LATE_CHECK_INTERVAL)
            self.close_late()

    def close_late(self) -> None:
        """Close the connections that did not sign in in time."""
        for visit in self.connections:
            if visit.auth_level is AuthLevel.STRANGER and self.clock.now() - visit.accepted_at > SIGN_IN_TIMEOUT:
                visit.close()

    def admit(self, visit: ClientConnection) -> bool:
        """Add the connection ``visit`` if there is room; return whether it was added.

        To make room, an older connection that has not signed in may be closed.
        """
        self.connections = [each for each in self.connections if each.is_open]
        same = [
            each for each in self.connections if each.network == visit.network and each.auth_level < AuthLevel.SIGNED_IN
        ]
        if len(same) >= MAX_CONNECTIONS_PER_ADDRESS:
            self._evict_one(same)
        elif len(self.connections) >= self._capacity() and not self._evict_one(self.connections):
            return False
        visit.accepted_at = self.clock.now()
        self.connections.append(visit)
        return True

    def _evict_one(self, among: list[ClientConnection]) -> bool:
        """Close one of the connections ``among``, unless all have signed in; return whether one was closed.

        Only connections with the lowest ``AuthLevel`` are considered. Of these, the oldest connection of the network
        that has the most connections is closed.
        """
        lowest = min((each.auth_level for each in among), default=AuthLevel.SIGNED_IN)
        if lowest is AuthLevel.SIGNED_IN:
            return False
        candidates = [each for each in among if each.auth_level is lowest]
        [(busiest, _)] = Counter(each.network for each in candidates).most_common(1)
        ended = next(each for each in candidates if each.network == busiest)
        ended.close()
        self.connections = [each for each in self.connections if each is not ended]
        return True

    def _capacity(self) -> int:
        """Return the number of connections for which there are file descriptors, without those reserved for stops."""
        now = self.clock.now()
        if now >= self._count_at:
            self._count_at = now + COUNT_INTERVAL
            self._other_descriptors = _open_descriptors() - len(self.connections)
        limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        if limit == resource.RLIM_INFINITY:
            return MAX_CONNECTIONS
        return max(MIN_CONNECTIONS, min(MAX_CONNECTIONS, limit - RESERVED_DESCRIPTORS - self._other_descriptors))

    async def _serve(self, visit: ClientConnection) -> None:
        """Do the TLS handshake, and pass the connection on to its HTTP protocol."""
        timeouts: dict[str, Any] = {}
        if self.ssl_context is not None:
            timeouts = {"ssl_handshake_timeout": HANDSHAKE_TIMEOUT, "ssl_shutdown_timeout": CLOSING_TIMEOUT}
        loop = asyncio.get_running_loop()
        try:
            await loop.connect_accepted_socket(
                lambda: self.protocol(visit), visit.raw_socket, ssl=self.ssl_context, **timeouts
            )
        except OSError:  # includes errors and timeouts of TLS
            visit.raw_socket.close()

    def _start_task(self, work: Any) -> None:
        task: asyncio.Task[None] = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def network_of(address: tuple[Any, ...]) -> str:
    """Return the network of a client's address, which limits treat as one client: of IPv6, the first 64 bits.

    A single home or server has 2**64 IPv6 addresses, so a limit for each address would have no effect.
    """
    found = ipaddress.ip_address(str(address[0]).partition("%")[0])
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    return str(found.ipv4_mapped or ipaddress.ip_network((found, 64), strict=False))


def _open_descriptors() -> int:
    """Return the number of open descriptors of this process; 0 if the system does not provide it."""
    with suppress(OSError):
        return len(os.listdir("/proc/self/fd"))  # noqa: PTH208 - up to ten times a second
    return 0
