"""What ``drivers.api.Head`` promises, kept on wires, a bus and topics of ROS 2, and by twins."""

from abc import abstractmethod
from collections.abc import Iterator
from itertools import pairwise
from math import inf, nan, radians
from typing import Protocol

import pytest

from drivers.api import HEAD_ACCELERATION, Head, HeadPose, JointLimits, Quality
from drivers.arduino.board import ArduinoBoard
from drivers.arduino.driver import ArduinoHead
from drivers.arduino.virtual import VirtualRodney
from drivers.errors import BadRequest, NotConnected
from drivers.head.axis import ServoAxis
from drivers.head.guardian_head import GuardianHead
from drivers.head.joints_head import JointAxis, NeckDriver
from drivers.head.pantilt import Trimmable
from drivers.head.twin import ServoHeadTwin
from drivers.ros2.joint_topics import ARRAY, TRAJECTORY, TopicJoint
from drivers.ros2.joints import TopicJoints
from drivers.ros2.joints_twin import Ros2HeadTwin as TopicHeadTwin
from drivers.ros2.joints_twin import StiffJoints
from drivers.ros2.make import Ros2Head
from drivers.ros2.virtual_joints import VirtualJoints
from drivers.servos.bus import ServoBus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import JointSpec
from drivers.servos.twin import JointsTwin, NeckTwin
from drivers.virtual.guardian import VirtualServos
from tests.contract.rigs import InSimulatedTime, Rig, simulated
from tests.drivers.chains import chain
from tests.drivers.cranked import PERIOD, HandWire, by_hand
from tests.drivers.lines import DirectLine

PAN = ServoAxis(0, radians(-80), radians(80), start=90)
TILT = ServoAxis(1, radians(-60), radians(20), flip=True, start=120)
SPEED = radians(120)
START = HeadPose(radians(10), radians(-5))
DEGREE = radians(1)


SPECS = {
    "neck_pan": JointSpec(1, lower=radians(-90), upper=radians(90), speed=3.0),
    "neck_tilt": JointSpec(2, lower=radians(-70), upper=radians(70), speed=3.0, direction=-1),
}
NECK = (JointAxis("neck_pan", PAN.lower, PAN.upper), JointAxis("neck_tilt", TILT.lower, TILT.upper))


class TrimmableHead(Head, Trimmable, Protocol):
    """What every head is."""


class HeadRig(Rig):
    device: TrimmableHead
    awake = HeadPose(0.0, radians(-30))
    """Where its servos stand when it is found: the sketch starts its second servo at 120 degrees, which is 30 up."""

    @abstractmethod
    def truth(self) -> HeadPose:
        """Where its servos really stand."""

    def start(self) -> None:
        """Open it, and wait until it looks where it is to look at first."""
        self.device.open()
        self.until(lambda: self.device.health().online and self.told("online"))
        self.until(lambda: self.looks(START))

    def pose(self) -> HeadPose:
        value = self.device.pose().value
        assert value is not None
        return value

    def looks(self, pose: HeadPose) -> bool:
        """Whether it looks there, by its own account and in truth, to a degree."""
        truth = self.truth()
        known = self.device.pose()
        return known.good and all(
            abs(place.pan - pose.pan) <= DEGREE and abs(place.tilt - pose.tilt) <= DEGREE
            for place in (truth, known.value or truth)
        )


class WireHead(InSimulatedTime, HeadRig):
    def __init__(self) -> None:
        super().__init__()
        self.rodney = VirtualRodney()
        self.wire = HandWire(self.rodney, self.timeline)
        link = self.wire.link("head", report=self.notices.append)
        board = ArduinoBoard(link, self.clock, boot_delay=0.0, report=self.notices.append)
        self.device = ArduinoHead(board, self.clock, pan=PAN, tilt=TILT, speed=SPEED, start=START, changed=self.changed)

    def truth(self) -> HeadPose:
        now = self.clock.now()
        return HeadPose(PAN.to_radians(self.rodney.angle(0, now)), TILT.to_radians(self.rodney.angle(1, now)))

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()

    def close(self) -> None:
        self.device.close()


