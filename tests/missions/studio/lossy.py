"""A network between a page and the studio that is slow and loses segments, as TCP lets its users see that.

TCP loses nothing: a segment that was lost is sent again, and all that was sent after it waits. So each piece of up to
1460 bytes comes ``up`` or ``down`` seconds after it was sent, a lost one ``AGAIN`` seconds later still (twice the way
there and back, as the kernel's tail loss probe waits where nothing follows; lost again, twice as long), and never
before what was sent earlier. Connections lose for themselves.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from math import inf
from threading import Thread
from typing import Any

SEGMENT = 1460
AGAIN = 4.0
"""Delays until a lost segment is sent again."""

Loses = Callable[[int, bool], bool]
"""Says whether the next segment of a connection is lost: by the number of its websocket, or 0, and if upwards."""


class Lossy:
    """Passes on what comes to ``port`` to a ``target`` on this computer. ``upwards`` segments are on their way up;
    ``sockets`` websockets have been opened. ``rate`` is how many bytes a second come down, of each connection.

    The delays ``up`` and ``down`` and the rate may change at any time: what is sent from then on has the new ones.
    """

    def __init__(self, target: int, delay: float, loses: Loses) -> None:
        self.port = self.upwards = self.sockets = 0
        self.loses = loses
        self.up = self.down = delay
        self.rate = inf
        self._target = target

    async def serve(self) -> asyncio.Server:
        """Begin."""
        server = await asyncio.start_server(self._meet, "127.0.0.1", 0, limit=SEGMENT)
        self.port = server.sockets[0].getsockname()[1]
        return server

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, back = await asyncio.open_connection("127.0.0.1", self._target)
        first = await reader.read(SEGMENT)
        number = 0
        if first.startswith(b"GET /ws"):
            number = self.sockets = self.sockets + 1
        ways = (self._pass(number, True, first, reader, back), self._pass(number, False, b"", there, writer))
        try:
            with suppress(asyncio.CancelledError):
                await asyncio.gather(*ways)
        finally:
            for end in (back, writer):
                end.transport.abort()

    async def _pass(
        self, number: int, up: bool, data: bytes, source: asyncio.StreamReader, sink: asyncio.StreamWriter
    ) -> None:
        loop, last = asyncio.get_running_loop(), 0.0
        coming = deque[Callable[[], object]]()  # in order: the loop has none among what is due at one moment

        def come() -> None:
            coming.popleft()()
            self.upwards -= up

        with suppress(OSError):
            data = data or await source.read(SEGMENT)
            while data:
                delay = self.up if up else self.down
                due, wait = loop.time() + delay, AGAIN * delay
                while self.loses(number, up):
                    due, wait = due + wait, 2 * wait
                last = max(due, last + (0.0 if up else len(data) / self.rate))
                coming.append(partial(sink.write, data))
                self.upwards += up
                loop.call_at(last, come)
                data = await source.read(SEGMENT)
        coming.append(sink.close)
        self.upwards += up
        loop.call_at(max(last, loop.time() + (self.up if up else self.down)), come)


@contextmanager
def lossy(target: int, delay: float, loses: Loses) -> Iterator[Lossy]:
    """Have such a network in front of a port, on a thread of its own, until the end of the block."""
    network = Lossy(target, delay, loses)
    with served(network.serve):
        yield network


@contextmanager
def served(begin: Callable[[], Coroutine[Any, Any, asyncio.Server]]) -> Iterator[asyncio.Server]:
    """Have a server on a thread of its own until the end of the block."""
    loop = asyncio.new_event_loop()
    server = loop.run_until_complete(begin())
    thread = Thread(target=loop.run_forever, daemon=True)
    thread.start()

    async def end() -> None:
        server.close()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await asyncio.sleep(0)  # what was aborted is closed by now

    try:
        yield server
    finally:
        asyncio.run_coroutine_threadsafe(end(), loop).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
