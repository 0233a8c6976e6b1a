"""Poll rate of each joint, by its motion and by the clients that poll its state. Pure arithmetic."""

from collections.abc import Collection, Iterable
from math import inf, radians

from drivers.servos import round_schedule
from drivers.servos.joint import Joint

RESTING_INTERVAL = 0.2
"""Seconds between readings of a joint at rest."""

OBSERVED_INTERVAL = 0.1
"""Seconds between readings of a resting joint with torque on, while a client keeps polling the joint states."""

TORQUE_OFF_INTERVAL = 0.05
"""Seconds between readings of a resting joint with torque off, which a hand may turn, while a client keeps polling."""

OBSERVER_TIMEOUT = 0.25
"""Seconds after its last request for joint states after which a client no longer counts as polling.

Leaves request the states at each tick, 20 times a second; a record does so only twice a second.
"""

MOVING_INTERVAL = 0.04
"""Seconds between readings of a moving joint: seven readings within the lookahead of a setpoint, 0.3 s."""

HAND_TURNED_INTERVAL = 0.02
"""Seconds between readings of a joint that is turned by hand.

Joints that lead or follow are read at the arm's own rate instead.
"""

MAX_RESTING_SPEED = radians(2)
"""Maximum speed in rad/s of a joint at rest."""

EARLY_SHARE = 1 / 4
"""Share of its poll interval by which a joint may be read early, so that one request reads several joints."""


class PollSchedule:
    """Selects the joints to read: none more often than ``rate`` (Hz), all at least every ``max_interval`` seconds."""

    def __init__(self, rate: float, max_interval: float = RESTING_INTERVAL) -> None:
        self._min_interval = 1 / rate
        self._max_interval = max_interval
        self._requested_at = self._observed_since = -inf

    def note_request(self, now: float) -> bool:
        """Record a request for joint states at time ``now``; return True while a client keeps polling.

        A client keeps polling if it has sent requests for more than ``OBSERVER_TIMEOUT`` seconds, without a gap of this
        length.
        """
        if now - self._requested_at > OBSERVER_TIMEOUT:
            self._observed_since = now
        self._requested_at = now
        return now - self._observed_since > OBSERVER_TIMEOUT

    def _is_observed(self, now: float) -> bool:
        return self._requested_at > self._observed_since and now - self._requested_at <= OBSERVER_TIMEOUT

    def due_joints(self, joints: Iterable[Joint], coupled: Collection[str], now: float) -> list[Joint]:
        """Return those of ``joints`` that are due to be read; ``coupled`` names the joints that lead or follow.

        Joints that are nearly due are returned as well, so that one request reads several joints.
        """
        due = {joint: joint.reading.stamp + self._interval(joint, coupled, now) for joint in joints if joint.is_driven}
        early = round_schedule.EARLY_PERIODS * self._min_interval
        if all(max(time - early, joint.next_read_at) > now for joint, time in due.items()):
            return []
        return [
            joint
            for joint, time in due.items()
            if joint.next_read_at <= now and now >= time - max(EARLY_SHARE * (time - joint.reading.stamp), early)
        ]

    def next_due(self, joints: Iterable[Joint], coupled: Collection[str], now: float) -> float:
        """Return the time at which the first of ``joints`` is due."""
        times = (joint.reading.stamp + self._interval(joint, coupled, now) for joint in joints if joint.is_driven)
        return min(times, default=now + self._max_interval)

    def _interval(self, joint: Joint, coupled: Collection[str], now: float) -> float:
        """Return the seconds between two readings of a joint."""
        if joint.name in coupled or joint.missed_reads:
            return self._min_interval
        if is_in_motion(joint):
            usual = MOVING_INTERVAL if joint.torque else HAND_TURNED_INTERVAL
        elif self._is_observed(now):
            usual = OBSERVED_INTERVAL if joint.torque else TORQUE_OFF_INTERVAL
        else:
            usual = RESTING_INTERVAL
        return max(self._min_interval, min(usual, self._max_interval))


def is_in_motion(joint: Joint) -> bool:
    """True if a joint turns, by its newest reading, or has not reached its setpoint."""
    state = joint.reading.value
    if state is None or state.moving or abs(state.velocity) > MAX_RESTING_SPEED:
        return True
    if joint.goal is None or not joint.torque:
        return False
    if joint.progress.active and not joint.progress.blocked:
        return True  # a joint that does not move may be blocked, and its servo will shut down
    return joint.setpoint_sent_at >= joint.reading.stamp or joint.setpoint != joint.ticks(joint.goal)
