"""Arm, head and voice of a robot of ROS 2 behind a router of Zenoh on loopback: found, moved, lost, found again."""

from collections.abc import Callable, Iterator
from math import radians

import pytest

from config.diagnostics import InvalidFileError, SourceText
from drivers.api import DeviceStatus, HeadPose, Pose2D
from drivers.api.driver import DriverContext
from drivers.clock import ManualClock, SystemClock
from drivers.errors import BadRequest
from drivers.ros2.declared import (
    Ros2ArmKeys,
    Ros2AxisKeys,
    Ros2HeadKeys,
    Ros2JointKeys,
    Ros2VoiceKeys,
    ZenohKeys,
)
from drivers.ros2.graph import Ros2Graph
from drivers.ros2.joints import TopicJoints
from drivers.ros2.joints_twin import arm as twin_arm
from drivers.ros2.joints_twin import head as twin_head
from drivers.ros2.make import Ros2Head, Ros2Voice
from drivers.ros2.make import arm as make_arm
from drivers.ros2.make import graph as make_graph
from drivers.ros2.make import head as make_head
from drivers.ros2.make import voice as make_voice
from drivers.ros2.virtual import Ros2Terminal, arm, graph, head
from drivers.sim.context import SimContext
from drivers.sim.timeline import Timeline
from missions.library.drivers import parse_robot
from tests.drivers.ros2.ear import VirtualEar
from tests.waiting import wait_until

ARM = Ros2ArmKeys(
    command="arm_controller/joint_trajectory",
    joints={"elbow": Ros2JointKeys(joint="arm_2_joint", limits=(-1.5, 1.5), speed=1.0, reverse=True)},
)
HEAD = Ros2HeadKeys(
    command="{joint}/command",
    pan=Ros2AxisKeys(joint="head_1_joint", limits=(-1.2, 1.2)),
    tilt=Ros2AxisKeys(joint="head_2_joint", limits=(-0.5, 0.5), reverse=True),
)


class Robot:
    """The virtual parts of a robot in a namespace, and their real drivers."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.told: list[DeviceStatus] = []
        nodes = ZenohKeys(namespace="/tiago", domain=7)
        stage = SimContext(self.clock, None, lambda _: Pose2D(0.0, 0.0, 0.0), part_keys={"ros2": nodes})
        plugged = graph(nodes, stage)
        assert isinstance(plugged.port, Ros2Terminal)
        self.terminal = plugged.port
        beside = SimContext(self.clock, None, stage.pose, part_keys=stage.part_keys, parts={"ros2": plugged})
        self.virtual_arm, self.virtual_head = arm(ARM, beside), head(HEAD, beside)
        self.ear = VirtualEar("/tiago/say")
        self.terminal.devices.append(self.ear)
        keys = ZenohKeys(router=self.terminal.path, namespace="/tiago", domain=7)
        self.graph: Ros2Graph = make_graph(keys, DriverContext(self.clock))
        self.woken = list[None]()
        parts = {"ros2": self.graph}
        site = DriverContext(
            self.clock, report=self.told.append, on_change=lambda: self.woken.append(None), needed_parts=parts
        )
        self.arm: TopicJoints = make_arm(ARM, site)
        self.head: Ros2Head = make_head(HEAD, site)
        self.voice: Ros2Voice = make_voice(Ros2VoiceKeys(), site)
        self.devices = (self.arm, self.head, self.voice, self.graph)

    def open(self) -> None:
        self.terminal.open()
        for device in self.devices:
            device.open()
        wait_until(lambda: all(device.health().online for device in self.devices))

    def truly(self) -> float:
        """Where the elbow really is."""
        now, state = self.clock.now(), self.virtual_arm.state
        assert state is not None
        found = self.terminal.call_paused(lambda: state(now))
        assert isinstance(found, dict)
        return float(found["elbow"])

    def looks(self) -> HeadPose:
        """Where the head truly looks."""
        now, looks = self.clock.now(), self.virtual_head.head_pose
        assert looks is not None
        return self.terminal.call_paused(lambda: looks(now))

    def close(self) -> None:
        for device in self.devices:
            device.rest()
        for device in self.devices:
            device.close()
        self.terminal.close()


@pytest.fixture
def robot() -> Iterator[Robot]:
    robot = Robot()
    yield robot
    robot.close()


@pytest.mark.real_time
def test_arm_head_and_voice_follow_commands(robot: Robot) -> None:
    robot.open()
    robot.arm.move({"elbow": 0.4})
    robot.head.look(HeadPose(0.5, 0.2))
    robot.voice.say("hello")
    wait_until(lambda: abs(robot.truly() - 0.4) < 0.01)
    wait_until(lambda: abs(robot.looks().pan - 0.5) < 0.01 and abs(robot.looks().tilt - 0.2) < 0.01)
    wait_until(lambda: robot.ear.said == ["hello"])
    pose = robot.head.pose().value
    assert pose is not None
    assert pose.tilt == pytest.approx(0.2, abs=0.02)


@pytest.mark.real_time
def test_reports_of_resting_joints_wake_no_mission(robot: Robot) -> None:
    robot.open()
    before, told = len(robot.woken), robot.arm.health().counters["reports"]
    wait_until(lambda: robot.arm.health().counters["reports"] >= told + 20)
    assert len(robot.woken) - before <= 2


@pytest.mark.real_time
def test_arm_stops_without_its_router_and_stays_until_commanded(robot: Robot) -> None:
    robot.open()
    robot.arm.move({"elbow": 1.4}, speeds={"elbow": 0.3})
    wait_until(lambda: robot.truly() > 0.05)
    robot.terminal.unplug()
    gone = robot.truly()
    wait_until(lambda: not any(device.health().online for device in robot.devices))
    rested = robot.truly()
    assert rested - gone < 0.3 * 0.3 + 0.05
    robot.terminal.replug()
    wait_until(lambda: all(device.health().online for device in robot.devices))
    assert robot.truly() == pytest.approx(rested, abs=0.1)
    robot.arm.enable()
    robot.arm.move({"elbow": 0.0})
    wait_until(lambda: abs(robot.truly()) < 0.01)


def test_continuous_joints_have_twins() -> None:
    timeline = Timeline()
    stage = SimContext(timeline.clock, None, lambda _: Pose2D(0.0, 0.0, 0.0), part_name="head")
    turning = Ros2HeadKeys(pan=Ros2AxisKeys(joint="one"), tilt=Ros2AxisKeys(joint="two"))
    joints = Ros2ArmKeys(joints={"a": Ros2JointKeys(), "b": Ros2JointKeys()})
    for twin in (twin_arm(joints, stage), twin_head(turning, stage)):
        twin.open()
        timeline.call_every(twin.STEP_INTERVAL, twin.step)
        timeline.run_until(timeline.clock.now() + 0.1)
        assert twin.health().online
        twin.close()


ROBOT = """
robot: tiago
ros2:
  router: tcp/127.0.0.1:7447
