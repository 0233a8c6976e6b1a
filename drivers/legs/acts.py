"""What legs do beside walking: they come to a stand or a sit, and play gaits, each from and to a stand that holds.

A gait grows out of the stand over one of its cycles, and shrinks back into it over another: at any time it can be ended
without a fall that the gait itself would not bring.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import atan2, degrees, radians
from typing import Literal

import numpy as np
import numpy.typing as npt

from drivers.api import COMMAND_LIFE, JointLimits, JointState, Pose2D, Reading
from drivers.api.base import PERFORMED
from drivers.api.base import Posture as Poised
from drivers.api.gait import GaitKeys
from drivers.errors import BadRequest, DeviceFault
from drivers.legs.body import SIDES, Body, Floats
from drivers.legs.checking import mistakes
from drivers.legs.declared import StrideKeys
from drivers.legs.engine import Engine, Posture, legs, manner_of, stands, whole
from drivers.legs.gait import Gait, of_keys
from drivers.legs.kinematics import FootOdometry, centre_of_mass, forward, sole, turning
from drivers.legs.walker import Pattern, Spot

# The way of legs from where they are found to a stand or a sit: slow, smooth, and over the soles where it can be.

NEAR = radians(6)
"""How far a joint may be from where a walk begins, to begin at once."""

FAR = radians(62)
"""How far it may be to be brought there straight."""

CLOSE = radians(20)
"""How far it may be from a pose between upright and a sit, all of which have the body over the soles."""

GENTLE = radians(35)
"""rad/s that joints take on the way there at most."""

SHORTEST = 0.5
"""Seconds that it takes at least."""

LEVELS = 0.003
"""Metres from one pose between upright and a sit to the next."""

SITS = 0.7
"""The share of the height of a stand at which it sits, where the robot file says nothing of that."""


@dataclass(frozen=True, slots=True)
class Approach:
    """Through poses ``rows`` (K, 12) that are reached at shares ``at`` (K,) of it, between two times in seconds."""

    rows: Floats
    at_shares: Floats
    since: float
    until: float

    @classmethod
    def begun(cls, rows: Floats, now: float) -> "Approach":
        """Return the way through these poses from time ``now`` on."""
        far = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(rows, axis=0)).max(axis=1))))
        shares = far / far[-1] if far[-1] > 0 else np.linspace(0.0, 1.0, len(rows))
        return cls(rows, shares, now, now + max(SHORTEST, 1.5 * float(far[-1]) / GENTLE))

    def share(self, now: float) -> float:
        """Return how much of its time is over, 0..1."""
        return min(1.0, (now - self.since) / (self.until - self.since))

    def at(self, now: float) -> Floats:
        """Return where the joints are to be (12,)."""
        share = self.share(now)
        share *= share * (3 - 2 * share)
        return np.array([np.interp(share, self.at_shares, column) for column in self.rows.T])


class Levels:
    """Poses of the legs between upright and a sit, the centre of mass over the middle of both soles in each of them.

    ``stand`` and ``sit`` are their places among ``rows`` (K, 12). Raises BadRequest for a sit that is out of reach.
    """

    def __init__(self, body: Body, stride: StrideKeys, limits: Mapping[str, JointLimits]) -> None:
        feet = manner_of(body, stride).feet
        lowest = SITS * stride.height if stride.sit is None else stride.sit
        above = stride.height + LEVELS * np.arange(60.0, 0.0, -1.0)
        below = np.arange(stride.height - LEVELS, lowest, -LEVELS)
        rows, reason = stands(body, stride, feet, np.concatenate((above, [stride.height], below, [lowest])))
        reached: npt.NDArray[np.bool_] = np.logical_not(reason.any(axis=1))
        for column, name in enumerate(body.walking):
            reached &= (rows[:, column] >= limits[name].lower) & (rows[:, column] <= limits[name].upper)
        if stride.sit is not None and not reached[-1]:
            told = f"base: its legs cannot bend so far that the trunk is {stride.sit:g} m above the soles"
            raise BadRequest(told, hint="give stride.sit more")
        first = last = len(above)
        while first > 0 and reached[first - 1]:
            first -= 1
        while last + 1 < len(rows) and reached[last + 1]:
            last += 1
        self.rows, self.stand, self.sit = rows[first : last + 1], len(above) - first, last - first

    def way(self, here: Floats, to: int) -> Floats | None:
        """Return the poses (K, 12) from where the legs are to one of these; None for legs that are far from all."""
        off = np.abs(self.rows - here).max(axis=1)
        near = int(off.argmin())
        if off[near] > CLOSE:
            if off[self.stand] > FAR:
                return None
            near = self.stand
        between = self.rows[near : to + 1] if near <= to else self.rows[to : near + 1][::-1]
        return np.concatenate((here[None], between))


def away_from(ready: Floats, names: Iterable[str], states: Mapping[str, Reading[JointState]]) -> dict[str, float]:
    """Return how far joints that were heard of are from where a walk begins, rad; ``ready`` is that, as ``names``."""
    goals = zip(names, ready.tolist(), strict=True)
    return {name: value.position - goal for name, goal in goals if (value := states[name].value) is not None}


def is_near(ready: Floats, names: Iterable[str], states: Mapping[str, Reading[JointState]]) -> bool:
    """Say whether joints are ``NEAR`` enough to where a walk begins."""
    return all(abs(off) <= NEAR for off in away_from(ready, names, states).values())


STAND, SIT, GAIT = PERFORMED

_, Y, _ = np.eye(3)


class Cycle:
    """A gait while it is played, from a stand: ``grown`` is how much of it there is, 0..1."""

    def __init__(self, body: Body, lean: float, ready: Floats, gait: Gait) -> None:
        self._body, self._lean, self._gait = body, lean, gait
        placed = forward(body, whole(body, ready))
        upright = turning(Y, np.array(lean))
        self._stand = np.array([upright @ sole(body, placed, side)[0] for side in SIDES])
        off = np.abs(gait.feet[..., 1].mean(axis=1)) + 10.0 * ~gait.on.all(axis=1)
        self._at = float(off.argmin()) / len(off)  # on both feet, if it ever is, and between them
        self.cycles = self.grown = 0.0
        self.ending = False

    @property
    def over(self) -> bool:
        """Whether it has shrunk into the stand again."""
        return self.ending and self.grown == 0.0

    def step(self, dt: float) -> tuple[Floats, tuple[bool, bool]]:
        """Go on by ``dt`` seconds; return the angles of the legs (12,), and which soles are on the floor."""
        share = dt / self._gait.period
        self.cycles += share
        self.grown = min(max(self.grown + (-share if self.ending else share), 0.0), 1.0)
        count = len(self._gait.feet)
        place = (self._at + self.cycles) % 1.0 * count
        low, part = int(place) % count, place - int(place)
        feet, headings = (
            (1 - part) * rows[low] + part * rows[(low + 1) % count] for rows in (self._gait.feet, self._gait.headings)
        )
        grown = self.grown * self.grown * (3 - 2 * self.grown)
        turned = turning(Y, np.array((1 - grown) * self._lean))
        soles = self._stand + grown * (feet - self._stand)
        angles, reason = legs(self._body, np.zeros(3), turned, soles, grown * headings)
        if reason.any():  # between two poses that it reaches: no gait that was checked has that
            raise DeviceFault(f"{self._gait.name}: a foot is out of reach", hint="mission gait check")
        on = self._gait.on[low]
        return angles, (bool(on[0]), bool(on[1]))


@dataclass(frozen=True, slots=True)
class Asked:
    """What somebody wants the legs to do, until a time."""

    act: str
    gait: GaitKeys | None
    until: float


class Acts:
    """Does what is asked of the legs that ``engine`` does not do, while that stands. Angles are in radians."""

    def __init__(self, engine: Engine, limits: Mapping[str, JointLimits], torques: Mapping[str, float]) -> None:
        self._engine, self._limits, self._torques = engine, limits, torques
        self._levels: Levels | None = None
        self._asked: Asked | None = None
        self._way: Approach | None = None
        self._to = -1
        self._cycle: Cycle | None = None
        self._odometry: FootOdometry | None = None
        self._done = 0.0
        self._trouble = ""
        self.posture = Poised.UNKNOWN
        self.speed = (0.0, 0.0)

    @property
    def busy(self) -> bool:
        """Whether it leads the legs right now."""
        return self._way is not None or self._cycle is not None

    def ask(self, act: str, gait: GaitKeys | None, now: float) -> float:
        """Want an act until ``now`` and a while; return how far it has come. Raises BadRequest for one that it lacks.

        That is a share, 1 in the end; of a gait, how many cycles.
        """
        if act not in PERFORMED or (act == GAIT) != (gait is not None):
            raise BadRequest(f"base: it does not know how to '{act}'", hint=f"one of {', '.join(PERFORMED)}")
        last = self._asked
        if last is None or last.act != act or last.gait != gait or last.until < now:
            self._done, self._trouble = 0.0, ""
        self._asked = Asked(act, gait, now + COMMAND_LIFE)
        if self._trouble:
            raise BadRequest(self._trouble, hint="look at the robot, and at `mission gait check`")
        return self._done

    def end(self) -> None:
        """Want nothing more: a gait shrinks into a stand, and what leads to a stand or a sit stays where it is."""
        self._asked = None

    def forget(self) -> None:
        """Lead the legs no more: they are not where they should be."""
        self._way = self._cycle = None
        self.posture, self.speed = Poised.UNKNOWN, (0.0, 0.0)

    def far(self, here: Floats) -> str:
        """Say why legs cannot be brought to a stand from where they are (12,), or nothing."""
        levels = self._rows()
        if levels.way(here, levels.stand) is not None:
            return ""
        off = np.abs(here - self._engine.ready)
        name = self._engine.body.walking[int(off.argmax())]
        return f"{name} is {degrees(off.max()):.0f} deg from where a walk begins"

    def step(self, here: Floats, now: float, dt: float, *, walk: bool) -> Posture | None:
        """Go on by ``dt`` seconds, from legs that are ``here``; return where they are to be, None to leave them be.

        Who wants to ``walk`` needs a stand first, whatever else is asked.
        """
        asked = self._asked if self._asked is not None and self._asked.until >= now else None
        act = STAND if walk else "" if asked is None else asked.act
        self.speed = (0.0, 0.0)
        if self._cycle is not None:
            return self._play(self._cycle, act, dt)
        if self._way is not None:
            return self._go(self._way, act, now)
        if not act or self._trouble:
            return None
        try:
            way = self._begin(here, act, asked, now)
        except BadRequest as error:
            self._trouble = str(error)
            return None
        return None if way is None else self._go(way, act, now)  # at once: limp legs are stiff from now on

    def _rows(self) -> Levels:
        if self._levels is None:
            self._levels = Levels(self._engine.body, self._engine.stride, self._limits)
        return self._levels

    def _begin(self, here: Floats, act: str, asked: Asked | None, now: float) -> Approach | None:
        """Begin what is wanted; return the way of the legs to a stand or a sit where they have one before them."""
        levels = self._rows()
        to = levels.sit if act == SIT else levels.stand
        there = self.posture is (Poised.SITTING if act == SIT else Poised.STANDING) or act == GAIT
        if there and np.abs(here - levels.rows[to]).max() <= NEAR:
            if act == GAIT and asked is not None and asked.gait is not None:
                self._cycle = self._checked(asked.gait)
                self._odometry = FootOdometry(self._engine.body, Pose2D(0.0, 0.0, 0.0))
                self.posture = Poised.MOVING
            else:
                self._done = 1.0
            return None
        way = levels.way(here, to)
        if way is None:
            self._trouble = f"base: {self.far(here)}"
            return None
        self._way, self._to, self.posture = Approach.begun(way, now), to, Poised.MOVING
        return self._way

    def _checked(self, keys: GaitKeys) -> Cycle:
        """Return a gait to be played. Raises BadRequest for one that the legs cannot do."""
        engine = self._engine
        gait = of_keys(keys, engine.body, engine.stride)
        for wrong in mistakes(engine.body, gait, self._limits, self._torques):
            raise BadRequest(f"{gait.name}: {wrong}", hint="mission gait check tells more")
        return Cycle(engine.body, engine.stride.lean, engine.ready, gait)

    def _go(self, way: Approach, act: str, now: float) -> Posture:
        levels = self._rows()
        wanted = levels.sit if act == SIT else levels.stand
        over = way.share(now) == 1.0
        if over or not act or wanted != self._to:
            self._way = None
            if over:
                self.posture = Poised.SITTING if self._to == levels.sit else Poised.STANDING
                self._done = 1.0 if act in (STAND, SIT) and wanted == self._to else 0.0
            else:
                self.posture = Poised.UNKNOWN
        return pressed(self._engine.body, way.at(now), (True, True))

    def _play(self, cycle: Cycle, act: str, dt: float) -> Posture:
        cycle.ending = cycle.ending or act != GAIT
        angles, on = cycle.step(dt)
        self._done = cycle.cycles if act == GAIT and not cycle.ending else 0.0
        if cycle.over:
            self._cycle, self.posture = None, Poised.STANDING
        posture = pressed(self._engine.body, angles, on)
        if self._odometry is not None:
            before = self._odometry.pose
            pose = self._odometry.update(whole(self._engine.body, angles))
            gone = Spot(before.x, before.y, before.heading).seen(Spot(pose.x, pose.y, pose.heading))
            self._engine.carry(gone)
            self.speed = (gone.x / dt, gone.heading / dt) if dt > 0 else (0.0, 0.0)
        return posture


def pressed(body: Body, angles: Floats, on: tuple[bool, bool]) -> Posture:
    """Return the legs at angles (12,), as what sets goals ahead knows them: pressed upon under the mass."""
    placed = forward(body, whole(body, angles))
    feet = {}
    for side in SIDES:
        place, turned = sole(body, placed, side)
        feet[side] = float(place[0]), float(place[1]), 0.0, atan2(turned[1, 0], turned[0, 0])
    x, y, _ = centre_of_mass(body, placed).tolist()
    support: Literal["left", "right", "both"] = "both" if on[0] == on[1] else "left" if on[0] else "right"
    if support != "both":  # no farther out than the sole reaches
        foot, leg = feet["left" if on[0] else "right"], body.legs["left"]
        x = min(max(x, foot[0] - leg.length / 2), foot[0] + leg.length / 2)
        y = min(max(y, foot[1] - leg.width / 2), foot[1] + leg.width / 2)
    spot = Spot(0.0, 0.0, 0.0)
    pattern = Pattern(0.0, support, feet, (x, y), 0.0, (x, y), 0.0, spot, (0.0, 0.0, 0.0))
    return Posture(angles, pattern)
