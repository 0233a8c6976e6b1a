"""The clients of a run's control socket: each by itself, and what all that watch are sent at the same time."""

import socket
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

from drivers.clock import Clock
from missions.control.command_handler import CommandHandler
from missions.control.commands import MAX_REFUSED_BYTES, WatchCommand
from missions.control.messages import EventsMessage, PictureMessage, SceneMessage, encode_json, encode_message
from missions.control.picture_feed import PictureFeed
from missions.control.state_feed import MAX_QUEUED_EVENTS, StateFeed, merge_states, scene_of
from missions.runner import Runner

MAX_QUEUED_ANSWERS = 256
"""Answers that wait for a client; one that asks on and reads nothing is hung up on."""

MAX_UNSEEN_PICTURES = 2
"""Pictures that are on their way to a client."""

SEND_BUFFER_BYTES = 65536
"""Bytes that the kernel keeps for a client: what waits there is old when it is read."""

BLOCK_BYTES = 1 << 16

WATCH_NOTHING = WatchCommand(state=False)

Encode = Callable[[Mapping[str, object]], bytes]
"""Returns a state as a line; what several clients are sent is encoded once by it."""


class ClientQueue:
    """Keeps what one client is to hear, the newest of each, until it takes the ``next_line`` line. For one thread.

    ``flush`` is called whenever there is something. ``is_disconnected`` is True once it has asked for too much and taken nothing.
    """

    def __init__(self, run: str, encode: Encode) -> None:
        self.watch = WATCH_NOTHING
        self.is_disconnected = False
        self._run, self._encode = run, encode
        self._urgent_lines: deque[bytes] = deque()  # answers, and the scene
        self._pending_state: Mapping[str, object] | None = None
        self._events: deque[Mapping[str, object]] = deque()
        self._lost_events = 0
        self._picture: bytes | None = None
        self._unseen_pictures: deque[float] = deque()
        self._pictured_at = self._picture_stamp = float("-inf")

    def flush(self) -> None:
        """Have it sent, as far as the client takes it."""

    def send_first(self, line: bytes) -> None:
        """Send a line before all else that waits."""
        self._urgent_lines.append(line)
        self.is_disconnected = self.is_disconnected or len(self._urgent_lines) > MAX_QUEUED_ANSWERS
        self.flush()

    def start_watch(self, watch: WatchCommand, scene: bytes) -> None:
        """Watch so from now on, beginning with a ``scene``."""
        self._picture = None
        self._urgent_lines.extend(
            list(iter(self.next_line, None))
        )  # the client may be a studio, and it be news to one of many
        self.watch = watch
        self._unseen_pictures.clear()
        self.send_first(scene)

    def add_state(self, state: Mapping[str, object]) -> None:
        """Send a state, or put it together with what waits."""
        if self.watch.state:
            self._pending_state = state if self._pending_state is None else merge_states(self._pending_state, state)
            self.flush()

    def add_events(self, events: list[Mapping[str, object]], lost: int) -> None:
        """Send events; those that do not fit are lost."""
        if self.watch.events and (events or lost):
            self._events.extend(events)
            over = max(0, len(self._events) - MAX_QUEUED_EVENTS)
            for _ in range(over):
                self._events.popleft()
            self._lost_events += lost + over
            self.flush()

    def is_picture_due(self, now: float) -> bool:
        """Say whether it is to get a picture at ``now`` seconds."""
        rate = self.watch.pictures
        due = rate > 0 and now - self._pictured_at >= 1 / rate - 0.005
        return due and self._picture is None and len(self._unseen_pictures) < MAX_UNSEEN_PICTURES

    def add_picture(self, line: bytes, stamp: float, now: float) -> None:
        """Send a picture of a time, unless it has been sent."""
        if stamp > self._picture_stamp:
            self._picture, self._pictured_at, self._picture_stamp = line, now, stamp
            self._unseen_pictures.append(stamp)
            self.flush()

    def on_picture_shown(self, stamp: float) -> None:
        """The client has shown the picture of this time, and those before."""
        while self._unseen_pictures and self._unseen_pictures[0] <= stamp:
            self._unseen_pictures.popleft()

    def next_line(self) -> bytes | None:
        """Return what is to be sent next; None while there is nothing."""
        if self._urgent_lines:
            return self._urgent_lines.popleft()
        if self._pending_state is not None:
            state, self._pending_state = self._pending_state, None
            return self._encode(state)
        if self._events or self._lost_events:
            told = EventsMessage(run=self._run, events=list(self._events), lost=self._lost_events)
            self._events.clear()
            self._lost_events = 0
            return encode_message(told) + b"\n"
        if self._picture is not None:
            line, self._picture = self._picture, None
            return line
        return None


