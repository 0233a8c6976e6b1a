"""What ``drivers.api.Joints`` promises, as far as ROS 2 has words for it, kept by an arm over topics and its twin."""

from abc import abstractmethod
from collections.abc import Iterator
from functools import partial
from math import inf, nan

import pytest

from drivers.api import Coupling, JointLimits, Joints, JointState, Quality, ReconnectPolicy
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.ros2.joint_topics import ARRAY, JOINT_STATE, OFFLINE_TIMEOUT, TRAJECTORY, TRAJECTORY_HORIZON, TopicJoint
from drivers.ros2.joints import TopicJoints
from drivers.ros2.joints_twin import StiffJoints
from drivers.ros2.types import types
from drivers.ros2.virtual_joints import VirtualJoints
from drivers.ros2.wire import frame
from tests.contract.rigs import InSimulatedTime, Rig, simulated
from tests.contract.test_joints_contract import (  # noqa: F401 - what holds of joints that are always stiff
    TICK,
    test_a_goal_beyond_the_limits_is_clamped,
    test_unopened_device_is_offline_and_has_no_readings,
)
from tests.drivers.cranked import HandWire

JOINTS = {
    "wrist": TopicJoint("arm_3", JointLimits(-1.0, 1.0, 4.0)),
    "elbow": TopicJoint("elbow_joint", JointLimits(-1.5, 1.5, 4.0), -1),
    "shoulder": TopicJoint("shoulder", JointLimits(-3.0, 3.0, 5.0)),
}

AWAY = ReconnectPolicy(decide_after=1.0, latch_after=3.0)


class ArmRig(Rig):
    device: TopicJoints | StiffJoints

    @abstractmethod
    def truth(self, joint: str) -> float:
        """Where a joint really is, in radians."""

    def start(self) -> None:
        self.device.open()
        self.until(lambda: self.device.health().online and self.told("online"))
        self.until(lambda: all(reading.good for reading in self.device.states().values()))

    def state(self, joint: str) -> JointState:
        value = self.device.states()[joint].value
        assert value is not None
        return value

    def fresh(self, joint: str) -> JointState:
        now = self.clock.now()
        self.until(lambda: self.device.states()[joint].stamp > now)
        return self.state(joint)

    def at(self, joint: str, angle: float) -> bool:
        return abs(self.state(joint).position - angle) <= TICK and abs(self.truth(joint) - angle) <= TICK


class TopicArm(InSimulatedTime, ArmRig):
    """Moved by trajectories."""

    device: TopicJoints
    command, kind, rates = "/controller/joint_trajectory", TRAJECTORY, True

    def __init__(self) -> None:
        super().__init__()
        self.robot = VirtualJoints("/joint_states", self.command, JOINTS, kind=self.kind, rates=self.rates)
        self.wire = HandWire(self.robot, self.timeline)
        self.device = TopicJoints(
            self.wire.link("arm", report=self.notices.append),
            self.clock,
            self.robot.channels,
            JOINTS,
            away=AWAY,
            report=self.notices.append,
        )

    def truth(self, joint: str) -> float:
        return JOINTS[joint].direction * self.robot.position(JOINTS[joint].ros_name, self.clock.now())

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()

    def close(self) -> None:
        self.device.close()


class ArrayArm(TopicArm):
    """Moved by positions of all."""

    command, kind = "/forward_position_controller/commands", ARRAY


class SinglyArm(TopicArm):
    """Moved by a topic for each joint; its states have no velocities."""

    command, rates = "/{joint}/cmd_pos", False


class TwinArm(InSimulatedTime, ArmRig):
    device: StiffJoints

    def __init__(self) -> None:
        super().__init__()
        self.device = StiffJoints(JOINTS, self.clock, away=AWAY, report=self.notices.append)
        self.timeline.call_every(self.device.STEP_INTERVAL, self.device.step)

    def truth(self, joint: str) -> float:
        return self.device.true_angle(joint, self.clock.now())

    def unplug(self) -> None:
        self.device.plug.unplug()

    def plug_in(self) -> None:
        self.device.plug.plug_in()

    def close(self) -> None:
        self.device.close()


TOPICS = [simulated(TopicArm, "trajectory"), simulated(ArrayArm, "array"), simulated(SinglyArm, "singly")]


@pytest.fixture(params=[*TOPICS, simulated(TwinArm, "twin")])
def rig(request: pytest.FixtureRequest) -> Iterator[ArmRig]:
    rig: ArmRig = request.param()
    yield rig
    rig.close()


@pytest.fixture
def arm(rig: ArmRig) -> ArmRig:
    """A rig whose arm is there."""
    rig.start()
    return rig


