"""One client of the studio: reads its commands, lets through what its role may do, and passes on what the runs say."""

import asyncio
from collections.abc import Coroutine, Mapping
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from drivers.clock import Clock, SystemClock
from missions.codec import encode_word
from missions.control.commands import (
    KEY,
    RULES,
    BadMessage,
    Command,
    OfRun,
    Role,
    Seen,
    Stop,
    Watch,
    id_in,
    read_command,
)
from missions.control.messages import Answer, Runs, line_of
from missions.plugins.studio.access import SignIn
from missions.plugins.studio.gate import link_to
from missions.plugins.studio.studio import Studio
from missions.plugins.studio.watching import Hearer, Link
from missions.plugins.studio.wishes import COMMANDS, Hello, Record

RATE = 100.0
"""Commands a second, at most; some more may come at once. A `stop` is always heard."""

MOST_WAITING = 64
"""Commands that wait to be done, at most."""

MOST_UNREAD = 65536
"""Bytes that wait for a run which hangs, at most."""

HELLO_TIME = 10.0
"""Seconds that a client has to say hello."""

STOP_TIME = 10.0
"""Seconds for which a session of somebody who has gone is kept for the stops that they have asked for."""

REFUSED = 1008
"""The code by which a websocket is closed to who does not keep to the protocol."""


