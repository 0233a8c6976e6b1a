"""The clients of a run's control socket: each by itself, and what all that watch are sent at the same time."""

import socket
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

from drivers.clock import Clock
from missions.control.commands import MAX_REFUSED_BYTES, Watch
from missions.control.doing import Doing
from missions.control.messages import Events, Picture, Scene, as_json, line_of
from missions.control.outlet import MOST_EVENTS, Outlet, merged, scene_of
from missions.control.pictures import Pictures
from missions.runner import Runner

MOST_ANSWERS = 256
"""Answers that wait for a client; one that asks on and reads nothing is hung up on."""

MOST_UNSEEN = 2
"""Pictures that are on their way to a client."""

SEND_BUFFER = 65536
"""Bytes that the kernel keeps for a client: what waits there is old when it is read."""

BLOCK = 1 << 16

NOTHING = Watch(state=False)

Encode = Callable[[Mapping[str, object]], bytes]
"""Returns a state as a line; what several clients are sent is encoded once by it."""


class Waiting:
    """Keeps what one client is to hear, the newest of each, until it takes the ``next`` line. For one thread.

    ``flush`` is called whenever there is something. ``gone`` is True once it has asked for too much and taken nothing.
    """

    def __init__(self, run: str, encode: Encode) -> None:
        self.watch = NOTHING
        self.gone = False
        self._run, self._encode = run, encode
        self._first: deque[bytes] = deque()  # answers, and the scene
        self._behind: Mapping[str, object] | None = None
        self._events: deque[Mapping[str, object]] = deque()
        self._lost = 0
        self._picture: bytes | None = None
        self._unseen: deque[float] = deque()
        self._pictured = self._stamp = float("-inf")

    def flush(self) -> None:
        """Have it sent, as far as the client takes it."""

    def say(self, line: bytes) -> None:
        """Send a line before all else that waits."""
        self._first.append(line)
        self.gone = self.gone or len(self._first) > MOST_ANSWERS
        self.flush()

    def begin(self, watch: Watch, scene: bytes) -> None:
        """Watch so from now on, beginning with a ``scene``."""
        self._picture = None
        self._first.extend(list(iter(self.next, None)))  # the client may be a studio, and it be news to one of many
        self.watch = watch
        self._unseen.clear()
        self.say(scene)

    def news(self, state: Mapping[str, object]) -> None:
        """Send a state, or put it together with what waits."""
        if self.watch.state:
            self._behind = state if self._behind is None else merged(self._behind, state)
            self.flush()

    def events(self, events: list[Mapping[str, object]], lost: int) -> None:
        """Send events; those that do not fit are lost."""
        if self.watch.events and (events or lost):
            self._events.extend(events)
            over = max(0, len(self._events) - MOST_EVENTS)
            for _ in range(over):
                self._events.popleft()
            self._lost += lost + over
            self.flush()

    def wants_picture(self, now: float) -> bool:
        """Say whether it is to get a picture at ``now`` seconds."""
        rate = self.watch.pictures
        due = rate > 0 and now - self._pictured >= 1 / rate - 0.005
        return due and self._picture is None and len(self._unseen) < MOST_UNSEEN

    def picture(self, line: bytes, stamp: float, now: float) -> None:
        """Send a picture of a time, unless it has been sent."""
        if stamp > self._stamp:
            self._picture, self._pictured, self._stamp = line, now, stamp
            self._unseen.append(stamp)
            self.flush()

    def seen(self, stamp: float) -> None:
        """The client has shown the picture of this time, and those before."""
        while self._unseen and self._unseen[0] <= stamp:
            self._unseen.popleft()

    def next(self) -> bytes | None:
        """Return what is to be sent next; None while there is nothing."""
        if self._first:
            return self._first.popleft()
        if self._behind is not None:
            state, self._behind = self._behind, None
            return self._encode(state)
        if self._events or self._lost:
            told = Events(run=self._run, events=list(self._events), lost=self._lost)
            self._events.clear()
            self._lost = 0
            return line_of(told) + b"\n"
        if self._picture is not None:
            line, self._picture = self._picture, None
            return line
        return None


