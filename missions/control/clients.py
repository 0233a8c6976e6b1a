"""Clients of a run's control socket, and the broadcast of states, events and pictures to them."""

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
"""Maximum number of answers queued for a client; a client that sends commands but reads no answers is disconnected."""

MAX_UNSEEN_PICTURES = 2
"""Maximum number of pictures that are sent to a client before it confirms that it has shown the first of them."""

SEND_BUFFER_BYTES = 65536
"""Size of the kernel's send buffer of a client; small, since a state that waits in it becomes old."""

BLOCK_BYTES = 1 << 16

WATCH_NOTHING = WatchCommand(state=False)

Encode = Callable[[Mapping[str, object]], bytes]
"""Function that encodes a state as a JSON line; the result is shared by all clients."""


class ClientQueue:
    """Outgoing messages of one client, until ``next_line`` takes them. Not thread-safe.

    Backpressure: for a slow client, the oldest events are dropped, and queued states are merged into one.
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
        """Send the queued lines as far as the client accepts them."""

    def send_first(self, line: bytes) -> None:
        """Queue a line that is sent before all queued states, events and pictures."""
        self._urgent_lines.append(line)
        self.is_disconnected = self.is_disconnected or len(self._urgent_lines) > MAX_QUEUED_ANSWERS
        self.flush()

    def start_watch(self, watch: WatchCommand, scene: bytes) -> None:
        """Replace the client's subscription by ``watch``; queue the ``scene``, the complete state of the run."""
        self._picture = None
        self._urgent_lines.extend(list(iter(self.next_line, None)))  # a studio passes it on to many viewers
        self.watch = watch
        self._unseen_pictures.clear()
        self.send_first(scene)

    def add_state(self, state: Mapping[str, object]) -> None:
        """Queue a state, merged with a state that is still queued."""
        if self.watch.state:
            self._pending_state = state if self._pending_state is None else merge_states(self._pending_state, state)
            self.flush()

    def add_events(self, events: list[Mapping[str, object]], lost: int) -> None:
        """Queue events; the oldest are dropped if the queue is full."""
        if self.watch.events and (events or lost):
            self._events.extend(events)
            over = max(0, len(self._events) - MAX_QUEUED_EVENTS)
            for _ in range(over):
                self._events.popleft()
            self._lost_events += lost + over
            self.flush()

    def is_picture_due(self, now: float) -> bool:
        """Return whether a picture should be sent at ``now`` seconds."""
        rate = self.watch.pictures
        due = rate > 0 and now - self._pictured_at >= 1 / rate - 0.005
        return due and self._picture is None and len(self._unseen_pictures) < MAX_UNSEEN_PICTURES

    def add_picture(self, line: bytes, stamp: float, now: float) -> None:
        """Queue a picture, unless its stamp was queued before."""
        if stamp > self._picture_stamp:
            self._picture, self._pictured_at, self._picture_stamp = line, now, stamp
            self._unseen_pictures.append(stamp)
            self.flush()

    def on_picture_shown(self, stamp: float) -> None:
        """Record that the client has shown the picture with this stamp and earlier ones, so more can be sent."""
        while self._unseen_pictures and self._unseen_pictures[0] <= stamp:
            self._unseen_pictures.popleft()

    def next_line(self) -> bytes | None:
        """Return the next line to send; None if nothing is queued."""
        if self._urgent_lines:
            return self._urgent_lines.popleft()
        if self._pending_state is not None:
            state, self._pending_state = self._pending_state, None
            return self._encode(state)
        if self._events or self._lost_events:
            message = EventsMessage(run=self._run, events=list(self._events), lost=self._lost_events)
            self._events.clear()
            self._lost_events = 0
            return encode_message(message) + b"\n"
        if self._picture is not None:
            line, self._picture = self._picture, None
            return line
        return None


