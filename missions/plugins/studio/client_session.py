"""Session of one client of the studio: reads its commands, checks its role, and sends the messages of runs."""

import asyncio
from collections.abc import Coroutine, Mapping
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from drivers.clock import Clock, SystemClock
from missions.codec import encode_tagged
from missions.control.commands import (
    CODEC_RULES,
    COMMAND_KEY,
    BadMessage,
    ClientCommand,
    PictureShownCommand,
    Role,
    RunCommand,
    StopCommand,
    WatchCommand,
    find_id,
    read_command,
)
from missions.control.messages import AnswerMessage, RunsMessage, encode_message
from missions.plugins.studio.access import SignIn
from missions.plugins.studio.auth_gate import link_to
from missions.plugins.studio.run_feed import AsyncRunLink, FeedClient
from missions.plugins.studio.studio import Studio
from missions.plugins.studio.studio_commands import COMMANDS, Hello, RecordQuery

MAX_COMMAND_RATE = 100.0
"""Rate limit: maximum commands of a client per second, with a small burst. A `stop` is never refused."""

MAX_PENDING_COMMANDS = 64
"""Maximum number of a client's commands that wait to be sent to their runs."""

MAX_UNREAD_BYTES = 65536
"""Maximum number of bytes that were sent to a run and that the run has not read."""

HELLO_TIMEOUT = 10.0
"""Seconds within which a client must send `hello`."""

STOP_TIMEOUT = 10.0
"""Seconds for which the session of a disconnected client is kept for its pending stops."""

CLOSE_POLICY_VIOLATION = 1008
"""Websocket close code for a client that breaks the protocol."""


