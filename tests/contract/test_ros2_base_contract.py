"""What ``drivers.api.Base`` promises, kept by a base of ROS 2 over its topics: with Twist, and with TwistStamped."""

import math
from collections.abc import Iterator
from dataclasses import replace
from math import inf, nan, radians

import pytest

from behaviours.driving.motion import DriveLeaf
from behaviours.leaf import FAILURE, RUNNING
from drivers.api import ZERO_VELOCITY, BaseLimits, Lamp, Pose2D, Sides
from drivers.base.diff_drive import DiffDriveBase
from drivers.clock import ManualClock
from drivers.ros2 import base as create3
from drivers.ros2.base import Ros2BaseProtocol
from drivers.ros2.declared import Ros2BaseKeys
from drivers.ros2.types import types
from drivers.ros2.virtual_topics import VirtualRos2Base
from drivers.ros2.wire import frame
from drivers.sim.base_body import NO_SIDES, BaseBody
from drivers.sim.world_objects import BackupLimit
from drivers.transport.link import SerialLink
from missions.plugins.testing.recorders import LeafTestBench
from tests.contract.rigs import InSimulatedTime, simulated
from tests.contract.test_base_contract import (  # noqa: F401 - all that a base promises
    BaseRig,
    Room,
    test_a_bumper_forbids_forward_but_not_back_and_round,
    test_a_person_has_the_wheels_before_the_mission_and_a_while_after,
    test_base_accelerates_gently_and_keeps_its_velocity,
    test_base_at_a_cliff_only_drives_straight_back,
    test_base_backs_off_after_a_bump,
    test_base_plays_sounds_and_refuses_unknown_lights,
    test_base_with_dropped_wheels_does_not_drive,
    test_cliff_stops_a_forward_drive,
    test_closed_base_stops_and_drives_again_once_opened,
    test_command_expires_without_renewal,
    test_command_with_source_safety_is_refused,
    test_heading_continues_beyond_a_full_turn,
    test_latched_base_refuses_all_commands_until_enabled,
    test_opened_base_comes_online_with_one_notice,
    test_past_heading_is_interpolated,
    test_replugged_base_is_online_at_rest_with_its_pose,
    test_sounds_and_lights_of_an_unplugged_base_are_not_connected,
    test_stop_is_at_once_and_without_a_ramp,
    test_too_fast_velocity_is_scaled_down_as_a_whole,
    test_unopened_device_is_offline_and_has_no_readings,
    test_unplugged_base_gives_the_reason_refuses_commands_and_stops,
    test_velocity_that_is_not_finite_is_refused,
    test_wall_stops_the_base_which_can_back_off,
)
from tests.drivers.cranked import HandWire

TOPICS = {
    "cmd_vel": "/cmd_vel",
    "odom": "/odom",
    "battery": "/battery_state",
    "hazards": "/hazard_detection",
    "dock": "/dock_status",
    "lights": "/cmd_lightring",
    "sounds": "/cmd_audio",
}


class Topics(InSimulatedTime, BaseRig):
    stamped = False
    topics = TOPICS

    def __init__(self) -> None:
        super().__init__()
        origin = Pose2D(3.0, -2.0, radians(130))  # it has driven before
        self.robot = VirtualRos2Base(BaseBody(ground=Room()), self.topics, stamped=self.stamped, origin=origin)
        self.wire = HandWire(self.robot, self.timeline)
        self.halts = 0
        self.entrusted = False
        self.start_told: list[Pose2D] = []
        protocol = Ros2BaseProtocol(
            "base",
            self.clock,
            self.robot.channels,
            list(self.topics),
            BaseLimits(0.5, 1.9, 0.5, 3.5),
            on_origin=lambda pose, _: self.start_told.append(pose),
            is_goal_active=lambda: self.entrusted,
        )
        self.device = DiffDriveBase(
            self.wire.link("base", report=self.notices.append),
            self.clock,
            protocol,
            on_stop=self.halted,
            report=self.notices.append,
            changed=self.changed,
        )

    def halted(self) -> None:
        self.halts += 1

    def truth(self) -> Pose2D:
        return self.robot.pose(self.clock.now())

    def touch(self, bumper: Sides = NO_SIDES, cliff: Sides = NO_SIDES) -> None:
        self.robot.bumper, self.robot.cliff = bumper, cliff

    def lift(self, *, up: bool) -> None:
        self.robot.wheel_drop = Sides(left=up, right=up)

    def shines(self, number: int) -> Lamp:
        return self.robot.lamps[number - 1]

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()

    def close(self) -> None:
        self.device.close()