@pytest.fixture(params=TOPICS)
def topics(request: pytest.FixtureRequest) -> Iterator[TopicArm]:
    """A rig whose arm is reached by topics, and is there."""
    rig: TopicArm = request.param()
    rig.start()
    yield rig
    rig.close()


def test_ros2_arm_is_online_with_torque_in_the_order_of_the_file(arm: ArmRig) -> None:
    device: Joints = arm.device
    assert device.name == "arm"
    assert list(device.limits) == list(device.states()) == ["wrist", "elbow", "shoulder"]
    assert device.limits["elbow"] == JointLimits(-1.5, 1.5, 4.0)
    health = device.health()
    assert (health.online, health.detail, health.hint) == (True, "", "")
    assert {notice.kind for notice in arm.notices} == {"online"}
    assert (arm.state("elbow").torque, arm.state("elbow").moving) == (True, False)


def test_joints_move_together_to_their_goals(arm: ArmRig) -> None:
    goals = {"elbow": 0.8, "wrist": -0.6}
    assert arm.device.move(goals) == goals
    arm.until(lambda: all(arm.at(joint, goal) for joint, goal in goals.items()))
    arm.until(lambda: not arm.state("elbow").moving)
    assert arm.state("elbow").goal == 0.8
    assert arm.at("shoulder", 0.0)


def test_joint_moves_at_the_requested_speed(arm: ArmRig) -> None:
    began = arm.clock.now()
    arm.device.move({"elbow": -0.5}, speeds={"elbow": 1.0})
    arm.until(lambda: arm.state("elbow").velocity < -0.9)
    assert arm.state("elbow").moving
    arm.until(lambda: arm.at("elbow", -0.5))
    assert 0.45 < arm.clock.now() - began < 0.65


@pytest.mark.parametrize(
    ("goals", "speeds", "complaint"),
    [
        ({"knee": 0.1}, {}, "no joint 'knee'"),
        ({"elbow": 0.1}, {"toe": 1.0}, "no joint 'toe'"),
        ({"elbow": 0.1, "wrist": nan}, {}, "a goal of nan"),
        ({"elbow": 0.1}, {"elbow": inf}, "a speed of inf"),
    ],
)
def test_invalid_move_is_refused_as_a_whole(
    arm: ArmRig, goals: dict[str, float], speeds: dict[str, float], complaint: str
) -> None:
    with pytest.raises(BadRequest, match=complaint):
        arm.device.move(goals, speeds=speeds)
    arm.wait(0.3)
    assert arm.at("elbow", 0.0)


def test_held_joint_stops_and_the_others_move_on(arm: ArmRig) -> None:
    arm.device.move({"shoulder": 2.0, "wrist": 0.8}, speeds={"shoulder": 1.5, "wrist": 1.0})
    arm.until(lambda: arm.state("shoulder").position > 0.3)
    arm.device.hold(["shoulder"])
    arm.until(lambda: not arm.fresh("shoulder").moving)
    held = arm.truth("shoulder")
    assert 0.25 < held < 0.5
    arm.until(lambda: arm.at("wrist", 0.8))
    assert arm.truth("shoulder") == pytest.approx(held, abs=1e-9)
    for refused in (arm.device.hold, arm.device.relax):
        with pytest.raises(BadRequest, match=r"no joint 'knee' \(there are wrist, elbow, shoulder\)"):
            refused(["wrist", "knee"])


def test_repeated_rest_does_not_shift_the_goal(arm: ArmRig) -> None:
    arm.device.move({"elbow": 0.7})
    arm.until(lambda: arm.at("elbow", 0.7) and not arm.state("elbow").moving)
    for _ in range(20):
        arm.device.rest()
        arm.wait(0.05)
    assert arm.state("elbow").goal == pytest.approx(0.7, abs=TICK)
    assert arm.truth("elbow") == pytest.approx(0.7, abs=TICK)


def test_relax_of_a_ros2_arm_holds_and_reports_a_fault(arm: ArmRig) -> None:
    arm.device.move({"shoulder": 2.0}, speeds={"shoulder": 1.5})
    arm.until(lambda: arm.state("shoulder").position > 0.3)
    arm.device.relax()
    arm.until(lambda: not arm.fresh("shoulder").moving)
    assert 0.25 < arm.truth("shoulder") < 0.5
    assert arm.state("shoulder").torque
    (notice,) = [notice for notice in arm.notices if notice.kind == "fault"]
    assert "ROS 2 cannot switch its torque off" in notice.message
    assert notice.hint