class Session:
    """Serves one websocket until it is closed. What its client drove stands then: its connections to runs end."""

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
        self._allowance, self._counted = RATE, self._clock.now()
        self._sending = asyncio.Lock()
        self._links: dict[str, Link] = {}
        self._waiting: asyncio.Queue[OfRun] = asyncio.Queue(MOST_WAITING)
        self._tasks: set[asyncio.Task[None]] = set()
        self._stops: set[asyncio.Task[None]] = set()
        self._hearers: dict[str, Hearer] = {}
        self._epoch, self._out = studio.access.epoch, False
        self._served: asyncio.Task[Any] | None = None
        self._runs: Runs | None = None
        self._news = asyncio.Event()

    async def run(self) -> None:
        """Serve."""
        self._served = asyncio.current_task()
        await self._socket.accept()
        try:
            async with asyncio.timeout(HELLO_TIME):
                greeted = await self._hello(await self._receive())
            if not greeted or self._epoch != self._studio.access.epoch:
                await self._socket.close(REFUSED)
                return
            self._begin(self._relay())
            self._begin(self._tell_on())
            with self._studio.joined(self):
                self.tell(Runs(runs=self._studio.hub.runs()))
                while True:
                    await self._hear(await self._receive())
        except asyncio.CancelledError:
            if not self._out:
                raise
        except (WebSocketDisconnect, TimeoutError, RuntimeError):
            pass  # it has gone, or says nothing
        finally:
            # First what moves: the ends of these connections stop the base.
            await asyncio.gather(*(link.close() for link in self._links.values()), return_exceptions=True)
            if self._stops:  # a stop is done and written down although nobody hears of it any more
                await asyncio.wait(self._stops, timeout=STOP_TIME)
            for task in list(self._tasks):
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._out:
            with suppress(WebSocketDisconnect, RuntimeError):
                await self._socket.close(REFUSED)

    def shut_out(self) -> None:
        """See Client."""
        self._out = True
        if self._served is not None:
            self._served.cancel()

    def tell(self, runs: Runs) -> None:
        """Send what runs there are, when this client can take it; of several, the newest."""
        self._runs = runs
        self._news.set()

    async def _tell_on(self) -> None:
        while await self._news.wait():
            self._news.clear()
            if self._runs is not None:
                await self.say(self._runs)

    async def say(self, message: object) -> None:
        """Send a message."""
        await self._send(line_of(message).decode())

    async def _send(self, text: str) -> None:
        async with self._sending:
            with suppress(WebSocketDisconnect, RuntimeError):
                await self._socket.send_text(text)

    async def _receive(self) -> str:
        """Return the next message; one of bytes as the text that it holds."""
        message = await self._socket.receive()
        if message["type"] != "websocket.receive":
            raise WebSocketDisconnect(message.get("code", 1005))
        text, data = message.get("text"), message.get("bytes")
        return text if isinstance(text, str) else bytes(data or b"").decode("utf-8", "replace")

    async def _hello(self, line: str) -> bool:
        """Answer the first command; say whether it was a good one."""
        try:
            command = read_command(line, words=COMMANDS)
            if not isinstance(command, Hello):
                raise BadMessage("hello_first", "the first command is hello", '{"do": "hello", "version": "2"}')
            if command.version not in self._studio.versions:
                raise BadMessage("old_page", "this page is of another version of the studio", "reload it")
        except BadMessage as error:
            await self.say(_refused(id_in(line), error))
            return False
        await self.say(self._studio.welcome(self.role, self.name))
        return True

    async def _hear(self, line: str) -> None:
        """Do what a line asks for, or have it done: a stop that comes next is not to wait for it."""
        try:
            command = read_command(line, words=COMMANDS)
            if isinstance(command, Stop):
                self._stops.add(stop := self._begin(self._answered(command, self._stop(command))))
                stop.add_done_callback(self._stops.discard)
                if not self._has_allowance():
                    await asyncio.sleep(1 / RATE)  # it is done; what comes next of this client waits
                return
            if not self._has_allowance():
                raise BadMessage("too_many", f"more than {RATE:g} commands a second")
            if command.role == "operator" and self.role != "operator":
                self._studio.audit.tell(self.name, self.role, {KEY: command.word}, "not_allowed")
                raise BadMessage("not_allowed", "a viewer may not do this", "open the operator's link")
            if isinstance(command, OfRun) and not isinstance(command, Watch | Seen):
                self._waiting.put_nowait(command)
            elif isinstance(command, Hello):
                await self.say(self._studio.welcome(self.role, self.name))
            elif len(self._tasks) > MOST_WAITING:
                raise asyncio.QueueFull
            else:
                self._begin(self._answered(command, self._do(command)))
        except asyncio.QueueFull:
            await self.say(_refused(id_in(line), BadMessage("too_many", "more commands than can be done")))
        except BadMessage as error:
            await self.say(_refused(id_in(line), error))

    def _has_allowance(self) -> bool:
        now = self._clock.now()
        had = min(RATE, self._allowance + (now - self._counted) * RATE)
        self._allowance, self._counted = max(0.0, had - 1.0), now
        return had >= 1.0

    async def _answered(self, command: Command, work: Any) -> None:
        """Do what a command asks of the studio, and answer."""
        outcome = "ok"
        try:
            result = await work
        except BadMessage as error:
            outcome = error.error
            await self.say(_refused(command.id, error))
        except Exception as error:  # a fault of our own ends no session
            outcome = "fault"
            await self.say(_refused(command.id, BadMessage("fault", f"{type(error).__name__}: {error}")))
        else:
            if command.id is not None:
                await self.say(Answer(id=command.id, ok=True, result=result))
        self._studio.tell(self, self.role, command, outcome)

    async def _do(self, command: Command) -> Mapping[str, object] | None:
        match command:
            case Watch():
                try:
                    await self._watch(command)
                except BadMessage as error:
                    if words := await self._studio.last_words(command.run):
                        raise BadMessage("no_such_run", words) from error
                    raise
            case Seen():
                self._seen(command)
            case Record() if self.role == "operator":
                paths = {"report": f"/reports/{command.name}", "download": f"/records/{command.name}"}
                links = {name: link_to(path, self._sign_in) for name, path in paths.items()}
                return {**await self._studio.do(command, self), "links": links}
            case _:
                return await self._studio.do(command, self)
        return None

    async def _stop(self, command: Stop) -> Mapping[str, object]:
        return {"stopped": await self._studio.stop(command.run, self.name, command.press)}

    # --- what goes to and comes from runs -----------------------------------------------------------------------------

    async def _relay(self) -> None:
        """Pass commands on to their runs, in order."""
        while True:
            command = await self._waiting.get()
            outcome = "ok"
            try:
                link = await self._link(command.run)
                if link.unread > MOST_UNREAD:
                    raise BadMessage("no_answer", f"run {command.run} does not read what it is sent")
                members = {name: value for name, value in encode_word(command, KEY, RULES).items() if name != "run"}
                link.send({**members, "by": self.name})
            except BadMessage as error:
                outcome = error.error
                await self.say(_refused(command.id, error))
            self._studio.tell(self, self.role, command, outcome)

    async def _link(self, run: str) -> Link:
        """Return this client's own connection to a run: its end is the end of the client. Raises BadMessage."""
        link = self._links.get(run)
        if link is not None and not link.closed.is_set():
            return link
        self._studio.hub.known(run)

        async def answered(line: bytes) -> None:
            if line.startswith(b'{"say":"answer"'):
                await self._send(line.decode())

        try:
            link = self._links[run] = await self._studio.hub.connect(run, answered)
        except (OSError, ValueError) as error:  # a TimeoutError is an OSError
            raise BadMessage("no_answer", f"run {run} does not answer: {error}") from error
        return link

    async def _watch(self, command: Watch) -> None:
        """Watch a run, together with all others who do; or no more."""
        hearer = self._hearers.get(command.run)
        if not (command.state or command.events or command.pictures):
            if hearer is not None:
                hearer.watching.leave(hearer)
            return
        watching = self._studio.hub.watching(command.run)
        if hearer is None or hearer.over or hearer.watching is not watching:
            hearer = self._hearers[command.run] = Hearer(watching)
            self._begin(self._pass_on(hearer))
        await watching.watch(hearer, command)

    def _seen(self, command: Seen) -> None:
        hearer = self._hearers.get(command.run)
        if hearer is None:
            raise BadMessage("no_such_run", f"run '{command.run}' is not watched here", "watch")
        hearer.watching.seen(hearer, command.t)

    async def _pass_on(self, hearer: Hearer) -> None:
        """Send what a run tells, as this client takes it."""
        try:
            async for line in hearer.lines():
                await self._send(line.decode())
        finally:
            hearer.watching.leave(hearer)
        if hearer.gone:
            self.shut_out()

    def _begin(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task


def _refused(number: int | None, error: BadMessage) -> Answer:
    return Answer(id=number, ok=False, error=error.error, message=str(error), hint=error.hint or None)
