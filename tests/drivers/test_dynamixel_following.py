"""Where followers belong, what couplings cannot be, and the goals that are clamped: all of it without any bus."""

from math import inf, nan, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import Coupling, DeviceStatus
from drivers.api.joints import FOLLOWING_TOLERANCE, MAX_APPROACH_SPEED, MAX_FOLLOW_GAP, ActiveCouplings
from drivers.errors import BadRequest
from drivers.joints.request_checks import check_couplings
from drivers.servos.joint import Joint, JointSpec
from drivers.servos.models import MODELS
from drivers.servos.round_schedule import STATISTICS_WINDOW, RoundSchedule
from drivers.servos.servo_joints import CLAMP_REPORT_INTERVAL, GoalLimiter

JOINTS = {"left": 1, "right": 2, "third": 3}
ANGLES = st.floats(-3.0, 3.0)


@given(ANGLES, st.floats(-2.0, 2.0), ANGLES)
def test_a_follower_belongs_at_scale_times_leader_plus_offset(position: float, scale: float, offset: float) -> None:
    following = ActiveCouplings([Coupling("left", "right", scale=scale, offset=offset)])
    assert following.goals({"left": position, "third": 9.0}) == {"right": scale * position + offset}


def test_follower_without_a_leader_reading_gets_no_goal() -> None:
    following = ActiveCouplings([Coupling("left", "right"), Coupling("third", "fourth", scale=-1.0)])
    assert following.goals({"third": 0.5}) == {"fourth": -0.5}
    assert following.goals({}) == {}


def test_followers_can_be_let_go_one_by_one() -> None:
    following = ActiveCouplings([Coupling("left", "right"), Coupling("left", "third")])
    following.release(["right", "left", "nobody"])
    assert following.couplings == (Coupling("left", "third"),)
    assert following.goals({"left": 0.3}) == {"third": 0.3}
    assert following.followers_without([Coupling("right", "third")]) == []
    assert following.followers_without([Coupling("left", "right")]) == ["third"]
    following.release({"third"})
    assert not following


def test_all_faults_of_couplings_are_reported_together() -> None:
    wrong = [
        Coupling("left", "right", scale=nan),
        Coupling("right", "third", offset=inf),
        Coupling("left", "third"),
        Coupling("left", "left"),
        Coupling("nose", "toe"),
    ]
    with pytest.raises(BadRequest) as caught:
        check_couplings("arm", wrong, JOINTS)
    for words in (
        "no joint 'nose' (there are left, right, third)",
        "no joint 'toe'",
        "scale nan",
        "offset inf",
        "right after left: right leads, and cannot follow as well",
        "third after left: third follows another joint already",
        "left after left: left leads",
    ):
        assert words in str(caught.value)
    assert caught.value.hint
    check_couplings("arm", [Coupling("left", "right"), Coupling("left", "third", scale=-1.0)], JOINTS)


class Limited:
    """One joint of +-1 rad, and what is told of its goals."""

    def __init__(self) -> None:
        self.notices: list[DeviceStatus] = []
        self.joint = Joint("elbow", JointSpec(2, lower=-1.0, upper=1.0), MODELS["AX-12A"])
        self.clamping = GoalLimiter("arm", {"elbow": self.joint}, self.notices.append)

    def ask(self, goal: float, now: float = 0.0) -> float:
        return self.clamping.clamp_goals({"elbow": goal}, now)["elbow"]


@given(st.floats(-10, 10))
def test_goals_are_the_nearest_within_the_limits(goal: float) -> None:
    limited = Limited()
    assert limited.ask(goal) == min(max(goal, -1.0), 1.0)
    assert bool(limited.notices) == (abs(goal) > 1.0 + limited.joint.model.tick / 2)