class KeptHead(InSimulatedTime, HeadRig):
    def __init__(self) -> None:
        super().__init__()
        self.servos = VirtualServos((90, 120))
        self.wire = HandWire(self.servos, self.timeline)
        self.device = GuardianHead(
            self.wire.link("head", report=self.notices.append),
            self.clock,
            pan=PAN,
            tilt=TILT,
            speed=SPEED,
            start=START,
            report=self.notices.append,
            changed=self.changed,
        )

    def truth(self) -> HeadPose:
        now = self.clock.now()
        return HeadPose(PAN.to_radians(self.servos.angle(0, now)), TILT.to_radians(self.servos.angle(1, now)))

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()

    def close(self) -> None:
        self.device.close()


class TwinHead(InSimulatedTime, HeadRig):
    def __init__(self) -> None:
        super().__init__()
        self.twin = ServoHeadTwin(
            self.clock,
            pan=PAN,
            tilt=TILT,
            speed=SPEED,
            start=START,
            report=self.notices.append,
            changed=self.changed,
        )
        self.device = self.twin
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def truth(self) -> HeadPose:
        return self.twin.true_pose(self.clock.now())

    def unplug(self) -> None:
        self.twin.plug.unplug()

    def plug_in(self) -> None:
        self.twin.plug.plug_in()

    def close(self) -> None:
        self.device.close()


class WireNeck(InSimulatedTime, HeadRig):
    awake = HeadPose(0.0, 0.0)

    def __init__(self) -> None:
        super().__init__()
        self.chain = chain(2)
        self.line = DirectLine(self.chain, self.timeline.clock)
        self.timeline.call_every(PERIOD, self.line.poll)
        bus = ServoBus("/dev/servos", self.clock, name="arm", dial=self.line.dial)
        self.joints = DynamixelJoints(bus, SPECS, self.clock, loop=by_hand(self.timeline))
        self.joints.open()
        self.device = NeckDriver(
            self.joints,
            self.clock,
            pan=NECK[0],
            tilt=NECK[1],
            speed=SPEED,
            start=START,
            report=self.notices.append,
            changed=self.changed,
        )
        self.device.make_loop = by_hand(self.timeline)

    def truth(self) -> HeadPose:
        return HeadPose(self.chain.servo(1).angle, -self.chain.servo(2).angle)

    def unplug(self) -> None:
        self.line.plugged = False

    def plug_in(self) -> None:
        self.line.plugged = True

    def close(self) -> None:
        self.device.close()
        self.joints.close()


class TwinNeck(InSimulatedTime, HeadRig):
    awake = HeadPose(0.0, 0.0)

    def __init__(self) -> None:
        super().__init__()
        self.joints = JointsTwin(SPECS, self.clock)
        self.joints.open()
        self.twin = NeckTwin(
            self.joints,
            self.clock,
            pan=NECK[0],
            tilt=NECK[1],
            speed=SPEED,
            start=START,
            report=self.notices.append,
            changed=self.changed,
        )
        self.device = self.twin
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def truth(self) -> HeadPose:
        now = self.clock.now()
        return HeadPose(self.joints.true_angle("neck_pan", now), self.joints.true_angle("neck_tilt", now))

    def unplug(self) -> None:
        self.twin.plug.unplug()

    def plug_in(self) -> None:
        self.twin.plug.plug_in()

    def close(self) -> None:
        self.device.close()
        self.joints.close()


TURNS = {
    "neck_pan": TopicJoint("head_1_joint", JointLimits(-3.0, 3.0, SPEED)),
    "neck_tilt": TopicJoint("head_2_joint", JointLimits(-3.0, 3.0, SPEED), -1),
}


