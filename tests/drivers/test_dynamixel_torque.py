"""Stiff and limp on a wire that loses packets: nothing leaps, nothing runs on, and what was not told is named."""

from collections.abc import Callable
from functools import partial
from random import Random
from threading import Thread
from typing import Any, Literal

import pytest

from drivers.api import Coupling, DeviceStatus, ReconnectPolicy
from drivers.api.joints import FOLLOWING_TOLERANCE, MAX_APPROACH_SPEED
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from drivers.servos.bus import ServoBus
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import JointSpec
from drivers.servos.models import MODELS
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.servos.wire import Protocol1Instruction
from tests.drivers.chains import mixed_chain
from tests.drivers.lines import DirectLine
from tests.waiting import wait_until

BOTH = pytest.mark.parametrize("model", ["AX-12A", "XL430-W250"])
ROUND = 0.01


def code_of(frame: bytes) -> int:
    """The instruction of a request of either protocol."""
    return frame[7] if frame[:3] == b"\xff\xff\xfd" else frame[4]


def wrote(frame: bytes, register: str, model: str = "AX-12A") -> bool:
    """Whether a request writes to one servo from ``register`` on."""
    place = frame[8] if frame[:3] == b"\xff\xff\xfd" else frame[5]
    return code_of(frame) == Protocol1Instruction.WRITE and place == MODELS[model].table[register].address


def together(frame: bytes) -> bool:
    """Whether a request is for many servos, of which none acknowledges it."""
    return code_of(frame) == Protocol1Instruction.SYNC_WRITE


def at_times(chance: Random, share: float) -> bool:
    """Say yes in a ``share`` (0..1) of all cases."""
    return chance.random() < share


class LossyLine(DirectLine[VirtualServoBus]):
    """Requests that it ``loses`` never arrive; the plug is pulled behind one that is the ``last``.

    Replies that are ``late`` are not heard; ``held_up`` is how long (s) a request takes to leave.
    """

    def __init__(self, chain: VirtualServoBus, clock: ManualClock) -> None:
        super().__init__(chain, clock)
        self.loses: Callable[[bytes], bool] = lambda _: False
        self.last: Callable[[bytes], bool] = lambda _: False
        self.late: Callable[[], bool] = lambda: False
        self.held_up = 0.0

    def send(self, data: bytes) -> None:
        if self.loses(data):
            self._require()
            return
        if self.held_up:
            self._clock.advance(self.held_up)
        super().send(data)
        if self.late():
            self._heard = b""  # it comes when nobody waits for it any more
        self.plugged = not self.last(data)


class Hand:
    """An arm whose rounds are gone through by hand, of servos called a, b and so on."""

    def __init__(
        self, *models: str, at_rest: Literal["hold", "relax"] = "hold", away: ReconnectPolicy | None = None, **spec: Any
    ) -> None:
        self.clock = ManualClock()
        self.chain = mixed_chain(*models)
        self.line = LossyLine(self.chain, self.clock)
        self.notices: list[DeviceStatus] = []
        specs = {
            name: JointSpec(number, model=model, **{"lower": -2.0, "upper": 2.0, **spec})
            for number, (name, model) in enumerate(zip("abc", models, strict=False), 1)
        }
        bus = ServoBus("/dev/servos", self.clock, name="arm", dial=self.line.dial)
        self.joints = DynamixelJoints(bus, specs, self.clock, at_rest=at_rest, away=away, report=self.notices.append)

    def run(self, seconds: float = ROUND) -> None:
        """Go through the rounds of so many seconds."""
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            self.joints._poll_round()
            self.clock.advance(ROUND)

    def servo(self, number: int = 1) -> VirtualServo:
        return self.chain.servo(number)

    def faults(self) -> list[str]:
        return [notice.message for notice in self.notices if notice.kind == "fault"]

    def change_unseen(self, number: int, register: str, value: int) -> None:
        """Let a servo come back after a while with another setting."""
        self.servo(number).present = False
        self.run(1.0)
        self.servo(number).set(register, value)
        self.servo(number).present = True
        self.run(2.0)
        self.notices.clear()


