"""The follower on a small model of robot and person: how soon, how steadily, and that it never swings."""

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from math import degrees, radians
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.tracking.follow import LONGEST_STEP, PAUSE, Follower, RuleBases
from behaviours.tracking.fuzzy import Controller
from config.controller import load_controller
from config.library import shipped
from drivers.api import HeadLimits, HeadPose
from drivers.clock import ManualClock
from drivers.history import History
from drivers.sim.servo import Shaft
from perception.api import Box, Face

LIMITS = HeadLimits(pan=(radians(-80), radians(80)), tilt=(radians(-60), radians(20)), speed=radians(120))
MAX_TURN = radians(110)
CENTRE = HeadPose(0.0, 0.0)

Path2D = Callable[[float], tuple[float, float]]
"""Where a person is, (yaw, pitch) in degrees, at a time."""


@pytest.fixture(scope="module")
def values() -> Mapping[str, Any]:
    """The shipped rules as plain values."""
    return load_controller(shipped("controllers")["face"]).values


@pytest.fixture(scope="module")
def rules(values: Mapping[str, Any]) -> RuleBases:
    return RuleBases.from_mapping(values)


@pytest.fixture
def follower(rules: RuleBases) -> Follower:
    return Follower(rules, limits=LIMITS, max_turn=MAX_TURN)


def face_at(  # all in degrees
    stamp: float, yaw: float, pitch: float = 0.0, *, yaw_rate: float = 0.0, pitch_rate: float = 0.0
) -> Face:
    return Face(
        id=1,
        stamp=stamp,
        box=Box(0, 0, 50, 50),
        bearing=0.0,
        drop=0.0,
        yaw=radians(yaw),
        pitch=radians(pitch),
        yaw_rate=radians(yaw_rate),
        pitch_rate=radians(pitch_rate),
        distance=1.0,
    )


@pytest.mark.parametrize("name", ["pan", "tilt"])
def test_the_shipped_rules_know_no_side_and_ask_for_more_the_farther_off(values: Mapping[str, Any], name: str) -> None:
    surface = Controller.from_mapping(name, values[name])
    for rate in map(radians, range(-120, 121, 15)):
        asked = [surface(radians(error), rate) for error in range(-20, 21)]
        assert asked == sorted(asked)
        assert asked == pytest.approx([-surface(radians(-error), -rate) for error in range(-20, 21)])


# --- single steps ----------------------------------------------------------------------------------------------------


def look(follower: Follower, now: float, face: Face, *, heading: float = 0.0, turning: float = 0.0) -> HeadPose:
    return follower.step(now, face, head=CENTRE, heading=radians(heading), turning=radians(turning)).head


def test_a_first_step_starts_from_where_the_head_looks(follower: Follower) -> None:
    there = HeadPose(radians(30), radians(-10))
    command = follower.step(5.0, face_at(5.0, 30, -10), head=there, heading=0.0, turning=0.0)
    assert command.head == there


def test_a_step_that_takes_no_time_moves_nothing(follower: Follower) -> None:
    first = look(follower, 1.0, face_at(1.0, 60))
    assert look(follower, 1.0, face_at(1.0, -60)) == first
    assert look(follower, 0.9, face_at(1.0, -60)) == first


def test_a_late_step_counts_for_no_more_than_the_longest(follower: Follower) -> None:
    first = look(follower, 1.0, face_at(1.0, 70))
    late = look(follower, 1.0 + 0.9 * PAUSE, face_at(1.0, 70))
    assert late.pan - first.pan == pytest.approx(LIMITS.speed * LONGEST_STEP)


def test_after_a_pause_it_starts_from_where_the_head_looks_now(follower: Follower) -> None:
    look(follower, 1.0, face_at(1.0, 70))
    moved = HeadPose(radians(-40), 0.0)
    command = follower.step(1.1 + PAUSE, face_at(1.0, -40), head=moved, heading=0.0, turning=0.0)
    assert command.head.pan == pytest.approx(moved.pan)


def test_the_head_goes_no_faster_than_it_can_and_no_farther_than_its_limits(follower: Follower) -> None:
    poses = [look(follower, n * 0.05, face_at(n * 0.05, 170, 90)) for n in range(40)]
    assert all(abs(b.pan - a.pan) <= LIMITS.speed * 0.05 + 1e-9 for a, b in pairwise(poses))
    assert poses[-1] == HeadPose(LIMITS.pan[1], LIMITS.tilt[1])