class Stamped(Topics):
    stamped = True


@pytest.fixture(params=[simulated(Topics, "twist"), simulated(Stamped, "twist stamped")])
def rig(request: pytest.FixtureRequest) -> Iterator[Topics]:
    rig: Topics = request.param()
    yield rig
    rig.close()


@pytest.fixture
def base(rig: Topics) -> Topics:
    """A rig whose base is there."""
    rig.start()
    return rig


def test_base_pose_starts_at_zero_with_standard_directions(base: Topics) -> None:
    assert base.state().pose == Pose2D(0.0, 0.0, 0.0)
    base.drive(0.2, 0.0, lambda: base.state().pose.x > 0.06)
    assert base.truth().x > 0.04
    assert base.state().pose.y == pytest.approx(0.0, abs=1e-3)
    base.device.stop()
    base.drive(0.0, 1.0, lambda: base.state().pose.heading > 0.4)
    assert base.truth().heading > 0.3
    assert base.start_told[0] == base.robot.origin


@pytest.mark.parametrize("there", [(), ("sounds",), ("lights",), ("sounds", "lights")], ids=str)
def test_ros2_base_capabilities_depend_on_its_topics(there: tuple[str, ...]) -> None:
    topics = [topic for topic in TOPICS if topic not in {"sounds", "lights"} or topic in there]
    named = {topic: TOPICS[topic] if topic in there else "" for topic in ("sounds", "lights")}
    keys = Ros2BaseKeys(sounds=named["sounds"], lights=named["lights"])
    protocol = Ros2BaseProtocol("base", ManualClock(), [], topics, BaseLimits(0.5, 1.9, 0.5, 3.5))
    device = DiffDriveBase(SerialLink("base", "", 1), ManualClock(), protocol)
    assert keys.capabilities == {*there}
    assert {name for name in ("sounds", "lights", "legs") if getattr(device, name) is not None} == {*there}


def test_idle_ros2_base_publishes_no_velocity(base: Topics) -> None:
    base.drive(0.2, 0.0, lambda: base.state().velocity.linear > 0.1)
    base.wait(2.0)
    said = len(base.robot.received_velocities)
    assert [velocity for _, velocity in base.robot.received_velocities[-10:]] == [ZERO_VELOCITY] * 10
    base.wait(5.0)
    assert len(base.robot.received_velocities) == said


def test_latched_ros2_base_repeats_zero_and_cancels_goals(base: Topics) -> None:
    base.wait(2.0)
    said, halts = len(base.robot.received_velocities), base.halts
    base.device.latch("somebody shouted")
    base.wait(2.0)
    assert base.halts > halts
    assert len(base.robot.received_velocities) - said >= 10


def test_reset_of_the_odometry_origin_does_not_move_the_pose(base: Topics) -> None:
    base.drive(0.2, 0.0, lambda: base.state().pose.x > 0.1)
    base.comes_to_rest()
    base.wait(0.1)
    before = base.state().pose
    base.robot.origin = Pose2D(40.0, 7.0, -1.0)
    base.wait(0.2)
    assert base.state().pose.x == pytest.approx(before.x, abs=1e-6)
    assert base.state().pose.heading == pytest.approx(before.heading, abs=1e-6)
    base.drive(0.2, 0.0, lambda: base.state().pose.x > before.x + 0.1)
    assert base.state().pose.y == pytest.approx(before.y, abs=2e-3)


def test_stalled_link_stops_the_base_within_0_7_seconds(base: Topics) -> None:
    base.drive(0.2, 0.0, lambda: base.state().velocity.linear > 0.19)
    base.robot.is_stalled = True
    began = base.clock.now()
    base.until(lambda: base.robot.body.velocity == ZERO_VELOCITY)
    assert base.clock.now() - began < 0.7
    base.until(lambda: not base.device.health().online)
    base.robot.is_stalled = False
    base.until(lambda: base.device.health().online)
    base.wait(0.5)
    assert base.stands(), "what was commanded before is not in force"