# --- packets that are lost --------------------------------------------------------------------------------------------


@BOTH
def test_moving_joint_is_stopped_although_the_sync_write_is_lost(model: str) -> None:
    arm = Hand(model)
    arm.run()
    arm.joints.move({"a": 1.5}, speeds={"a": 1.0})
    arm.run(0.5)
    arm.line.loses = together
    arm.joints.hold()
    stopped = arm.servo().angle
    assert 0.2 < stopped < 1.0
    arm.run(1.0)
    assert arm.servo().angle == pytest.approx(stopped, abs=0.05)
    assert arm.faults() == []


@BOTH
def test_limp_joint_does_not_jump_if_the_sync_write_is_lost(model: str) -> None:
    arm = Hand(model)
    arm.run()
    arm.joints.move({"a": 0.8})
    arm.run(1.0)
    arm.joints.relax()
    arm.servo().turn_by_hand(-0.5)
    arm.run()
    arm.line.loses = together
    arm.joints.hold()
    arm.run(1.0)
    assert not arm.servo().limp
    assert arm.servo().angle == pytest.approx(-0.5, abs=0.01)


@BOTH
def test_torque_stays_off_until_the_goal_is_confirmed(model: str) -> None:
    arm = Hand(model)
    arm.run()
    arm.joints.move({"a": 0.8})
    arm.run(1.0)
    arm.joints.relax()
    arm.servo().turn_by_hand(-0.5)
    arm.run()
    first = "goal_position" if model == "AX-12A" else "profile_velocity"
    arm.line.loses = lambda frame: together(frame) or wrote(frame, first, model)
    for _ in range(3):
        arm.joints.hold()
        arm.run(0.5)
    assert arm.servo().limp
    assert arm.faults() == ["could not be held: a (servo 1)"]
    arm.line.loses = lambda _: False
    arm.run(1.5)
    assert not arm.servo().limp
    assert arm.servo().angle == pytest.approx(-0.5, abs=0.01)
    assert arm.faults() == ["could not be held: a (servo 1)"]


def test_joint_that_missed_relax_is_relaxed_again() -> None:
    arm = Hand("AX-12A", "AX-12A")
    arm.run()
    arm.joints.move({"a": 0.3, "b": 0.3})
    arm.run(1.0)
    arm.line.loses = lambda frame: together(frame) or wrote(frame, "torque_enable")
    arm.joints.relax(["b"])
    assert arm.faults() == []  # the reply may be late
    arm.run(1.2)
    assert arm.faults() == ["could not be relaxed: b (servo 2)"]
    assert not arm.servo(2).limp
    arm.line.loses = lambda _: False
    arm.run(0.1)
    assert arm.servo(2).limp
    assert not arm.servo(1).limp


@BOTH
def test_joint_that_missed_its_goal_gets_the_goal_again(model: str) -> None:
    arm = Hand(model)
    arm.run()
    arm.joints.hold()
    arm.line.loses = together
    arm.joints.move({"a": 0.5}, speeds={"a": 0.7})
    arm.line.loses = lambda _: False
    arm.run(2.5)
    assert arm.servo().angle == pytest.approx(0.5, abs=0.01)
    assert arm.servo().get(arm.servo().model.table.speed) == arm.servo().model.speed_ticks(0.7)


# --- a busy machine: replies come too late, and nobody is alarmed -----------------------------------------------------


@pytest.mark.parametrize("at_rest", ["hold", "relax"])
def test_late_replies_at_rest_are_not_reported_as_refusals(
    at_rest: Literal["hold", "relax"],
) -> None:
    for share in (0.3, 0.6, 0.8):
        for seed in range(10):
            arm = Hand("AX-12A", "MX-28", "XL430-W250", at_rest=at_rest)
            arm.run()
            arm.joints.move(dict.fromkeys("abc", 1.5), speeds=dict.fromkeys("abc", 1.0))
            arm.run(0.5)
            chance = Random(seed)  # noqa: S311 - chance, not a secret
            arm.line.late = partial(at_times, chance, share)
            began = arm.clock.now()
            arm.joints.rest()
            assert arm.faults() == [], (share, seed)
            assert arm.clock.now() - began < 2.0
            assert [servo.limp for servo in arm.chain.servos] == [at_rest == "relax"] * 3
            before = [servo.angle for servo in arm.chain.servos]
            arm.clock.advance(1.0)
            arm.chain.poll(arm.clock.now())
            assert [servo.angle for servo in arm.chain.servos] == pytest.approx(before, abs=0.05)


