"""Joints that follow others: the leaders limp, the followers led by the driver, all as stiff as before in the end."""

import math
from collections.abc import Mapping

import pytest

from behaviours.joint_motion import RUN_IN
from behaviours.leaf import FAILURE, RUNNING
from behaviours.mirror import LEADING_TOLERANCE, LIMP, FollowJoint, Mirror
from drivers.api import Coupling, JointLimits, JointState, Reading
from missions.testing.recorders import GONE, HOLD, RELAX, Bench, none
from tests.behaviours.servo_arm import TICK, ServoArm, moves, tick, with_servos

LEFT, RIGHT = ("left_shoulder", "left_elbow"), ("right_shoulder", "right_elbow")
LIMITS = {name: JointLimits(-1.0, 1.5, speed=2.0) for name in (*LEFT, *RIGHT)}


def bench_of_two_arms() -> tuple[Bench, ServoArm]:
    return with_servos(LIMITS, left_arm=LEFT, right_arm=RIGHT)


def mirroring(bench: Bench, **arguments: object) -> Mirror:
    return bench.put(Mirror("mirror"), **{"leader": ("left_arm",), "follower": ("right_arm",), **arguments})


def couplings(scale: float = 1.0, offset: float = 0.0) -> tuple[Coupling, ...]:
    return tuple(Coupling(leader, joint, scale, offset) for leader, joint in zip(LEFT, RIGHT, strict=True))


# --- mirror ----------------------------------------------------------------------------------------------------------


def test_the_leaders_become_limp_and_the_driver_leads_the_others() -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench)
    assert tick(bench, leaf, 1.0) is RUNNING
    assert arm.commands == [(RELAX, *LEFT), couplings()]
    assert leaf.reason == "right_shoulder, right_elbow follow"


def test_scale_and_offset_are_for_all_and_can_be_given_by_joint() -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench, scale=-1.0, scales={"right_elbow": 0.5}, offsets={"right_shoulder": 0.05})
    tick(bench, leaf, 1.0)
    assert arm.commands[-1] == (
        Coupling("left_shoulder", "right_shoulder", -1.0, 0.05),
        Coupling("left_elbow", "right_elbow", 0.5, 0.0),
    )


def test_followers_that_are_far_off_come_slowly_before_they_are_led() -> None:
    bench, arm = bench_of_two_arms()
    arm.turn_by_hand("left_elbow", 1.2)
    leaf = mirroring(bench)
    tick(bench, leaf, 0.5)
    assert leaf.reason == "right_shoulder, right_elbow come to where they belong"
    assert arm.speeds[-1] == dict.fromkeys(RIGHT, RUN_IN)
    tick(bench, leaf, 2.0)
    assert arm.commands[-1] == couplings()
    assert moves(arm)[-1]["right_elbow"] == pytest.approx(1.2)
    assert arm.shafts["right_elbow"].position == pytest.approx(1.2, abs=LEADING_TOLERANCE)


def test_a_leader_beyond_what_its_follower_can_do_leads_it_to_its_limit() -> None:
    bench, arm = bench_of_two_arms()
    arm.turn_by_hand("left_elbow", 1.4)
    tick(bench, mirroring(bench, scale=2.0), 3.0)
    assert moves(arm)[-1]["right_elbow"] == 1.5
    assert arm.commands[-1] == couplings(2.0)


def test_a_halt_leaves_the_followers_where_they_are_and_the_leaders_as_stiff_as_before() -> None:
    bench, arm = bench_of_two_arms()
    arm.relax(["left_elbow"])
    leaf = mirroring(bench)
    tick(bench, leaf, 1.0)
    assert bench.halt(leaf)
    assert arm.commands[-1] == (HOLD, *RIGHT, "left_shoulder")
    assert arm.limp == {"left_elbow"}


def test_a_halt_before_anything_is_known_leaves_the_arms_alone() -> None:
    bench, arm = bench_of_two_arms()
    arm.silent = {"right_elbow"}
    leaf = mirroring(bench)
    assert tick(bench, leaf, 1.0) is RUNNING
    assert leaf.reason == "waiting for right_elbow to report"
    assert bench.halt(leaf)
    assert arm.commands == []


def test_after_a_pause_the_leaders_are_limp_again_and_lead_again() -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench)
    tick(bench, leaf, 1.0)
    arm.hold()  # as a pause does
    bench.clock.advance(20.0)
    tick(bench, leaf, 1.0)
    assert arm.commands[3:] == [(RELAX, *LEFT), couplings()]
    assert bench.halt(leaf)
    assert arm.commands[-1] == (HOLD, *RIGHT, *LEFT)


def test_after_a_lost_bus_the_followers_are_led_again() -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench)
    tick(bench, leaf, 1.0)
    arm.trouble, arm.silent = GONE, {*LEFT, *RIGHT}
    assert tick(bench, leaf, 5.0) is RUNNING
    arm.trouble, arm.silent = None, set()
    arm.turn_by_hand("left_elbow", 1.0)
    assert tick(bench, leaf, 3.0) is RUNNING
    assert arm.commands[-1] == couplings()
    assert arm.shafts["right_elbow"].position == pytest.approx(1.0, abs=LEADING_TOLERANCE)


