"""An arm whose program falls silent: each servo was told to go a short way only, and rests where that ends."""

from collections.abc import Callable
from itertools import pairwise
from math import degrees, radians
from random import Random
from typing import Any, Literal

import pytest

from drivers.api import Coupling, DeviceStatus, JointState, Quality, Reading, ReconnectPolicy
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from drivers.servos.bus import ServoBus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import Joint, JointSpec
from drivers.servos.models import MODELS as MODELS_BY_NAME
from drivers.servos.poll_rate import MOVING_INTERVAL
from drivers.servos.setpoint_lookahead import LOADED_LOOKAHEAD, next_setpoint
from drivers.servos.virtual.servo import VirtualServo
from tests.drivers.chains import mixed_chain
from tests.drivers.lines import DirectLine
from tests.tries import tries

MODELS = ("AX-12A", "MX-28", "XL430-W250")
WITHIN = 0.5
"""Seconds from the last that a servo hears to its rest."""


class Quiet:
    """An arm of a servo of each model, called a, b and c, whose rounds are gone through by hand."""

    def __init__(
        self, *models: str, rate: float = 100.0, at_rest: Literal["hold", "relax"] = "hold", **spec: Any
    ) -> None:
        self.clock = ManualClock()
        self.chain = mixed_chain(*(models or MODELS))
        self.line = DirectLine(self.chain, self.clock)
        self.notices: list[DeviceStatus] = []
        self._round = 1 / rate
        specs = {
            name: JointSpec(number, model=model, **{"lower": -2.4, "upper": 2.4, "speed": 4.0, **spec})
            for number, (name, model) in enumerate(zip("abc", models or MODELS, strict=False), 1)
        }
        bus = ServoBus("/dev/servos", self.clock, name="arm", dial=self.line.dial)
        away = ReconnectPolicy(
            decide_after=30.0, latch_after=60.0
        )  # what is tried here is what the joints do without that rule
        self.joints = DynamixelJoints(
            bus, specs, self.clock, rate=rate, at_rest=at_rest, away=away, report=self.notices.append
        )
        self.run(0.1)

    def run(self, seconds: float) -> None:
        """Go through the rounds of so many seconds."""
        end = self.clock.now() + seconds
        while self.clock.now() < end - 1e-9:
            began = self.clock.now()
            self.joints._poll_round()
            self.wait(began + self._round - self.clock.now(), step=self._round)

    def wait(self, seconds: float, *, step: float = 0.005) -> None:
        """Let time pass in which nobody says anything."""
        end = self.clock.now() + seconds
        while self.clock.now() < end - 1e-9:
            self.clock.advance_to(min(end, self.clock.now() + step))
            self.chain.poll(self.clock.now())

    def servo(self, number: int = 1) -> VirtualServo:
        return self.chain.servo(number)

    def tries(self) -> list[int]:
        """How often each servo was asked so far."""
        return [self.joints._bus.statistics(number).tries for number in range(1, len(self.chain.servos) + 1)]

    def angles(self) -> list[float]:
        self.chain.poll(self.clock.now())
        return [servo.angle for servo in self.chain.servos]

    def rests_after(self) -> float:
        """Fall silent; return the seconds until nothing moves any more, stiff all the while."""
        self.line.sent.clear()
        began, moved = self.clock.now(), 0.0
        before = self.angles()
        while self.clock.now() < began + 2.0:
            self.wait(0.01, step=0.01)
            if (now := self.angles()) != before:
                before, moved = now, self.clock.now() - began
        assert self.line.sent == []
        assert not any(servo.limp for servo in self.chain.servos)
        return moved

    def steps(self, number: int, seconds: float) -> list[float]:
        """Return by how much a servo turns in each round of so many seconds."""
        seen = [self.servo(number).angle]
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            self.run(self._round)
            seen.append(self.angles()[number - 1])
        return [later - earlier for earlier, later in pairwise(seen)]


Begin = Callable[[Quiet, Random], None]


def move(arm: Quiet, chance: Random) -> None:
    """Go somewhere, faster or slower."""
    goals = {name: chance.uniform(-2.4, 2.4) for name in "abc"}
    arm.joints.move(goals, speeds={name: chance.uniform(0.1, 5.0) for name in goals})


def follow(arm: Quiet, chance: Random) -> None:
    """Let two joints follow the first, which somebody turns."""
    arm.joints.relax(["a"])
    arm.joints.follow([Coupling("a", "b"), Coupling("a", "c", scale=-1.0)])
    arm.servo(1).turn_by_hand(chance.uniform(-2.0, 2.0))


def hold(arm: Quiet, chance: Random) -> None:
    """Go somewhere, and be held on the way."""
    move(arm, chance)
    arm.run(0.3)
    arm.joints.hold()