arm:
  driver: ros2
  joints:
    elbow: {limits: [-90 deg, 90 deg]}
    wrist: {joint: JOINT, limits: [-90 deg, LIMIT]}
head:
  driver: ros2
  pan: {joint: head_1_joint}
  tilt: {joint: TILT, limits: [-30 deg, 30 deg]}
voice:
  driver: ros2
  topic: /tts
"""


@pytest.mark.parametrize(
    ("joint", "limit", "tilt", "wrong"),
    [
        ("wrist_joint", "90 deg", "head_2_joint", ""),
        ("elbow", "90 deg", "head_2_joint", "joint 'wrist' is 'elbow' of ROS 2, as 'elbow' is"),
        ("wrist_joint", "200 deg", "head_2_joint", "within -180 deg and 180 deg"),
        ("wrist_joint", "90 deg", "head_1_joint", "'pan' and 'tilt' are both joint 'head_1_joint'"),
    ],
)
def test_joint_limits_of_a_robot_file_are_checked(joint: str, limit: str, tilt: str, wrong: str) -> None:
    text = ROBOT.replace("JOINT", joint).replace("LIMIT", limit).replace("TILT", tilt)
    if not wrong:
        found = parse_robot(SourceText("tiago.yaml", text)).keys(Ros2ArmKeys)
        assert found is not None
        assert found.limits["wrist"].upper == radians(90)
        return
    with pytest.raises(InvalidFileError) as caught:
        parse_robot(SourceText("tiago.yaml", text))
    assert any(wrong in str(fault) for fault in caught.value.diagnostics)


def test_wildcard_topic_in_a_robot_file_is_an_error() -> None:
    base = "base: {driver: ros2, cmd_vel: /cmd*/**, odom: odometry/filtered, dock: 'a b'}"
    with pytest.raises(InvalidFileError) as caught:
        parse_robot(SourceText("wild.yaml", f"robot: wild\nros2: {{driver: zenoh, namespace: /*}}\n{base}\n"))
    found = [str(fault) for fault in caught.value.diagnostics]
    assert len(found) == 3
    assert "wild.yaml:3:31: 'cmd_vel': '/cmd*/**' is not a valid topic name" in "\n".join(found)


@pytest.mark.parametrize(("command", "there"), [("{joint}/command", "left arm"), ("arm/*", "left_arm")])
def test_joint_name_with_a_wildcard_is_an_error(command: str, there: str) -> None:
    arm = f"arm: {{driver: ros2, command: '{command}', joints: {{wrist: {{joint: {there}}}}}}}"
    with pytest.raises(InvalidFileError, match=r"cannot stand in a topic|is not a valid topic name"):
        parse_robot(SourceText("wild.yaml", f"robot: wild\nros2: {{driver: zenoh}}\n{arm}\n"))


@pytest.mark.parametrize(
    "asked",
    [
        lambda it: it.publish("/cmd*", "std_msgs/msg/String", "{}"),
        lambda it: it.call("/robot1/**", "std_srvs/srv/Trigger", "{}"),
        lambda it: it.begin("dock it", "", "{}"),
        lambda it: it.latest("odom?"),
    ],
)
def test_wildcard_topic_of_a_mission_is_refused(asked: Callable[[Ros2Graph], object]) -> None:
    nodes = make_graph(ZenohKeys(), DriverContext(ManualClock()))
    with pytest.raises(BadRequest, match="is not a valid topic name"):
        asked(nodes)
