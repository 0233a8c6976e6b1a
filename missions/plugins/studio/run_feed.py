"""Connections to runs; and the feed of a run, which all watching clients of the studio share."""

import asyncio
import itertools
import json
import re
import secrets
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Self

from config.file_io import parse_object
from drivers.clock import Clock, SystemClock
from missions.control import sockets
from missions.control.clients import WATCH_NOTHING, ClientQueue
from missions.control.command_broadcast import STOP_TRIES
from missions.control.commands import BadMessage, WatchCommand
from missions.control.messages import RunOverMessage, encode_json, encode_message
from missions.control.processes import ProcessIdentity, identity_of
from missions.control.run_search import FoundProcess, addresses_of
from missions.control.sockets import MAX_MESSAGE_BYTES, REPLY_TIMEOUT

# Connection of the studio to a run's control socket: sends commands, forwards messages unchanged.

OnLine = Callable[[bytes], Awaitable[None]]
"""Async callback for each line that a run sends.

While the callback waits, no line is read, so the run keeps only its newest state for sending.
"""


async def ignore_line(line: bytes) -> None:
    """Do nothing: the default callback for lines of a run."""
    del line


def ignore_end() -> None:
    """Do nothing: the default callback for the end of a connection."""


class AsyncRunLink:
    """Connection to the control socket of a run, made by ``open``. ``about`` is the run's first message, about itself.

    ``on_closed`` is called after the last line, when the connection ends, unless ``close`` ended it.
    """

    def __init__(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        on_line: OnLine,
        on_closed: Callable[[], None],
    ) -> None:
        self._reader, self._writer, self.on_line, self._on_closed = reader, writer, on_line, on_closed
        self.about: Mapping[str, Any] = {}
        self.process, self.uid = sockets.peer_credentials(writer.get_extra_info("socket"))
        self.where: sockets.Address = ""
        self.identity: ProcessIdentity | None = None
        self.closed = asyncio.Event()
        self.stopping = asyncio.Lock()
        self._numbers = itertools.count(-1, -1)  # negative: numbers of clients are not
        self._pending: dict[int, asyncio.Future[Mapping[str, Any]]] = {}
        self._task: asyncio.Task[None] | None = None

    @classmethod
    async def open(
        cls, where: sockets.Address, on_line: OnLine = ignore_line, on_closed: Callable[[], None] = ignore_end
    ) -> Self:
        """Connect to the run at ``where``. Raises OSError, or TimeoutError if the run does not answer."""
        plain = await asyncio.to_thread(sockets.connect, where)
        plain.setblocking(False)
        reader, writer = await asyncio.open_unix_connection(sock=plain, limit=MAX_MESSAGE_BYTES)
        link = cls(reader, writer, on_line, on_closed)
        try:
            link.where, link.identity = where, identity_of(link.process)
            async with asyncio.timeout(REPLY_TIMEOUT):
                link.about = parse_object(await reader.readline() or b"{}")
        except BaseException:
            writer.close()
            raise
        link._task = asyncio.create_task(link._read())
        return link

    async def open_another(
        self, on_line: OnLine = ignore_line, on_closed: Callable[[], None] = ignore_end
    ) -> "AsyncRunLink":
        """Return another connection to the same run, even if its control socket has moved. Raises OSError, ValueError.

        A run of the same name in another container is refused.
        """
        run = str(self.about.get("run", ""))
        error: OSError = ConnectionRefusedError(f"run {run} has no control socket")
        for where in dict.fromkeys([self.where, *await asyncio.to_thread(addresses_of, run)]):
            try:
                link = await AsyncRunLink.open(where, on_line, on_closed)
            except OSError as found:
                error = found
                continue
            if link.run_identity == self.run_identity:
                return link
            await link.close()
        raise error

    @property
    def run_identity(self) -> tuple[object, ...]:
        """Key that distinguishes this run from others of the same name."""
        members = "run", "pid", "began", "mission", "robot", "simulated"
        return self.identity, *(self.about.get(name) for name in members)

    def is_connected_to(self, found: FoundProcess) -> bool:
        """Return whether this connection leads to the run ``found``.

        It is also True if the run is in a container, and ``found`` describes it as seen from outside the container.
        """
        is_known = self.identity is not None and self.identity in (found.identity, found.local_identity)
        return is_known or self.where in found.addresses

    def send(self, command: Mapping[str, object]) -> None:
        """Send a command; its answer arrives as a line."""
        self._writer.write(json.dumps(command).encode() + b"\n")

    async def request(self, command: Mapping[str, object], timeout: float = REPLY_TIMEOUT) -> Mapping[str, Any]:
        """Send a command and return its answer. Raises TimeoutError, ConnectionError."""
        number = next(self._numbers)
        future = self._pending[number] = asyncio.get_running_loop().create_future()
        try:
            self.send({**command, "id": number})
            async with asyncio.timeout(timeout):
                answer: Mapping[str, Any] = await future
                return answer
        finally:
            del self._pending[number]

    @property
    def unread(self) -> int:
        """Number of bytes sent that the run has not read."""
        return self._writer.transport.get_write_buffer_size()

    async def stop(self, by: str, press: str) -> Mapping[str, object]:
        """Stop the run; if it does not answer, terminate it.

        Return its answer, with a text `trouble` if it may not have stopped. ``by`` names the person who stops it.
        ``press`` identifies the press of STOP, so that it counts once if it arrives twice.
        """
        press = press or secrets.token_hex(8)  # the tries of one stop count once
        for _ in range(STOP_TRIES):
            try:
                answer = await self.request({"do": "stop", "by": by, "press": press})
            except TimeoutError:
                try:
                    self.terminate()
                except OSError as error:
                    return {"trouble": f"it does not answer, and SIGTERM could not be sent: {error}"}
                return {"trouble": "it does not answer; SIGTERM was sent to end it"}
            except ConnectionError as error:
                return {"trouble": str(error)}
            result: Mapping[str, object] = answer.get("result") or {"trouble": str(answer.get("message", ""))}
            if not result.get("missing"):
                return result
        missing = ", ".join(map(str, result["missing"])) if isinstance(result["missing"], list) else ""
        return {**result, "trouble": f"perhaps not stopped: {missing}"}

    def has_ended(self) -> bool:
        """Return whether the run's process is known to have ended."""
        try:
            return self.identity is not None and not self.identity.is_alive()
        except OSError:
            return False

    def terminate(self) -> None:
        """Send SIGTERM to the run's process, where it is handled even if the run hangs. Raises OSError."""
        if self.identity is None:
            raise OSError("its process is not visible from here")
        self.identity.terminate()

    async def close(self) -> None:
        """Close the connection; the run then stops the parts that it drove."""
        self._writer.close()
        if self._task is not None and self._task is not asyncio.current_task():
            self._task.cancel()
            with suppress(asyncio.CancelledError, OSError):
                await self._task
        with suppress(OSError):
            await self._writer.wait_closed()

    async def _read(self) -> None:
        try:
            while line := await self._reader.readline():
                if self._pending and line.startswith(b'{"say":"answer","id":-'):
                    answer = parse_object(line)
                    future = self._pending.get(answer["id"])
                    if future is not None and not future.done():
                        future.set_result(answer)
                else:
                    await self.on_line(line)
        except (OSError, ValueError):
            pass
        finally:
            self._writer.close()
            self.on_line = ignore_line  # breaks the reference cycle with the owner's callback
            self.closed.set()
            for future in self._pending.values():
                if not future.done():
                    future.set_exception(ConnectionError("the run has ended"))
        self._on_closed()


