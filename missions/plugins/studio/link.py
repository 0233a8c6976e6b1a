"""The studio's connection to a run's control socket: commands go in, and each message is passed on as it comes."""

import asyncio
import itertools
import json
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from typing import Any, Self

from config.reading import parse_object
from missions.control import sockets
from missions.control.processes import ProcessIdentity, identity_of
from missions.control.searching import Found, addresses_of
from missions.control.sockets import LARGEST, PATIENCE
from missions.control.stopping import STOP_TRIES

OnLine = Callable[[bytes], Awaitable[None]]
"""Gets each line of a run; while it waits, the run keeps the rest, and makes one of it."""


async def ignore(line: bytes) -> None:
    """Do nothing with a line."""
    del line


def nothing() -> None:
    """Do nothing about an end."""


class Link:
    """A connection to a run. Made by ``open``; ``about`` is the run's first message. ``closed`` once it has gone.

    ``on_closed`` is called then, unless it was by ``close``, after the last line.
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
        self.process, self.uid = sockets.peer_of(writer.get_extra_info("socket"))
        self.where: sockets.Address = ""
        self.identity: ProcessIdentity | None = None
        self.closed = asyncio.Event()
        self.stopping = asyncio.Lock()
        self._numbers = itertools.count(-1, -1)  # below all that clients give
        self._asked: dict[int, asyncio.Future[Mapping[str, Any]]] = {}
        self._task: asyncio.Task[None] | None = None

    @classmethod
    async def open(
        cls, where: sockets.Address, on_line: OnLine = ignore, on_closed: Callable[[], None] = nothing
    ) -> Self:
        """Connect to the run at ``where``. Raises OSError; TimeoutError where it does not answer."""
        plain = await asyncio.to_thread(sockets.connect, where)
        plain.setblocking(False)
        reader, writer = await asyncio.open_unix_connection(sock=plain, limit=LARGEST)
        link = cls(reader, writer, on_line, on_closed)
        try:
            link.where, link.identity = where, identity_of(link.process)
            async with asyncio.timeout(PATIENCE):
                link.about = parse_object(await reader.readline() or b"{}")
        except BaseException:
            writer.close()
            raise
        link._task = asyncio.create_task(link._read())
        return link

    async def again(self, on_line: OnLine = ignore, on_closed: Callable[[], None] = nothing) -> "Link":
        """Return another connection to the same run, also at an address that it has since. Raises OSError, ValueError.

        A run of the same name, in another container, is refused.
        """
        run = str(self.about.get("run", ""))
        error: OSError = ConnectionRefusedError(f"run {run} has no control socket")
        for where in dict.fromkeys([self.where, *await asyncio.to_thread(addresses_of, run)]):
            try:
                link = await Link.open(where, on_line, on_closed)
            except OSError as found:
                error = found
                continue
            if link.run_identity == self.run_identity:
                return link
            await link.close()
        raise error

    @property
    def run_identity(self) -> tuple[object, ...]:
        """What tells this run from others of its name."""
        members = "run", "pid", "began", "mission", "robot", "simulated"
        return self.identity, *(self.about.get(name) for name in members)

    def is_to(self, found: Found) -> bool:
        """Return whether this is a connection to what a search has found, also from outside of its container."""
        is_known = self.identity is not None and self.identity in (found.identity, found.visible)
        return is_known or self.where in found.addresses

    def send(self, command: Mapping[str, object]) -> None:
        """Send a command; its answer comes as a line."""
        self._writer.write(json.dumps(command).encode() + b"\n")

    async def ask(self, command: Mapping[str, object], patience: float = PATIENCE) -> Mapping[str, Any]:
        """Send a command and return its answer. Raises TimeoutError, ConnectionError."""
        number = next(self._numbers)
        future = self._asked[number] = asyncio.get_running_loop().create_future()
        try:
            self.send({**command, "id": number})
            async with asyncio.timeout(patience):
                answer: Mapping[str, Any] = await future
                return answer
        finally:
            del self._asked[number]

    @property
    def unread(self) -> int:
        """How many bytes wait for the run to read them."""
        return self._writer.transport.get_write_buffer_size()

    async def stop(self, by: str, press: str) -> Mapping[str, object]:
        """Stop the run; end it by a signal if it does not answer. Return its result, with `trouble` if in doubt."""
        for _ in range(STOP_TRIES):
            try:
                answer = await self.ask({"do": "stop", "by": by, "press": press})
            except TimeoutError:
                try:
                    self.terminate()
                except OSError as error:
                    return {"trouble": f"it does not answer, and SIGTERM could not be sent: {error}"}
                return {"trouble": "it does not answer: SIGTERM was sent, which ends it"}
            except ConnectionError as error:
                return {"trouble": str(error)}
            result: Mapping[str, object] = answer.get("result") or {"trouble": str(answer.get("message", ""))}
            if not result.get("missing"):
                return result
        missing = ", ".join(map(str, result["missing"])) if isinstance(result["missing"], list) else ""
        return {**result, "trouble": f"perhaps not stopped: {missing}"}

    def has_ended(self) -> bool:
        """Return whether the process at the other end has ended, as far as that is known."""
        try:
            return self.identity is not None and not self.identity.lives()
        except OSError:
            return False

    def terminate(self) -> None:
        """Send the run the signal that its watchdog hears, whatever hangs. Raises OSError where that cannot be."""
        if self.identity is None:
            raise OSError("its process is not seen from here")
        self.identity.terminate()

    async def close(self) -> None:
        """Hang up: what was driven by this connection stands."""
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
                if self._asked and line.startswith(b'{"say":"answer","id":-'):
                    answer = parse_object(line)
                    future = self._asked.get(answer["id"])
                    if future is not None and not future.done():
                        future.set_result(answer)
                else:
                    await self.on_line(line)
        except (OSError, ValueError):
            pass
        finally:
            self._writer.close()
            self.on_line = ignore  # a callback that keeps this link would keep it, and its owner, until a collection
            self.closed.set()
            for future in self._asked.values():
                if not future.done():
                    future.set_exception(ConnectionError("the run has gone"))
        self._on_closed()
