"""Session of rosserial, computer side: waits for the boot, requests the topics, and replies with the time."""

import math
from collections import Counter, deque
from enum import Enum, auto
from math import inf
from typing import Final

from drivers.api import DeviceStatus, Quality, Reading, StatusCallback
from drivers.arduino import wire
from drivers.clock import Clock
from drivers.transport.link import SerialLink

# Detect resets of a rosserial board, so that no servo leaps from a position that the driver does not know.
#
# A Rodney sketch obeys servo setpoints from the moment it runs, and does not announce a reset. Setpoints may
# therefore be sent only on a fresh proof that the board has not restarted: a proof younger than the shortest boot
# time.
#
# An encoder message is such a proof, and so is the log line with which the first sketches acknowledge a setpoint.
# Without either, the board is probed (``wire.PROBE``). The answer also shows whether the board was in a session with
# a computer: a board without a session requests the time four times, any other board once.
#
# The session rules are those of ``node_handle.h`` in rosserial_client.

MAX_PROOF_AGE = 0.05
"""Maximum age in seconds of a proof that the board was not reset: the fastest boards boot in 65 ms."""

ACK_TIMEOUT = 2 * MAX_PROOF_AGE
"""Seconds for which the acknowledgement of a setpoint is awaited, before the board is probed instead."""

PROBE_TIMEOUT = 0.25
"""Seconds until a probe counts as unanswered: 200 bytes at 57600 baud, plus the latency of the USB adapter."""

MIN_TIME_REQUEST_INTERVAL = 2.3
"""Shortest seconds between time requests of a board in a session, which sends one every 2.5 s."""

SESSION_TIMEOUT = 10.5
"""Seconds without a reply to a time request until the board may drop the session; rosserial drops it after 11 s."""

SESSION_TIME_REQUESTS = 4
"""Number of time requests without a reply after which a board drops the session."""

NO_SESSION_TIME_REQUESTS = 3
"""Number of time requests in reply to a probe that shows that the board had no session.

Such a board sends four requests, any other board one or two.
"""


class BootState(Enum):
    """Result of a probe of the board: whether it was reset."""

    UNCHANGED = auto()  # the session is intact, so there was no reset
    RESET = auto()
    UNKNOWN = auto()  # a reset is possible: the session expired, or it is unclear which probe opened it


class DetectorState(Enum):
    """State of a ``ResetDetector``: which messages of the board prove that it was not reset."""

    TRACKING = auto()  # messages of the board count as proof
    SUSPECT = auto()  # only the answer to a probe counts as proof
    PROBING = auto()
    SILENT = auto()  # the last probe timed out
    REPROBING = auto()  # a probe is pending, after one that timed out


class DetectorEvent(Enum):
    """Event of a ``ResetDetector``; DISTRUST is a stall of this process, or a time request soon after a probe."""

    DISTRUST, PROBE, ANSWER, TIMEOUT = range(4)


TRANSITIONS: Final = {
    **{(state, DetectorEvent.ANSWER): DetectorState.TRACKING for state in DetectorState},
    **{(state, DetectorEvent.DISTRUST): state for state in DetectorState},
    (DetectorState.TRACKING, DetectorEvent.DISTRUST): DetectorState.SUSPECT,
    (DetectorState.TRACKING, DetectorEvent.PROBE): DetectorState.PROBING,
    (DetectorState.SUSPECT, DetectorEvent.PROBE): DetectorState.PROBING,
    (DetectorState.PROBING, DetectorEvent.PROBE): DetectorState.PROBING,
    (DetectorState.PROBING, DetectorEvent.TIMEOUT): DetectorState.SILENT,
    (DetectorState.SILENT, DetectorEvent.PROBE): DetectorState.REPROBING,
    (DetectorState.REPROBING, DetectorEvent.PROBE): DetectorState.REPROBING,
    (DetectorState.REPROBING, DetectorEvent.TIMEOUT): DetectorState.SILENT,
}
"""Next state by state and event. Any other pair leads to SUSPECT: nothing is sent until a probe is answered."""


