"""Joints that do not get where they are sent: at the wire of servos, in twins, and without any device."""

import re
from collections.abc import Callable
from contextlib import suppress
from math import radians, sin, tau
from random import Random

import pytest

from drivers.api import Coupling, DeviceStatus
from drivers.clock import ManualClock
from drivers.errors import DeviceFault
from drivers.joints.progress import BLOCKED_AFTER, RETRY_AFTER, WRONG_WAY, JointProgress
from drivers.servos.joint import JointSpec
from drivers.servos.twin import JointsTwin
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import ServoFault
from tests.drivers.test_dynamixel_silence import Quiet
from tests.machines import walk
from tests.tries import tries

MODELS = ("AX-12A", "MX-28", "XL430-W250", "STS3215")

ENDS_WITHIN = 1.4
"""Seconds after a joint stops following its goal until its driver holds it."""


class Wire:
    """The driver over one virtual servo."""

    def __init__(self, model: str = "AX-12A") -> None:
        self.arm = Quiet(model)
        self.joints = self.arm.joints
        self.joints.hold()
        self.notices = self.arm.notices

    @property
    def servo(self) -> VirtualServo:
        return self.arm.servo()

    def run(self, seconds: float) -> None:
        self.arm.run(seconds)

    def now(self) -> float:
        return self.arm.clock.now()

    def fail(self, fault: str) -> None:
        self.servo.freeze(on=fault == "frozen")
        self.servo.shaft.motion_factor = {"blocked": 0.0, "reversed": -1.0}.get(fault, 1.0)

    def angle(self) -> float:
        return self.servo.angle


class Twin:
    """The twin of one servo."""

    def __init__(self, model: str = "AX-12A", joints: str = "a") -> None:
        self.clock = ManualClock()
        self.notices: list[DeviceStatus] = []
        specs = {
            name: JointSpec(number, model=model, lower=-2.4, upper=2.4, speed=4.0)
            for number, name in enumerate(joints, 1)
        }
        self.joints = JointsTwin(specs, self.clock, report=self.notices.append)
        self.joints.open()
        self.joints.hold()

    def run(self, seconds: float) -> None:
        end = self.clock.now() + seconds
        while self.clock.now() < end - 1e-9:
            self.clock.advance(self.joints.STEP_INTERVAL)
            self.joints.step()

    def now(self) -> float:
        return self.clock.now()

    def fail(self, fault: str) -> None:
        self.joints.fail("a", fault)

    def angle(self) -> float:
        return self.joints.true_angle("a", self.clock.now())


Rig = Wire | Twin
RIGS: list[Callable[[], Rig]] = [*(lambda model=model: Wire(model) for model in MODELS), Twin]
NAMES = [*MODELS, "twin"]


@pytest.fixture(params=RIGS, ids=NAMES)
def rig(request: pytest.FixtureRequest) -> Rig:
    made: Rig = request.param()
    return made


def drive(rig: Rig, goal: float, speed: float = 1.0, limit: float = 5.0) -> str:
    """Send the joint to ``goal`` at each tick, as leaves do; return why it was refused, and until when."""
    until = rig.now() + limit
    while rig.now() < until:
        try:
            rig.joints.move({"a": goal}, speeds={"a": speed})
        except DeviceFault as error:
            return str(error)
        rig.run(0.05)
    return ""


def state(rig: Rig) -> float:
    value = rig.joints.states()["a"].value
    assert value is not None
    return value.position


def faults(rig: Rig) -> list[str]:
    return [notice.message for notice in rig.notices if notice.kind == "fault"]


@pytest.mark.parametrize("fault", ["blocked", "frozen"])
def test_blocked_joint_is_held_before_its_servo_shuts_down(rig: Rig, fault: str) -> None:
    drive(rig, 0.4, limit=1.0)
    rig.fail(fault)
    began = rig.now()
    said = drive(rig, 1.2)
    assert rig.now() - began < ENDS_WITHIN
    match = re.fullmatch(
        r"joint a: commanded 1.20 rad, at 0\.\d\d rad for 0\.[89]\d? s: blocked\?(; load \d+ %)?", said
    )
    assert match, said
    assert (match[1] is not None) or fault == "frozen"
    assert faults(rig) == [said]
    rig.run(3.0)  # nobody commands any more: it neither pushes nor falls
    felt = rig.joints.states()["a"].value
    assert felt is not None
    assert felt.torque
    assert felt.blocked == said
    assert felt.goal == pytest.approx(state(rig), abs=0.02)
    assert abs(felt.load) < 0.2
    if isinstance(rig, Wire):
        assert not rig.servo.faults & ServoFault.OVERLOAD
        assert not rig.servo.limp