class TopicHead(InSimulatedTime, HeadRig):
    """Turned by trajectories of ROS 2."""

    awake = HeadPose(0.0, 0.0)
    kind = TRAJECTORY

    def __init__(self) -> None:
        super().__init__()
        self.robot = VirtualJoints("/joint_states", "/head_controller/command", TURNS, kind=self.kind)
        self.wire = HandWire(self.robot, self.timeline)
        joints = TopicJoints(self.wire.link("head"), self.clock, self.robot.channels, TURNS, name="head")
        self.device = Ros2Head(
            joints,
            self.clock,
            pan=NECK[0],
            tilt=NECK[1],
            speed=SPEED,
            start=START,
            report=self.notices.append,
            changed=self.changed,
        )
        self.device.make_loop = by_hand(self.timeline)

    def truth(self) -> HeadPose:
        now = self.clock.now()
        return HeadPose(self.robot.position("head_1_joint", now), -self.robot.position("head_2_joint", now))

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()

    def close(self) -> None:
        self.device.close()


class ArrayHead(TopicHead):
    """Turned by positions of both joints."""

    kind = ARRAY


class TwinTopicHead(InSimulatedTime, HeadRig):
    awake = HeadPose(0.0, 0.0)

    def __init__(self) -> None:
        super().__init__()
        self.joints = StiffJoints(TURNS, self.clock)
        self.twin = TopicHeadTwin(
            self.joints,
            self.clock,
            pan=NECK[0],
            tilt=NECK[1],
            speed=SPEED,
            start=START,
            report=self.notices.append,
            changed=self.changed,
        )
        self.device = self.twin
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def truth(self) -> HeadPose:
        return self.twin.true_pose(self.clock.now())

    def unplug(self) -> None:
        self.twin.plug.unplug()

    def plug_in(self) -> None:
        self.twin.plug.plug_in()

    def close(self) -> None:
        self.device.close()


@pytest.fixture(
    params=[
        simulated(WireHead, "wire"),
        simulated(KeptHead, "keeper"),
        simulated(TwinHead, "twin"),
        simulated(WireNeck, "bus"),
        simulated(TwinNeck, "neck twin"),
        simulated(TopicHead, "topics"),
        simulated(ArrayHead, "topics array"),
        simulated(TwinTopicHead, "topics twin"),
    ]
)
def rig(request: pytest.FixtureRequest) -> Iterator[HeadRig]:
    rig: HeadRig = request.param()
    yield rig
    rig.close()


@pytest.fixture
def head(rig: HeadRig) -> HeadRig:
    """A rig whose head is there, and looks where it is to look at first."""
    rig.start()
    return rig


def test_unopened_device_is_offline_and_has_no_readings(rig: HeadRig) -> None:
    health = rig.device.health()
    assert (health.online, health.detail != "") == (False, True)
    assert (rig.device.pose().value, rig.device.pose().quality) == (None, Quality.NONE)
    assert rig.device.pose_at(rig.clock.now()) is None
    with pytest.raises(NotConnected, match="head"):
        rig.device.look(START)
    rig.device.stop()
    rig.device.rest()
    rig.device.close()


def test_opened_head_comes_online_and_moves_to_its_start_pose(rig: HeadRig) -> None:
    rig.device.open()
    rig.until(lambda: rig.device.pose().good)
    found, way = rig.pose(), abs(START.tilt - rig.awake.tilt) + START.pan
    assert abs(found.tilt - rig.awake.tilt) + abs(found.pan) < way - DEGREE
    rig.until(lambda: rig.looks(START))
    rig.until(lambda: rig.device.pose_at(rig.clock.now()) == rig.device.pose().value)
    health = rig.device.health()
    assert (health.online, health.detail, health.hint) == (True, "", "")
    assert {notice.kind for notice in rig.notices} == {"online"}


def test_head_limits_are_those_of_the_axes(rig: HeadRig) -> None:
    assert rig.device.limits.pan == PAN.range
    assert rig.device.limits.tilt == TILT.range
    assert (rig.device.limits.speed, rig.device.limits.acceleration) == (SPEED, HEAD_ACCELERATION)