class ControlClient(ClientQueue):
    """A client ``connection`` with its queue; sending never blocks. Not thread-safe."""

    def __init__(self, connection: socket.socket, run: str, encode: Encode) -> None:
        super().__init__(run, encode)
        connection.setblocking(False)
        with suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        self.connection = connection
        self._received = bytearray()
        self._unsent: memoryview | None = None

    def send_message(self, message: object) -> None:
        """Queue a message before states, events and pictures."""
        self.send_first(encode_message(message) + b"\n")

    @property
    def has_unsent(self) -> bool:
        """True if the last line was sent only in part, and the rest must wait until the connection is writable."""
        return self._unsent is not None

    def read_lines(self) -> Iterator[bytes]:
        """Yield the lines received so far; ``is_disconnected`` is then True if the client closed the connection."""
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
"""Minimum seconds between two state messages to clients."""

IDLE_STATE_INTERVAL, MOVING_STATE_INTERVAL = 0.5, 0.05
"""Maximum seconds between two states: at rest, and while the pose changes or a person drives.

No event reports a change of the pose, and drive commands need fresh states.
"""

MOTION_KEYS = ("pose", "joints", "scan")
"""Keys of a state that change while the robot moves."""

Json = dict[str, object]


class Broadcaster:
    """Sends states, events and pictures of a run to its ``clients``. Not thread-safe.

    ``due`` is the time of the next state message (s). A client that subscribes first gets the scene, the complete state
    of the run. ``scene_extras`` are members that are added to each scene.
    """

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
        """Schedule a state soon after an event, but not before ``MIN_STATE_INTERVAL``."""
        if self._feed.is_watched:
            self.due = min(self.due, max(self._clock.now(), self._sent_at + MIN_STATE_INTERVAL))

    def watch(self, client: ControlClient, command: WatchCommand) -> None:
        """Set the subscription of a client, and send it the scene: the complete state of the run."""
        self._scene = self._scene or scene_of(self._runner)
        self.send_state()
        status = {
            **self._scene,
            **self._scene_extras,
            **self._feed.history.as_dict(),
            "state": self._feed.state,
            "log": list(self._feed.log),
        }
        client.start_watch(command, encode_message(SceneMessage(run=self._name, **status)) + b"\n")  # type: ignore[arg-type]
        self.update_watches()

    def update_watches(self) -> None:
        """Collect states, events and pictures of the run only while a client has subscribed to them."""
        watches = [client.watch for client in self.clients]
        self._feed.is_watched = any(watch.state for watch in watches)
        self._feed.has_event_listeners = any(watch.events for watch in watches)
        self._pictures.is_watched = any(watch.pictures for watch in watches)
        if not (self._feed.is_watched or self._feed.has_event_listeners or self._pictures.is_watched):
            self.due = float("inf")
        elif self.due == float("inf"):
            self.due = self._clock.now() + MIN_STATE_INTERVAL

    def send_state(self) -> None:
        """Send the changes of the state, and new events, to the subscribed clients."""
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
            wake()  # detectors pause without queries

    def send_pictures(self, now: float) -> None:
        """Send the newest picture to each client whose next picture is due, by its rate and its confirmations.

        ``now`` is the time in seconds.
        """
        wanting = [client for client in self.clients if self._pictures.is_watched and client.is_picture_due(now)]
        picture = self._pictures.newest() if wanting else None
        if picture is None:
            return
        if self._encoded_picture[0] is not picture:
            self._encoded_picture = picture, encode_message(PictureMessage(run=self._name, **picture)) + b"\n"  # type: ignore[arg-type]
        for client in wanting:
            client.add_picture(self._encoded_picture[1], picture["t"], now)  # type: ignore[arg-type]

    def encode_state(self, state: Mapping[str, object]) -> bytes:
        """Return a state as a JSON line, encoded once for all clients."""
        if self._encoded_state[0] is not state:
            self._encoded_state = state, encode_json(state) + b"\n"
        return self._encoded_state[1]