def test_silent_joints_are_pinged_before_a_fault_at_rest() -> None:
    for at_rest in ("hold", "relax"):
        arm = Hand("AX-12A", "XL430-W250", at_rest="hold" if at_rest == "hold" else "relax")
        arm.run()
        arm.joints.move({"a": 1.5, "b": 1.5}, speeds={"a": 1.0, "b": 1.0})
        arm.run(0.3)
        arm.line.late = lambda: True
        arm.run(0.5)
        arm.line.late = lambda: False
        assert "does not answer" in arm.joints.health().detail
        arm.notices.clear()
        arm.joints.rest()
        assert arm.faults() == []
        assert [servo.limp for servo in arm.chain.servos] == [at_rest == "relax"] * 2


def test_silent_joint_at_rest_is_reported_as_unconfirmed() -> None:
    arm = Hand("AX-12A", "XL430-W250")
    arm.run()
    arm.joints.move({"a": 1.5, "b": 1.5}, speeds={"a": 1.0, "b": 1.0})
    arm.run(0.3)
    arm.servo(2).present = False
    arm.joints.rest()
    assert arm.faults() == ["did not confirm that they are held: b (servo 2)"]
    assert "stops by itself" in arm.notices[-1].hint
    arm.joints.rest()
    assert len(arm.faults()) == 1


def test_whoever_is_held_up_before_a_request_has_left_does_not_miss_the_reply() -> None:
    arm = Hand("AX-12A")
    arm.chain.paced = True
    arm.run()
    arm.line.held_up = 0.1
    for _ in range(20):
        arm.run()
    assert arm.joints.health().counters["misses"] == 0


# --- servos that are not what they should be any more -----------------------------------------------------------------


def test_resting_arm_relaxes_a_servo_with_changed_settings() -> None:
    arm = Hand("AX-12A", "AX-12A", at_rest="relax")
    arm.run()
    arm.joints.move({"a": 0.2, "b": 0.2})
    arm.run(1.0)
    arm.change_unseen(2, "ccw_angle_limit", 600)
    assert "has angle limits" in arm.joints.health().detail
    assert not arm.servo(2).limp
    arm.joints.rest()
    assert (arm.servo(1).limp, arm.servo(2).limp) == (True, True)
    assert arm.faults() == []


def test_servo_with_changed_settings_that_stays_stiff_is_reported() -> None:
    arm = Hand("AX-12A", "AX-12A", at_rest="relax")
    arm.run()
    arm.joints.move({"a": 0.2, "b": 0.2})
    arm.run(1.0)
    arm.change_unseen(2, "ccw_angle_limit", 600)
    arm.line.loses = lambda frame: together(frame) or (wrote(frame, "torque_enable") and frame[2] == 2)
    arm.joints.rest()
    assert arm.faults() == ["could not be relaxed: b (servo 2)"]
    arm.joints.rest()
    assert len(arm.faults()) == 1
    arm.line.loses = lambda _: False
    arm.run(1.5)
    assert arm.servo(2).limp


def test_servo_with_changed_settings_cannot_be_held() -> None:
    arm = Hand("AX-12A", "AX-12A")
    arm.run()
    arm.joints.move({"a": 0.2, "b": 0.2})
    arm.run(1.0)
    arm.change_unseen(2, "ccw_angle_limit", 600)
    arm.joints.rest()
    assert arm.faults() == ["could not be held: b (servo 2)"]


def test_never_valid_servo_is_left_alone_at_rest() -> None:
    arm = Hand("AX-12A", "AX-12A", at_rest="relax")
    arm.servo(2).set("model_number", 18)
    arm.servo(2).set("torque_enable", 1)
    arm.run()
    arm.notices.clear()
    arm.joints.rest()
    assert not arm.servo(2).limp
    assert arm.faults() == []