def test_reversed_joint_is_held_before_it_goes_far(rig: Rig) -> None:
    rig.fail("reversed")
    said = drive(rig, 1.2)
    assert re.fullmatch(r"joint a: commanded 1.20 rad, turned the wrong way, from .* rad(; load \d+ %)?", said), said
    assert abs(rig.angle()) < WRONG_WAY + 1.0 * 0.7
    rig.run(1.0)
    there = rig.angle()
    rig.run(3.0)
    assert rig.angle() == pytest.approx(there, abs=0.01)  # a joint that runs away when it is held is let go
    assert "its torque is switched off" in faults(rig)[-1]


def test_joint_that_runs_away_after_a_hold_is_relaxed(rig: Rig) -> None:
    rig.fail("reversed")
    assert "turned the wrong way" in drive(rig, 1.2)
    rig.joints.hold(["a"])  # as the leaf does that has failed
    rig.run(3.0)
    there = rig.angle()
    rig.run(2.0)
    assert rig.angle() == pytest.approx(there, abs=0.01)
    assert "its torque is switched off" in faults(rig)[-1]


def test_a_blocked_joint_may_turn_back_and_is_tried_again_after_a_hold_or_a_while(rig: Rig) -> None:
    drive(rig, 0.4, limit=1.0)
    rig.fail("blocked")
    assert drive(rig, 1.2)
    assert drive(rig, 1.0)  # still in the way
    rig.fail("")
    assert not drive(rig, -0.5, limit=2.0)
    assert state(rig) == pytest.approx(-0.5, abs=0.05)
    rig.fail("blocked")
    assert drive(rig, 1.2)
    rig.joints.hold()
    rig.fail("")
    assert not drive(rig, 1.2, limit=3.0)
    rig.fail("blocked")
    assert drive(rig, -1.2)
    rig.fail("")
    rig.run(RETRY_AFTER + 0.1)
    assert not drive(rig, -1.2, limit=4.0)


def followed_on_wire() -> tuple[Quiet, list[DeviceStatus], Callable[[], None]]:
    arm = Quiet("AX-12A", "AX-12A")

    def block() -> None:
        arm.servo(2).shaft.motion_factor = 0.0
        arm.servo(1).turn_by_hand(1.0)

    return arm, arm.notices, block


def followed_twin() -> tuple[Twin, list[DeviceStatus], Callable[[], None]]:
    rig = Twin(joints="ab")

    def block() -> None:
        rig.joints.fail("b", "blocked")
        rig.joints.turn_by_hand("a", 1.0)

    return rig, rig.notices, block


@pytest.mark.parametrize("made", [followed_on_wire, followed_twin])
def test_blocked_follower_stops_following(
    made: Callable[[], tuple[Quiet | Twin, list[DeviceStatus], Callable[[], None]]],
) -> None:
    rig, notices, block = made()
    rig.joints.hold()
    rig.joints.relax(["a"])
    rig.joints.follow([Coupling("a", "b")])
    rig.run(0.5)
    block()
    rig.run(ENDS_WITHIN)
    felt = rig.joints.states()["b"].value
    assert felt is not None
    assert "joint b: commanded" in felt.blocked
    assert [notice.message for notice in notices if "joint b" in notice.message] == [felt.blocked]
    assert felt.goal == pytest.approx(felt.position, abs=0.02)


def test_joint_pushed_from_its_goal_is_reported_and_keeps_its_goal() -> None:
    rig = Twin()
    drive(rig, 0.4, limit=1.5)
    rig.joints.push("a", 0.9)
    rig.run(2.0)
    assert faults(rig) == ["joint a: holds 0.40 rad, but is at 0.90 rad: pushed away, or overloaded?"]
    felt = rig.joints.states()["a"].value
    assert felt is not None
    assert felt.goal == pytest.approx(0.4, abs=0.01)
    rig.joints.fail("a")
    rig.run(2.0)
    assert state(rig) == pytest.approx(0.4, abs=0.02)