class ControlClient(ClientQueue):
    """Sends what a client is to hear over its ``connection``, as fast as it reads; never waits. For one thread."""

    def __init__(self, connection: socket.socket, run: str, encode: Encode) -> None:
        super().__init__(run, encode)
        connection.setblocking(False)
        with suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        self.connection = connection
        self._received = bytearray()
        self._unsent: memoryview | None = None

    def send_message(self, message: object) -> None:
        """Send a message before all else that waits."""
        self.send_first(encode_message(message) + b"\n")

    @property
    def has_unsent(self) -> bool:
        """Whether something could not be sent yet."""
        return self._unsent is not None

    def read_lines(self) -> Iterator[bytes]:
        """Yield the lines that have come. ``is_disconnected`` is True after the last."""
        try:
            data = self.connection.recv(BLOCK_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.is_disconnected = True
            return
        self._received += data
        while (end := self._received.find(b"\n")) >= 0:
            line = bytes(self._received[:end])
            del self._received[: end + 1]
            yield line
        if len(self._received) > MAX_REFUSED_BYTES:
            yield bytes(self._received)
            self.is_disconnected = True

    def flush(self) -> None:
        """Send as much as the client takes."""
        try:
            while not self.is_disconnected:
                if self._unsent is None:
                    line = self.next_line()
                    if line is None:
                        return
                    self._unsent = memoryview(line)
                sent = self.connection.send(self._unsent[:BLOCK_BYTES])
                self._unsent = self._unsent[sent:] if sent < len(self._unsent) else None
        except BlockingIOError:
            return
        except OSError:
            self.is_disconnected = True


MIN_STATE_INTERVAL = 0.04
"""Seconds from one state to the next, at least."""

IDLE_STATE_INTERVAL, MOVING_STATE_INTERVAL = 0.5, 0.05
"""Seconds from one state to the next, at most; the latter while the robot's place changes, which no event tells, and
while somebody drives, whose commands need a new state."""

MOTION_KEYS = ("pose", "joints", "scan")
"""What a state tells of where the robot and its arms are, and what stands around it."""

Json = dict[str, object]


class Broadcaster:
    """The ``clients``, and when the next state is ``due`` to be told. For one thread. ``of`` is more of the scene."""

    def __init__(
        self,
        name: str,
        runner: Runner,
        feed: StateFeed,
        pictures: PictureFeed,
        handler: CommandHandler,
        clock: Clock,
        scene_extras: Mapping[str, object],
    ) -> None:
        self.clients: list[ControlClient] = []
        self.due = float("inf")
        self._name, self._runner, self._scene_extras = name, runner, scene_extras
        self._feed, self._pictures, self._handler, self._clock = feed, pictures, handler, clock
        self._scene: Json = {}
        self._encoded_state: tuple[object, bytes] = (None, b"")
        self._encoded_picture: tuple[object, bytes] = (None, b"")
        self._sent_at = float("-inf")

    def schedule_state(self) -> None:
        """Something has happened: it is told soon, but not more often than ``MIN_STATE_INTERVAL``."""
        if self._feed.is_watched:
            self.due = min(self.due, max(self._clock.now(), self._sent_at + MIN_STATE_INTERVAL))

    def watch(self, client: ControlClient, command: WatchCommand) -> None:
        """Let a client watch so from now on, beginning with all that is so far."""
        self._scene = self._scene or scene_of(self._runner)
        self.send_state()
        told = {
            **self._scene,
            **self._scene_extras,
            **self._feed.history.as_dict(),
            "state": self._feed.state,
            "log": list(self._feed.log),
        }
        client.start_watch(command, encode_message(SceneMessage(run=self._name, **told)) + b"\n")  # type: ignore[arg-type]
        self.update_watches()

    def update_watches(self) -> None:
        """Gather only what somebody watches."""
        watches = [client.watch for client in self.clients]
        self._feed.is_watched = any(watch.state for watch in watches)
        self._feed.has_event_listeners = any(watch.events for watch in watches)
        self._pictures.is_watched = any(watch.pictures for watch in watches)
        if not (self._feed.is_watched or self._feed.has_event_listeners or self._pictures.is_watched):
            self.due = float("inf")
        elif self.due == float("inf"):
            self.due = self._clock.now() + MIN_STATE_INTERVAL

    def send_state(self) -> None:
        """Send what is new to those who watch."""
        now = self._sent_at = self._clock.now()
        self.due = now + IDLE_STATE_INTERVAL
        state: Json = {"say": "state", "run": self._name, **self._feed.take_changes(self._handler.status())}
        if state.get("driver") or not state.keys().isdisjoint(MOTION_KEYS):
            self.due = now + MOVING_STATE_INTERVAL
        for client in self.clients:
            client.add_state(state)
        if self._feed.has_event_listeners:
            events, lost = self._feed.take_events()
            for client in self.clients:
                client.add_events(events, lost)
        if self._pictures.is_watched and (wake := getattr(self._runner.assembled_robot.eyes, "wake", None)) is not None:
            wake()  # eyes rest while nobody queries them

    def send_pictures(self, now: float) -> None:
        """Send the newest picture to those who look and have seen the last."""
        wanting = [client for client in self.clients if self._pictures.is_watched and client.is_picture_due(now)]
        picture = self._pictures.newest() if wanting else None
        if picture is None:
            return
        if self._encoded_picture[0] is not picture:
            self._encoded_picture = picture, encode_message(PictureMessage(run=self._name, **picture)) + b"\n"  # type: ignore[arg-type]
        for client in wanting:
            client.add_picture(self._encoded_picture[1], picture["t"], now)  # type: ignore[arg-type]

    def encode_state(self, state: Mapping[str, object]) -> bytes:
        """Return a state as a line: once for all who are sent the same."""
        if self._encoded_state[0] is not state:
            self._encoded_state = state, encode_json(state) + b"\n"
        return self._encoded_state[1]
