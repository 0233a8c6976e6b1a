"""How good a trial was, and how good it could have been."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isnan, radians, sqrt

from drivers.base.limits import BRAKING
from missions.plugins.testing.controllers.scenario import Body, Scenario, stands
from missions.plugins.testing.controllers.trial import BASE, HEAD, Trace

CENTRED = radians(2)
"""Within this error the face is centred."""

STAYING = 0.5
"""Seconds for which it must stay so, at least, before something unforeseen happens."""

_INSTANT = 0.0005


@dataclass(frozen=True, slots=True)
class Score:
    """What a trial comes to.

    ``centred`` is the time in seconds from which on the face was centred, None where it never was; ``bound`` the least
    that it can be for one who knows with the first picture what the face does, and ``known`` for one who must see it.
    ``overshoot`` is how far past the face it went at first, ``rms`` the error of following; radians.
    A face that was ``lost`` has no ``rms``. ``swings`` counts how often the robot went past the face by more than
    ``CENTRED``. ``delay_error`` is that of the camera's delay in the end, None where it was not known, and
    ``worst_known`` the largest one while it was known; seconds.
    """

    centred: float | None
    bound: float
    overshoot: float
    rms: float | None
    lost: bool
    known: float = 0.0
    swings: int = 0
    delay_error: float | None = None
    worst_known: float = 0.0

    @property
    def ratio(self) -> float | None:
        """How many times the bound it took to centre the face."""
        return self.centred / self.bound if self.centred is not None and self.bound > 0 else None

    @property
    def ratio_known(self) -> float | None:
        """How many times the least that it can take who sees what the face does."""
        return self.centred / self.known if self.centred is not None and self.known > 0 else None


@dataclass(frozen=True, slots=True)
class Ability:
    """How fast (rad/s) a body turns its camera, how hard (rad/s^2) it speeds up and brakes."""

    speed: float
    acceleration: float
    braking: float


ABILITIES = {
    Body.HEAD: Ability(HEAD.speed, HEAD.acceleration, HEAD.acceleration),
    Body.BASE: Ability(BASE.max_angular, BASE.angular_acceleration, BRAKING * BASE.angular_acceleration),
}


def ability(body: Body) -> Ability:
    """Return what a body can do; both together no more than the sum."""
    if body is not Body.BOTH:
        return ABILITIES[body]
    head, base = ABILITIES.values()
    return Ability(head.speed + base.speed, head.acceleration + base.acceleration, head.braking + base.braking)


def score(trace: Trace, scenario: Scenario, body: Body) -> Score:
    """Return how good a trial was."""
    samples = list(zip(trace.times, trace.errors, strict=True))
    foreseen = [(time, error) for time, error in samples if time < scenario.surprise]
    outside = max((time for time, error in foreseen if abs(error) > CENTRED), default=0.0)
    early = [error for time, error in foreseen if time < scenario.settled]
    late = [error**2 for time, error in samples if time >= scenario.settled]
    can, lag = ability(body), scenario.base_lag if body is Body.BASE else 0.0
    # One picture shows where a face is. How fast it goes, two show.
    least, told = bound(scenario, can, lag), 0 if scenario.path is stands else 1
    seen = trace.understood[told] if len(trace.understood) > told else scenario.latency
    return Score(
        centred=None if trace.lost or not foreseen or outside >= scenario.surprise - STAYING else outside,
        bound=least,
        overshoot=max(0.0, -min(early, default=0.0)),
        rms=None if trace.lost or not late else sqrt(sum(late) / len(late)),
        lost=trace.lost,
        known=max(least, bound(replace(scenario, latency=seen), can, lag)),
        swings=_swings([error for _, error in foreseen]),
        delay_error=next((error for error in trace.delay_errors[-1:] if not isnan(error)), None),
        worst_known=max((abs(error) for error in trace.delay_errors if not isnan(error)), default=0.0),
    )


def _swings(errors: Sequence[float]) -> int:
    """Count the changes of side among the errors beyond ``CENTRED``."""
    sides = [error > 0 for error in errors if abs(error) > CENTRED]
    return sum(before != after for before, after in pairwise(sides))


def bound(scenario: Scenario, can: Ability, lag: float = 0.0) -> float:
    """Return the earliest time in seconds from which on the error can stay within ``CENTRED``.

    That is of the time-optimal motion: nothing for the time of the latency and of a base's ``lag``, then as hard as it
    can until it must brake to come to go with the face at the far edge of what counts as centred. 0 where nothing that
    the face does can be foreseen.
    """
    if scenario.surprise <= 0.0:
        return 0.0
    time = outside = scenario.latency + lag
    angle = speed = 0.0
    while time < scenario.surprise:
        target = scenario.path(time)
        rate = (scenario.path(time + _INSTANT) - target) / _INSTANT
        error, closing = target - angle, speed - rate
        if abs(error) > CENTRED:
            outside = time
        elif closing >= 0.0:
            return outside
        if error + CENTRED > closing * abs(closing) / (2 * can.braking):
            speed = min(speed + can.acceleration * _INSTANT, can.speed)
        else:
            speed = max(speed - can.braking * _INSTANT, rate)
        angle += speed * _INSTANT
        time += _INSTANT
    return outside
