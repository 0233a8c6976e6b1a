"""Progress of joints towards their goals: finds those that are blocked, turn the wrong way, or are pushed away.

It compares where a joint is sent with where it is measured. A joint that is given up is to be held where it stands:
then its motor no longer pushes, and the limb does not fall.
"""

from math import radians

from drivers.errors import DeviceFault

TOLERANCE = radians(10)
"""A joint this far from its goal is not there: nearer, a servo with a proportional controller may come to rest."""

FULL_LOAD, LOADED_TOLERANCE = 0.8, radians(4)
"""Share of the stall torque from which on a joint pushes with all that it has, and the tolerance then."""

BLOCKED_AFTER = 0.8
"""Seconds without progress after which a joint is blocked: a servo that protects itself lets the limb fall at 1 s."""

STEP, RESOLUTION = radians(2), radians(0.6)
"""Progress within ``BLOCKED_AFTER`` that is enough, and the least that sensors tell from none."""

SLOW = 0.25
"""Share of the commanded speed that is enough progress, too."""

SETTLED = 0.3
"""Seconds near its goal after which a joint has arrived."""

WRONG_WAY, WRONG_WAY_AFTER = radians(12), 0.5
"""Way in the wrong direction, and the seconds that it takes at least: shorter ones are those of a joint that brakes."""

RETRY_AFTER = 2.0
"""Seconds without a command after which a joint that was given up may be tried again."""

LONGEST_GAP = 0.25
"""Seconds between two readings that count: while nothing is read, nothing is known of its progress."""

HINT = "free the joint; if nothing holds it, look at its cable and its sensor"


class JointProgress:
    """Watches one joint by its readings, in radians and seconds. For one thread at a time.

    ``title`` is the name of the joint in messages. ``blocked`` says why it was given up, as long as it is.
    ``runs_away`` is True for one that turned the wrong way, and goes on when it is held: its driver has to let go of
    it, or to say that it cannot.
    """

    def __init__(self, title: str) -> None:
        self.title = title
        self.blocked = ""
        self.runs_away = False
        self._goal: float | None = None
        self._settled: float | None = None  # the goal at which it has arrived
        self._blocked_at = 0.0
        self._left_at: float | None = None  # where it is held since it turned the wrong way
        self._speed = self._commanded_at = self._stamp = 0.0
        self._arrived = True
        self._away = False  # it does not stay where it holds
        self._direction = 0  # in which the goal lies, once it is too far away
        self._front = self._mark = 0.0  # how far it has come in that direction; and where progress was counted last
        self._front_at = self._near = 0.0
        self._stood = self._patience = 0.0  # seconds without progress, and the share of what it is given at its speed

    @property
    def active(self) -> bool:
        """True while it is under way, or was given up: while readings matter."""
        return self._left_at is not None or (self._goal is not None and not self._arrived)

    def permit(self, goal: float, now: float) -> None:
        """Raise DeviceFault for a goal that is blocked; a goal on the other side, or after a while, is permitted.

        A joint that turned the wrong way has no other side.
        """
        if not self.blocked:
            return
        waited, self._commanded_at = now - self._commanded_at, now
        back = self._left_at is None and (goal - self._blocked_at) * self._direction < 0
        if waited > RETRY_AFTER or back:
            self.hold(None)
        else:
            raise DeviceFault(self.blocked, hint=HINT)

    def command(self, goal: float, speed: float, now: float) -> None:
        """Expect it to go to ``goal`` at ``speed`` (rad/s) at most."""
        if self._arrived and (self._settled is None or abs(goal - self._settled) > RESOLUTION):
            self._arrived = False
            self._restart()
        self._goal, self._speed, self._commanded_at, self._left_at = goal, speed, now, None

    def hold(self, place: float | None) -> None:
        """Expect it to stay at ``place``, None for a limp joint; nothing is blocked any more.

        A joint that turned the wrong way is still watched: it may run away from there.
        """
        self._left_at = None if self._left_at is None else place
        self.blocked, self.runs_away = "", False
        self._goal = self._settled = place
        self._arrived = True
        self._restart()

    def look(self, here: float, load: float, stamp: float) -> str:
        """Take a reading; return what is new: why it is given up, or that it was pushed away from where it holds."""
        passed, self._stamp = min(max(stamp - self._stamp, 0.0), LONGEST_GAP), max(stamp, self._stamp)
        if self._left_at is not None and not self.runs_away and abs(here - self._left_at) > WRONG_WAY:
            self.runs_away = True
            self._blocked_at = here
            said = f"{self.title}: runs away from {self._left_at:.2f} rad, where it is held"
            self.blocked = self.blocked or said
            return said
        if self._goal is None or self.blocked:
            return ""
        error = self._goal - here
        loaded = abs(load) >= FULL_LOAD
        if abs(error) <= (LOADED_TOLERANCE if loaded and not self._arrived else TOLERANCE):
            self._near += passed
            if self._near >= SETTLED:
                self._arrived, self._settled = True, self._goal
                self._restart()
            return ""
        self._near = 0.0
        self._advance(here, 1 if error > 0 else -1, passed)
        if self._arrived:
            return self._pushed_away(here)
        away = (self._front - here) * self._direction
        if away > WRONG_WAY and stamp - self._front_at >= WRONG_WAY_AFTER:
            self._left_at = here
            return self._give_up(here, f"turned the wrong way, from {self._front:.2f} to {here:.2f} rad", load)
        if self._patience >= 1.0:
            return self._give_up(here, f"stands at {here:.2f} rad since {self._stood:.1f} s: blocked?", load)
        return ""

    def _advance(self, here: float, direction: int, passed: float) -> None:
        """Take in how far it is on its way."""
        if direction != self._direction:
            self._direction, self._front, self._front_at, self._mark = direction, here, self._stamp, here
        if (here - self._front) * direction > 0:
            self._front, self._front_at = here, self._stamp
        enough = min(STEP, max(RESOLUTION, SLOW * self._speed * BLOCKED_AFTER))
        if (self._front - self._mark) * direction >= enough:
            self._mark, self._stood, self._patience = self._front, 0.0, 0.0
            return
        self._stood += passed
        self._patience += passed / max(BLOCKED_AFTER, 4 * RESOLUTION / max(self._speed, RESOLUTION))

    def _pushed_away(self, here: float) -> str:
        """Say, once until it is back, that it does not stay where it holds."""
        if self._patience < 1.0 or self._away:
            return ""
        self._away = True
        return f"{self.title}: holds {self._goal:.2f} rad, stands at {here:.2f} rad: pushed away, or overloaded?"

    def _give_up(self, here: float, why: str, load: float) -> str:
        self._blocked_at = here
        felt = f"; load {abs(load):.0%}".replace("%", " %") if load else ""
        self.blocked = f"{self.title}: commanded {self._goal:.2f} rad, {why}{felt}"
        return self.blocked

    def _restart(self) -> None:
        """Count from the next reading on."""
        self._direction, self._away = 0, False
        self._near = self._stood = self._patience = 0.0