def test_malformed_messages_are_counted_and_ignored(base: Topics) -> None:
    for channel in range(-1, len(TOPICS)):
        for payload in (b"", b"\0\1\0\0", b"\xff" * 900, bytes(700)):
            base.wire.take(frame(channel % 0x10000, payload))
    base.wait(0.1)
    assert base.device.health().online
    assert base.device.health().counters["malformed"] > 10


def test_missing_subscriber_is_reported_with_its_topic() -> None:
    rig = Topics()
    rig.robot._kind = lambda channel: "" if channel == 0 else VirtualRos2Base._kind(rig.robot, channel)  # type: ignore[method-assign]
    rig.device.open()
    rig.wait(1.0)
    health = rig.device.health()
    assert not health.online
    assert "no subscriber of /cmd_vel (geometry_msgs/msg/Twist or geometry_msgs/msg/TwistStamped)" in health.detail
    assert "mission ros2 topics" in health.hint
    rig.close()


def test_odometry_of_no_robot_is_counted_and_nothing_follows(base: Topics) -> None:
    before, counted = base.state().pose, base.device.health().counters["malformed"]
    for x in (1e200, 1e6, inf, nan):
        told = {"pose": {"pose": {"position": {"x": x}, "orientation": {"w": 1.0}}}}
        base.wire.take(frame(list(TOPICS).index("odom"), types().encode("nav_msgs/msg/Odometry", told)))
    base.wait(0.1)
    assert base.state().pose == before
    assert base.device.health().counters["malformed"] >= counted + 4


def test_hazards_are_in_the_state_and_blocking_ones_are_faults(base: Topics) -> None:
    base.robot.hazards = [(create3.STALL, "wheel_left"), (create3.OBJECT_PROXIMITY, "ir_intensity_left"), (9, "")]
    base.wait(0.1)
    assert base.state().hazards == {"stall left", "object near left", "hazard of type 9"}
    faults = [(notice.message, notice.hint) for notice in base.notices if notice.kind == "fault"]
    assert ("stall left: a wheel is blocked", "check for objects that block the wheels") in faults
    assert any("hazard of type 9" in fault and "mission ros2 echo" in hint for fault, hint in faults)
    assert not any("object near" in fault for fault, _ in faults)
    base.robot.hazards = []
    base.wait(0.1)
    assert base.state().hazards == frozenset()


def test_a_hazard_between_two_reports_of_odometry_is_not_missed(base: Topics) -> None:
    number = list(TOPICS).index("hazards")
    seen = {"detections": [{"type": create3.BACKUP_LIMIT, "header": {"frame_id": "base_link"}}]}
    states = []
    base.wire.take(frame(number, types().encode("irobot_create_msgs/msg/HazardDetectionVector", seen)))
    base.wire.take(frame(number, types().encode("irobot_create_msgs/msg/HazardDetectionVector", {"detections": []})))
    for _ in range(5):
        base.wait(0.02)
        states.append(base.state().hazards)
    assert {"backup limit"} in states
    assert states[-1] == frozenset()


def test_backup_limit_stops_the_base_until_it_drives_forwards(base: Topics) -> None:
    base.robot.body.backup_limit = BackupLimit(0.025)
    started = base.clock.now()
    base.drive(-0.2, 0.0, lambda: base.clock.now() > started + 1.5)
    assert base.state().hazards == {"backup limit"}
    assert -0.09 < base.truth().x < -0.02
    assert base.state().velocity == ZERO_VELOCITY
    assert any("backup limit" in notice.message and "safety_override" in notice.hint for notice in base.notices)
    there = base.truth().x
    base.drive(0.2, 0.0, lambda: base.truth().x > there + 0.1)
    base.wait(0.5)
    assert base.state().hazards == frozenset()
    base.drive(-0.2, 0.0, lambda: base.truth().x < there + 0.05)