PICTURE_PATTERN = re.compile(rb'\{"say":"picture","run":"[^"]*","t":(-?[\d.e+-]+)')
"""Pattern of the beginning of a picture message, with the picture's time.

The rest of the message is forwarded without being parsed.
"""

Connect = Callable[[OnLine, Callable[[], None]], Awaitable[AsyncRunLink]]
"""Function that connects to a run, given callbacks for the run's lines and for the end of the connection.

It raises OSError or ValueError.
"""

SCENE_TIMEOUT = 10.0
"""Seconds within which a run must send its complete state to a client that begins to watch it."""


class FeedClient(ClientQueue):
    """Queue of lines for one client that is watching a run; ends with the run or with ``end``."""

    def __init__(self, feed: "RunFeed") -> None:
        super().__init__(feed.run, feed.encode_state)
        self.feed = feed
        self.is_over = False
        self._has_more = asyncio.Event()

    def flush(self) -> None:
        """Wake the asyncio task that sends the queued lines."""
        self._has_more.set()

    def end(self) -> None:
        """End the queue: ``lines`` then yields no more lines."""
        self.is_over = True
        self._has_more.set()

    async def lines(self) -> AsyncIterator[bytes]:
        """Yield the lines to send, as they arrive, until the end."""
        while not self._has_ended():
            await self._has_more.wait()
            self._has_more.clear()
            while (line := self.next_line()) is not None:
                yield line

    def _has_ended(self) -> bool:
        return self.is_over or self.is_disconnected