def test_a_bus_that_is_gone_when_it_begins_is_waited_for() -> None:
    bench, arm = bench_of_two_arms()
    arm.trouble = GONE
    leaf = mirroring(bench)
    assert tick(bench, leaf, 1.0) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    arm.trouble = None
    tick(bench, leaf, 2 * TICK)
    assert arm.commands[-1] == couplings()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"leader": ("left_arms",)}, "the arm has no joint or group 'left_arms' (did you mean 'left_arm'?)"),
        ({"leader": ("left_elbow",)}, "1 joint cannot lead 2 joints"),
        ({"follower": ("left_elbow", "right_elbow")}, "'left_elbow' cannot both lead and follow"),
        ({"scales": {"left_elbow": -1.0}}, "'left_elbow' has a scale or an offset, and does not follow"),
    ],
)
def test_arms_that_do_not_go_together_fail_it_and_nothing_becomes_limp(
    arguments: dict[str, object], reason: str
) -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench, **arguments)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == reason
    assert arm.commands == []


@pytest.mark.parametrize("word", ["mirror", "follow_joint"])
def test_a_reading_that_goes_stale_within_a_tick_does_no_harm(word: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench) if word == "mirror" else following(bench)
    fresh, asked = arm.states, list[float]()

    def once_a_tick() -> Mapping[str, Reading[JointState]]:
        stale = bench.clock.now() in asked
        asked.append(bench.clock.now())
        return dict.fromkeys(LIMITS, none()) if stale else fresh()

    monkeypatch.setattr(arm, "states", once_a_tick)
    assert tick(bench, leaf, 1.0) is RUNNING
    assert len(asked) == round(1.0 / TICK)


def test_a_follower_that_has_shut_down_ends_it() -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench)
    tick(bench, leaf, 1.0)
    arm.limp.add("right_elbow")
    assert tick(bench, leaf, LIMP + 3 * TICK) is FAILURE
    assert leaf.reason == "right_elbow is limp, and cannot follow"
    assert arm.commands[-1] == (HOLD, *RIGHT, *LEFT)


# --- follow_joint ----------------------------------------------------------------------------------------------------


def following(bench: Bench, **arguments: object) -> FollowJoint:
    given = {"leader": "left_elbow", "follower": "right_elbow", "past": math.radians(20), **arguments}
    return bench.put(FollowJoint("follow_joint"), **given)


def test_a_joint_follows_once_its_leader_was_turned_far_enough() -> None:
    bench, arm = bench_of_two_arms()
    leaf = following(bench, scale=-1.0)
    tick(bench, leaf, 0.5)
    assert arm.commands == [(RELAX, "left_elbow")]
    assert leaf.reason == "left_elbow is turned by 0 deg, waiting for 20 deg"
    arm.turn_by_hand("left_elbow", -0.5)
    tick(bench, leaf, TICK)
    assert arm.commands[1:] == [(Coupling("left_elbow", "right_elbow", -1.0),)]
    assert leaf.reason == "right_elbow follows left_elbow"
    arm.turn_by_hand("left_elbow", 0.0)
    tick(bench, leaf, TICK)
    assert leaf.reason == "right_elbow follows left_elbow"
    assert bench.halt(leaf)
    assert arm.commands[-1] == (HOLD, "right_elbow", "left_elbow")


def test_a_joint_that_waits_for_its_leader_may_be_limp() -> None:
    bench, arm = bench_of_two_arms()
    arm.relax(["right_elbow"])
    leaf = following(bench)
    assert tick(bench, leaf, 3 * LIMP) is RUNNING
    arm.turn_by_hand("left_elbow", 0.5)
    assert tick(bench, leaf, LIMP + 3 * TICK) is FAILURE
    assert leaf.reason == "right_elbow is limp, and cannot follow"


@pytest.mark.parametrize("begun", [True, False])
def test_after_a_pause_it_waits_again_only_where_it_had_not_begun(begun: bool) -> None:
    bench, arm = bench_of_two_arms()
    leaf = following(bench)
    tick(bench, leaf, 0.5)
    arm.turn_by_hand("left_elbow", 0.5 if begun else 0.1)
    tick(bench, leaf, 0.5)
    arm.hold()
    bench.clock.advance(20.0)
    tick(bench, leaf, 0.5)
    assert arm.commands[-1] == ((Coupling("left_elbow", "right_elbow"),) if begun else (RELAX, "left_elbow"))


def test_joints_that_cannot_follow_are_told_of() -> None:
    bench, arm = bench_of_two_arms()
    assert bench.tick(following(bench, leader="left_arm")) is FAILURE
    leaf = following(bench, follower="left_elbow")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "'left_elbow' cannot both lead and follow"
    assert arm.commands == []
