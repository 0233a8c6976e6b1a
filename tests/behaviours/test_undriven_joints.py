"""Joints that do not report although their arm is there: a leaf fails within seconds, with the reason and the fix."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from behaviours.joint_motion import REPORT_TIMEOUT
from behaviours.joints import MoveJoints
from behaviours.leaf import FAILURE, RUNNING, Leaf
from behaviours.mirror import FollowJoint
from behaviours.sweep_joints import SweepLeaf
from missions.plugins.testing.recorders import LeafTestBench
from tests.behaviours.servo_arm import ServoArm, tick, with_servos

DETAIL = "arm: elbow (servo 2) is not in position mode (operating mode 1, not 3)"
FIX = "mission servo set 2 operating_mode 3 --robot FILE"

Make = Callable[[LeafTestBench], Leaf]

LEAVES: list[Make] = [
    lambda bench: bench.put(MoveJoints("move_joints"), to={"elbow": 1.0}),
    lambda bench: bench.put(SweepLeaf("sweep_joints"), joints=("elbow",), between=(0.2, 0.6)),
    lambda bench: bench.put(FollowJoint("follow_joint"), leader="shoulder", follower="elbow"),
]


def silent_arm(*, online: bool) -> tuple[LeafTestBench, ServoArm]:
    bench, servos = with_servos()
    servos.silent = {"elbow"}
    health = servos.health()
    servos.health = lambda: replace(health, online=online, detail=DETAIL, hint=FIX)  # type: ignore[method-assign]
    return bench, servos


@pytest.mark.parametrize("make", LEAVES)
def test_undriven_joint_fails_after_the_report_timeout(make: Make) -> None:
    bench, servos = silent_arm(online=True)
    leaf = make(bench)
    assert tick(bench, leaf, REPORT_TIMEOUT - 0.2) is RUNNING
    assert tick(bench, leaf, 1.0) is FAILURE
    assert leaf.reason == f"elbow cannot be moved: {DETAIL}; try: {FIX}"
    assert not servos.speeds


@pytest.mark.parametrize("make", LEAVES)
def test_joint_of_an_offline_arm_is_waited_for(make: Make) -> None:
    bench, _ = silent_arm(online=False)
    leaf = make(bench)
    assert tick(bench, leaf, 4 * REPORT_TIMEOUT) is RUNNING


@pytest.mark.parametrize("make", LEAVES)
def test_joint_that_reports_in_time_is_moved(make: Make) -> None:
    bench, servos = silent_arm(online=True)
    leaf = make(bench)
    tick(bench, leaf, REPORT_TIMEOUT / 2)
    servos.silent = set()
    tick(bench, leaf, 1.0)
    assert "cannot be moved" not in leaf.reason


def test_reason_of_a_short_joint_includes_the_servo_fault() -> None:
    bench, servos = with_servos()
    servos.stuck = {"elbow"}
    health = servos.health()
    told = replace(health, detail="arm: elbow (servo 2) has shut down")
    servos.health = lambda: told  # type: ignore[method-assign]
    leaf = bench.put(MoveJoints("move_joints"), to={"elbow": math.radians(30)}, patience=0.5)
    tick(bench, leaf, 3.0)
    assert leaf.status is FAILURE
    assert "short of 30 deg (arm: elbow (servo 2) has shut down)" in leaf.reason