def test_bus_lost_during_hold_names_the_stiff_servo_at_rest() -> None:
    arm = Hand("AX-12A", "AX-12A")
    arm.joints.hold()
    assert arm.faults() == []
    arm.line.last = lambda frame: wrote(frame, "torque_enable")
    with pytest.raises(NotConnected):
        arm.run()
    assert not arm.servo(1).limp
    arm.joints.rest()
    assert arm.faults() == ["could not be held: a (servo 1)"]


@pytest.mark.parametrize("stiff", [False, True])
def test_servo_left_in_torque_mode_returns_to_position_mode_without_a_jump(*, stiff: bool) -> None:
    arm = Hand("MX-64", lower=-1.0, upper=1.0)
    servo = arm.servo()
    servo.turn_by_hand(0.4)
    servo.set("torque_mode", 1)
    servo.set("goal_position", servo.model.ticks(-0.9))
    servo.set("torque_enable", int(stiff))
    arm.run()
    assert servo.get("torque_mode") == 0
    assert servo.limp is not stiff
    writes = [frame for frame in arm.line.sent if code_of(frame) == Protocol1Instruction.WRITE]
    changed = next(at for at, frame in enumerate(writes) if wrote(frame, "torque_mode", "MX-64"))
    assert any(wrote(frame, "goal_position", "MX-64") for frame in writes[:changed]) is stiff
    arm.run(1.0)
    assert servo.angle == pytest.approx(0.4, abs=0.06)  # it goes on while it is identified
    arm.joints.move({"a": -0.2})
    arm.run(1.0)
    assert servo.angle == pytest.approx(-0.2, abs=0.01)


# --- followers that are far away --------------------------------------------------------------------------------------


def fastest_far_off(arm: Hand, seconds: float) -> float:
    """Return how fast (rad/s) the second joint turns at most, over a tenth of a second, while the first is far off."""
    leader, follower = arm.servo(1), arm.servo(2)
    found, end = 0.0, arm.clock.now() + seconds
    while arm.clock.now() < end:
        before, began = follower.angle, arm.clock.now()
        arm.run(0.1)
        if abs(follower.angle - leader.angle) > FOLLOWING_TOLERANCE:
            found = max(found, abs(follower.angle - before) / (arm.clock.now() - began))
    return found


def test_distant_follower_approaches_slowly_and_then_at_its_limit() -> None:
    arm = Hand("AX-12A", "AX-12A", speed=4.0)
    arm.run()
    arm.servo(1).turn_by_hand(1.0)
    arm.run()
    arm.joints.follow([Coupling("a", "b")])
    arm.run()
    arm.servo(1).turn_by_hand(1.4)
    assert 0.8 * MAX_APPROACH_SPEED < fastest_far_off(arm, 2.5) < 1.1 * MAX_APPROACH_SPEED
    assert arm.servo(2).angle == pytest.approx(1.4, abs=FOLLOWING_TOLERANCE / 2)
    arm.servo(1).turn_by_hand(0.0)
    assert fastest_far_off(arm, 1.0) > 2 * MAX_APPROACH_SPEED


def test_followers_approach_slowly_again_after_a_disconnect() -> None:
    patient = ReconnectPolicy(
        decide_after=30.0, latch_after=60.0
    )  # what is tried here is how followers come over, not the rule for absences
    arm = Hand("AX-12A", "AX-12A", speed=4.0, away=patient)
    arm.run()
    arm.joints.follow([Coupling("a", "b")])
    arm.run(0.5)
    arm.line.plugged = False
    with pytest.raises(NotConnected) as caught:
        arm.run()
    arm.joints._monitor.on_port_lost(caught.value)
    arm.servo(1).turn_by_hand(1.0)
    arm.line.plugged = True
    assert 0.8 * MAX_APPROACH_SPEED < fastest_far_off(arm, 2.0) < 1.1 * MAX_APPROACH_SPEED
    assert arm.servo(2).angle == pytest.approx(1.0, abs=FOLLOWING_TOLERANCE / 2)
    arm.servo(1).present = False
    arm.run(1.0)
    arm.servo(1).turn_by_hand(0.0)
    arm.servo(1).present = True
    assert 0.8 * MAX_APPROACH_SPEED < fastest_far_off(arm, 3.0) < 1.1 * MAX_APPROACH_SPEED
    assert arm.servo(2).angle == pytest.approx(0.0, abs=FOLLOWING_TOLERANCE / 2)


