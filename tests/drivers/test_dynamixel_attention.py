"""A joint is read as often as is worth while: seldom at rest, often on its way, at the rate of the arm in couplings."""

from collections.abc import Collection
from dataclasses import replace
from math import radians

import pytest

from drivers.api import Coupling, JointState, Quality, Reading
from drivers.servos.driver import STALE_AFTER
from drivers.servos.joint import Joint, JointSpec
from drivers.servos.models import MODELS
from drivers.servos.poll_rate import (
    HAND_TURNED_INTERVAL,
    MOVING_INTERVAL,
    OBSERVED_INTERVAL,
    OBSERVER_TIMEOUT,
    RESTING_INTERVAL,
    TORQUE_OFF_INTERVAL,
    PollSchedule,
)
from tests.drivers.test_dynamixel_silence import Quiet

STILL = JointState(0.0, 0.0, None, 0.0, 12.0, 35.0, moving=False, torque=False)


def joint(name: str = "a", seen: float = 5.0, state: JointState = STILL, **known: object) -> Joint:
    found = Joint(name, JointSpec(1), MODELS["AX-12A"], undriven_reason="")
    found.reading = Reading(state, seen, Quality.GOOD)
    for attribute, value in known.items():
        setattr(found, attribute, value)
    return found


def period(
    found: Joint, attention: PollSchedule | None = None, coupled: Collection[str] = (), now: float = 5.0
) -> float:
    return (attention or PollSchedule(100.0)).next_due([found], coupled, now) - found.reading.stamp


@pytest.mark.parametrize(("torque", "asked"), [(True, OBSERVED_INTERVAL), (False, TORQUE_OFF_INTERVAL)])
def test_observed_resting_joint_is_read_more_often(torque: bool, asked: float) -> None:
    attention, resting = PollSchedule(100.0), joint(torque=torque)
    assert not attention.note_request(5.0)
    assert period(resting, attention) == pytest.approx(RESTING_INTERVAL)
    assert not attention.note_request(5.0 + OBSERVER_TIMEOUT)
    assert period(resting, attention, now=5.0 + OBSERVER_TIMEOUT) == pytest.approx(asked)
    assert attention.note_request(5.1 + OBSERVER_TIMEOUT)
    assert period(resting, attention, now=5.11 + 2 * OBSERVER_TIMEOUT) == pytest.approx(RESTING_INTERVAL)
    assert not attention.note_request(5.11 + 2 * OBSERVER_TIMEOUT)


def test_resting_reading_is_fresh_for_occasional_observers_only() -> None:
    arm = Quiet("AX-12A")
    arm.run(1.0)
    seen = arm.joints.states()["a"].stamp
    arm.wait(seen + STALE_AFTER + RESTING_INTERVAL - 0.01 - arm.clock.now())
    assert arm.joints.states()["a"].good
    arm.wait(0.02)
    assert arm.joints.states()["a"].quality is Quality.STALE
    while arm.clock.now() < seen + 1.0:
        arm.run(0.1)
        assert arm.joints.states()["a"].good
    seen = arm.joints.states()["a"].stamp
    arm.wait(seen + OBSERVER_TIMEOUT - arm.clock.now())
    assert arm.joints.states()["a"].good
    arm.wait(0.02)
    assert arm.joints.states()["a"].quality is Quality.STALE


@pytest.mark.parametrize(
    ("found", "seconds"),
    [
        (joint(state=replace(STILL, moving=True)), HAND_TURNED_INTERVAL),
        (joint(state=replace(STILL, velocity=radians(-5))), HAND_TURNED_INTERVAL),
        (joint(torque=True, goal=1.0, setpoint=600, setpoint_sent_at=4.0), MOVING_INTERVAL),
        (joint(torque=True, goal=0.0, setpoint=512, setpoint_sent_at=5.0), MOVING_INTERVAL),
    ],
    ids=["it says that it moves", "turned by hand", "part of its way was sent", "sent since it was read"],
)
def test_moving_joint_is_read_often_and_hand_turned_joint_most(found: Joint, seconds: float) -> None:
    assert period(found) == pytest.approx(seconds)


def test_coupled_or_missed_joint_is_read_at_the_arm_rate() -> None:
    assert period(joint(), coupled={"a"}) == pytest.approx(0.01)
    assert period(joint(missed_reads=1)) == pytest.approx(0.01)


def test_no_joint_is_read_more_often_than_the_rate_nor_more_seldom_than_an_absence_needs() -> None:
    assert period(joint(state=replace(STILL, moving=True)), PollSchedule(20.0)) == pytest.approx(0.05)
    assert period(joint(), PollSchedule(5.0)) == pytest.approx(0.2)
    assert period(joint(), PollSchedule(100.0, max_interval=0.03)) == pytest.approx(0.03)


def test_nearly_due_joints_are_read_together() -> None:
    attention, a, b, c = PollSchedule(100.0), joint("a", 5.0), joint("b", 5.04), joint("c", 5.12)
    assert attention.due_joints([a, b, c], (), 5.19) == []
    assert attention.due_joints([a, b, c], (), 5.2) == [a, b]


def test_joint_with_a_slow_reading_is_due_in_the_nearest_round() -> None:
    attention = PollSchedule(100.0)
    moving = joint("a", 5.004, replace(STILL, moving=True))
    assert attention.due_joints([moving], (), 5.01) == []
    assert attention.due_joints([moving], (), 5.02) == [moving]
    leading = joint("b", 5.004)
    assert attention.due_joints([leading], {"b"}, 5.01) == [leading]


def test_postponed_or_undriven_joint_is_not_read() -> None:
    attention, silent, other = (
        PollSchedule(100.0),
        joint("a", next_read_at=6.0),
        joint("b", undriven_reason="does not answer"),
    )
    assert attention.due_joints([silent, other], (), 5.5) == []
    assert attention.due_joints([silent, other], (), 6.0) == [silent]


def test_resting_arm_is_read_rarely_and_a_starting_joint_often() -> None:
    arm = Quiet("AX-12A", "AX-12A")
    arm.run(0.5)
    before = arm.tries()
    arm.run(1.0)
    assert sum(arm.tries()) - sum(before) == pytest.approx(
        2 * (1 / RESTING_INTERVAL + 2), abs=4
    )  # and the slow registers
    arm.joints.move({"a": 1.0}, speeds={"a": 1.0})
    before = arm.tries()
    arm.run(0.6)
    moving, resting = (after - begun for after, begun in zip(arm.tries(), before, strict=True))
    assert moving == pytest.approx(0.6 / MOVING_INTERVAL, abs=6)
    assert resting <= 0.6 / RESTING_INTERVAL + 4


def test_resting_leader_is_read_at_the_arm_rate() -> None:
    arm = Quiet("AX-12A", "AX-12A")
    arm.joints.hold()
    arm.joints.follow([Coupling("b", "a")])
    arm.run(0.2)
    before = arm.tries()
    arm.run(0.5)
    assert arm.tries()[0] - before[0] == pytest.approx(50, abs=5)