def test_ros2_follower_follows_until_commanded(arm: ArmRig) -> None:
    arm.device.follow([Coupling("elbow", "wrist", scale=-0.5, offset=0.1)])
    arm.until(lambda: arm.at("wrist", 0.1))
    for angle in (0.8, -0.6):
        arm.device.move({"elbow": angle}, speeds={"elbow": 1.0})
        arm.until(partial(arm.at, "wrist", 0.1 - 0.5 * angle))
    arm.device.hold(["wrist"])
    arm.device.move({"elbow": 1.0})
    arm.until(lambda: arm.at("elbow", 1.0))
    assert arm.at("wrist", 0.4)
    with pytest.raises(BadRequest, match="cannot follow as well"):
        arm.device.follow([Coupling("elbow", "wrist"), Coupling("wrist", "shoulder")])


def test_unplugged_ros2_arm_gives_the_reason_and_stops(arm: ArmRig) -> None:
    arm.device.move({"elbow": 1.4}, speeds={"elbow": 1.0})
    arm.until(lambda: arm.state("elbow").position > 0.1)
    before = arm.truth("elbow")
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    health = arm.device.health()
    assert (health.online, health.detail != "", health.hint != "") == (False, True, True)
    with pytest.raises(NotConnected, match="arm") as caught:
        arm.device.move({"elbow": 0.1})
    assert caught.value.hint
    arm.wait(0.5)
    rested = arm.truth("elbow")
    assert before <= rested < before + 1.3 * TRAJECTORY_HORIZON
    arm.wait(0.5)
    assert arm.truth("elbow") == rested
    assert {reading.quality for reading in arm.device.states().values()} == {Quality.STALE}
    for _ in range(3):
        arm.device.hold(["elbow"])
    (notice,) = [notice for notice in arm.notices if "could not be held: elbow" in notice.message]
    assert notice.hint


def test_replugged_arm_holds_its_position(arm: ArmRig) -> None:
    arm.device.move({"elbow": 1.2}, speeds={"elbow": 0.5})
    arm.until(lambda: arm.state("elbow").position > 0.1)
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    arm.notices.clear()
    arm.plug_in()
    arm.until(lambda: arm.told("online") and arm.device.states()["elbow"].good)
    arm.until(lambda: not arm.state("elbow").moving)
    here = arm.truth("elbow")
    assert 0.1 < here < 0.6
    arm.wait(0.5)
    assert arm.truth("elbow") == pytest.approx(here, abs=TICK)
    arm.device.move({"elbow": 0.0})
    arm.until(lambda: arm.at("elbow", 0.0))


def test_device_is_latched_after_a_long_disconnect(arm: ArmRig) -> None:
    arm.device.follow([Coupling("elbow", "wrist")])
    arm.unplug()
    arm.wait(4.0)
    arm.plug_in()
    arm.until(lambda: arm.device.health().reconnected_at is not None)
    arm.until(lambda: arm.device.health().online)
    with pytest.raises(DeviceFault, match="arm: stopped: it was away for"):
        arm.device.move({"elbow": 0.5})
    arm.device.enable()
    arm.device.move({"elbow": 0.5})
    arm.until(lambda: arm.at("elbow", 0.5))
    assert arm.at("wrist", 0.0), "what it followed before is not in force"


def test_closed_ros2_arm_stops_and_moves_again_once_opened(arm: ArmRig) -> None:
    arm.device.move({"shoulder": 2.5}, speeds={"shoulder": 1.0})
    arm.until(lambda: arm.state("shoulder").position > 0.3)
    arm.device.close()
    arm.device.close()
    arm.wait(1.0)
    assert 0.25 < arm.truth("shoulder") < 0.5
    arm.start()
    arm.device.move({"shoulder": 0.0})
    arm.until(lambda: arm.at("shoulder", 0.0))


def test_killed_program_stops_the_arm_within_0_3_seconds(topics: TopicArm) -> None:
    topics.device.move({"shoulder": 2.5}, speeds={"shoulder": 1.0})
    topics.until(lambda: topics.state("shoulder").position > 0.3)
    before = topics.truth("shoulder")
    topics.wire.holder = None  # nothing is said any more, not even goodbye
    topics.wire.unplug()
    topics.wait(TRAJECTORY_HORIZON + 0.02)
    rested = topics.truth("shoulder")
    topics.wait(2.0)
    assert topics.truth("shoulder") == pytest.approx(rested, abs=1e-9)
    assert rested - before <= 1.1 * TRAJECTORY_HORIZON