class Client(Waiting):
    """Sends what a client is to hear over its ``connection``, as fast as it reads; never waits. For one thread."""

    def __init__(self, connection: socket.socket, run: str, encode: Encode) -> None:
        super().__init__(run, encode)
        connection.setblocking(False)
        with suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self.connection = connection
        self._heard = bytearray()
        self._sending: memoryview | None = None

    def tell(self, message: object) -> None:
        """Send a message before all else that waits."""
        self.say(line_of(message) + b"\n")

    @property
    def waiting(self) -> bool:
        """Whether something could not be sent yet."""
        return self._sending is not None

    def read(self) -> Iterator[bytes]:
        """Yield the lines that have come. ``gone`` is True after the last."""
        try:
            data = self.connection.recv(BLOCK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.gone = True
            return
        self._heard += data
        while (end := self._heard.find(b"\n")) >= 0:
            line = bytes(self._heard[:end])
            del self._heard[: end + 1]
            yield line
        if len(self._heard) > MAX_REFUSED_BYTES:
            yield bytes(self._heard)
            self.gone = True

    def flush(self) -> None:
        """Send as much as the client takes."""
        try:
            while not self.gone:
                if self._sending is None:
                    line = self.next()
                    if line is None:
                        return
                    self._sending = memoryview(line)
                sent = self.connection.send(self._sending[:BLOCK])
                self._sending = self._sending[sent:] if sent < len(self._sending) else None
        except BlockingIOError:
            return
        except OSError:
            self.gone = True


PERIOD = 0.04
"""Seconds from one state to the next, at least."""

IDLE, MOVING = 0.5, 0.05
"""Seconds from one state to the next, at most; the latter while the robot's place changes, which no event tells, and
while somebody drives, whose commands need a new state."""

PLACE = ("pose", "joints", "scan")
"""What a state tells of where the robot and its arms are, and what stands around it."""

Json = dict[str, object]


class Audience:
    """The ``clients``, and when the next state is ``due`` to be told. For one thread. ``of`` is more of the scene."""

    def __init__(
        self,
        name: str,
        runner: Runner,
        outlet: Outlet,
        pictures: Pictures,
        doing: Doing,
        clock: Clock,
        of: Mapping[str, object],
    ) -> None:
        self.clients: list[Client] = []
        self.due = float("inf")
        self._name, self._runner, self._of = name, runner, of
        self._outlet, self._pictures, self._doing, self._clock = outlet, pictures, doing, clock
        self._scene: Json = {}
        self._line: tuple[object, bytes] = (None, b"")
        self._shown: tuple[object, bytes] = (None, b"")
        self._told_at = float("-inf")

    def hurry(self) -> None:
        """Something has happened: it is told soon, but not more often than ``PERIOD``."""
        if self._outlet.watched:
            self.due = min(self.due, max(self._clock.now(), self._told_at + PERIOD))

    def watch(self, client: Client, command: Watch) -> None:
        """Let a client watch so from now on, beginning with all that is so far."""
        self._scene = self._scene or scene_of(self._runner)
        self.tell()
        told = {
            **self._scene,
            **self._of,
            **self._outlet.past.told(),
            "state": self._outlet.all,
            "log": list(self._outlet.log),
        }
        client.begin(command, line_of(Scene(run=self._name, **told)) + b"\n")  # type: ignore[arg-type]
        self.look_at_watches()

    def look_at_watches(self) -> None:
        """Gather only what somebody watches."""
        watches = [client.watch for client in self.clients]
        self._outlet.watched = any(watch.state for watch in watches)
        self._outlet.listened = any(watch.events for watch in watches)
        self._pictures.watched = any(watch.pictures for watch in watches)
        if not (self._outlet.watched or self._outlet.listened or self._pictures.watched):
            self.due = float("inf")
        elif self.due == float("inf"):
            self.due = self._clock.now() + PERIOD

    def tell(self) -> None:
        """Send what is new to those who watch."""
        now = self._told_at = self._clock.now()
        self.due = now + IDLE
        state: Json = {"say": "state", "run": self._name, **self._outlet.news(self._doing.told())}
        if state.get("driver") or not state.keys().isdisjoint(PLACE):
            self.due = now + MOVING
        for client in self.clients:
            client.news(state)
        if self._outlet.listened:
            events, lost = self._outlet.events()
            for client in self.clients:
                client.events(events, lost)
        if self._pictures.watched and (ask := getattr(self._runner.assembled.eyes, "ask", None)) is not None:
            ask()  # eyes that nobody asks rest

    def show(self, now: float) -> None:
        """Send the newest picture to those who look and have seen the last."""
        wanting = [client for client in self.clients if self._pictures.watched and client.wants_picture(now)]
        picture = self._pictures.newest() if wanting else None
        if picture is None:
            return
        if self._shown[0] is not picture:
            self._shown = picture, line_of(Picture(run=self._name, **picture)) + b"\n"  # type: ignore[arg-type]
        for client in wanting:
            client.picture(self._shown[1], picture["t"], now)  # type: ignore[arg-type]

    def encoded(self, state: Mapping[str, object]) -> bytes:
        """Return a state as a line: once for all who are sent the same."""
        if self._line[0] is not state:
            self._line = state, as_json(state) + b"\n"
        return self._line[1]
