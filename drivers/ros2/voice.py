"""A voice of a robot of ROS 2: each text goes to a topic in its turn, for whoever speaks there."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from drivers.api import AS_USUAL, Health, Manner, Priority, Report, Utterance, ignore
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.ros2 import wire
from drivers.ros2.line import Channel, absent
from drivers.ros2.node import TopicFaults
from drivers.ros2.types import types
from drivers.sound.printed import PrintedVoice
from drivers.transport.link import Link

STRING = "std_msgs/msg/String"


class Ros2Voice(PrintedVoice):
    """A ``drivers.api.Voice`` over a link to a topic. Nobody tells when something was said: it lasts as its speed says.

    What has been sent cannot be taken back: cancelled, it is waited for no longer, and what waits is not sent.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        channel: Channel,
        *,
        usual: Manner = AS_USUAL,
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        super().__init__(clock, self._send, usual=usual, changed=changed)
        self._link, self._channel = link, channel
        self._faults = TopicFaults(self.name, [channel.topic], clock, report)
        self._finder = wire.FrameFinder()
        self._kind = ""

    def open(self) -> None:
        """Start looking for who listens; returns at once."""
        super().open()
        self._link.open(self)

    def close(self) -> None:
        """Send nothing any more."""
        super().close()
        self._link.close()

    def health(self) -> Health:
        """Say whether somebody listens."""
        link, health = self._link.health(), super().health()
        if not health.online:
            return health
        if not link.online:
            return Health(False, link.detail, link.hint, {**link.counters, **health.counters})
        if not self._kind:
            error = absent(self.name, self._channel, self._faults.why(0))
            return Health(False, str(error), error.hint, {**link.counters, **health.counters})
        return replace(health, counters={**link.counters, **health.counters})

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Send ``text`` in its turn. Raises NotConnected while nobody listens."""
        health = self.health()
        if not health.online:
            raise NotConnected(health.detail, hint=health.hint)
        return super().say(text, manner, priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Refuse: a topic of texts has no sounds. Raises BadRequest."""
        del priority
        raise BadRequest(
            f"{self.name}: cannot play {path.name}: {self._channel.topic} takes texts alone", hint="say it"
        )

    # --- the link's thread: see drivers.transport.link.Talker --------------------------------------------------------

    def connected(self) -> None:
        """Ask who listens."""
        self._finder, self._kind = wire.FrameFinder(), ""
        self._link.write(wire.ASK)

    def received(self, data: bytes) -> None:
        """Take note of who listens."""
        for channel, payload in self._finder.feed(data):
            if channel == wire.ABOUT:
                self._kind = next(iter(wire.told(payload)[1]), "")
            elif channel == wire.MISMATCH:
                self._faults.mismatch(payload)

    def pulse(self) -> None:
        """Let what waits have its turn."""
        self.settle()

    def ending(self) -> None:
        """Do nothing: silence is its rest."""

    def _send(self, text: str) -> None:
        try:
            self._link.write(wire.frame(0, types().encode(STRING, {"data": text})))
        except NotConnected:
            return  # its health says so; the words are lost