@pytest.mark.parametrize("begin", [move, follow, hold])
def test_arm_rests_within_half_a_second_of_program_silence(begin: Begin) -> None:
    chance = Random(15)  # noqa: S311 - chance, not a secret
    took = []
    for _ in range(tries(12, most=40)):
        arm = Quiet()
        arm.joints.hold()
        begin(arm, chance)
        arm.run(chance.uniform(0.0, 1.2))
        if begin is follow:
            arm.joints._hold_or_relax(["a"], stiff=True)  # whoever turns it has let go
        took.append(arm.rests_after())
    assert max(took) <= WITHIN
    if begin is not hold:
        assert sorted(took)[len(took) // 2] > 0.05, "it hardly ever moved: nothing was tried"


def test_a_very_slow_joint_ends_within_a_degree_or_two() -> None:
    for speed in (0.0, radians(1), radians(2)):
        arm = Quiet()
        arm.joints.hold()
        arm.joints.move(dict.fromkeys("abc", 1.0), speeds=dict.fromkeys("abc", speed))
        arm.run(3.0)
        before = arm.angles()
        arm.wait(20.0)
        ways = [degrees(now - then) for now, then in zip(arm.angles(), before, strict=True)]
        assert max(ways) < 1.5, speed
        assert min(ways) > 0.0, speed


def test_joint_far_beyond_its_limits_is_returned_in_steps() -> None:
    arm = Quiet("AX-12A", lower=-0.2, upper=0.2, speed=1.0)
    arm.servo().turn_by_hand(2.0)
    arm.run(0.1)
    arm.joints.hold()
    assert arm.rests_after() <= WITHIN
    assert arm.servo().angle > 1.4
    arm.run(2.0)
    assert arm.servo().angle == pytest.approx(0.2, abs=0.006)


# --- a move is none the worse for it ----------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [100.0, 20.0, 5.0])
def test_move_is_even_and_at_its_commanded_speed(rate: float) -> None:
    for speed in (0.5, 2.0, 4.0):
        arm = Quiet(rate=rate)
        arm.joints.hold()
        arm.joints.move(dict.fromkeys("abc", 1.5), speeds=dict.fromkeys("abc", speed))
        for number in (1, 2, 3):
            servo = arm.servo(number)
            true = servo.model.speed_ticks(speed) * servo.model.speed_unit
            arm.joints.move({"abc"[number - 1]: -1.5}, speeds={"abc"[number - 1]: speed})
            began = arm.clock.now()
            ways = arm.steps(number, abs(servo.angle + 1.5) / true + 1.0)
            turning = [-way * rate for way in ways if way][1:-1]
            assert turning == pytest.approx([true] * len(turning), rel=0.02), (speed, servo.model.name)
            assert servo.angle == pytest.approx(-1.5, abs=servo.model.tick), (speed, servo.model.name)
            assert arm.clock.now() > began


def test_goals_on_the_way_take_little_of_the_wire() -> None:
    arm = Quiet(*["AX-12A"] * 3)
    arm.joints.hold()
    arm.joints.move(dict.fromkeys("abc", 2.0), speeds=dict.fromkeys("abc", 1.0))
    arm.line.sent.clear()
    arm.run(1.0)
    together = [frame for frame in arm.line.sent if frame[4] == 0x83]
    assert 5 <= len(together) <= 12


def test_loaded_joint_gets_more_force_but_no_distant_goal() -> None:
    arm = Quiet("AX-12A")
    arm.joints.hold()
    arm.joints.move({"a": 2.0}, speeds={"a": radians(10)})
    arm.run(0.5)
    servo = arm.servo()
    servo.load = 2.0
    servo.set("shutdown", 0)
    arm.run(0.5)  # before it is given up
    ahead = degrees(servo.model.angle(servo.get("goal_position")) - servo.angle)
    assert 15.0 < ahead < 21.0
    servo.load = 0.0
    arm.run(12.0)
    assert servo.angle == pytest.approx(2.0, abs=servo.model.tick)


def test_resumed_program_continues_the_move_without_a_jump() -> None:
    arm = Quiet()
    arm.joints.hold()
    arm.joints.move(dict.fromkeys("abc", 2.0), speeds=dict.fromkeys("abc", 1.0))
    arm.run(0.5)
    arm.wait(0.9)
    rested = arm.angles()
    ways = arm.steps(1, 0.5)
    assert max(rested) < 1.2
    assert max(ways) <= 1.05 * 0.01
    arm.run(2.0)
    assert arm.angles() == pytest.approx([2.0] * 3, abs=0.006)


def test_move_after_a_stopped_program_waits_for_readings() -> None:
    arm = Quiet()
    arm.joints.hold()
    arm.run(0.1)
    arm.wait(0.9)
    arm.line.sent.clear()
    arm.joints.move({"a": 1.0}, speeds={"a": 1.0})
    assert arm.line.sent == []
    arm.run(1.5)
    assert arm.servo().angle == pytest.approx(1.0, abs=0.006)


def test_unplugged_arm_rests_and_is_held_when_replugged() -> None:
    arm = Quiet()
    arm.joints.hold()
    arm.joints.move(dict.fromkeys("abc", 2.0), speeds=dict.fromkeys("abc", 1.0))
    arm.run(0.5)
    arm.line.plugged = False
    with pytest.raises(NotConnected) as caught:
        arm.run(1.5 * MOVING_INTERVAL)
    arm.joints._monitor.on_port_lost(caught.value)
    assert arm.rests_after() <= WITHIN
    rested = arm.angles()
    arm.line.plugged = True
    arm.run(1.0)
    assert arm.angles() == pytest.approx(rested, abs=0.006)


def test_reading_older_than_the_setpoint_does_not_count_as_lag() -> None:
    joint = Joint("a", JointSpec(1), MODELS_BY_NAME["AX-12A"], goal=1.0, speed=0.2, setpoint_sent_at=0.9, torque=True)
    joint.setpoint = joint.ticks(0.06)

    def seen_at(stamp: float) -> None:
        state = JointState(0.0, 0.0, 1.0, 0.0, 12.0, 35.0, moving=True, torque=True)
        joint.reading = Reading(state, stamp, Quality.GOOD)

    seen_at(1.0)
    assert next_setpoint(joint, 1.24) is None
    seen_at(1.23)
    assert next_setpoint(joint, 1.24) == joint.ticks(LOADED_LOOKAHEAD)
