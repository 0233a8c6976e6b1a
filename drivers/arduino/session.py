"""The computer's end of rosserial: waits for the board to boot, asks what topics it has, and tells it the time."""

import math
from collections import Counter

from drivers.api import DeviceStatus, Quality, Reading, Report
from drivers.arduino import wire
from drivers.arduino.reset_detector import BootState, DetectorState, ResetDetector
from drivers.clock import Clock
from drivers.transport.link import Link

SILENT = 2.7
"""Seconds without a question for the time after which the board is probed: in step it asks every 2.5 s."""

TACHO_SILENT = 0.2
"""Seconds without a word of the encoders after which it is: a sketch that has them tells of them every 50 ms."""

ASK_AGAIN = 1.0
"""Seconds between two requests for the topics; a board that runs answers one within a tenth of a second."""

FRAME_TIMEOUT = 0.1
"""Seconds of silence after which the rest of a frame is no longer waited for."""

WARNING = 2
"""The level of a log line from which it is a fault."""


class Session:
    """One connection to a board, from the opening of the port until it is lost. Served by the link's thread.

    ``topic`` is the number by which the board knows the ``wanted`` topic: None until it has said so, when it means
    something else by it, and once it has fallen silent.
    ``tacho`` is the newest that its encoders have measured, on the clock's time; the first sketch has none.
    ``boot_state`` is set whenever the board has said whether it has begun anew; who has taken account of it clears it.
    ``detector`` says whether it is sure that it has not: it is asked on opening the port, which resets most boards, and
    one that is starting does not answer; then it has ``boot_delay`` seconds until it is asked again.
    The board is told the clock's own time: a monotonic one, not the time of day.
    """

    def __init__(
        self,
        name: str,
        wanted: wire.Topic,
        link: Link,
        clock: Clock,
        report: Report,
        *,
        boot_delay: float,
        previous: ResetDetector | None = None,
    ) -> None:
        self.topic: int | None = None
        self.boot_state: BootState | None = None
        self.detector = ResetDetector(previous)
        self.tacho: Reading[wire.Tacho] = Reading(None, -math.inf, Quality.NONE)
        self._name = name
        self._wanted = wanted
        self._link = link
        self._clock = clock
        self._report = report
        self._boot_delay = boot_delay
        self._awake: float | None = None  # when the board will have booted
        self._asked = self._heard = self._synced = self._encoded = -math.inf
        self._finder = wire.FrameFinder()
        self._topics: dict[int, wire.Topic] = {}
        self._trouble = ("", "")
        self._counters: Counter[str] = Counter(
            {"frames": 0, "malformed": 0, "unknown topics": 0, "requests": 0, "times": 0, "tachos": 0, "log lines": 0}
        )

    def counters(self) -> Counter[str]:
        """Return what has been counted in this session."""
        found = {"skipped bytes": self._finder.skipped, "checksum errors": self._finder.checksum_errors}
        return Counter({**self._counters, **found})

    def received(self, data: bytes) -> None:
        """Take bytes of the board, and answer what it asks. Raises NotConnected when the port has gone."""
        self._heard = now = self._clock.now()
        self.detector.on_poll(now)
        self._take(self._finder.feed(data))

    def pulse(self) -> None:
        """Do what is due: ask for the topics, notice silence. Raises NotConnected when the port has gone."""
        now = self._clock.now()
        self.detector.on_poll(now)
        if self._awake is None:
            self._awake = now + self._boot_delay
            self._probe(now)
        if self._finder.waiting and now - self._heard > FRAME_TIMEOUT:
            self._take(self._finder.give_up())
        if self.detector.check_timeout(now) and self.topic is not None:
            self.topic = None
            self._topics.clear()
            silence = f"the board does not answer, and has not asked for the time for {now - self._synced:.1f} s"
            self._report(
                DeviceStatus(self._name, "offline", silence, "press the board's reset button, look at its power")
            )
        if self.topic is None:
            self._ask(now)
        elif now - self._synced > SILENT or (self.later and now - max(self._encoded, self._asked) > TACHO_SILENT):
            self._doubt()

    @property
    def later(self) -> bool:
        """Whether it is one of the later sketches, which have encoders."""
        return wire.TACHO in list(self._topics.values())  # the link's thread may add some

    def reassure(self) -> None:
        """Ask the board whether it has begun anew, unless it is about to tell. Raises NotConnected."""
        now, detector = self._clock.now(), self.detector
        tells = detector.expects_ack(now) or (self.later and now - self._encoded <= TACHO_SILENT)
        if detector.state is DetectorState.SUSPECT or not tells:
            self._doubt()

    def _doubt(self) -> None:
        if not self.detector.probe_pending:
            self._probe(self._clock.now())

    def trouble(self) -> tuple[str, str]:
        """Say what is still missing before the board takes angles, and what to try."""
        look = f"python3 -m serial.tools.miniterm {self._link.port} {self._link.baud}"
        if self._awake is None or self._clock.now() < self._awake:
            return "waiting for the board to boot", ""
        if any(self._trouble):
            return self._trouble
        if self._topics:
            names = ", ".join(topic.name for topic in list(self._topics.values()))  # the link's thread may add some
            return f"the board has the topics {names}, but no {self._wanted.name}", "flash the Rodney sketch"
        if self._finder.skipped and not self._counters["frames"]:
            noise = f"{self._finder.skipped} bytes heard at {self._link.baud} baud, none of them rosserial"
            return noise, f"{look}  (text: another sketch; gibberish: another baud rate)"
        waiting = "waiting for the board to say which topics it has; is the Rodney sketch on it?"
        return waiting, f"{look}  (is this the sketch's baud rate? 57600 on a Nano, 500000 on a Teensy)"

    def _ask(self, now: float) -> None:
        """Request the topics, unless that was done a moment ago or the board is still booting."""
        if self._awake is not None and now >= self._awake and now - self._asked >= ASK_AGAIN:
            self._probe(now)

    def _probe(self, now: float) -> None:
        self._asked = now
        self._counters["requests"] += 1
        self.detector.on_probe_sent(now)
        self._link.write(wire.PROBE)

    def _take(self, frames: list[wire.Frame]) -> None:
        for frame in frames:
            self._counters["frames"] += 1
            try:
                self._hear(frame)
            except ValueError:
                self._counters["malformed"] += 1

    def _hear(self, frame: wire.Frame) -> None:
        match frame.topic:
            case wire.TIME:
                self._synced = self._clock.now()
                self._counters["times"] += 1
                again = self.detector.on_time_request(self._synced)
                self._link.write(wire.Frame(wire.TIME, wire.Time(self._synced).pack()).pack())
                if again:
                    self._doubt()
            case wire.PUBLISHER:
                info = wire.TopicInfo.unpack(frame.data)
                self._topics[info.id] = info.topic
                self._check_tacho(info.topic)
            case wire.SUBSCRIBER:
                self._learn(wire.TopicInfo.unpack(frame.data))
            case wire.LOG:
                self._log(wire.Log.unpack(frame.data))
            case number if number not in wire.OWN and number not in self._topics:
                self._counters["unknown topics"] += 1
                self._ask(self._clock.now())
            case number if self._topics.get(number) == wire.TACHO:
                self.detector.on_encoder_message()
                self._encoded = self._clock.now()
                self.tacho = Reading(wire.Tacho.unpack(frame.data), self._clock.now(), Quality.GOOD)
                self._counters["tachos"] += 1

    def _learn(self, info: wire.TopicInfo) -> None:
        """Remember what the board listens to; take the wanted topic only if both mean the same by it."""
        self._topics[info.id] = info.topic
        if info.topic.name != self._wanted.name:
            return
        if info.topic == self._wanted:
            now, asked = self._clock.now(), self.detector.probe_pending
            self.boot_state = self.detector.on_answer(now)
            if self.topic is not None and not asked and now - self._asked > ASK_AGAIN:
                self.boot_state = BootState.RESET  # nobody had asked: it is telling a newcomer, as after a reset
            if self.topic is not None and self.boot_state is BootState.RESET:
                self._report(
                    DeviceStatus(self._name, "fault", "the board has started anew", "look at its power supply")
                )
            elif self.topic is None:
                self._report(
                    DeviceStatus(self._name, "online", f"the board takes {info.topic.type} as topic {info.id}")
                )
            self.topic, self._trouble, self._synced = info.id, ("", ""), now
            return
        found = _other(info.topic, self._wanted)
        cure = "rosrun rosserial_arduino make_libraries.py  (with Rodney's servo_msgs; then flash the sketch again)"
        if self._trouble != (found, cure):
            self._report(DeviceStatus(self._name, "fault", found, cure))
        self.topic, self._trouble = None, (found, cure)

    def _check_tacho(self, topic: wire.Topic) -> None:
        """Say it when encoders cannot be read because the board means something else by their message."""
        if topic.name == wire.TACHO.name and topic != wire.TACHO:
            cure = "rosrun rosserial_arduino make_libraries.py  (with Rodney's tacho_msgs; then flash the sketch again)"
            self._report(DeviceStatus(self._name, "fault", _other(topic, wire.TACHO), cure))

    def _log(self, line: wire.Log) -> None:
        self.detector.on_log_line()
        self._counters["log lines"] += 1
        if line.level >= WARNING:
            self._report(DeviceStatus(self._name, "fault", f"the board says: {line.text}"))


def _other(topic: wire.Topic, expected: wire.Topic) -> str:
    """Say that the board means something else by a topic."""
    return (
        f"the board's topic {topic.name} is {topic.type} (md5 {topic.md5}), "
        f"expected {expected.type} (md5 {expected.md5})"
    )
