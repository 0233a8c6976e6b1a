"""The leaf that goes after a person: the face stays in the picture, and the person at a distance."""

import math

from behaviours.clearance import Lookout, free_way, safe_speed
from behaviours.driving.motion import BRAKING, HELD_OFF, REACTION, Way, held_up, obstacle
from behaviours.leaf import argument
from behaviours.tracking.track_face import TrackFace
from drivers.api import STILL, BaseState, Steering, is_guarded
from perception.api import Percept

EAGERNESS = 0.8
"""Speed in m/s for each metre too far: with a Kobuki's dead time of 0.25 s it arrives without overshooting."""

SLACK = 0.1
"""Metres too far that are near enough: the distance is a guess from the size of the face, and trembles."""

NEAREST = 0.6
"""Metres to people at least. A TurtleBot 2 (0.18 m) touches a person (0.25 m) at 0.43 m: told to stay 0.5 m behind, it
bumps into people in the simulated rooms, told 0.6 m it does not; nearer by, a face leaves the picture of its camera."""

AHEAD = math.radians(45)
"""With the head turned further aside the base only turns: it would drive past the person."""


class FollowPerson(TrackFace):
    """Follow a person: the head and the base turn to their face, and the base drives after them up to `distance`.

    Running while there is a face to follow; it never succeeds. It never drives backwards. With a range finder it slows
    down for whatever is in its way, and stops before it. Fails once no face was seen for `patience`, when it bumps into
    something, comes to a cliff, or a wheel drops, once something has been in its way for 5 s, and while the base is
    stopped until somebody enables it.
    """

    word = "follow_person"
    needs = frozenset({"camera", "head", "base"})
    uses = frozenset({"range"})
    distance: float = argument("length", "how far to stay behind the person", default=1.0, low=NEAREST, high=5.0)
    speed: float = argument("speed", "how fast it may drive", default=0.3, low=0.01, high=0.7)

    _lookout: Lookout | None = None
    _held_off_since: float | None = None

    def initialise(self) -> None:
        super().initialise()
        self._held_off_since = None
        self._lookout = Lookout(self.robot)

    def trouble(self) -> str:
        base = self.robot.base
        state = base.state().value
        steering = base.steering()
        return (
            held_up(base) or ("" if state is None else obstacle(state, Way.AHEAD, steering)) or self._held_off(steering)
        )

    def _held_off(self, steering: Steering) -> str:
        """Say what the range guard sees in the way, once the base has stood for ``HELD_OFF`` seconds because of it."""
        if not is_guarded(steering) or steering.given != STILL:
            self._held_off_since = None
            return ""
        now = self.run.now()
        if self._held_off_since is None:
            self._held_off_since = now
        return steering.because if now - self._held_off_since > HELD_OFF else ""

    def forward(self, target: Percept, pan: float) -> float:
        too_far = target.distance - self.distance - SLACK
        # Without fresh reports neither an obstacle nor the way gone is known.
        reading = self.robot.base.state()
        if not too_far > 0.0 or abs(pan) >= AHEAD or reading.value is None or not reading.good:  # nor does it by a NaN
            return 0.0
        speed = min(EAGERNESS * too_far, self.speed, self._safe_speed(reading.value))
        return speed * math.cos(pan * math.pi / 2 / AHEAD)

    def _safe_speed(self, state: BaseState) -> float:
        """Return how fast it may drive straight ahead, as far as the range finder sees: not while it is silent."""
        if self._lookout is None or self.robot.ranger_part is None:
            return math.inf
        seen = self._lookout.around(state, self.run.now())
        if seen is None:
            return 0.0
        braking = BRAKING * self.robot.base.limits.acceleration
        return safe_speed(free_way(seen), braking=braking, reaction=REACTION)
