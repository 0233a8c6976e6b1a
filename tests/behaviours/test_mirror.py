"""Joints that follow others: the leaders limp, the followers led by the driver, all as stiff as before in the end."""

import math
from collections.abc import Mapping

import pytest
from py_trees.common import Status

from behaviours.joint_motion import RUN_IN_SPEED
from behaviours.leaf import FAILURE, RUNNING
from behaviours.mirror import LEADING_TOLERANCE, LIMP_TIMEOUT, FollowJoint, Mirror
from behaviours.robot import ExtraPart, Robot
from drivers.api import Coupling, JointLimits, JointState, Reading
from missions.plugins.testing.recorders import HOLD, OFFLINE_ERROR, RELAX, LeafTestBench, none
from tests.behaviours.servo_arm import TICK, ServoArm, moves, tick, with_servos

LEFT, RIGHT = ("left_shoulder", "left_elbow"), ("right_shoulder", "right_elbow")
LIMITS = {name: JointLimits(-1.0, 1.5, speed=2.0) for name in (*LEFT, *RIGHT)}


def bench_of_two_arms() -> tuple[LeafTestBench, ServoArm]:
    return with_servos(LIMITS, left_arm=LEFT, right_arm=RIGHT)


def mirroring(bench: LeafTestBench, **arguments: object) -> Mirror:
    return bench.put(Mirror("mirror"), **{"leader": ("left_arm",), "follower": ("right_arm",), **arguments})


def couplings(scale: float = 1.0, offset: float = 0.0) -> tuple[Coupling, ...]:
    return tuple(Coupling(leader, joint, scale, offset) for leader, joint in zip(LEFT, RIGHT, strict=True))


# --- mirror ----------------------------------------------------------------------------------------------------------


def test_mirror_relaxes_the_leaders_and_couples_the_followers() -> None:
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


def test_mirror_brings_distant_followers_in_slowly_before_coupling() -> None:
    bench, arm = bench_of_two_arms()
    arm.turn_by_hand("left_elbow", 1.2)
    leaf = mirroring(bench)
    tick(bench, leaf, 0.5)
    assert leaf.reason == "right_shoulder, right_elbow approach their goals"
    assert arm.speeds[-1] == dict.fromkeys(RIGHT, RUN_IN_SPEED)
    tick(bench, leaf, 2.0)
    assert arm.commands[-1] == couplings()
    assert moves(arm)[-1]["right_elbow"] == pytest.approx(1.2)
    assert arm.shafts["right_elbow"].position == pytest.approx(1.2, abs=LEADING_TOLERANCE)


def test_leader_beyond_the_follower_limits_leads_to_the_limit() -> None:
    bench, arm = bench_of_two_arms()
    arm.turn_by_hand("left_elbow", 1.4)
    tick(bench, mirroring(bench, scale=2.0), 3.0)
    assert moves(arm)[-1]["right_elbow"] == 1.5
    assert arm.commands[-1] == couplings(2.0)


def test_mirror_halt_holds_followers_and_restores_leader_torque() -> None:
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
    arm.trouble, arm.silent = OFFLINE_ERROR, {*LEFT, *RIGHT}
    assert tick(bench, leaf, 5.0) is RUNNING
    arm.trouble, arm.silent = None, set()
    arm.turn_by_hand("left_elbow", 1.0)
    assert tick(bench, leaf, 3.0) is RUNNING
    assert arm.commands[-1] == couplings()
    assert arm.shafts["right_elbow"].position == pytest.approx(1.0, abs=LEADING_TOLERANCE)


def test_mirror_waits_for_an_offline_bus() -> None:
    bench, arm = bench_of_two_arms()
    arm.trouble = OFFLINE_ERROR
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
def test_mirror_of_unlike_arms_fails_and_relaxes_nothing(arguments: dict[str, object], reason: str) -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench, **arguments)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == reason
    assert arm.commands == []


