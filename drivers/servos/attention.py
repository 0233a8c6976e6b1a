"""How often each joint is read: as often as what it does is worth knowing. Pure arithmetic."""

from collections.abc import Collection, Iterable
from math import inf, radians

from drivers.servos import pace
from drivers.servos.joint import Joint

RESTING = 0.2
"""Seconds between readings of a joint at rest."""

ASKED = 0.1
"""Seconds between its readings while somebody keeps asking for the states of joints: one that is held stays there."""

LIMP = 0.05
"""The same for one without torque, which anybody may turn."""

LATELY = 0.25
"""Seconds in which who keeps asking asks again, as a leaf does at each tick; a record asks twice a second."""

SENT = 0.04
"""Seconds between readings of a joint that goes where it was sent: its leg lasts for seven of them."""

TURNED = 0.02
"""Seconds between readings of one that is turned by hand; a joint that leads or follows is read as often as the arm's
rate says."""

STILL = radians(2)
"""rad/s: a joint that turns no faster is at rest."""

EARLY = 1 / 4
"""A joint is read by this share of its time earlier, along with others: one request may ask several."""


class Attention:
    """Says which joints are to be read at a time: none more often than at ``rate`` (Hz), all every ``most`` seconds."""

    def __init__(self, rate: float, most: float = RESTING) -> None:
        self._least = 1 / rate
        self._most = most
        self._asked_at = self._asked_since = -inf

    def asked(self, now: float) -> bool:
        """Take note of a question for the states of joints; say whether somebody has kept asking for a while."""
        if now - self._asked_at > LATELY:
            self._asked_since = now
        self._asked_at = now
        return now - self._asked_since > LATELY

    def _keeps_asking(self, now: float) -> bool:
        return self._asked_at > self._asked_since and now - self._asked_at <= LATELY

    def wanted(self, joints: Iterable[Joint], coupled: Collection[str], now: float) -> list[Joint]:
        """Return those of ``joints`` that are to be read now; ``coupled`` are those that lead or follow.

        What is due is due in the nearest round.
        """
        due = {joint: joint.reading.stamp + self._period(joint, coupled, now) for joint in joints if joint.driven}
        early = pace.EARLY * self._least
        if all(max(time - early, joint.due) > now for joint, time in due.items()):
            return []
        return [
            joint
            for joint, time in due.items()
            if joint.due <= now and now >= time - max(EARLY * (time - joint.reading.stamp), early)
        ]

    def next_at(self, joints: Iterable[Joint], coupled: Collection[str], now: float) -> float:
        """Return when the first of ``joints`` is to be read."""
        times = (joint.reading.stamp + self._period(joint, coupled, now) for joint in joints if joint.driven)
        return min(times, default=now + self._most)

    def _period(self, joint: Joint, coupled: Collection[str], now: float) -> float:
        """Return the seconds from one reading of a joint to the next."""
        if joint.name in coupled or joint.failures:
            return self._least
        if under_way(joint):
            usual = SENT if joint.torque else TURNED
        elif self._keeps_asking(now):
            usual = ASKED if joint.torque else LIMP
        else:
            usual = RESTING
        return max(self._least, min(usual, self._most))


def under_way(joint: Joint) -> bool:
    """Whether a joint turns, by its newest reading, or was sent farther than it has come."""
    state = joint.reading.value
    if state is None or state.moving or abs(state.velocity) > STILL:
        return True
    if joint.goal is None or not joint.torque:
        return False
    if joint.progress.active and not joint.progress.blocked:
        return True  # one that does not move may be blocked, and its servo shuts down soon
    return joint.sent_at >= joint.reading.stamp or joint.sent != joint.ticks(joint.goal)