class ClientSession:
    """Serves one websocket until it is closed. Then its connections to runs end, which stops the parts it drove."""

    def __init__(
        self,
        socket: WebSocket,
        role: Role,
        name: str,
        studio: Studio,
        *,
        sign_in: SignIn | None = None,
        clock: Clock | None = None,
    ) -> None:
        self.role, self.name, self._sign_in = role, name, sign_in
        self._socket, self._studio = socket, studio
        self._clock = clock or SystemClock()
        self._allowance, self._counted_at = MAX_COMMAND_RATE, self._clock.now()
        self._sending = asyncio.Lock()
        self._links: dict[str, AsyncRunLink] = {}
        self._run_commands: asyncio.Queue[RunCommand] = asyncio.Queue(MAX_PENDING_COMMANDS)
        self._tasks: set[asyncio.Task[None]] = set()
        self._stops: set[asyncio.Task[None]] = set()
        self._feed_clients: dict[str, FeedClient] = {}
        self._epoch, self._is_shut_out = studio.access.epoch, False
        self._serve_task: asyncio.Task[Any] | None = None
        self._runs: RunsMessage | None = None
        self._has_news = asyncio.Event()

    async def run(self) -> None:
        """Serve the client until it disconnects."""
        self._serve_task = asyncio.current_task()
        await self._socket.accept()
        try:
            async with asyncio.timeout(HELLO_TIMEOUT):
                greeted = await self._check_hello(await self._receive())
            if not greeted or self._epoch != self._studio.access.epoch:
                await self._socket.close(CLOSE_POLICY_VIOLATION)
                return
            self._start_task(self._relay())
            self._start_task(self._send_newest_runs())
            with self._studio.register(self):
                self.send_runs(RunsMessage(runs=self._studio.hub.runs()))
                while True:
                    await self._handle_line(await self._receive())
        except asyncio.CancelledError:
            if not self._is_shut_out:
                raise
        except (WebSocketDisconnect, TimeoutError, RuntimeError):
            pass  # disconnected, or sent no `hello`
        finally:
            # Close these first: the end of a connection stops the parts that it drives.
            await asyncio.gather(*(link.close() for link in self._links.values()), return_exceptions=True)
            if self._stops:  # stops are finished and logged even after the client disconnects
                await asyncio.wait(self._stops, timeout=STOP_TIMEOUT)
            for task in list(self._tasks):
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._is_shut_out:
            with suppress(WebSocketDisconnect, RuntimeError):
                await self._socket.close(CLOSE_POLICY_VIOLATION)

    def disconnect(self) -> None:
        self._is_shut_out = True
        if self._serve_task is not None:
            self._serve_task.cancel()

    def send_runs(self, runs: RunsMessage) -> None:
        """Send the list of runs as soon as the client can receive it.

        If several lists wait, only the newest is sent.
        """
        self._runs = runs
        self._has_news.set()

    async def _send_newest_runs(self) -> None:
        while await self._has_news.wait():
            self._has_news.clear()
            if self._runs is not None:
                await self.send(self._runs)

    async def send(self, message: object) -> None:
        """Send a message to the client."""
        await self._send_text(encode_message(message).decode())

    async def _send_text(self, text: str) -> None:
        async with self._sending:
            with suppress(WebSocketDisconnect, RuntimeError):
                await self._socket.send_text(text)

    async def _receive(self) -> str:
        """Return the next message; a binary message is decoded as text."""
        message = await self._socket.receive()
        if message["type"] != "websocket.receive":
            raise WebSocketDisconnect(message.get("code", 1005))
        text, data = message.get("text"), message.get("bytes")
        return text if isinstance(text, str) else bytes(data or b"").decode("utf-8", "replace")

    async def _check_hello(self, line: str) -> bool:
        """Answer the first command; return whether it is a valid `hello`."""
        try:
            command = read_command(line, commands=COMMANDS)
            if not isinstance(command, Hello):
                raise BadMessage("hello_first", "the first command must be hello", '{"do": "hello", "version": "2"}')
            if command.version not in self._studio.versions:
                raise BadMessage("old_page", "this page belongs to another version of the studio", "reload it")
        except BadMessage as error:
            await self.send(_error_answer(find_id(line), error))
            return False
        await self.send(self._studio.welcome(self.role, self.name))
        return True

    async def _handle_line(self, line: str) -> None:
        """Read a command and run or queue it, without waiting for its end: a stop may follow at once."""
        try:
            command = read_command(line, commands=COMMANDS)
            if isinstance(command, StopCommand):
                self._stops.add(stop := self._start_task(self._run_and_answer(command, self._stop(command))))
                stop.add_done_callback(self._stops.discard)
                if not self._has_allowance():
                    await asyncio.sleep(1 / MAX_COMMAND_RATE)  # the command is done, but this client's next one waits
                return
            if not self._has_allowance():
                raise BadMessage("too_many", f"more than {MAX_COMMAND_RATE:g} commands per second")
            if command.role == "operator" and self.role != "operator":
                self._studio.audit.write(self.name, self.role, {COMMAND_KEY: command.word}, "not_allowed")
                raise BadMessage("not_allowed", "viewers may not do this", "open the operator's link")
            if isinstance(command, RunCommand) and not isinstance(command, WatchCommand | PictureShownCommand):
                self._run_commands.put_nowait(command)
            elif isinstance(command, Hello):
                await self.send(self._studio.welcome(self.role, self.name))
            elif len(self._tasks) > MAX_PENDING_COMMANDS:
                raise asyncio.QueueFull
            else:
                self._start_task(self._run_and_answer(command, self._run_command(command)))
        except asyncio.QueueFull:
            await self.send(_error_answer(find_id(line), BadMessage("too_many", "too many pending commands")))
        except BadMessage as error:
            await self.send(_error_answer(find_id(line), error))

    def _has_allowance(self) -> bool:
        now = self._clock.now()
        had = min(MAX_COMMAND_RATE, self._allowance + (now - self._counted_at) * MAX_COMMAND_RATE)
        self._allowance, self._counted_at = max(0.0, had - 1.0), now
        return had >= 1.0

    async def _run_and_answer(self, command: ClientCommand, work: Any) -> None:
        """Await ``work``, which runs a command of the studio, and send its result or error as the answer."""
        outcome = "ok"
        try:
            result = await work
        except BadMessage as error:
            outcome = error.error
            await self.send(_error_answer(command.id, error))
        except Exception as error:  # an internal error must not end the session
            outcome = "fault"
            await self.send(_error_answer(command.id, BadMessage("fault", f"{type(error).__name__}: {error}")))
        else:
            if command.id is not None:
                await self.send(AnswerMessage(id=command.id, ok=True, result=result))
        self._studio.log_command(self, self.role, command, outcome)

    async def _run_command(self, command: ClientCommand) -> Mapping[str, object] | None:
        match command:
            case WatchCommand():
                try:
                    await self._watch(command)
                except BadMessage as error:
                    if words := await self._studio.last_output(command.run):
                        raise BadMessage("no_such_run", words) from error
                    raise
            case PictureShownCommand():
                self._acknowledge_picture(command)
            case RecordQuery() if self.role == "operator":
                paths = {"report": f"/reports/{command.name}", "download": f"/records/{command.name}"}
                links = {name: link_to(path, self._sign_in) for name, path in paths.items()}
                return {**await self._studio.run_command(command, self), "links": links}
            case _:
                return await self._studio.run_command(command, self)
        return None

    async def _stop(self, command: StopCommand) -> Mapping[str, object]:
        return {"stopped": await self._studio.stop(command.run, self.name, command.press)}

    # --- what goes to and comes from runs -----------------------------------------------------------------------------

    async def _relay(self) -> None:
        """Forward the client's queued commands to their runs, in order."""
        while True:
            command = await self._run_commands.get()
            outcome = "ok"
            try:
                link = await self._link(command.run)
                if link.unread > MAX_UNREAD_BYTES:
                    raise BadMessage("no_answer", f"run {command.run} does not read its commands")
                members = {
                    name: value
                    for name, value in encode_tagged(command, COMMAND_KEY, CODEC_RULES).items()
                    if name != "run"
                }
                link.send({**members, "by": self.name})
            except BadMessage as error:
                outcome = error.error
                await self.send(_error_answer(command.id, error))
            self._studio.log_command(self, self.role, command, outcome)

    async def _link(self, run: str) -> AsyncRunLink:
        """Return this client's own connection to a run, which closes with the client. Raises BadMessage."""
        link = self._links.get(run)
        if link is not None and not link.closed.is_set():
            return link
        self._studio.hub.about_run(run)

        async def answered(line: bytes) -> None:
            if line.startswith(b'{"say":"answer"'):
                await self._send_text(line.decode())

        try:
            link = self._links[run] = await self._studio.hub.connect(run, answered)
        except (OSError, ValueError) as error:  # OSError includes TimeoutError
            raise BadMessage("no_answer", f"run {run} does not answer: {error}") from error
        return link

    async def _watch(self, command: WatchCommand) -> None:
        """Begin or end watching a run over the connection that all watchers share."""
        hearer = self._feed_clients.get(command.run)
        if not (command.state or command.events or command.pictures):
            if hearer is not None:
                hearer.feed.leave(hearer)
            return
        watching = self._studio.hub.feed_of(command.run)
        if hearer is None or hearer.is_over or hearer.feed is not watching:
            hearer = self._feed_clients[command.run] = FeedClient(watching)
            self._start_task(self._pass_on(hearer))
        await watching.watch(hearer, command)

    def _acknowledge_picture(self, command: PictureShownCommand) -> None:
        hearer = self._feed_clients.get(command.run)
        if hearer is None:
            raise BadMessage("no_such_run", f"run '{command.run}' is not being watched", "watch")
        hearer.feed.on_seen(hearer, command.t)

    async def _pass_on(self, hearer: FeedClient) -> None:
        """Send the lines in the queue ``hearer`` to the client, as fast as the client reads them."""
        try:
            async for line in hearer.lines():
                await self._send_text(line.decode())
        finally:
            hearer.feed.leave(hearer)
        if hearer.is_disconnected:
            self.disconnect()

    def _start_task(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task


def _error_answer(number: int | None, error: BadMessage) -> AnswerMessage:
    return AnswerMessage(id=number, ok=False, error=error.error, message=str(error), hint=error.hint or None)