class ResetDetector:
    """Detector of resets of a board on one connection; ``previous`` is the detector of the connection before.

    Each event of the connection is reported by an ``on_...`` method, with times in seconds on a monotonic clock.
    """

    def __init__(self, previous: "ResetDetector | None" = None) -> None:
        self.state = DetectorState.TRACKING
        self.unanswered_probes = 0
        self.session_until: float | None = None  # None: the board never had a session with us
        # The port was lost while a probe was pending, so its answer is lost. If the board was reset before that probe,
        # the probe opened a new session, and only its answer showed the reset.
        self.is_answer_lost = False
        if previous is not None:
            self.unanswered_probes, self.session_until = previous.unanswered_probes, previous.session_until
            self.is_answer_lost = previous.probe_pending or previous.is_answer_lost
            if previous.had_timeout:
                self.state = DetectorState.SILENT
        self.idle_period = 0.0  # longest intended time between two polls, in seconds
        self._had_session = False  # on this connection
        self._backlog = False  # the data being read may be old
        self._time_requests = 0  # since the last probe
        self._queued_time_requests = 0  # read from a backlog, since the last answer
        self._unacked: deque[float] = deque()  # times at which setpoints were sent
        self._polled_at: float | None = None
        self._received_after = self._stall_ended_at = self._time_requested_at = -inf
        self._probe_sent_at = self._proof_at = -inf

    @property
    def probe_pending(self) -> bool:
        """True while a probe waits for its answer."""
        return self.state in (DetectorState.PROBING, DetectorState.REPROBING)

    @property
    def had_timeout(self) -> bool:
        """True if a probe has timed out since the last answer."""
        return self.state in (DetectorState.SILENT, DetectorState.REPROBING)

    @property
    def _is_answer_late(self) -> bool:
        """True if the next answer must belong to an earlier probe.

        This is so if exactly one probe has not been answered, and it has timed out.
        """
        return self.state is DetectorState.SILENT and self.unanswered_probes == 1

    def is_fresh(self, now: float) -> bool:
        """Return whether setpoints may be sent: a recent proof shows that the board was not reset."""
        return not self.probe_pending and now - self._proof_at <= MAX_PROOF_AGE

    def expects_ack(self, now: float) -> bool:
        """Return whether an ack of a recent setpoint is due, so that a probe would be superfluous."""
        return bool(self._unacked) and now - self._unacked[-1] <= ACK_TIMEOUT

    def check_timeout(self, now: float) -> bool:
        """Return whether the pending probe has just timed out."""
        # After a stall of this process the timeout starts over: the board may have been stalled with it.
        waiting_since = max(self._probe_sent_at, self._stall_ended_at)
        if not self.probe_pending or now - waiting_since <= PROBE_TIMEOUT:
            return False
        self._advance(DetectorEvent.TIMEOUT)
        return True

    def on_poll(self, now: float) -> None:
        """Record that the port is read at time ``now``.

        Call this before received data are handled, and in each pass of the loop without data.
        """
        polled_at, self._polled_at = self._polled_at, now
        self._backlog = polled_at is not None and now - polled_at > MAX_PROOF_AGE + self.idle_period
        self._received_after = -inf if polled_at is None or self._backlog else polled_at
        if self._backlog:
            # This process was stalled: the data may have been in the kernel's buffer since before a reset.
            self._stall_ended_at = now
            self._unacked.clear()
            self._distrust()

    def on_probe_sent(self, now: float) -> None:
        """Discard the proofs so far: from now on only the answer to this probe counts."""
        self._advance(DetectorEvent.PROBE)
        # After a timeout time requests are still counted: they may be all that was left of a garbled answer.
        if self.state is DetectorState.PROBING:
            self._time_requests = 0
        self.unanswered_probes += 1
        self._probe_sent_at, self._proof_at = now, -inf
        self._unacked.clear()

    def on_setpoints_sent(self, count: int, now: float) -> None:
        """Expect ``count`` acks of the board, one for each setpoint that was sent."""
        self._unacked.extend([now] * count)

    def on_encoder_message(self) -> None:
        """Count an encoder message as a proof that the board was not reset up to the previous poll of the port.

        The message may have been received at any time since that poll.
        """
        if self.state is DetectorState.TRACKING:
            self._proof_at = max(self._proof_at, self._received_after)

    def on_log_line(self) -> None:
        """Count a log line as the acknowledgement of the oldest setpoint: the first sketches log each setpoint."""
        if self._unacked:
            self._proof_at = max(self._proof_at, self._unacked.popleft())

    def on_time_request(self, now: float) -> bool:
        """Return whether the board must be probed: in a session it would not have requested the time so early."""
        self._time_requests += 1
        if self._backlog:
            # With a probe pending they belong to its answer: before a probe is sent, all earlier data are read.
            self._queued_time_requests += not self.probe_pending
            return False
        is_early, self._time_requested_at = now - self._time_requested_at < MIN_TIME_REQUEST_INTERVAL, now
        if self.probe_pending or self._is_answer_late:  # each answer begins with a time request
            return False
        if not is_early:
            self.session_until, self._had_session = now + SESSION_TIMEOUT, True
            return False
        if now - self._probe_sent_at <= PROBE_TIMEOUT:
            # It may begin a second answer, to an earlier probe that timed out. A probe now would provoke
            # another such answer, and so on without end.
            self._distrust()
            return False
        return True

    def on_answer(self, now: float) -> BootState:
        """Return the boot state that follows from an answer to a probe.

        The answer proves this state only for the time at which the probe was sent.
        """
        is_late = self._is_answer_late
        probed_at = self._probe_sent_at if self.probe_pending or is_late else now
        # After a timeout it is unclear which probe is answered. An earlier one may have opened a new session, so an
        # intact session no longer excludes a reset.
        is_ambiguous, is_answer_lost = self.had_timeout and not is_late, self.is_answer_lost
        is_session_intact = self._time_requests < NO_SESSION_TIME_REQUESTS
        # Too few time requests in the backlog of a stall show that the session did not expire during it.
        is_session_expected = self.session_until is not None and (
            probed_at <= self.session_until
            or (self._had_session and self._queued_time_requests < SESSION_TIME_REQUESTS)
        )
        self._advance(DetectorEvent.ANSWER)
        self.unanswered_probes = self._time_requests = self._queued_time_requests = 0
        self.is_answer_lost = False
        self._proof_at, self._time_requested_at = probed_at, now
        self.session_until, self._had_session = probed_at + SESSION_TIMEOUT, True
        if is_session_intact:
            return BootState.UNKNOWN if is_ambiguous or is_answer_lost else BootState.UNCHANGED
        return BootState.RESET if is_ambiguous or is_session_expected else BootState.UNKNOWN

    def _distrust(self) -> None:
        self._proof_at = -inf
        self._advance(DetectorEvent.DISTRUST)

    def _advance(self, event: DetectorEvent) -> None:
        self.state = TRANSITIONS.get((self.state, event), DetectorState.SUSPECT)