@pytest.mark.parametrize(("pan", "tilt"), [(30, 12), (-45.4, -20), (70.6, 20), (0, 0)])
def test_head_reaches_its_goal(head: HeadRig, pan: float, tilt: float) -> None:
    goal = HeadPose(radians(pan), radians(tilt))
    assert head.device.look(goal) == goal
    head.until(lambda: head.looks(goal))
    head.wait(0.1)
    assert head.looks(goal)


def test_head_goal_beyond_the_limits_is_clamped(head: HeadRig) -> None:
    accepted = head.device.look(HeadPose(3.0, -3.0))
    assert accepted == HeadPose(PAN.upper, TILT.lower)
    head.until(lambda: head.looks(accepted))


@pytest.mark.parametrize("wrong", [HeadPose(nan, 0.0), HeadPose(0.0, inf)], ids=str)
def test_head_goal_that_is_not_finite_is_refused(head: HeadRig, wrong: HeadPose) -> None:
    with pytest.raises(BadRequest, match="head") as caught:
        head.device.look(wrong)
    assert caught.value.hint
    head.wait(0.1)
    assert head.looks(START)


def test_head_turns_at_its_speed_and_reports_every_degree(head: HeadRig) -> None:
    began, changes = head.clock.now(), head.changes
    head.device.look(HeadPose(START.pan - radians(60), START.tilt))
    head.until(lambda: head.looks(HeadPose(START.pan - radians(60), START.tilt)))
    assert head.clock.now() - began >= (radians(60) - 2 * DEGREE) / SPEED
    assert head.changes - changes >= 5


def test_stopped_head_brakes_and_holds(head: HeadRig) -> None:
    head.device.look(HeadPose(radians(-70), START.tilt))
    head.until(lambda: head.pose().pan < 0.0)
    head.device.stop()
    head.device.stop()
    head.wait(SPEED / HEAD_ACCELERATION + 0.15)
    held = head.pose()
    assert held.pan > radians(-65)
    head.wait(0.15)
    assert head.looks(held)


@pytest.mark.parametrize("way", [-40, 40])
@pytest.mark.parametrize("after", [0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.15, 0.2, 0.3])
def test_head_stopped_at_any_moment_does_not_turn_back(head: HeadRig, way: float, after: float) -> None:
    head.wait(0.5)
    head.device.look(HeadPose(START.pan + radians(way), START.tilt))
    head.wait(after)
    head.device.stop()
    past = [head.pose().pan]
    for moment in range(20):
        if moment == 10:
            head.device.stop()
        head.wait(0.02)
        past.append(head.pose().pan)
    assert all((now - before) * way >= 0 for before, now in pairwise(past))


@pytest.mark.parametrize("way", [-40, 40])
@pytest.mark.parametrize("after", [0.0, 0.02, 0.06, 0.3])
def test_head_sent_back_after_a_stop_does_not_jump(head: HeadRig, way: float, after: float) -> None:
    head.wait(0.5)
    head.device.look(HeadPose(START.pan + radians(way), START.tilt))
    head.wait(after)
    head.device.stop()
    head.wait(1.0)
    held = head.pose().pan
    head.device.look(HeadPose(START.pan - radians(way), START.tilt))
    for _ in range(3):
        assert abs(head.pose().pan - held) <= 1.01 * DEGREE
        head.wait(0.01)


@pytest.mark.parametrize("way", [-40, 40])
def test_repeatedly_stopped_head_stays_and_returns_to_its_start(head: HeadRig, way: float) -> None:
    head.wait(0.5)
    began = head.pose()
    for _ in range(8):
        head.device.look(HeadPose(began.pan + radians(way), began.tilt))
        head.device.stop()
        head.wait(0.1)
    assert abs(head.pose().pan - began.pan) <= 1.01 * DEGREE
    head.device.look(began)
    head.until(lambda: abs(head.pose().pan - began.pan) < DEGREE / 2)


