"""Questions about joints: answered from the newest readings, and never guessed."""

import math
from dataclasses import replace

import pytest

from behaviours.joints import JointAt, JointHot, JointLoaded, JointMoving
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.robot import Robot
from drivers.api import Quality, Reading
from missions.plugins.testing.recorders import LeafTestBench, none


def feeling(bench: LeafTestBench, joint: str, **changes: object) -> None:
    felt = bench.arm.readings[joint].value
    assert felt is not None
    bench.arm.set_state(joint, replace(felt, **changes))  # type: ignore[arg-type]  # the fields of a state, by name


def answer(bench: LeafTestBench, leaf: Leaf) -> tuple[object, str]:
    return bench.tick(leaf), leaf.reason


def test_joint_at_succeeds_within_the_tolerance() -> None:
    bench = LeafTestBench()
    bench.arm.place({"elbow": math.radians(32)})
    leaf = bench.put(JointAt("joint_at"), joint="elbow", angle=math.radians(30))
    assert answer(bench, leaf) == (SUCCESS, "elbow is at 32 deg")
    assert leaf.result == pytest.approx(math.radians(32))
    leaf.tolerance = math.radians(1)
    assert answer(bench, leaf) == (FAILURE, "elbow is at 32 deg")


@pytest.mark.parametrize("quality", [Quality.NONE, Quality.STALE])
@pytest.mark.parametrize(
    "leaf",
    [JointAt("joint_at"), JointHot("joint_hot"), JointLoaded("joint_loaded"), JointMoving("joint_moving")],
    ids=lambda leaf: leaf.tag,
)
def test_joint_conditions_suspend_while_a_joint_is_silent(quality: Quality, leaf: Leaf) -> None:
    bench = LeafTestBench()
    felt = bench.arm.readings["elbow"].value
    bench.arm.readings["elbow"] = none() if quality is Quality.NONE else Reading(felt, 0.0, quality)
    bench.put(leaf, joint="elbow", joints=("elbow",), angle=0.0)
    assert answer(bench, leaf) == (RUNNING, "waiting: the joint elbow does not report")
    assert leaf.is_suspended


def test_joint_conditions_fail_on_unknown_joints_and_angles_outside_limits() -> None:
    bench = LeafTestBench()
    leaf = bench.put(JointAt("joint_at"), joint="hand", angle=0.0)
    assert answer(bench, leaf) == (FAILURE, "the arm has no joint 'hand'")
    leaf.joint, leaf.angle = "elbow", -1.0
    assert answer(bench, leaf)[1].startswith("elbow at -57.3 deg is outside its limits")
    hot = bench.put(JointHot("joint_hot"), joints=("hand",))
    assert answer(bench, hot) == (FAILURE, "the arm has no joint or group 'hand'")


def test_joint_hot_checks_all_joints_and_stores_the_hot_ones() -> None:
    bench = LeafTestBench()
    leaf = bench.put(JointHot("joint_hot"))
    feeling(bench, "elbow", temperature=55.0)
    assert answer(bench, leaf) == (FAILURE, "elbow has 55 degC")
    feeling(bench, "elbow", temperature=61.0)
    assert answer(bench, leaf) == (SUCCESS, "elbow has 61 degC")
    assert leaf.result == ["elbow"]


def test_joint_hot_succeeds_although_other_joints_are_silent() -> None:
    bench = LeafTestBench()
    feeling(bench, "elbow", temperature=61.0)
    bench.arm.readings["shoulder"] = none()
    assert bench.tick(bench.put(JointHot("joint_hot"))) is SUCCESS


def test_joint_loaded_counts_either_way() -> None:
    bench = LeafTestBench()
    leaf = bench.put(JointLoaded("joint_loaded"), joints=("elbow",), over=0.5)
    feeling(bench, "elbow", load=-0.6)
    assert answer(bench, leaf) == (SUCCESS, "elbow is loaded to 60%")
    feeling(bench, "elbow", load=0.4)
    assert answer(bench, leaf) == (FAILURE, "elbow is loaded to 40%")


def test_joint_moving_takes_groups() -> None:
    bench = LeafTestBench()
    robot = Robot(arm_part=bench.arm, groups={"upper": ("shoulder",)})
    leaf = bench.put(JointMoving("joint_moving"), joints=("upper",))
    leaf.robot = robot
    feeling(bench, "elbow", moving=True)
    assert answer(bench, leaf) == (FAILURE, "shoulder stands still")
    feeling(bench, "shoulder", moving=True)
    assert answer(bench, leaf) == (SUCCESS, "shoulder moves")