def test_arm_without_joint_states_stops(topics: TopicArm) -> None:
    topics.device.move({"shoulder": 2.5}, speeds={"shoulder": 1.0})
    topics.until(lambda: topics.state("shoulder").position > 0.3)
    before, topics.robot.is_silent = topics.truth("shoulder"), True
    topics.until(lambda: topics.told("offline"))
    topics.wait(1.0)
    assert topics.truth("shoulder") - before <= OFFLINE_TIMEOUT + TRAJECTORY_HORIZON + 0.05
    assert "no states of arm_3, elbow_joint, shoulder" in topics.device.health().detail
    topics.robot.is_silent = False
    topics.until(lambda: topics.device.health().online)
    here = topics.truth("shoulder")
    topics.wait(0.5)
    assert topics.truth("shoulder") == pytest.approx(here, abs=1e-9)


def test_malformed_messages_are_counted_and_ignored(topics: TopicArm) -> None:
    before = topics.device.health().counters["malformed"]
    wrong = [b"", b"\xff" * 300]
    wrong += [types().encode(JOINT_STATE, {"name": ["shoulder"], "position": [value]}) for value in (inf, 1e9)]
    wrong.append(types().encode(JOINT_STATE, {"name": ["shoulder"], "position": []}))
    for payload in wrong:
        topics.wire.take(frame(0, payload))
    topics.wait(0.1)
    assert topics.device.health().counters["malformed"] == before + len(wrong)
    assert topics.at("shoulder", 0.0)


def test_missing_trajectory_subscriber_is_reported_with_its_topic() -> None:
    rig = TopicArm()
    rig.robot._kind = lambda channel: "" if channel else JOINT_STATE  # type: ignore[method-assign]
    rig.device.open()
    rig.wait(1.0)
    detail = rig.device.health().detail
    assert "arm: no subscriber of /controller/joint_trajectory (trajectory_msgs/msg/JointTrajectory or" in detail
    rig.close()


@pytest.mark.parametrize("grip", [0.0, -1.0])
def test_blocked_or_reversed_joint_is_refused_and_held(topics: TopicArm, grip: float) -> None:
    topics.robot.shafts["elbow_joint"].motion_factor = grip
    began = topics.clock.now()
    refused = []

    def moved() -> bool:
        try:
            topics.device.move({"elbow": 1.2}, speeds={"elbow": 1.0})
        except DeviceFault as error:
            refused.append(str(error))
        return bool(refused)

    topics.until(moved)
    assert topics.clock.now() - began < 1.6
    assert refused[0].startswith("joint elbow: commanded 1.20 rad, ")
    assert topics.told("fault", "joint elbow: commanded")
    state = topics.state("elbow")
    assert state.blocked == refused[0]
    topics.robot.shafts["elbow_joint"].motion_factor = 1.0
    topics.wait(0.5)
    there = topics.truth("elbow")
    topics.wait(1.0)
    assert topics.truth("elbow") == pytest.approx(there, abs=1e-3)
    topics.device.move({"shoulder": 0.5})
    topics.until(lambda: topics.at("shoulder", 0.5))
    topics.device.hold()
    topics.device.move({"elbow": 1.2})
    topics.until(lambda: topics.at("elbow", 1.2))


def reverse(rig: ArmRig, *, ended: bool) -> None:
    """Have the motor of the elbow turn the wrong way, or end that."""
    if isinstance(rig, TopicArm):
        rig.robot.shafts["elbow_joint"].motion_factor = 1.0 if ended else -1.0
    elif isinstance(rig, TwinArm):
        rig.device.fail("elbow", "" if ended else "reversed")


@pytest.mark.parametrize("held", [False, True])
def test_runaway_joint_stops_the_arm_without_a_torque_report(arm: ArmRig, held: bool) -> None:
    reverse(arm, ended=False)
    with pytest.raises(DeviceFault):  # noqa: PT012 - sent at each tick, as leaves do
        for _ in range(60):
            arm.device.move({"elbow": 1.2}, speeds={"elbow": 1.0})
            arm.device.move({"shoulder": 2.5}, speeds={"shoulder": 0.3})
            arm.wait(0.05)
    if held:  # as the leaf does that has failed
        arm.device.hold(["elbow"])
    arm.until(lambda: arm.told("fault", "runs away"))
    (notice,) = [each for each in arm.notices if "runs away" in each.message]
    assert "torque is switched off" not in notice.message
    assert "ROS 2 cannot switch its torque off" in notice.message
    assert notice.hint.startswith("switch the power of its motor off")
    assert "joint elbow: runs away" in arm.device.latched
    with pytest.raises(DeviceFault, match="runs away"):
        arm.device.move({"wrist": 0.3})
    arm.wait(0.5)
    there = arm.truth("shoulder")
    arm.wait(1.0)
    assert arm.truth("shoulder") == pytest.approx(there, abs=TICK)
    reverse(arm, ended=True)
    arm.wait(3.0)
    arm.device.enable()
    arm.device.move({"elbow": 0.5})
    arm.until(lambda: arm.at("elbow", 0.5))