def test_trim_while_running_keeps_the_commanded_direction(head: HeadRig) -> None:
    here = head.truth()
    assert head.device.trim(pan=radians(6)) == (radians(6), 0.0)
    head.until(lambda: abs(head.truth().pan - here.pan - radians(6)) <= DEGREE)
    known = head.device.pose().value
    assert known is not None
    head.until(lambda: abs(head.pose().pan - START.pan) <= DEGREE)
    assert head.truth().tilt == pytest.approx(here.tilt, abs=DEGREE)
    assert head.device.trim() == (radians(6), 0.0)
    assert head.device.trim(pan=0.0, tilt=0.0) == (0.0, 0.0)
    head.until(lambda: head.looks(START))


def test_a_trim_of_more_than_45_degrees_is_refused_and_changes_nothing(head: HeadRig) -> None:
    for wrong in (radians(46), -1.0, nan):
        with pytest.raises(BadRequest, match=r"head: .*not within -45..45 deg") as caught:
            head.device.trim(pan=radians(3), tilt=wrong)
        assert caught.value.hint
    assert head.device.trim() == (0.0, 0.0)


def test_past_head_pose_is_interpolated(head: HeadRig) -> None:
    began = head.device.pose().stamp
    head.device.look(HeadPose(radians(60), START.tilt))
    head.until(lambda: head.looks(HeadPose(radians(60), START.tilt)))
    ended = head.device.pose().stamp
    poses = [head.device.pose_at(began + share / 20 * (ended - began)) for share in range(21)]
    pans = [pose.pan for pose in poses if pose is not None]
    assert len(pans) == 21
    assert pans == sorted(pans)
    # A degree that was not sent yet, and one that the servos still have to go.
    assert (pans[0], pans[-1]) == pytest.approx((START.pan, radians(60)), abs=2.01 * DEGREE)
    assert any(START.pan < pan < radians(60) for pan in pans)
    assert head.device.pose_at(began - 10.0) is None


def test_unplugged_head_gives_the_reason_and_refuses_goals(head: HeadRig) -> None:
    head.unplug()
    head.until(lambda: head.told("offline"))
    (notice,) = [notice for notice in head.notices if notice.kind == "offline"]
    assert (notice.device, notice.hint != "") == ("head", True)
    health = head.device.health()
    assert (health.online, health.detail != "", health.hint != "") == (False, True, True)
    with pytest.raises(NotConnected, match="head") as caught:
        head.device.look(START)
    assert caught.value.hint
    assert head.device.pose().quality is Quality.STALE
    assert head.device.pose().value is not None
    head.device.stop()


def test_a_goal_does_not_survive_the_plug(head: HeadRig) -> None:
    head.device.look(HeadPose(radians(-70), START.tilt))
    head.until(lambda: head.pose().pan < 0.0)
    head.unplug()
    head.until(lambda: head.told("offline"))
    head.notices.clear()
    head.plug_in()
    head.until(lambda: head.told("online") and head.device.pose().good)
    here = head.pose()
    assert here.pan > radians(-65)
    head.wait(0.2)
    assert head.looks(here)
    head.device.look(START)
    head.until(lambda: head.looks(START))


def test_closed_head_holds_and_moves_again_once_opened(head: HeadRig) -> None:
    head.device.look(HeadPose(radians(-70), START.tilt))
    head.until(lambda: head.pose().pan < 0.0)
    head.device.close()
    head.device.close()
    head.device.rest()
    assert not head.device.health().online
    assert not head.told("offline"), "it was closed on purpose"
    head.wait(0.1)
    held = head.truth()
    head.wait(0.1)
    assert head.truth() == held
    with pytest.raises(NotConnected):
        head.device.look(START)
    head.device.open()
    head.until(lambda: head.device.health().online)
    head.device.look(START)
    head.until(lambda: head.looks(START))