def test_a_face_above_lifts_the_head(follower: Follower) -> None:
    assert look(follower, 0.0, face_at(0.0, 0, -20)).tilt < 0


def test_a_face_behind_is_followed_the_shorter_way_round(follower: Follower) -> None:
    assert look(follower, 0.0, face_at(0.0, 190)).pan < 0
    assert look(follower, 0.0, face_at(0.0, 190), heading=360).pan < 0


def test_it_aims_where_the_face_will_be_when_the_command_acts(rules: RuleBases) -> None:
    late = Follower(rules, limits=LIMITS, max_turn=MAX_TURN, latency=0.2)
    # Half a second since the frame and 0.2 s to go: 14 degrees on; and the base will have turned by 4.
    face = face_at(0.0, 0, yaw_rate=20)
    poses = [look(late, 0.5 + n * 0.05, face, heading=n, turning=20) for n in range(40)]
    assert degrees(poses[-1].pan) == pytest.approx(14 - 4, abs=0.01)


def test_the_base_stands_while_the_head_is_near_the_middle_and_turns_faster_towards_its_limit(
    follower: Follower,
) -> None:
    turns: list[float] = []
    for pan in (-80, -60, -40, -15, 0, 15, 40, 60, 80):
        head = HeadPose(radians(pan), 0.0)
        now = 10.0 + len(turns) * 2 * PAUSE
        turns.append(follower.step(now, face_at(now, pan), head=head, heading=0.0, turning=0.0).turn)
    assert turns == sorted(turns)
    assert turns[3:6] == [0.0, 0.0, 0.0]
    assert turns[0] == pytest.approx(-MAX_TURN)
    assert turns[-1] == pytest.approx(MAX_TURN)
    assert turns[2] == pytest.approx(-turns[6])


def test_the_base_turns_no_faster_than_it_may(rules: RuleBases) -> None:
    still = Follower(rules, limits=LIMITS, max_turn=0.0)
    slow = Follower(rules, limits=LIMITS, max_turn=0.3)
    head = HeadPose(radians(80), 0.0)
    assert still.step(0.0, face_at(0.0, 120), head=head, heading=0.0, turning=0.0).turn == 0.0
    assert slow.step(0.0, face_at(0.0, 120), head=head, heading=0.0, turning=0.0).turn == 0.3


def test_a_face_that_is_nowhere_is_refused_and_forgotten(follower: Follower) -> None:
    look(follower, 0.0, face_at(0.0, 20))
    with pytest.raises(ValueError, match="not finite: face at nan"):
        look(follower, 0.05, face_at(0.05, math.nan))
    with pytest.raises(ValueError, match="turning inf"):
        look(follower, 0.05, face_at(0.05, 0), turning=math.inf)
    assert math.isfinite(look(follower, 0.1, face_at(0.1, 20)).pan)


def test_rule_bases_that_are_missing_or_for_something_else_are_refused(values: Mapping[str, Any]) -> None:
    with pytest.raises(ValueError, match="tilt: its inputs must be error, rate, not pan"):
        RuleBases.from_mapping({**values, "tilt": values["base"]})
    with pytest.raises(ValueError, match="pan: needs 'inputs'"):
        RuleBases.from_mapping({})
    with pytest.raises(ValueError, match="base: needs 'inputs'"):
        RuleBases.from_mapping({**values, "base": "none"})
    with pytest.raises(ValueError, match="'roll' is none of the rule bases pan, tilt and base"):
        RuleBases.from_mapping({**values, "roll": values["base"]})