class RunFeed:
    """Feed of a ``run`` to all clients that watch it, over one connection, which is closed when no client watches."""

    def __init__(self, run: str, connect: Connect, clock: Clock | None = None) -> None:
        self.run, self._connect, self._clock = run, connect, clock or SystemClock()
        self._link: AsyncRunLink | None = None
        self._clients: list[FeedClient] = []
        self._request_lock = asyncio.Lock()
        self._requested = WATCH_NOTHING
        self._next_scene: tuple[FeedClient, WatchCommand] | None = None  # the client that gets the next complete state
        self._line: tuple[object, bytes] = (None, b"")
        self._picture: tuple[float, bytes] | None = None
        self._is_over = False
        self._tasks: set[asyncio.Task[None]] = set()

    def encode_state(self, state: Mapping[str, object]) -> bytes:
        """Return a state as a line of JSON.

        The state that was received last is not encoded again: the line in which it arrived is returned.
        """
        return self._line[1] if self._line[0] is state else encode_json(state)

    async def watch(self, client: FeedClient, command: WatchCommand) -> None:
        """Begin to send a client the topics in ``command``, after a complete state of the run. Raises BadMessage."""
        async with self._request_lock:
            self._next_scene = client, command
            try:
                if self._link is None:
                    self._link = await self._connect(self._on_line, self._on_closed)
                    self._is_over = False
                await self._request(
                    self._link, [*(each.watch for each in self._clients if each is not client), command]
                )
            except (OSError, ValueError) as error:  # OSError includes TimeoutError and ConnectionError
                raise BadMessage("no_answer", f"run {self.run} does not answer: {error}") from error
            finally:
                self._next_scene = None

    def leave(self, client: FeedClient) -> None:
        """Remove a client that no longer watches the run; returns at once."""
        client.end()
        if client in self._clients:
            self._clients.remove(client)
            if self._picture is not None:
                self._acknowledge(self._picture[0])  # the client that left may have been the one to acknowledge
            task = asyncio.ensure_future(self._reduce_request())
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """Close the feed's connection to its run, if it is open."""
        if self._link is not None:
            link, self._link, self._picture = self._link, None, None
            await link.close()

    def on_seen(self, client: FeedClient, stamp: float) -> None:
        """Handle a client's acknowledgement of the picture with time ``stamp``; the run may then send another one."""
        client.on_picture_shown(stamp)
        self._acknowledge(stamp)
        if self._picture is not None:
            self._offer_picture(client, *self._picture)

    async def _reduce_request(self) -> None:
        async with self._request_lock:
            watches = [each.watch for each in self._clients]
            if not watches:
                await self.close()
            elif self._link is not None and merge_watches(watches) != self._requested:
                with suppress(OSError):
                    await self._request(self._link, watches)

    async def _request(self, link: AsyncRunLink, watches: Sequence[WatchCommand]) -> None:
        """Request from the run all topics that the clients watch; the run answers with its complete state first."""
        self._requested = merge_watches(watches)
        members = {name: getattr(self._requested, name) for name in ("state", "events", "pictures")}
        await link.request({"do": "watch", **members}, SCENE_TIMEOUT)

    def _acknowledge(self, stamp: float) -> None:
        if self._link is not None:
            self._link.send({"do": "seen", "t": stamp})

    def _offer_picture(self, client: FeedClient, stamp: float, line: bytes) -> bool:
        """Queue the picture taken at ``stamp`` for a client, unless its picture rate forbids it.

        Return whether the picture was queued.
        """
        wants = client.is_picture_due(self._clock.now())
        if wants:
            client.add_picture(line, stamp, self._clock.now())
        return wants

    async def _on_line(self, line: bytes) -> None:
        """Forward a line of the run to the clients that requested its topic."""
        line = self._rename_run(line)
        if found := PICTURE_PATTERN.match(line):
            self._picture = float(found[1]), line
            if not [each for each in self._clients if self._offer_picture(each, *self._picture)]:
                self._acknowledge(self._picture[0])
        elif line.startswith(b'{"say":"state"'):
            state = parse_object(line)
            self._line = state, line
            for each in self._clients:
                each.add_state(state)
        elif line.startswith(b'{"say":"events"'):
            message = parse_object(line)
            for each in self._clients:
                each.add_events(message["events"], message.get("lost", 0))
        elif line.startswith(b'{"say":"scene"') and self._next_scene is not None:
            hearer, command = self._next_scene
            if hearer not in self._clients and not hearer.is_over:
                self._clients.append(hearer)
            hearer.start_watch(command, line)
        elif line.startswith(b'{"say":"over"'):
            self._end(line)

    def _rename_run(self, line: bytes) -> bytes:
        """Return a line of the run with the name that the studio gives the run.

        This name differs from the run's own if two runs have the same name.
        """
        own = "" if self._link is None else str(self._link.about.get("run", self.run))
        if own in ("", self.run):
            return line
        return line.replace(b'"run":' + encode_json(own), b'"run":' + encode_json(self.run), 1)

    def _end(self, line: bytes) -> None:
        self._is_over = True
        for each in self._clients:
            each.send_first(line)

    def _on_closed(self) -> None:
        """Handle the end of the connection: end all clients' queues.

        If the run has not sent a final message, each client first gets one.
        """
        if not self._is_over:
            self._end(
                encode_message(
                    RunOverMessage(run=self.run, result="", reason="the run ended without a message", seconds=0.0)
                )
            )
        self._link = self._picture = None
        while self._clients:
            self._clients.pop().end()


def merge_watches(watches: Sequence[WatchCommand]) -> WatchCommand:
    """Return one command that requests from a run all topics that any of ``watches`` requests."""
    return WatchCommand(
        state=any(each.state for each in watches),
        events=any(each.events for each in watches),
        pictures=max(each.pictures for each in watches),
    )
