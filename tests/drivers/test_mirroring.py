"""An arm that copies another on a port of its own: lag, a leader that falls silent, a follower that is unplugged."""

from collections.abc import Iterator
from math import degrees, pi, radians, sin

import pytest

from behaviours.joint_motion import JointMirror, range_coupling
from drivers.api import Coupling
from drivers.api.joints import FOLLOWING_TOLERANCE, MAX_APPROACH_SPEED
from drivers.errors import BadRequest, NotConnected
from drivers.servos.joint import JointSpec
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from tests.drivers.arms import Arm
from tests.drivers.cranked import PERIOD

STS = "STS3215"
NAMES = ("pan", "lift", "elbow", "flex", "roll", "gripper")


def specs(upper: float = 2.0) -> dict[str, JointSpec]:
    return {name: JointSpec(n, STS, lower=-2.0, upper=upper, speed=4.0) for n, name in enumerate(NAMES, 1)}


def chain() -> VirtualServoBus:
    return VirtualServoBus([VirtualServo(n, model=STS) for n in range(1, 7)])


class Pair:
    """A leader and a follower, each on a wire of its own, in one time."""

    def __init__(self) -> None:
        self.leader, self.follower = Arm(specs(), servos=chain()), Arm(specs(upper=1.0), servos=chain())
        self.follower.timeline.call_every(PERIOD, lambda: self.leader.timeline.run_until(self.follower.clock.now()))
        self.leader.start()
        self.follower.start()
        self.catch_up()
        self.leader.joints.relax()
        self.rounds = 0
        self.leader.joints.poll_fast(NAMES, self.count)
        limits, lower = self.leader.joints.limits, self.follower.joints.limits
        couplings = [Coupling(name, name) for name in NAMES[:-1]]
        gripper = range_coupling("gripper", limits["gripper"], "gripper", lower["gripper"])
        self.mirroring = JointMirror(self.leader.joints, self.follower.joints, [*couplings, gripper])

    def count(self) -> None:
        self.rounds += 1

    def catch_up(self) -> None:
        """Bring both to one time."""
        end = max(arm.clock.now() for arm in (self.leader, self.follower))
        for arm in (self.leader, self.follower):
            arm.timeline.run_until(end)

    def turn(self, angle: float, *joints: int) -> None:
        for number in joints or range(1, 7):
            self.leader.chain.servo(number).turn_by_hand(angle)

    def go_on(self, seconds: float = 0.01) -> None:
        """Let time pass, and mirror once."""
        end = self.follower.clock.now() + seconds
        self.follower.timeline.run_until(end)
        self.mirroring.step(end)

    def speed_to(self, goal: float) -> float:
        """Go on a little; return how fast (rad/s) it went while it was far from where it is led."""
        before = self.at()
        self.go_on(0.05)
        return abs(self.at() - before) / 0.05 if abs(self.at() - goal) > FOLLOWING_TOLERANCE else 0.0

    def at(self, number: int = 1) -> float:
        return self.follower.chain.servo(number).angle

    def close(self) -> None:
        self.leader.close()
        self.follower.close()


@pytest.fixture
def pair() -> Iterator[Pair]:
    pair = Pair()
    yield pair
    pair.close()


def test_distant_follower_approaches_slowly_and_then_follows_at_once(pair: Pair) -> None:
    pair.turn(0.8)
    began, fastest = pair.follower.clock.now(), 0.0
    while abs(pair.at() - 0.8) > 0.02:
        fastest = max(fastest, pair.speed_to(0.8))
        assert pair.follower.clock.now() - began < 3.0
    assert fastest <= MAX_APPROACH_SPEED * 1.21  # a shaft is seen to 5 ms, an angle to a step
    late = []
    for step in range(300):  # a hand that swings by 30 degrees, once a second
        pair.turn(0.8 + radians(30) * sin(2 * pi * step / 100))
        pair.go_on()
        late.append(abs(pair.at() - pair.leader.chain.servo(1).angle))
    assert degrees(sorted(late)[len(late) // 2]) < 5.0
    assert pair.rounds >= 0.9 * 300  # the leader was read a hundred times a second


def test_goal_is_clamped_and_the_gripper_follows_by_range(pair: Pair) -> None:
    pair.turn(1.9)
    for _ in range(400):
        pair.go_on()
    assert pair.at(1) == pytest.approx(1.0, abs=0.01)
    assert pair.at(6) == pytest.approx(-2.0 + 3.0 * (3.9 / 4.0), abs=0.02)


def test_silent_leader_leaves_the_follower_at_rest(pair: Pair) -> None:
    pair.turn(0.0)
    for _ in range(50):
        pair.go_on()
    pair.turn(0.6)
    pair.go_on(0.02)
    pair.leader.line.plugged = False
    for _ in range(100):
        pair.go_on()
    stands = pair.at()
    for _ in range(100):
        assert pair.mirroring.step(pair.follower.clock.now()) == {}
        pair.follower.timeline.run_until(pair.follower.clock.now() + 0.01)
    assert pair.at() == stands
    assert not any(servo.is_moving for servo in pair.follower.chain.servos)


def test_replugged_follower_approaches_without_a_jump(pair: Pair) -> None:
    for _ in range(50):
        pair.go_on()
    pair.turn(0.4)
    pair.go_on(0.05)
    pair.follower.line.plugged = False
    pair.follower.until(lambda: not pair.follower.joints.health().online)
    with pytest.raises(NotConnected):
        pair.go_on()
    pair.turn(-0.9)  # the leader goes elsewhere meanwhile
    pair.mirroring.pause()
    pair.follower.line.plugged = True
    pair.follower.until(lambda: pair.follower.joints.health().online)
    pair.follower.fresh()
    fastest = max(pair.speed_to(-0.9) for _ in range(300))
    assert pair.at() == pytest.approx(-0.9, abs=0.02)
    assert fastest <= MAX_APPROACH_SPEED * 1.21  # a shaft is seen to 5 ms, an angle to a step


def test_poll_fast_refuses_unknown_joints(pair: Pair) -> None:
    with pytest.raises(BadRequest, match="no joint 'toe'"):
        pair.leader.joints.poll_fast(["toe"])