def test_base_with_active_e_stop_is_reported_by_the_monitor(base: Topics) -> None:
    base.robot.body.e_stop = True
    started, notices = base.clock.now(), len(base.notices)
    base.drive(0.2, 0.5, lambda: base.clock.now() > started + 1.5)
    assert base.truth() == Pose2D(0.0, 0.0, 0.0)
    assert [(notice.kind, "commanded 0.2 m/s" in notice.message) for notice in base.notices[notices:]] == [
        ("fault", True)
    ]


def test_backup_limit_fails_the_drive_leaf_within_two_seconds(base: Topics) -> None:
    base.robot.body.backup_limit = BackupLimit(0.025)
    bench = LeafTestBench(base.clock)  # type: ignore[arg-type]
    bench.robot = replace(bench.robot, base_part=base.device)
    leaf = bench.put(DriveLeaf("drive"), distance=-0.3)
    began = base.clock.now()
    while bench.tick(leaf, after=0.0) is RUNNING:
        base.wait(0.05)
    assert base.clock.now() - began < 2.0
    assert leaf.status is FAILURE
    assert "backup limit" in leaf.feedback_message
    assert any("safety_override" in notice.hint for notice in base.notices if "commanded" in notice.message)


class Odometry:
    """Odometry of a base that stands, as messages: its gyro turns at ``rate``; ``stamped`` ones tell when."""

    def __init__(self, base: Topics, *, stamped: bool) -> None:
        self.base, self.stamped = base, stamped
        self.measured_at, self.heading = 0.0, 0.0
        base.robot.odometry_interval = inf
        base.robot._odometry_due = inf

    def tell(self, rate: float, seconds: float, *, arrivals: float) -> None:
        """Measure for 20 ms steps, and send two messages ``arrivals`` seconds apart each 40 ms."""
        timeline = self.base.timeline
        for _ in range(round(seconds / 0.04)):
            began = self.base.clock.now()
            for number in range(2):
                timeline.run_until(began + 0.04 - arrivals * (1 - number))
                self.measured_at += 0.02
                self.heading += rate * 0.02
                self._send(rate)

    def _send(self, rate: float) -> None:
        turned = {"z": math.sin(self.heading / 2), "w": math.cos(self.heading / 2)}
        stamp = {"sec": int(self.measured_at), "nanosec": int(self.measured_at % 1 * 1e9)}
        told = {
            "header": {"frame_id": "odom", **({"stamp": stamp} if self.stamped else {})},
            "pose": {"pose": {"orientation": turned}},
            "twist": {"twist": {"angular": {"z": rate}}},
        }
        self.base.wire.take(frame(list(TOPICS).index("odom"), types().encode("nav_msgs/msg/Odometry", told)))


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize("arrivals", [0.001, 0.007, 0.02])
def test_gyro_drift_is_learnt_from_paired_odometry(base: Topics, stamped: bool, arrivals: float) -> None:
    odometry = Odometry(base, stamped=stamped)
    odometry.tell(0.015, 4.0, arrivals=arrivals)
    state = base.device.state().value
    assert state is not None
    assert not state.settling
    assert state.velocity.angular == 0.0
    odometry.tell(0.015, 4.0, arrivals=arrivals)
    after = base.device.state().value
    assert after is not None
    assert after.pose.heading == pytest.approx(state.pose.heading, abs=0.001)


def test_slow_turn_by_another_node_is_not_learnt_as_drift(base: Topics) -> None:
    odometry = Odometry(base, stamped=True)
    odometry.tell(0.0, 5.0, arrivals=0.02)
    before = base.device.state().value
    odometry.tell(0.1, 5.0, arrivals=0.02)
    after = base.device.state().value
    assert before is not None
    assert after is not None
    assert after.pose.heading - before.pose.heading == pytest.approx(0.5, abs=0.01)
    assert after.velocity.angular == pytest.approx(0.1, abs=0.01)


def test_drift_is_not_learnt_during_a_goal_of_another_node(base: Topics) -> None:
    base.entrusted = True
    odometry = Odometry(base, stamped=True)
    odometry.tell(0.1, 5.0, arrivals=0.02)
    state = base.device.state().value
    assert state is not None
    assert state.velocity.angular == pytest.approx(0.1)
    assert not state.settling