@given(
    where=st.floats(-70, 70),
    rate=st.floats(-30, 30),
    start=st.floats(-80, 80),
    ticks=st.lists(st.floats(0.0, 0.1), max_size=20),
)
def test_it_never_steps_past_a_face_whatever_the_ticks(
    rules: RuleBases, where: float, rate: float, start: float, ticks: list[float]
) -> None:
    follower = Follower(rules, limits=LIMITS, max_turn=0.0)
    face, now = face_at(0.0, where, yaw_rate=rate), 0.0
    head = HeadPose(radians(start), 0.0)
    left = start < where
    for tick in [0.0, *ticks]:
        now += tick
        pan = follower.step(now, face, head=head, heading=0.0, turning=0.0).head.pan
        # A step leads no farther than to where the face will be at its end, or the head's limit before.
        ahead = [min(max(face.predict(now + span)[0], LIMITS.pan[0]), LIMITS.pan[1]) for span in (0.0, LONGEST_STEP)]
        assert pan <= max(ahead) + 1e-9 if left else pan >= min(ahead) - 1e-9


# --- the whole loop ---------------------------------------------------------------------------------------------------


class AlphaBeta:
    """One angle and its rate, filtered over frames."""

    def __init__(self, alpha: float = 0.7, beta: float = 0.25) -> None:
        self._alpha, self._beta = alpha, beta
        self.angle = self.rate = 0.0
        self._stamp: float | None = None

    def add(self, stamp: float, measured: float) -> None:
        if self._stamp is None:
            self.angle = measured
        elif stamp > self._stamp:
            span = stamp - self._stamp
            expected = self.angle + self.rate * span
            self.angle = expected + self._alpha * (measured - expected)
            self.rate += self._beta / span * (measured - expected)
        self._stamp = stamp


@dataclass
class Log:
    """What a run showed at every moment, in degrees."""

    time: list[float] = field(default_factory=list)
    error: list[float] = field(default_factory=list)
    pan: list[float] = field(default_factory=list)
    turning: list[float] = field(default_factory=list)
    unseen: int = 0

    def after(self, start: float) -> list[float]:
        return [error for time, error in zip(self.time, self.error, strict=True) if time >= start]

    def rms(self, start: float) -> float:
        errors = self.after(start)
        return math.sqrt(sum(error**2 for error in errors) / len(errors))

    def settled(self, within: float, start: float = 0.0) -> float:
        outside = [time for time, e in zip(self.time, self.error, strict=True) if abs(e) > within and time >= start]
        return outside[-1] - start if outside else 0.0


class Robot:
    """A head whose servo takes whole degrees, a base with inertia, a camera whose pictures come late."""

    STEP, FRAME, DELAY = 0.005, 0.05, 0.1
    TURN_ACCELERATION = 3.5
    HALF_VIEW = 30.0

    def __init__(
        self, follower: Follower, person: Path2D, *, noise: float = 0.0, beta: float = 0.25, tick: float = 0.05
    ) -> None:
        self._follower = follower
        self._person = person
        self._clock = ManualClock()
        self._pan = Shaft(0.0, 0.0, 120.0)
        self._tilt = Shaft(0.0, 0.0, 120.0)
        self._heading = self._turning = self._asked = 0.0
        self._poses = History()
        self._yaw, self._pitch = AlphaBeta(beta=beta), AlphaBeta(beta=beta)
        self._frames: list[tuple[float, float, float]] = []
        self._stamp: float | None = None
        self._noise = noise
        self._period = round(tick / self.STEP)
        self._dice = random.Random(1)  # noqa: S311 - the same noise in every run is what is wanted
        self.log = Log()

    def run(self, seconds: float) -> Log:
        for n in range(round(seconds / self.STEP)):
            if n % round(self.FRAME / self.STEP) == 0:
                self._expose()
            # The tick falls between two frames, as it would: nothing keeps them in step.
            if n % self._period == 3:
                self._tick()
            self._move()
        return self.log

    def _expose(self) -> None:
        now = self._clock.now()
        yaw, pitch = self._person(now)
        bearing = yaw - self._heading - self._pan.position
        if abs(bearing) > self.HALF_VIEW:
            self.log.unseen += 1
            return
        drop = pitch - self._tilt.position + self._dice.gauss(0, self._noise)
        self._frames.append((now, bearing + self._dice.gauss(0, self._noise), drop))

    def _tick(self) -> None:
        now = self._clock.now()
        while self._frames and self._frames[0][0] <= now - self.DELAY:
            self._stamp, bearing, drop = self._frames.pop(0)
            gaze = self._poses.at(self._stamp) or (0.0, 0.0)
            self._yaw.add(self._stamp, gaze[0] + bearing)
            self._pitch.add(self._stamp, gaze[1] + drop)
        if self._stamp is None:
            return
        rates = {"yaw_rate": self._yaw.rate, "pitch_rate": self._pitch.rate}
        face = face_at(self._stamp, self._yaw.angle, self._pitch.angle, **rates)
        head = HeadPose(radians(self._pan.goal), radians(self._tilt.goal))
        heading, turning = radians(self._heading), self._turning
        command = self._follower.step(now, face, head=head, heading=heading, turning=turning)
        self._pan.goal = round(degrees(command.head.pan))
        self._tilt.goal = round(degrees(command.head.tilt))
        self._asked = command.turn

    def _move(self) -> None:
        change = self.TURN_ACCELERATION * self.STEP
        self._turning += min(max(self._asked - self._turning, -change), change)
        self._heading += degrees(self._turning) * self.STEP
        now = self._clock.advance(self.STEP)
        self._pan.advance(now)
        self._tilt.advance(now)
        self._poses.add(now, (self._heading + self._pan.position, self._tilt.position))
        self.log.time.append(now)
        self.log.error.append(self._person(now)[0] - self._heading - self._pan.position)
        self.log.pan.append(self._pan.position)
        self.log.turning.append(degrees(self._turning))