TIME_REQUEST_TIMEOUT = 2.7
"""Seconds without a time request after which the board is probed; a board in a session sends one every 2.5 s."""

TACHO_TIMEOUT = 0.2
"""Seconds without an encoder message after which the board is probed; a sketch with encoders sends one every 50 ms."""

TOPIC_REQUEST_INTERVAL = 1.0
"""Seconds between two requests for the topics; a running board replies within a tenth of a second."""

FRAME_TIMEOUT = 0.1
"""Seconds of silence after which an incomplete frame is dropped."""

WARNING_LEVEL = 2
"""Lowest level of a log line that is reported as a fault."""


class RosserialSession:
    """Session with a board, from the opening of the port to the disconnect. For the link's thread.

    ``topic`` is the number that the board has given to ``expected_topic``; None before the board has announced it,
    after a mismatch of the definitions, and while the board does not answer. ``tacho`` is the latest encoder message,
    in the clock's time; the first sketch sends none. ``boot_state`` is set by each reply that tells whether the board
    has restarted, and cleared by the caller. ``detector`` decides whether a reset can be excluded. Opening the port
    resets most boards, and a booting board does not reply to the first probe; it is probed again after ``boot_delay``
    seconds. Time replies carry the monotonic time of the clock, not the time of day.
    """

    def __init__(
        self,
        name: str,
        expected_topic: wire.RosserialTopic,
        link: SerialLink,
        clock: Clock,
        report: StatusCallback,
        *,
        boot_delay: float,
        previous: ResetDetector | None = None,
    ) -> None:
        self.topic: int | None = None
        self.boot_state: BootState | None = None
        self.detector = ResetDetector(previous)
        self.tacho: Reading[wire.Tacho] = Reading(None, -math.inf, Quality.NONE)
        self._name = name
        self._expected_topic = expected_topic
        self._link = link
        self._clock = clock
        self._report = report
        self._boot_delay = boot_delay
        self._booted_at: float | None = None  # end of the boot time
        self._probed_at = self._received_at = self._time_requested_at = self._tacho_at = -math.inf
        self._finder = wire.RosserialFrameFinder()
        self._topics: dict[int, wire.RosserialTopic] = {}
        self._trouble = ("", "")
        self._counters: Counter[str] = Counter(
            {"frames": 0, "malformed": 0, "unknown topics": 0, "requests": 0, "times": 0, "tachos": 0, "log lines": 0}
        )

    def counters(self) -> Counter[str]:
        """Return the counters of this session."""
        found = {"skipped bytes": self._finder.skipped, "checksum errors": self._finder.checksum_errors}
        return Counter({**self._counters, **found})

    def on_data(self, data: bytes) -> None:
        """Handle bytes from the board, and reply to its requests. Raises NotConnected if the port is gone."""
        self._received_at = now = self._clock.now()
        self.detector.on_poll(now)
        self._handle_frames(self._finder.feed(data))

    def poll(self) -> None:
        """Request the topics if that is due, and detect silence. Raises NotConnected if the port is gone."""
        now = self._clock.now()
        self.detector.on_poll(now)
        if self._booted_at is None:
            self._booted_at = now + self._boot_delay
            self._probe(now)
        if self._finder.has_partial_frame and now - self._received_at > FRAME_TIMEOUT:
            self._handle_frames(self._finder.drop_partial_frame())
        if self.detector.check_timeout(now) and self.topic is not None:
            self.topic = None
            self._topics.clear()
            silence = f"no reply from the board, and no time request for {now - self._time_requested_at:.1f} s"
            self._report(
                DeviceStatus(self._name, "offline", silence, "press the board's reset button, check its power")
            )
        if self.topic is None:
            self._request_topics(now)
        elif now - self._time_requested_at > TIME_REQUEST_TIMEOUT or (
            self.has_encoders and now - max(self._tacho_at, self._probed_at) > TACHO_TIMEOUT
        ):
            self._probe_unless_pending()

    @property
    def has_encoders(self) -> bool:
        """Whether the sketch is one of the later ones, with encoders."""
        return wire.TACHO_TOPIC in list(self._topics.values())  # a copy: the link's thread may add some

    def probe_if_needed(self) -> None:
        """Probe the board, unless it is about to send a proof by itself. Raises NotConnected."""
        now, detector = self._clock.now(), self.detector
        expects_proof = detector.expects_ack(now) or (self.has_encoders and now - self._tacho_at <= TACHO_TIMEOUT)
        if detector.state is DetectorState.SUSPECT or not expects_proof:
            self._probe_unless_pending()

    def _probe_unless_pending(self) -> None:
        if not self.detector.probe_pending:
            self._probe(self._clock.now())

    def offline_reason(self) -> tuple[str, str]:
        """Return why the board does not accept setpoints yet, and a hint."""
        look = f"python3 -m serial.tools.miniterm {self._link.port} {self._link.baud}"
        if self._booted_at is None or self._clock.now() < self._booted_at:
            return "waiting for the board to boot", ""
        if any(self._trouble):
            return self._trouble
        if self._topics:
            names = ", ".join(
                topic.name for topic in list(self._topics.values())
            )  # a copy: the link's thread may add some
            return f"the board has the topics {names}, but no {self._expected_topic.name}", "flash the Rodney sketch"
        if self._finder.skipped and not self._counters["frames"]:
            noise = f"{self._finder.skipped} bytes received at {self._link.baud} baud, none of them rosserial"
            return noise, f"{look}  (text: another sketch; gibberish: another baud rate)"
        waiting = "waiting for the topics of the board; does it have the Rodney sketch?"
        return waiting, f"{look}  (is this the sketch's baud rate? 57600 on a Nano, 500000 on a Teensy)"

    def _request_topics(self, now: float) -> None:
        """Request the topics, unless that was done recently or the board is booting."""
        # After a stall the last probe is old, but its timeout starts over. A probe before that would hide that the last
        # one was not answered, which shows that the board was booting.
        is_due = not self.detector.probe_pending and now - self._probed_at >= TOPIC_REQUEST_INTERVAL
        if is_due and self._booted_at is not None and now >= self._booted_at:
            self._probe(now)

    def _probe(self, now: float) -> None:
        self._probed_at = now
        self._counters["requests"] += 1
        self.detector.on_probe_sent(now)
        self._link.write(wire.PROBE)

    def _handle_frames(self, frames: list[wire.RosserialFrame]) -> None:
        for frame in frames:
            self._counters["frames"] += 1
            try:
                self._handle_frame(frame)
            except ValueError:
                self._counters["malformed"] += 1

    def _handle_frame(self, frame: wire.RosserialFrame) -> None:
        match frame.topic:
            case wire.TIME:
                self._time_requested_at = self._clock.now()
                self._counters["times"] += 1
                must_probe = self.detector.on_time_request(self._time_requested_at)
                self._link.write(
                    wire.RosserialFrame(wire.TIME, wire.RosserialTime(self._time_requested_at).pack()).pack()
                )
                if must_probe:
                    self._probe_unless_pending()
            case wire.PUBLISHER:
                info = wire.TopicInfo.unpack(frame.data)
                self._topics[info.id] = info.topic
                self._check_tacho(info.topic)
            case wire.SUBSCRIBER:
                self._on_subscriber(wire.TopicInfo.unpack(frame.data))
            case wire.LOG:
                self._log(wire.RosserialLog.unpack(frame.data))
            case number if number not in wire.RESERVED_TOPICS and number not in self._topics:
                self._counters["unknown topics"] += 1
                self._request_topics(self._clock.now())
            case number if self._topics.get(number) == wire.TACHO_TOPIC:
                self.detector.on_encoder_message()
                self._tacho_at = self._clock.now()
                self.tacho = Reading(wire.Tacho.unpack(frame.data), self._clock.now(), Quality.GOOD)
                self._counters["tachos"] += 1

    def _on_subscriber(self, info: wire.TopicInfo) -> None:
        """Record a topic that the board receives; accept the expected topic only if its definition matches."""
        self._topics[info.id] = info.topic
        if info.topic.name != self._expected_topic.name:
            return
        if info.topic == self._expected_topic:
            now, was_probed = self._clock.now(), self.detector.probe_pending
            self.boot_state = self.detector.on_answer(now)
            if self.topic is not None and not was_probed and now - self._probed_at > TOPIC_REQUEST_INTERVAL:
                self.boot_state = BootState.RESET  # unsolicited: it announces its topics, as after a reset
            if self.topic is not None and self.boot_state is BootState.RESET:
                self._report(DeviceStatus(self._name, "fault", "the board has restarted", "check its power supply"))
            elif self.topic is None:
                self._report(
                    DeviceStatus(self._name, "online", f"the board takes {info.topic.type} as topic {info.id}")
                )
            self.topic, self._trouble, self._time_requested_at = info.id, ("", ""), now
            return
        mismatch = _topic_mismatch(info.topic, self._expected_topic)
        hint = "rosrun rosserial_arduino make_libraries.py  (with Rodney's servo_msgs; then flash the sketch again)"
        if self._trouble != (mismatch, hint):
            self._report(DeviceStatus(self._name, "fault", mismatch, hint))
        self.topic, self._trouble = None, (mismatch, hint)

    def _check_tacho(self, topic: wire.RosserialTopic) -> None:
        """Report encoders whose message definition does not match."""
        if topic.name == wire.TACHO_TOPIC.name and topic != wire.TACHO_TOPIC:
            hint = "rosrun rosserial_arduino make_libraries.py  (with Rodney's tacho_msgs; then flash the sketch again)"
            self._report(DeviceStatus(self._name, "fault", _topic_mismatch(topic, wire.TACHO_TOPIC), hint))

    def _log(self, line: wire.RosserialLog) -> None:
        self.detector.on_log_line()
        self._counters["log lines"] += 1
        if line.level >= WARNING_LEVEL:
            self._report(DeviceStatus(self._name, "fault", f"log of the board: {line.text}"))


def _topic_mismatch(topic: wire.RosserialTopic, expected: wire.RosserialTopic) -> str:
    """Return the message about a topic with another definition."""
    return (
        f"the board's topic {topic.name} is {topic.type} (md5 {topic.md5}), "
        f"expected {expected.type} (md5 {expected.md5})"
    )
