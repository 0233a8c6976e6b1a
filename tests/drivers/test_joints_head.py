"""A head that is two joints of an arm: what it does beside the contract of all heads, in simulated time."""

from math import inf, nan, pi, radians

import pytest

from drivers.api import DeviceStatus, HeadPose, Quality
from drivers.errors import BadRequest, NotConnected
from drivers.head.joints_head import JointAxis
from drivers.servos.joint import JointSpec
from drivers.servos.twin import JointsTwin, NeckTwin
from drivers.sim.timeline import Timeline

SPECS = {
    "elbow": JointSpec(1),
    "neck_pan": JointSpec(2, lower=-1.5, upper=1.5, speed=4.0, zero=0.1),
    "neck_tilt": JointSpec(3, lower=-0.5, upper=1.0, speed=4.0, direction=-1),
}


class Bench:
    """A neck on an arm's twin, on a timeline."""

    def __init__(self, *, speed: float = 2.0, trim: float = 0.0) -> None:
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        self.notices: list[DeviceStatus] = []
        self.arm = JointsTwin(SPECS, self.clock)
        pan, tilt = JointAxis("neck_pan", -pi, pi, trim=trim), JointAxis("neck_tilt", -0.4, pi)
        self.neck = NeckTwin(self.arm, self.clock, pan=pan, tilt=tilt, speed=speed, report=self.notices.append)
        self.timeline.call_every(self.neck.STEP_INTERVAL, self.neck.step)

    def open(self) -> None:
        self.arm.open()
        self.neck.open()
        self.run(1.0)

    def run(self, seconds: float) -> None:
        self.timeline.run_until(self.clock.now() + seconds)

    @property
    def truth(self) -> tuple[float, float]:
        pose = self.neck.true_pose(self.clock.now())
        return pose.pan, pose.tilt


def near(pan: float, tilt: float) -> object:
    return pytest.approx((pan, tilt), abs=0.006)


def test_head_limits_are_the_intersection_with_joint_limits() -> None:
    limits = Bench(trim=0.2).neck.limits
    assert limits.pan == pytest.approx((-1.7, 1.3))
    assert limits.tilt == (-0.4, 1.0)


def test_a_trim_from_the_robot_file_is_added_to_the_joint_and_not_to_the_pose() -> None:
    bench = Bench(trim=0.2)
    bench.open()
    assert bench.arm.true_angle("neck_pan", bench.clock.now()) == pytest.approx(0.2, abs=0.006)
    pose = bench.neck.pose().value
    assert pose is not None
    assert (pose.pan, pose.tilt) == near(0.0, 0.0)


def test_neck_joints_respect_the_head_acceleration() -> None:
    bench = Bench()
    bench.open()
    bench.neck.look(HeadPose(1.2, 0.5))
    pans = [bench.truth[0]]
    for _ in range(60):
        bench.run(0.02)
        pans.append(bench.truth[0])
    velocities = [(later - sooner) / 0.1 for sooner, later in zip(pans, pans[5:], strict=False)]
    changes = [(later - sooner) / 0.1 for sooner, later in zip(velocities, velocities[5:], strict=False)]
    assert max(velocities) == pytest.approx(2.0, abs=0.1)
    assert max(map(abs, changes)) <= 7.0 + 1.0
    assert bench.truth == near(1.2, 0.5)


def test_relaxed_head_drops_its_goal_and_resumes_in_place() -> None:
    bench = Bench()
    bench.open()
    bench.neck.look(HeadPose(1.2, 0.0))
    bench.run(0.4)
    bench.arm.relax()
    bench.run(1.0)
    stopped = bench.truth
    assert 0.05 < stopped[0] < 0.7
    bench.neck.look(HeadPose(0.0, 0.0))
    bench.run(0.1)
    assert stopped[0] - 0.1 < bench.truth[0] <= stopped[0] + 0.006
    bench.run(1.0)
    assert bench.truth == near(0.0, 0.0)


def test_repeatedly_held_head_stays_once_stopped() -> None:
    bench = Bench()
    bench.open()
    for _ in range(40):
        bench.neck.look(HeadPose(1.2, 0.5))
        bench.run(0.02)
        bench.arm.hold()
    held = bench.truth
    bench.neck.stop()
    bench.arm.hold()
    bench.run(1.0)
    assert bench.truth == pytest.approx(held, abs=radians(2))


def test_head_stopped_with_stale_joint_readings_does_not_turn_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench()
    bench.open()
    bench.neck.look(HeadPose(1.2, 0.0))
    bench.run(0.3)
    with monkeypatch.context() as missed:
        states = bench.arm.states()
        missed.setattr(bench.arm, "states", lambda: states)
        bench.run(0.24)
        before = bench.truth[0]
        bench.neck.stop()
    bench.run(1.0)
    assert before > 0.6
    assert bench.truth[0] > before - radians(1)


def test_shut_down_neck_joint_does_not_block_the_other_axis() -> None:
    bench = Bench()
    bench.open()
    bench.arm.overload("neck_tilt")
    bench.neck.look(HeadPose(0.5, 0.5))
    bench.run(1.5)
    assert bench.truth == near(0.5, 0.0)
    assert bench.neck.pose().good


def test_other_arm_joints_stay_untouched() -> None:
    bench = Bench()
    bench.open()
    bench.neck.look(HeadPose(0.5, 0.5))
    bench.run(1.0)
    elbow = bench.arm.states()["elbow"].value
    assert elbow is not None
    assert not elbow.torque


def test_head_without_its_arm_names_the_missing_joints() -> None:
    bench = Bench()
    bench.neck.open()
    bench.run(0.5)
    health = bench.neck.health()
    assert (health.online, health.hint != "") == (False, True)
    assert "neck_pan and neck_tilt" in health.detail
    with pytest.raises(NotConnected, match="neck_pan"):
        bench.neck.look(HeadPose(0.0, 0.0))
    assert bench.neck.pose().quality is Quality.NONE
    assert bench.notices == []


def test_invalid_neck_is_refused() -> None:
    arm = JointsTwin(SPECS, Timeline().clock)
    good, other = JointAxis("neck_pan", -1.0, 1.0), JointAxis("neck_tilt", -1.0, 1.0)

    def make(pan: JointAxis, tilt: JointAxis, speed: float = 1.0, acceleration: float = 1.0) -> NeckTwin:
        clock = Timeline().clock
        return NeckTwin(arm, clock, pan=pan, tilt=tilt, speed=speed, acceleration=acceleration)

    with pytest.raises(BadRequest, match=r"no joint 'nose' \(there are elbow, neck_pan, neck_tilt\)"):
        make(JointAxis("nose", -1.0, 1.0), other)
    with pytest.raises(ValueError, match="both joint 'neck_pan'"):
        make(good, good)
    with pytest.raises(ValueError, match="within its reach"):
        make(JointAxis("neck_pan", 2.0, 3.0), other)
    for wrong in (0.0, -1.0, inf, nan):
        with pytest.raises(ValueError, match="is not positive"):
            make(good, other, speed=wrong)
        with pytest.raises(ValueError, match="is not positive"):
            make(good, other, acceleration=wrong)
