"""One connection to a run for all clients of the studio who watch it: the run tells each thing once."""

import asyncio
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import suppress

from config.reading import parse_object
from drivers.clock import Clock, SystemClock
from missions.control.audience import NOTHING, Waiting
from missions.control.commands import BadMessage, Watch
from missions.control.messages import Over, as_json, line_of
from missions.plugins.studio.link import Link, OnLine

PICTURE = re.compile(rb'\{"say":"picture","run":"[^"]*","t":(-?[\d.e+-]+)')
"""How a picture begins, which has its time in it: the rest is passed on as it is."""

Connect = Callable[[OnLine, Callable[[], None]], Awaitable[Link]]
"""Connects to a run; takes a callback for its lines, and one for its end. Raises OSError, ValueError."""

SCENE_TIME = 10.0
"""Seconds that a run has to tell all that is so."""


class Hearer(Waiting):
    """A client of the studio who is ``watching`` a run, until it is over for this one."""

    def __init__(self, watching: "Watching") -> None:
        super().__init__(watching.run, watching.encoded)
        self.watching = watching
        self.over = False
        self._more = asyncio.Event()

    def flush(self) -> None:
        """Have it sent when the client takes it."""
        self._more.set()

    def end(self) -> None:
        """Nothing more comes."""
        self.over = True
        self._more.set()

    async def lines(self) -> AsyncIterator[bytes]:
        """Yield what is to be sent, as it comes, to the end."""
        while not self._has_ended():
            await self._more.wait()
            self._more.clear()
            while (line := self.next()) is not None:
                yield line

    def _has_ended(self) -> bool:
        return self.over or self.gone


class Watching:
    """What clients of the studio watch of a ``run``, over one connection, which is there while somebody watches."""

    def __init__(self, run: str, connect: Connect, clock: Clock | None = None) -> None:
        self.run, self._connect, self._clock = run, connect, clock or SystemClock()
        self._link: Link | None = None
        self._hearers: list[Hearer] = []
        self._asking = asyncio.Lock()
        self._asked = NOTHING
        self._next: tuple[Hearer, Watch] | None = None  # for whom the next scene is
        self._line: tuple[object, bytes] = (None, b"")
        self._picture: tuple[float, bytes] | None = None
        self._over = False
        self._tasks: set[asyncio.Task[None]] = set()

    def encoded(self, state: Mapping[str, object]) -> bytes:
        """Return a state as a line: as it came, where it is told as it came."""
        return self._line[1] if self._line[0] is state else as_json(state)

    async def watch(self, hearer: Hearer, command: Watch) -> None:
        """Let a client watch so from now on, beginning with a scene. Raises BadMessage."""
        async with self._asking:
            self._next = hearer, command
            try:
                if self._link is None:
                    self._link = await self._connect(self._hear, self._closed)
                    self._over = False
                await self._ask(self._link, [*(each.watch for each in self._hearers if each is not hearer), command])
            except (OSError, ValueError) as error:  # a TimeoutError is an OSError, and a ConnectionError
                raise BadMessage("no_answer", f"run {self.run} does not answer: {error}") from error
            finally:
                self._next = None

    def leave(self, hearer: Hearer) -> None:
        """A client watches no more, or has gone; returns at once."""
        hearer.end()
        if hearer in self._hearers:
            self._hearers.remove(hearer)
            if self._picture is not None:
                self._acknowledge(self._picture[0])  # it may have been the one that was to do so
            task = asyncio.ensure_future(self._ask_for_less())
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """Hang up."""
        if self._link is not None:
            link, self._link, self._picture = self._link, None, None
            await link.close()

    def seen(self, hearer: Hearer, stamp: float) -> None:
        """A client has shown a picture: the run may send another one, and this client get the newest."""
        hearer.seen(stamp)
        self._acknowledge(stamp)
        if self._picture is not None:
            self._offer(hearer, *self._picture)

    async def _ask_for_less(self) -> None:
        async with self._asking:
            watches = [each.watch for each in self._hearers]
            if not watches:
                await self.close()
            elif self._link is not None and together(watches) != self._asked:
                with suppress(OSError):
                    await self._ask(self._link, watches)

    async def _ask(self, link: Link, watches: Sequence[Watch]) -> None:
        """Ask the run for what all together watch. A scene comes first, which is for the next one, if there is one."""
        self._asked = together(watches)
        members = {name: getattr(self._asked, name) for name in ("state", "events", "pictures")}
        await link.ask({"do": "watch", **members}, SCENE_TIME)

    def _acknowledge(self, stamp: float) -> None:
        if self._link is not None:
            self._link.send({"do": "seen", "t": stamp})

    def _offer(self, hearer: Hearer, stamp: float, line: bytes) -> bool:
        """Give a client a picture, if it is to get one; say whether it does."""
        wants = hearer.wants_picture(self._clock.now())
        if wants:
            hearer.picture(line, stamp, self._clock.now())
        return wants

    async def _hear(self, line: bytes) -> None:
        """Pass on each line of the run to the clients that it concerns."""
        line = self._renamed(line)
        if found := PICTURE.match(line):
            self._picture = float(found[1]), line
            if not [each for each in self._hearers if self._offer(each, *self._picture)]:
                self._acknowledge(self._picture[0])
        elif line.startswith(b'{"say":"state"'):
            state = parse_object(line)
            self._line = state, line
            for each in self._hearers:
                each.news(state)
        elif line.startswith(b'{"say":"events"'):
            told = parse_object(line)
            for each in self._hearers:
                each.events(told["events"], told.get("lost", 0))
        elif line.startswith(b'{"say":"scene"') and self._next is not None:
            hearer, command = self._next
            if hearer not in self._hearers and not hearer.over:
                self._hearers.append(hearer)
            hearer.begin(command, line)
        elif line.startswith(b'{"say":"over"'):
            self._end(line)

    def _renamed(self, line: bytes) -> bytes:
        """Return a line with the studio's name of the run, which is not its own where two runs have the same."""
        own = "" if self._link is None else str(self._link.about.get("run", self.run))
        if own in ("", self.run):
            return line
        return line.replace(b'"run":' + as_json(own), b'"run":' + as_json(self.run), 1)

    def _end(self, line: bytes) -> None:
        self._over = True
        for each in self._hearers:
            each.say(line)

    def _closed(self) -> None:
        """The run has gone: one that could not say so itself is over all the same."""
        if not self._over:
            self._end(line_of(Over(run=self.run, result="", reason="the run has gone without a word", seconds=0.0)))
        self._link = self._picture = None
        while self._hearers:
            self._hearers.pop().end()


def together(watches: Sequence[Watch]) -> Watch:
    """Return what comes of several watches."""
    return Watch(
        state=any(each.state for each in watches),
        events=any(each.events for each in watches),
        pictures=max(each.pictures for each in watches),
    )
