"""Messages that cannot be used: counted, and reported by topic, with the type that was expected and what came."""

from collections.abc import Sequence
from math import inf
from threading import Lock

from drivers.api import DeviceStatus, Report, ignore
from drivers.clock import Clock
from drivers.guard import guarded
from drivers.ros2 import wire

REPORT_INTERVAL = 10.0
"""Seconds from one report of a topic to the next."""

RECENT = 2.0
"""Seconds for which a malformed message explains why nothing of its topic is used."""

MAX_TOPICS = 200
"""Topics whose faults are kept apart: names come from others."""


class TopicFaults:
    """The faults of the topics of one part, ``who``, by their numbers in ``topics``. Safe between threads.

    A fault is a malformed message, which counts for ``RECENT`` seconds, or another type under the name of a topic,
    which counts for as long as it is there.
    """

    def __init__(self, who: str, topics: Sequence[str], clock: Clock, report: Report = ignore) -> None:
        self.count = 0
        self._who, self._topics, self._clock, self._report = who, list(topics), clock, guarded(report)
        self._lock = Lock()
        self._malformed: dict[str, tuple[str, float]] = {}
        self._mismatches: dict[str, str] = {}
        self._reported_at: dict[str, float] = {}

    def add(self, number: int, why: object) -> None:
        """Take note of a malformed message of a topic; a number of no topic counts only."""
        self.count += 1
        if number < len(self._topics):
            self.add_of(self._topics[number], why)

    def add_of(self, topic: str, why: object) -> None:
        """Take note of a malformed message of a topic, a service or an action by its name."""
        with self._lock:
            if len(self._malformed) < MAX_TOPICS or topic in self._malformed:
                self._malformed[topic] = (f"{topic}: malformed message: {why}", self._clock.now())
        self._tell(topic)

    def mismatch(self, payload: bytes) -> None:
        """Take a frame of ``wire.mismatch``: which other type is there, or none any more. Raises ValueError."""
        number, why = wire.mismatch_of(payload)
        if number >= len(self._topics):
            return
        topic = self._topics[number]
        with self._lock:
            self._mismatches.pop(topic, None)
            if why:
                self._mismatches[topic] = f"{topic}: {why}"
                self._reported_at.pop(topic, None)
        self._tell(topic)

    def why(self, number: int) -> str:
        """Return the fault of a topic now; empty if it has none."""
        return self._why(self._topics[number])

    def _why(self, topic: str) -> str:
        with self._lock:
            said, at = self._malformed.get(topic, ("", -inf))
            return self._mismatches.get(topic, "") or (said if self._clock.now() - at <= RECENT else "")

    def _tell(self, topic: str) -> None:
        why, now = self._why(topic), self._clock.now()
        with self._lock:
            if not why or now - self._reported_at.get(topic, -inf) < REPORT_INTERVAL:
                return
            self._reported_at[topic] = now
        self._report(DeviceStatus(self._who, "fault", why, hint_for(topic)))


def hint_for(topic: str) -> str:
    """Return the command that shows the messages of a topic."""
    return f"`mission ros2 echo {topic}` shows what comes; is its node built for the ROS 2 of this robot?"
