"""The connections of the studio: how many there may be, and which of them go when room is short.

A connection is counted from ``accept`` on, so before TLS, until its descriptor is closed. One that has not signed in
goes for a newer one; one that has signed in never does.
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

# File descriptors that are kept for a stop: a studio that has none left for anything else can still look for runs.

RESERVED_DESCRIPTORS = 64
"""How many are kept: a folder, a note and a socket for each of some runs at the same time."""


class SpareDescriptors:
    """Holds descriptors, and lends their numbers while something important is done. For one thread."""

    def __init__(self, count: int = RESERVED_DESCRIPTORS) -> None:
        self._count, self._lent = count, 0
        self._held: list[int] = []
        self._fill()

    @contextmanager
    def lent(self) -> Iterator[None]:
        """Have them free while this is entered; from several places at once, until the last one leaves."""
        self._lent += 1
        self.close()
        try:
            yield
        finally:
            self._lent -= 1
            if not self._lent:
                self._fill()

    def close(self) -> None:
        """Hold none any more."""
        while self._held:
            os.close(self._held.pop())

    def _fill(self) -> None:
        try:
            while len(self._held) < self._count:
                self._held.append(os.open(os.devnull, os.O_RDONLY))
        except OSError:
            return  # there are not so many now: those that there are, and more after the next stop


MOST_CONNECTIONS = 200
"""Connections at once, if there are descriptors for them."""

MOST_OF_ADDRESS = 128
"""Connections of one address that have not signed in."""

MIN_CONNECTIONS = 8
"""Connections that there may be however few descriptors there are."""

HANDSHAKE_TIME, CLOSING_TIME = 5.0, 1.0
"""Seconds for the handshake of TLS, and for its end."""

ENTRY_TIME = 10.0
"""Seconds from ``accept`` until a connection has to have signed in."""

LOOK_INTERVAL = 1.0
"""Seconds from one look for connections that are late to the next."""

COUNT_INTERVAL = 0.1
"""Seconds from one count of the descriptors of this process to the next, at least."""

RETRY_INTERVAL = 0.1
"""Seconds for which nothing is accepted where the process has no descriptor left."""


class Standing(IntEnum):
    """What a connection has shown: nothing, the cookie of a browser, or also a proof (or a token)."""

    STRANGER = 0
    VISITOR = 1
    SIGNED_IN = 2


@dataclass(slots=True, eq=False)
class Visit:
    """A connection that was accepted at ``since`` (s). ``transport`` is None before TLS is done.

    ``network`` is its address, of IPv6 the first 64 bits.
    """

    connection: socket.socket
    network: str
    standing: Standing = Standing.STRANGER
    transport: asyncio.Transport | None = None
    since: float = 0.0

    @property
    def is_open(self) -> bool:
        """Whether it still has its descriptor."""
        return self.connection.fileno() >= 0

    def hang_up(self) -> None:
        """End it, in whatever state it is; its descriptor is closed in the next turn of the loop."""
        if self.transport is not None:
            self.transport.abort()
        elif self.is_open:
            with suppress(OSError):  # the other side has ended it
                self.connection.shutdown(socket.SHUT_RDWR)


ProtocolFactory = Callable[[Visit], asyncio.Protocol]


@dataclass(slots=True)
class Doors:
    """Accepts connections, with TLS where ``secure`` says how, and gives each a protocol. For one event loop."""

    protocol: ProtocolFactory
    secure: SSLContext | None = None
    clock: Clock = field(default_factory=SystemClock)
    visits: list[Visit] = field(default_factory=list)
    _tasks: set[asyncio.Task[None]] = field(default_factory=set)
    _others: int = 0
    _count_at: float = float("-inf")

    def open(self, listener: socket.socket) -> None:
        """Accept the connections of a socket that listens."""
        listener.setblocking(False)
        self._begin(self._accept(listener))
        self._begin(self._look())

    def close(self) -> None:
        """Accept nothing more, and end the handshakes that go on."""
        for task in self._tasks:
            task.cancel()
        for visit in self.visits:
            if visit.transport is None:
                visit.hang_up()

    async def wait_closed(self) -> None:
        """Wait until all that was going on here has ended."""
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _accept(self, listener: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, address = await loop.sock_accept(listener)
            except ConnectionError:
                continue  # it had gone before
            except OSError:  # no descriptor, or no memory
                self._end_one(self.visits)
                await asyncio.sleep(RETRY_INTERVAL)
                continue
            visit = Visit(connection, network_of(address))
            if self.admit(visit):
                self._begin(self._serve(visit))
            else:
                connection.close()
            await asyncio.sleep(0)  # one in a turn: those that are there are heard first

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(LOOK_INTERVAL)
            self.end_late()

    def end_late(self) -> None:
        """Hang up on those whose time to sign in is over."""
        for visit in self.visits:
            if visit.standing is Standing.STRANGER and self.clock.now() - visit.since > ENTRY_TIME:
                visit.hang_up()

    def admit(self, visit: Visit) -> bool:
        """Count a connection, for which another one may have to go; return whether there is room."""
        self.visits = [each for each in self.visits if each.is_open]
        same = [each for each in self.visits if each.network == visit.network and each.standing < Standing.SIGNED_IN]
        if len(same) >= MOST_OF_ADDRESS:
            self._end_one(same)
        elif len(self.visits) >= self._room() and not self._end_one(self.visits):
            return False
        visit.since = self.clock.now()
        self.visits.append(visit)
        return True

    def _end_one(self, among: list[Visit]) -> bool:
        """Hang up on the oldest of those that have shown least, of the address with most of them."""
        lowest = min((each.standing for each in among), default=Standing.SIGNED_IN)
        if lowest is Standing.SIGNED_IN:
            return False
        candidates = [each for each in among if each.standing is lowest]
        [(busiest, _)] = Counter(each.network for each in candidates).most_common(1)
        ended = next(each for each in candidates if each.network == busiest)
        ended.hang_up()
        self.visits = [each for each in self.visits if each is not ended]
        return True

    def _room(self) -> int:
        """Return for how many connections there are descriptors, without those in reserve."""
        now = self.clock.now()
        if now >= self._count_at:
            self._count_at = now + COUNT_INTERVAL
            self._others = _open_descriptors() - len(self.visits)
        limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        if limit == resource.RLIM_INFINITY:
            return MOST_CONNECTIONS
        return max(MIN_CONNECTIONS, min(MOST_CONNECTIONS, limit - RESERVED_DESCRIPTORS - self._others))

    async def _serve(self, visit: Visit) -> None:
        """Do the handshake, and hand the connection over to its protocol."""
        timeouts: dict[str, Any] = {}
        if self.secure is not None:
            timeouts = {"ssl_handshake_timeout": HANDSHAKE_TIME, "ssl_shutdown_timeout": CLOSING_TIME}
        loop = asyncio.get_running_loop()
        try:
            await loop.connect_accepted_socket(
                lambda: self.protocol(visit), visit.connection, ssl=self.secure, **timeouts
            )
        except OSError:  # as of TLS, and of its timeout
            visit.connection.close()

    def _begin(self, work: Any) -> None:
        task: asyncio.Task[None] = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def network_of(address: tuple[Any, ...]) -> str:
    """Return what counts as one address: a home or a server has 2**64 addresses of IPv6."""
    found = ipaddress.ip_address(str(address[0]).partition("%")[0])
    if isinstance(found, ipaddress.IPv4Address):
        return str(found)
    return str(found.ipv4_mapped or ipaddress.ip_network((found, 64), strict=False))


def _open_descriptors() -> int:
    """Return how many descriptors this process has open; none where the system does not tell."""
    with suppress(OSError):
        return len(os.listdir("/proc/self/fd"))  # noqa: PTH208 - up to ten times a second
    return 0
