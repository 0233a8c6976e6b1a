"""How often each joint is read: as often as what it does is worth knowing. Pure arithmetic."""

from collections.abc import Collection, Iterable
from math import inf, radians

from drivers.servos import round_schedule
from drivers.servos.joint import Joint

RESTING_INTERVAL = 0.2
"""Seconds between readings of a joint at rest."""

OBSERVED_INTERVAL = 0.1
"""Seconds between its readings while somebody keeps asking for the states of joints: one that is held stays there."""

TORQUE_OFF_INTERVAL = 0.05
"""The same for one without torque, which anybody may turn."""

OBSERVER_TIMEOUT = 0.25
"""Seconds in which who keeps asking asks again, as a leaf does at each tick; a record asks twice a second."""

MOVING_INTERVAL = 0.04
"""Seconds between readings of a joint that goes where it was sent: its leg lasts for seven of them."""

HAND_TURNED_INTERVAL = 0.02
"""Seconds between readings of one that is turned by hand; a joint that leads or follows is read as often as the arm's
rate says."""

MAX_RESTING_SPEED = radians(2)
"""rad/s: a joint that turns no faster is at rest."""

EARLY_SHARE = 1 / 4
"""A joint is read by this share of its time earlier, along with others: one request may ask several."""


class PollSchedule:
    """Says which joints are to be read at a time: none more often than at ``rate`` (Hz), all every ``most`` seconds."""

    def __init__(self, rate: float, max_interval: float = RESTING_INTERVAL) -> None:
        self._min_interval = 1 / rate
        self._max_interval = max_interval
        self._requested_at = self._observed_since = -inf

    def note_request(self, now: float) -> bool:
        """Take note of a question for the states of joints; say whether somebody has kept asking for a while."""
        if now - self._requested_at > OBSERVER_TIMEOUT:
            self._observed_since = now
        self._requested_at = now
        return now - self._observed_since > OBSERVER_TIMEOUT

    def _is_observed(self, now: float) -> bool:
        return self._requested_at > self._observed_since and now - self._requested_at <= OBSERVER_TIMEOUT

    def due_joints(self, joints: Iterable[Joint], coupled: Collection[str], now: float) -> list[Joint]:
        """Return those of ``joints`` that are to be read now; ``coupled`` are those that lead or follow.

        What is due is due in the nearest round.
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
        """Return when the first of ``joints`` is to be read."""
        times = (joint.reading.stamp + self._interval(joint, coupled, now) for joint in joints if joint.is_driven)
        return min(times, default=now + self._max_interval)

    def _interval(self, joint: Joint, coupled: Collection[str], now: float) -> float:
        """Return the seconds from one reading of a joint to the next."""
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
    """Whether a joint turns, by its newest reading, or was sent farther than it has come."""
    state = joint.reading.value
    if state is None or state.moving or abs(state.velocity) > MAX_RESTING_SPEED:
        return True
    if joint.goal is None or not joint.torque:
        return False
    if joint.progress.active and not joint.progress.blocked:
        return True  # one that does not move may be blocked, and its servo shuts down soon
    return joint.setpoint_sent_at >= joint.reading.stamp or joint.setpoint != joint.ticks(joint.goal)