def test_recovered_follower_approaches_slowly() -> None:
    arm = Hand("AX-12A", "AX-12A", speed=4.0)
    arm.run()
    arm.joints.follow([Coupling("a", "b")])
    arm.run(0.5)
    arm.servo(2).overload()
    arm.run(1.5)
    arm.servo(1).turn_by_hand(1.0)
    arm.run(0.5)
    assert arm.servo(2).limp
    assert arm.joints.recover() == ("b",)
    assert 0.8 * MAX_APPROACH_SPEED < fastest_far_off(arm, 2.0) < 1.1 * MAX_APPROACH_SPEED


def test_reconnected_joint_approaches_the_next_goal_slowly() -> None:
    arm = Hand("AX-12A", speed=4.0)
    arm.run()
    arm.joints.move({"a": 0.2})
    arm.run(0.5)
    arm.servo(1).present = False
    arm.run(2.0)
    arm.servo(1).present = True
    arm.run(1.5)
    assert arm.joints.health().reconnected_at is not None
    before = arm.servo(1).angle
    arm.joints.move({"a": 1.2})
    arm.run(0.5)
    assert 0.6 * MAX_APPROACH_SPEED < (arm.servo(1).angle - before) / 0.5 < 1.1 * MAX_APPROACH_SPEED
    arm.run(2.0)
    assert arm.servo(1).angle == pytest.approx(1.2, abs=FOLLOWING_TOLERANCE)


def test_goal_requested_before_a_reconnect_is_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    arm = Hand("AX-12A", "AX-12A", speed=4.0)
    arm.run()
    arm.joints.move({"a": 0.2, "b": 0.0})
    arm.run(0.5)
    arm.servo(1).present = False
    arm.run(2.0)

    def back_meanwhile(*_: object) -> None:  # the caller has its permit, and waits for the driver
        arm.servo(1).present = True
        arm.run(1.5)

    monkeypatch.setattr("drivers.servos.driver.check_move", back_meanwhile)
    with pytest.raises(NotConnected, match="looking for the servos"):
        arm.joints.move({"a": 1.2, "b": 1.2})
    monkeypatch.undo()
    arm.run(1.0)
    assert arm.servo(1).angle == pytest.approx(0.2, abs=FOLLOWING_TOLERANCE)
    assert arm.servo(2).angle == pytest.approx(0.0, abs=FOLLOWING_TOLERANCE)
    arm.joints.move({"b": 1.2})
    arm.run(1.0)
    assert arm.servo(2).angle == pytest.approx(1.2, abs=FOLLOWING_TOLERANCE)


def test_hold_takes_priority_over_the_next_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "drivers.servos.driver.COMMAND_PRIORITY_TIMEOUT", 60.0
    )  # in real time, however slow the machine is
    hand = Hand("AX-12A", "AX-12A", "AX-12A")
    hand.run(0.1)
    hand.joints.move({"a": 1.0, "b": 1.0, "c": 1.0})
    sent: list[bytes] = []
    holding = Thread(target=hand.joints.hold)

    def seen(frame: bytes) -> bool:
        sent.append(frame)
        if code_of(frame) == Protocol1Instruction.READ and holding.ident is None:
            holding.start()
            wait_until(lambda: not hand.joints._no_command_pending.is_set())  # it waits for the wire
        return False

    hand.line.loses = seen
    hand.run(0.5)
    holding.join()
    codes = [code_of(frame) for frame in sent]
    first = codes.index(Protocol1Instruction.READ)
    assert codes[first + 1] == Protocol1Instruction.SYNC_WRITE
    assert hand.joints._no_command_pending.is_set()