@pytest.mark.parametrize("word", ["mirror", "follow_joint"])
def test_stale_reading_within_a_tick_is_harmless(word: str, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_limp_follower_fails_mirror() -> None:
    bench, arm = bench_of_two_arms()
    leaf = mirroring(bench)
    tick(bench, leaf, 1.0)
    arm.limp.add("right_elbow")
    assert tick(bench, leaf, LIMP_TIMEOUT + 3 * TICK) is FAILURE
    assert leaf.reason == "right_elbow is limp, and cannot follow"
    assert arm.commands[-1] == (HOLD, *RIGHT, *LEFT)


# --- follow_joint ----------------------------------------------------------------------------------------------------


def following(bench: LeafTestBench, **arguments: object) -> FollowJoint:
    given = {"leader": "left_elbow", "follower": "right_elbow", "past": math.radians(20), **arguments}
    return bench.put(FollowJoint("follow_joint"), **given)


def test_follow_joint_starts_once_the_leader_was_turned() -> None:
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


def test_waiting_follower_may_be_limp() -> None:
    bench, arm = bench_of_two_arms()
    arm.relax(["right_elbow"])
    leaf = following(bench)
    assert tick(bench, leaf, 3 * LIMP_TIMEOUT) is RUNNING
    arm.turn_by_hand("left_elbow", 0.5)
    assert tick(bench, leaf, LIMP_TIMEOUT + 3 * TICK) is FAILURE
    assert leaf.reason == "right_elbow is limp, and cannot follow"


@pytest.mark.parametrize("begun", [True, False])
def test_follow_joint_waits_after_a_pause_only_if_not_begun(begun: bool) -> None:
    bench, arm = bench_of_two_arms()
    leaf = following(bench)
    tick(bench, leaf, 0.5)
    arm.turn_by_hand("left_elbow", 0.5 if begun else 0.1)
    tick(bench, leaf, 0.5)
    arm.hold()
    bench.clock.advance(20.0)
    tick(bench, leaf, 0.5)
    assert arm.commands[-1] == ((Coupling("left_elbow", "right_elbow"),) if begun else (RELAX, "left_elbow"))


def test_follow_joint_refuses_groups_and_self_following() -> None:
    bench, arm = bench_of_two_arms()
    assert bench.tick(following(bench, leader="left_arm")) is FAILURE
    leaf = following(bench, follower="left_elbow")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "'left_elbow' cannot both lead and follow"
    assert arm.commands == []


# --- two arms --------------------------------------------------------------------------------------------------------


class TwoArms:
    """A robot whose first arm leads its ``right_arm``, which a mirror moves."""

    def __init__(self, **arguments: object) -> None:
        self.bench = LeafTestBench()
        self.left = ServoArm(self.bench.clock, {name: JointLimits(-1.0, 1.0, speed=2.0) for name in ("elbow", "hand")})
        self.right = ServoArm(
            self.bench.clock,
            {"elbow": JointLimits(-0.5, 0.5, speed=2.0), "hand": JointLimits(0.0, 4.0, speed=2.0)},
        )
        self.right.short = 0.0
        robot = Robot(
            arm_part=self.left, extra_parts={"right_arm": ExtraPart("arm", self.right, {"all": ("elbow", "hand")})}
        )
        self.bench.robot = robot.with_named_parts({"arm": "right_arm"})
        self.leaf = self.bench.put(Mirror("mirror"), **{"on": "right_arm", "leader_arm": "arm", **arguments})

    def tick(self, seconds: float) -> Status:
        return tick(self.bench, self.leaf, seconds)

    def at(self, joint: str = "elbow") -> float:
        """Return where it stands."""
        return self.right.shafts[joint].advance(self.bench.clock.now())


def test_mirror_couples_two_arms_by_joint_name() -> None:
    arms = TwoArms()
    assert arms.tick(1.0) is RUNNING
    assert arms.left.commands == [(RELAX, "elbow", "hand")]
    assert arms.leaf.reason == "elbow, hand follow"
    arms.left.turn_by_hand("elbow", 0.06)
    arms.tick(0.3)
    assert arms.at() == pytest.approx(0.06, abs=0.01)
    arms.left.turn_by_hand("elbow", 0.9)
    arms.tick(1.0)
    assert arms.at() == 0.5  # its limit
    assert all("follow" not in str(command) for command in arms.right.commands)  # no driver has both


def test_moving_leader_is_followed_evenly_and_promptly() -> None:
    arms = TwoArms()
    arms.tick(1.0)
    lags = []
    for step in range(1, 61):
        hand = 0.4 * math.sin(step * TICK * 2)
        arms.left.turn_by_hand("elbow", hand)
        arms.tick(TICK)
        lags.append(abs(arms.at() - hand))
    speeds = [each["elbow"] for each in arms.right.speeds[-60:]]
    assert max(speeds) < 1.2  # 0.8 rad/s is the hand's own: no step is gone at the 2 rad/s that it may
    assert max(lags) < 0.8 * 3 * TICK  # what the hand goes in three ticks


def test_mirror_halt_holds_both_arms() -> None:
    arms = TwoArms()
    arms.tick(1.0)
    assert arms.bench.halt(arms.leaf)
    assert arms.left.commands[-1] == (HOLD, "elbow", "hand")
    assert arms.right.commands[-1] == (HOLD, "elbow", "hand")


def test_silent_leader_arm_stops_the_follower_and_resumes_slowly() -> None:
    arms = TwoArms()
    arms.tick(1.0)
    arms.left.silent = {"elbow"}
    told = len(arms.right.commands)
    assert arms.tick(1.0) is RUNNING
    assert arms.leaf.reason == "waiting for arm.elbow to report"
    assert len(arms.right.commands) == told
    arms.left.silent = set()
    arms.left.turn_by_hand("elbow", -0.5)
    arms.tick(3 * TICK)
    assert arms.right.speeds[-1]["elbow"] <= RUN_IN_SPEED
    arms.tick(2.0)
    assert arms.at() == pytest.approx(-0.5, abs=0.01)


def test_after_a_pause_the_leading_arm_is_limp_again() -> None:
    arms = TwoArms()
    arms.tick(1.0)
    arms.left.hold()
    arms.right.hold()
    arms.bench.clock.advance(20.0)
    arms.tick(2 * TICK)
    assert arms.left.limp == {"elbow", "hand"}


def test_gripper_follows_in_proportion_to_its_range() -> None:
    arms = TwoArms(by_range=("hand",))
    arms.left.turn_by_hand("hand", 0.5)
    arms.tick(4.0)
    assert arms.at("hand") == pytest.approx(3.0, abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"leader": ("all",)}, "the arm has no joint or group 'all'"),
        ({"leader": ("elbow",), "follower": ("all",)}, "1 joint cannot lead 2 joints"),
        ({"follower": ("elbow",), "by_range": ("hand",)}, "'hand' goes by its range, and does not follow"),
        ({"leader_arm": None}, "needs leader and follower, or a leader_arm other than the arm that it moves"),
    ],
)
def test_mirror_of_two_unlike_arms_fails_without_commands(arguments: dict[str, object], reason: str) -> None:
    arms = TwoArms(**arguments)
    assert arms.bench.tick(arms.leaf) is FAILURE
    assert arms.leaf.reason == reason
    assert (arms.left.commands, arms.right.commands) == ([], [])


def test_leader_without_a_range_fails_by_range_mirroring() -> None:
    arms = TwoArms(by_range=("hand",))
    arms.left.limits = {**arms.left.limits, "hand": JointLimits(0.5, 0.5, speed=2.0)}
    assert arms.bench.tick(arms.leaf) is FAILURE
    assert arms.leaf.reason == "'hand' cannot go by its range: 'hand', which leads it, has none"
    assert (arms.left.commands, arms.right.commands) == ([], [])


def test_follow_joint_couples_equal_names_across_arms() -> None:
    arms = TwoArms()
    given = {"leader": "hand", "follower": "hand", "on": "right_arm", "leader_arm": "arm"}
    leaf = arms.bench.put(FollowJoint("follow_joint"), **given)
    tick(arms.bench, leaf, 0.5)
    arms.left.turn_by_hand("hand", 0.4)
    tick(arms.bench, leaf, 2.0)
    assert arms.at("hand") == pytest.approx(0.4, abs=0.01)