def stands(yaw: float, pitch: float = 0.0) -> Path2D:
    return lambda _: (yaw, pitch)


def walks(rate: float, turns_at: float) -> Path2D:
    """To and fro at ``rate``, from the middle to ``turns_at`` on both sides."""

    def place(time: float) -> tuple[float, float]:
        along = (time * rate + turns_at) % (4 * turns_at)
        return (along - turns_at if along <= 2 * turns_at else 3 * turns_at - along), -5.0

    return place


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("tick", [0.02, 0.05, 0.1])
def test_a_face_25_degrees_off_is_centred_about_as_fast_as_the_head_can_turn(
    follower: Follower, noise: float, tick: float
) -> None:
    log = Robot(follower, stands(25, -10), noise=noise, tick=tick).run(4)
    # The picture's 100 ms, at most a tick, and 23 degrees at 120 degrees/s: 0.29 s and the tick.
    assert log.settled(within=2.0) < 0.36
    overshoot = max(-error for error in log.error)
    assert overshoot <= (1.0 if tick < 0.1 else 1.5)
    assert log.rms(1.0) < 1.0


def test_someone_walking_to_and_fro_stays_in_the_middle(follower: Follower) -> None:
    log = Robot(follower, walks(20, turns_at=60), noise=0.3).run(60)
    assert log.unseen == 0
    assert log.rms(2.0) < 1.6
    # What can't be foreseen is a turn-around: 40 degrees/s for the 100 ms of the picture and some frames of the filter.
    assert max(map(abs, log.after(2.0))) < 9


@pytest.mark.parametrize(("rate", "turns_at"), [(20, 150), (40, 100), (60, 170), (20, 10_000)])
def test_the_base_follows_beyond_the_limits_of_the_head_and_the_face_stays_in_view(
    follower: Follower, rate: float, turns_at: float
) -> None:
    log = Robot(follower, walks(rate, turns_at), noise=0.3).run(60)
    assert log.unseen == 0
    assert max(map(abs, log.pan)) < 65
    assert max(map(abs, log.turning)) == pytest.approx(rate, abs=3)


def test_a_steady_walk_leaves_no_lag(follower: Follower) -> None:
    log = Robot(follower, walks(20, turns_at=10_000)).run(30)
    errors = log.after(10.0)
    assert abs(sum(errors) / len(errors)) < 0.5
    assert log.rms(10.0) < 0.8


def test_without_the_rate_of_the_face_a_walk_does_lag(follower: Follower) -> None:
    log = Robot(follower, walks(20, turns_at=10_000), beta=0.0).run(30)
    assert log.rms(10.0) > 2.0


def test_the_base_comes_to_rest_with_the_head_near_the_middle(follower: Follower) -> None:
    log = Robot(follower, lambda time: (min(time * 20, 100.0), 0.0)).run(30)
    assert abs(log.turning[-1]) < 0.1
    assert abs(log.pan[-1]) <= 21
    assert abs(log.error[-1]) < 1
    # It never turned back: nothing for the base to hunt about.
    assert min(log.turning) >= 0