def test_clamped_goal_is_reported_once_per_episode() -> None:
    limited = Limited()
    for step in range(100):
        limited.ask(radians(90), now=step * 0.05)
    (notice,) = limited.notices
    assert (notice.device, notice.kind) == ("arm", "fault")
    assert notice.message == "the goal of elbow was clamped to 57.3 deg: 90.0 deg is beyond its limits"
    assert "-57.3..57.3 deg" in notice.hint
    limited.ask(-2.0, now=5.0 + CLAMP_REPORT_INTERVAL)
    assert "clamped to -57.3 deg" in limited.notices[1].message


def test_rounds_keep_their_rate_on_the_average_and_catch_up_with_no_burst() -> None:
    pace, now = RoundSchedule(100.0), 5.0
    pace.restart(now, 2.0)
    for n in range(300):
        now += 0.012 if n % 3 else 0.002  # the average of a round is 8.7 ms
        now += pace.end_round(now, 2.0 + n * 0.004)
    assert pace.rounds == 300
    assert now - 5.0 == pytest.approx(3.0, abs=0.02)
    assert pace.achieved_rate == pytest.approx(100.0, rel=0.03)
    assert pace.utilisation == pytest.approx(0.4, rel=0.03)
    now += 10 * STATISTICS_WINDOW  # the machine slept
    assert 0 < pace.end_round(now, 4.0) < 0.01
    assert pace.end_round(now + 0.001, 4.0) == pytest.approx(0.01, abs=0.001)


@pytest.mark.parametrize("period", [0.01, 0.02, 0.05, 0.1])
def test_round_schedule_keeps_the_average_rate(period: float) -> None:
    pace, now, rounds = RoundSchedule(100.0), 0.0, round(2.0 / period)
    pace.restart(now, 0.0)
    for _ in range(rounds):
        now += 0.003  # for which the round lasts
        now += pace.end_round(now, 0.0, now + period)
    assert now == pytest.approx(2.0, abs=0.02)


def test_overloaded_round_schedule_leaves_a_gap() -> None:
    pace = RoundSchedule(100.0)
    pace.restart(0.0, 0.0)
    now = 0.0
    for _ in range(5):
        now += 0.017
        rest = pace.end_round(now, now)
        assert rest >= 0.001 - 1e-9
        now += rest


# --- brought over -----------------------------------------------------------------------------------------------------


def test_follower_approaches_slowly_and_then_at_full_speed() -> None:
    following = ActiveCouplings([Coupling("left", "right")])
    assert following.speeds({"right": 1.0}, {"right": 0.0}, 0.00) == {"right": MAX_APPROACH_SPEED}
    assert following.speeds({"right": 1.0}, {}, 0.01) == {"right": MAX_APPROACH_SPEED}  # nobody knows where it is
    assert following.speeds({"right": 1.0}, {"right": 1.0 - 0.9 * FOLLOWING_TOLERANCE}, 0.02) == {}
    assert following.speeds({"right": -1.0}, {"right": 1.0}, 0.03) == {}
    assert following.speeds({"right": -1.0}, {}, 0.04) == {}


def test_follower_approaches_again_after_a_pause() -> None:
    following = ActiveCouplings([Coupling("left", "right"), Coupling("left", "third")])
    near = {"right": 0.0, "third": 0.0}
    assert following.speeds(near, near, 0.0) == {}
    far = {"right": 1.0, "third": 1.0}
    assert following.speeds(far, near, MAX_FOLLOW_GAP) == {}
    following.mark_paused(["third"])
    assert following.speeds(far, near, MAX_FOLLOW_GAP + 0.01) == {"third": MAX_APPROACH_SPEED}
    assert following.speeds(far, near, 3 * MAX_FOLLOW_GAP) == {"right": MAX_APPROACH_SPEED, "third": MAX_APPROACH_SPEED}
    assert following.speeds(near, near, 4 * MAX_FOLLOW_GAP) == {}
    following.mark_paused()
    assert following.speeds(far, near, 4 * MAX_FOLLOW_GAP) == {"right": MAX_APPROACH_SPEED, "third": MAX_APPROACH_SPEED}
