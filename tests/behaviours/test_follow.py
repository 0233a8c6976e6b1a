"""The follower, step by step: where it aims, how far it goes, and what it refuses."""

import math
from collections.abc import Mapping
from itertools import pairwise
from math import degrees, radians
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.tracking.follow import HEAD_LAG, MAX_STEP_TIME, RESTART_TIMEOUT, FollowCommand, Follower
from behaviours.tracking.fuzzy import Controller, RuleBases
from behaviours.tracking.lag_estimator import LagEstimator, TurnState
from config.controller import load_controller
from config.library import shipped_files
from drivers.api import HeadLimits, HeadPose
from perception.api import Box, Face, Thing

LIMITS = HeadLimits(pan=(radians(-80), radians(80)), tilt=(radians(-60), radians(20)), speed=radians(120))
MAX_TURN = radians(110)
CENTRE = HeadPose(0.0, 0.0)

STILL = TurnState(0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def values() -> Mapping[str, Any]:
    """The shipped rules as plain values."""
    return load_controller(shipped_files("controllers")["face"]).values


@pytest.fixture(scope="module")
def rules(values: Mapping[str, Any]) -> RuleBases:
    return RuleBases.from_mapping(values)


@pytest.fixture
def follower(rules: RuleBases) -> Follower:
    return Follower(rules, limits=LIMITS, max_turn=MAX_TURN)


def face_at(  # all in degrees
    stamp: float,
    yaw: float,
    pitch: float = 0.0,
    *,
    yaw_rate: float = 0.0,
    pitch_rate: float = 0.0,
    bearing: float = 0.0,
    edge: float = 290.0,
) -> Face:
    return Face(
        id=1,
        stamp=stamp,
        box=Box(edge, 200, 60, 60),
        bearing=radians(bearing),
        elevation=0.0,
        yaw=radians(yaw),
        pitch=radians(pitch),
        yaw_rate=radians(yaw_rate),
        pitch_rate=radians(pitch_rate),
        distance=1.0,
    )


@pytest.mark.parametrize("name", ["pan", "tilt", "turn"])
def test_shipped_rules_are_symmetric_and_monotonic(values: Mapping[str, Any], name: str) -> None:
    surface = Controller.from_mapping(name, values[name])
    for rate in map(radians, range(-120, 121, 15)):
        asked = [surface(radians(error), rate) for error in range(-20, 21)]
        assert all(b >= a - 1e-9 for a, b in pairwise(asked))
        assert asked == pytest.approx([-surface(radians(-error), -rate) for error in range(-20, 21)])


# --- single steps ----------------------------------------------------------------------------------------------------


def step(follower: Follower, now: float, face: Face, *, heading: float = 0.0, turning: float = 0.0) -> FollowCommand:
    """Step with a base that stands and turns so now, in degrees."""
    return follower.step(now, face, head=CENTRE, base=TurnState(radians(heading), radians(turning), now))


def look(follower: Follower, now: float, face: Face, *, heading: float = 0.0, turning: float = 0.0) -> HeadPose:
    return step(follower, now, face, heading=heading, turning=turning).head


def test_a_first_step_starts_from_where_the_head_looks(follower: Follower) -> None:
    there = HeadPose(radians(30), radians(-10))
    command = follower.step(5.0, face_at(5.0, 30, -10), head=there, base=STILL)
    assert command.head == there


def test_follower_step_without_elapsed_time_moves_nothing(follower: Follower) -> None:
    first = look(follower, 1.0, face_at(1.0, 60))
    assert look(follower, 1.0, face_at(1.0, -60)) == first
    assert look(follower, 0.9, face_at(1.0, -60)) == first


def test_a_late_step_counts_for_no_more_than_the_longest(follower: Follower) -> None:
    first = look(follower, 1.0, face_at(1.0, 70))
    late = look(follower, 1.0 + 0.9 * RESTART_TIMEOUT, face_at(1.0, 70))
    assert late.pan - first.pan == pytest.approx(LIMITS.speed * MAX_STEP_TIME)


def test_follower_restarts_from_the_current_head_pose_after_a_pause(follower: Follower) -> None:
    look(follower, 1.0, face_at(1.0, 70))
    moved = HeadPose(radians(-40), 0.0)
    command = follower.step(1.1 + RESTART_TIMEOUT, face_at(1.0, -40), head=moved, base=STILL)
    assert command.head.pan == pytest.approx(moved.pan)


def test_head_stays_within_its_speed_and_limits(follower: Follower) -> None:
    poses = [look(follower, n * 0.05, face_at(n * 0.05, 170, 90)) for n in range(40)]
    assert all(abs(b.pan - a.pan) <= LIMITS.speed * 0.05 + 1e-9 for a, b in pairwise(poses))
    assert poses[-1] == HeadPose(LIMITS.pan[1], LIMITS.tilt[1])


def test_a_face_above_lifts_the_head(follower: Follower) -> None:
    assert look(follower, 0.0, face_at(0.0, 0, -20)).tilt < 0


def test_a_face_behind_is_followed_the_shorter_way_round(follower: Follower) -> None:
    assert look(follower, 0.0, face_at(0.0, 190)).pan < 0
    assert look(follower, 0.0, face_at(0.0, 190), heading=360).pan < 0


def test_head_goal_is_the_predicted_face_half_a_step_ahead(follower: Follower) -> None:
    # Half a second since the frame and half a step to go; a head that trails what moves is sent ahead by that.
    face = face_at(0.0, 0, yaw_rate=20)
    poses = [look(follower, 0.5 + n * 0.05, face) for n in range(30)]
    ahead = degrees(radians(20) ** 2 / (2 * LIMITS.acceleration))
    now = 0.5 + 29 * 0.05
    assert degrees(poses[-1].pan) == pytest.approx(20 * (now + HEAD_LAG + 0.025) + ahead, abs=0.01)


def test_head_goal_is_corrected_for_the_turn_of_the_base(follower: Follower) -> None:
    poses = [look(follower, n * 0.05, face_at(n * 0.05, 40), heading=n, turning=20) for n in range(30)]
    trail = degrees(radians(20) ** 2 / (2 * LIMITS.acceleration))
    assert degrees(poses[-1].pan) == pytest.approx(40 - 29 - 20 * (HEAD_LAG + 0.025) - trail, abs=0.01)


def test_base_turn_grows_with_head_pan_outside_the_middle(
    follower: Follower,
) -> None:
    turns: list[float] = []
    for pan in (-80, -60, -40, -25, 0, 25, 40, 60, 80):
        head = HeadPose(radians(pan), 0.0)
        now = 10.0 + len(turns) * 2 * RESTART_TIMEOUT
        turns.append(follower.step(now, face_at(now, pan), head=head, base=STILL).turn)
    assert turns == sorted(turns)
    assert turns[3:6] == [0.0, 0.0, 0.0]
    assert turns[0] == pytest.approx(-MAX_TURN)
    assert turns[-1] == pytest.approx(MAX_TURN)
    assert turns[2] == pytest.approx(-turns[6])


def test_base_turn_is_limited_to_max_turn(rules: RuleBases) -> None:
    still = Follower(rules, limits=LIMITS, max_turn=0.0)
    slow = Follower(rules, limits=LIMITS, max_turn=0.3)
    head = HeadPose(radians(80), 0.0)
    assert still.step(0.0, face_at(0.0, 120), head=head, base=STILL).turn == 0.0
    assert slow.step(0.0, face_at(0.0, 120), head=head, base=STILL).turn == 0.3


def test_non_finite_face_is_refused_and_not_kept(follower: Follower) -> None:
    look(follower, 0.0, face_at(0.0, 20))
    with pytest.raises(ValueError, match="not finite: target at nan"):
        look(follower, 0.05, face_at(0.05, math.nan))
    with pytest.raises(ValueError, match="turning inf"):
        look(follower, 0.05, face_at(0.05, 0), turning=math.inf)
    assert math.isfinite(look(follower, 0.1, face_at(0.1, 20)).pan)


def test_missing_or_unsuitable_rule_bases_are_refused(values: Mapping[str, Any]) -> None:
    with pytest.raises(ValueError, match="tilt: there is no input 'pan' for it; there are error, rate"):
        RuleBases.from_mapping({**values, "tilt": values["base"]})
    with pytest.raises(ValueError, match="needs 'pan' to turn a head by, or 'turn' to turn a base by"):
        RuleBases.from_mapping({"tilt": values["tilt"]})
    with pytest.raises(ValueError, match="pan: needs 'inputs'"):
        RuleBases.from_mapping({"pan": {}})
    with pytest.raises(ValueError, match="'predict' needs true or false, not 'no'"):
        RuleBases.from_mapping({**values, "predict": "no"})
    with pytest.raises(ValueError, match="base: needs 'inputs'"):
        RuleBases.from_mapping({**values, "base": "none"})
    with pytest.raises(ValueError, match="'roll' is none of the rule bases pan, tilt, base, turn, nor 'predict'"):
        RuleBases.from_mapping({**values, "roll": values["base"]})


@given(
    where=st.floats(-70, 70),
    rate=st.floats(-30, 30),
    start=st.floats(-80, 80),
    ticks=st.lists(st.floats(0.0, 0.1), max_size=20),
)
def test_follower_never_overshoots_the_face_at_any_tick_rate(
    rules: RuleBases, where: float, rate: float, start: float, ticks: list[float]
) -> None:
    follower = Follower(rules, limits=LIMITS, max_turn=0.0)
    face, now = face_at(0.0, where, yaw_rate=rate), 0.0
    head = HeadPose(radians(start), 0.0)
    left = start < where
    for tick in [0.0, *ticks]:
        now += tick
        pan = follower.step(now, face, head=head, base=STILL).head.pan
        # A step leads no farther than to where the face will be at its end, or beyond one that goes on by the way in
        # which a head brakes; or the head's limit before.
        brakes = math.copysign(LIMITS.speed**2 / (2 * LIMITS.acceleration), rate) if rate else 0.0
        places = [face.predict(now + span)[0] + way for span in (0.0, MAX_STEP_TIME) for way in (0.0, brakes)]
        ahead = [min(max(place, LIMITS.pan[0]), LIMITS.pan[1]) for place in places]
        assert pan <= max(ahead) + 1e-9 if left else pan >= min(ahead) - 1e-9


# --- a base alone -----------------------------------------------------------------------------------------------------


@pytest.fixture
def base(rules: RuleBases) -> Follower:
    return Follower(rules, limits=None, max_turn=MAX_TURN)


def test_a_base_without_a_head_turns_to_the_face_faster_the_farther_off(rules: RuleBases) -> None:
    turns = [
        step(Follower(rules, limits=None, max_turn=MAX_TURN), 1.0, face_at(1.0, yaw)).turn
        for yaw in (-170, -20, -5, 0, 5, 20, 170)
    ]
    assert turns == sorted(turns)
    assert turns[3] == 0.0
    assert turns[-1] == pytest.approx(MAX_TURN)


def test_base_keeps_the_rate_of_a_centred_face(base: Follower) -> None:
    face = face_at(1.0, 30, yaw_rate=20)
    heading = 30 + 20 * (MAX_STEP_TIME / 2)
    turn = base.step(1.0, face, head=CENTRE, base=TurnState(radians(heading), radians(20), 1.0 + 0.05)).turn
    assert turn == pytest.approx(radians(20), abs=radians(0.5))


def test_base_lag_is_compensated_by_pending_commands(rules: RuleBases) -> None:
    quick, slow = (Follower(rules, limits=None, max_turn=MAX_TURN, lag=LagEstimator(lag, 3.5)) for lag in (0.0, 0.3))
    asked = [[step(each, n * 0.05, face_at(n * 0.05, 15)).turn for n in range(12)] for each in (quick, slow)]
    # What it was told and has not begun yet will turn it: the one that knows so asks for less and less.
    assert asked[0][-1] == pytest.approx(asked[0][2], rel=0.3)
    assert asked[1][5] < 0.8 * asked[1][0]


# --- without foresight ------------------------------------------------------------------------------------------------


PD = {"predict": False, "pan": {"p": 2.0, "d": 0.5, "most": 1.5}, "turn": {"p": 2.0, "d": 0.5}}


def test_pd_controller_without_prediction_uses_the_newest_picture_and_its_change() -> None:
    follower = Follower(RuleBases.from_mapping(PD), limits=None, max_turn=9.0)
    first = step(follower, 1.0, face_at(0.9, 99, bearing=10))
    assert first.turn == pytest.approx(2.0 * radians(10))
    again = step(follower, 1.05, face_at(0.9, 99, bearing=10))
    assert again == first
    second = step(follower, 1.1, face_at(1.0, 99, bearing=8))
    assert second.turn == pytest.approx(2.0 * radians(8) + 0.5 * radians(-2) / 0.1)


def test_without_prediction_a_head_may_go_past() -> None:
    follower = Follower(RuleBases.from_mapping(PD), limits=LIMITS, max_turn=0.0)
    poses = [look(follower, n * 0.1, face_at(0.0, 5, bearing=5)) for n in range(20)]
    assert degrees(poses[-1].pan) > 10
    assert poses[-1].tilt == 0.0


@pytest.mark.parametrize(("edge", "turn"), [(219, 10), (220, 0), (250, 0), (280, 0), (281, -10)])
def test_course_controller_follows_the_left_edge_of_the_box(edge: float, turn: float) -> None:
    rules = RuleBases.from_mapping(load_controller(shipped_files("controllers")["course"]).values)
    follower = Follower(rules, limits=None, max_turn=MAX_TURN)
    assert degrees(step(follower, 1.0, face_at(1.0, 0, edge=edge)).turn) == pytest.approx(turn)


def test_course_controller_refuses_targets_without_an_edge() -> None:
    rules = RuleBases.from_mapping(load_controller(shipped_files("controllers")["course"]).values)
    ball = Thing(1, 1.0, Box(1, 1, 9, 9), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, "red ball", "red", "ball")
    with pytest.raises(ValueError, match="the rules go by 'edge', which is not known of this Thing"):
        Follower(rules, limits=None, max_turn=1.0).step(1.0, ball, head=CENTRE, base=STILL)


@pytest.mark.parametrize(
    ("pan", "message"),
    [
        ({"p": 1.0}, "pan: a PD controller needs 'd'"),
        ({"p": 1.0, "d": -1.0}, "pan: 'd' needs a number of 0 or more, not -1.0"),
        ({"p": True, "d": 1.0}, "pan: 'p' needs a number of 0 or more, not True"),
        ({"p": 1.0, "d": 0.0, "i": 1.0}, "pan: a PD controller has no 'i'; known are: p, d, most"),
    ],
)
def test_invalid_pd_controller_is_refused_with_a_reason(pan: Mapping[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RuleBases.from_mapping({"pan": pan})