def test_working_joints_are_never_given_up() -> None:
    for seed in range(tries(4, most=300)):
        chance = Random(seed)  # noqa: S311 - chance, not a secret
        rig: Rig = Wire(chance.choice(MODELS)) if seed % 2 else Twin(chance.choice(MODELS))
        for _ in range(3):
            goal, speed = chance.uniform(-2.2, 2.2), chance.choice((0.0175, 0.1, 1.0, 4.0))
            assert not drive(rig, goal, speed, limit=chance.uniform(0.2, 4.0)), seed
        middle, width, period = chance.uniform(-1, 1), chance.uniform(0.1, 1.2), chance.uniform(1.0, 6.0)
        began = rig.now()
        while rig.now() - began < 6.0:  # a sweep that may be faster than the joint
            rig.joints.move({"a": middle + width * sin(tau * (rig.now() - began) / period)})
            rig.run(0.05)
        assert faults(rig) == [], seed


def test_randomly_failing_joints_are_held_without_overload() -> None:
    for seed in range(60000, 60000 + tries(6, most=300)):
        chance = Random(seed)  # noqa: S311 - chance, not a secret
        rig: Rig = Wire(chance.choice(MODELS)) if seed % 2 else Twin(chance.choice(MODELS))
        fault, start = chance.choice(("blocked", "frozen", "reversed")), chance.uniform(-1.5, 1.5)
        goal, speed = start - (1 if start > 0 else -1) * chance.uniform(0.5, 2.0), chance.choice((0.2, 0.5, 1.0, 4.0))
        drive(rig, start, 4.0, limit=2.0)
        drive(rig, goal, speed, limit=chance.uniform(0, 0.3) * abs(goal - start) / speed)
        rig.fail(fault)
        began = rig.now()
        assert drive(rig, goal, speed), (seed, fault)
        assert rig.now() - began < 1.0, (seed, fault)
        rig.run(2.0)
        if isinstance(rig, Wire) and fault != "reversed":
            assert not rig.servo.faults & ServoFault.OVERLOAD, (seed, fault)


# --- without a device -------------------------------------------------------------------------------------------------


def watched(positions: Callable[[float], float], goal: float, *, speed: float = 1.0, noise: float = 0.0) -> str:
    """Let a joint stand where ``positions`` say; return what is new first."""
    progress, chance = JointProgress("joint a"), Random(1)  # noqa: S311
    for step in range(500):
        now = step * 0.04
        progress.command(goal, speed, now)
        said = progress.update(positions(now) + chance.gauss(0, noise), 0.0, now)
        if said:
            return f"{now:.1f} {said}"
    return ""


def test_noise_of_a_sensor_is_no_progress() -> None:
    said = watched(lambda _: 0.0, 1.0, noise=radians(0.3))
    assert 0.7 < float(said.split()[0]) < 2 * BLOCKED_AFTER


def test_slow_joint_and_joint_near_its_goal_are_not_blocked() -> None:
    assert not watched(lambda now: min(0.1 * now, 1.0), 1.0)
    assert not watched(lambda now: min(now, 1.0 - radians(8)), 1.0)


def test_seconds_without_readings_do_not_count() -> None:
    progress = JointProgress("joint a")
    progress.command(1.0, 1.0, 0.0)
    assert not any(progress.update(0.0, 0.0, now) for now in (0.1, 5.0, 10.0))


class Handled:
    """A joint that somebody pushes about, with a clock of its own."""

    def __init__(self) -> None:
        self.progress, self.now, self.here, self.goal = JointProgress("joint a"), 0.0, 0.0, 0.0

    def command(self, chance: Random) -> None:
        goal = chance.choice((self.here, self.goal, chance.uniform(-2, 2)))
        with suppress(DeviceFault):
            self.progress.permit(goal, self.now)
            self.goal = goal
            self.progress.command(goal, 1.0, self.now)

    def look(self, chance: Random) -> None:
        self.now += chance.choice((0.05, 0.2))
        self.here += chance.choice((0.0, 0.3, -0.3, 1.0)) * (self.goal - self.here)
        self.progress.update(self.here, 0.0, self.now)
        assert not self.progress.blocked or self.progress.active


def test_random_events_take_every_transition(monkeypatch: pytest.MonkeyPatch) -> None:
    def hold(joint: Handled, _: Random) -> None:
        joint.progress.hold(joint.here)

    def relax(joint: Handled, _: Random) -> None:
        joint.progress.hold(None)

    actions = [Handled.command, Handled.command, hold, relax, *[Handled.look] * 16]
    table = walk(monkeypatch, "drivers.joints.progress.TRANSITIONS", Handled, actions, walks=800, steps=150)
    assert table.visited == set(table)
    assert not table.missing
