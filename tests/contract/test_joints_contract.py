"""What ``drivers.api.Joints`` promises, kept by the driver of Dynamixels and Feetechs over its bus, and by its twin."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from math import degrees, inf, nan
from typing import Literal

import pytest

from drivers.api import Coupling, Joints, JointState, Quality, ReconnectPolicy
from drivers.api.joints import FOLLOWING_TOLERANCE, MAX_APPROACH_SPEED
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.servos.bus import ServoBus
from drivers.servos.driver import STALE_AFTER, DynamixelJoints
from drivers.servos.joint import JointSpec
from drivers.servos.models import MODELS
from drivers.servos.twin import JointsTwin
from drivers.servos.units import Framing
from tests.contract.rigs import InSimulatedTime, Rig, simulated
from tests.drivers.chains import chain
from tests.drivers.cranked import PERIOD, by_hand
from tests.drivers.lines import DirectLine

TICK = MODELS["AX-12A"].tick
SPECS = {
    "wrist": JointSpec(3, lower=-1.0, upper=1.0, speed=4.0),
    "elbow": JointSpec(2, direction=-1, zero=0.5, lower=-1.5, upper=1.5, speed=4.0),
    "shoulder": JointSpec(1, speed=99.0),
}


class JointsRig(Rig):
    model = "AX-12A"
    device: DynamixelJoints | JointsTwin

    @abstractmethod
    def make(self, specs: Mapping[str, JointSpec]) -> object:
        """Make another arm of its kind."""

    @abstractmethod
    def truth(self, joint: str) -> float:
        """Where a joint really is, in radians."""

    @abstractmethod
    def overload(self, joint: str) -> None:
        """Let the servo of a joint shut itself down."""

    @abstractmethod
    def turn_by_hand(self, joint: str, angle: float) -> None:
        """Turn a joint that is limp to an angle in radians."""

    @abstractmethod
    def exchange(self, joint: str, angle: float) -> None:
        """Put another servo in the place of a joint's, which stands at an angle in radians, while it is unplugged."""

    def start(self) -> None:
        self.device.open()
        self.until(lambda: self.device.health().online and self.told("online"))
        self.until(lambda: all(reading.good for reading in self.device.states().values()))

    def state(self, joint: str) -> JointState:
        value = self.device.states()[joint].value
        assert value is not None
        return value

    def at(self, joint: str, angle: float) -> bool:
        """Whether it is there, by its own account and in truth."""
        return abs(self.state(joint).position - angle) <= TICK and abs(self.truth(joint) - angle) <= TICK

    def is_back(self, before: float | None) -> bool:
        """Whether it is back from a long absence, and not from the one that it was back from ``before``."""
        return self.device.health().reconnected_at not in (None, before)

    def near(self, joint: str, angle: float) -> bool:
        """Whether it is there in truth, within what two sensors round."""
        return abs(self.truth(joint) - angle) <= 2 * TICK

    def fresh(self, joint: str) -> JointState:
        """Return what one joint feels after now."""
        now = self.clock.now()
        self.until(lambda: self.device.states()[joint].stamp > now)
        return self.state(joint)


PATIENT = ReconnectPolicy(decide_after=30.0, latch_after=60.0)
"""So that a slow machine does not make a long absence of a short one."""


class WireJoints(InSimulatedTime, JointsRig):
    framing: Framing = "own"

    def __init__(self, at_rest: Literal["hold", "relax"] = "hold", away: ReconnectPolicy = PATIENT) -> None:
        super().__init__()
        self.chain = chain(3, self.model)
        self.chain.servo(2).turn_by_hand(SPECS["elbow"].zero)
        self.line = DirectLine(self.chain, self.timeline.clock)
        self.timeline.call_every(PERIOD, self.line.poll)
        self.device = DynamixelJoints(
            ServoBus("/dev/servos", self.clock, name="arm", dial=self.line.dial, framing=self.framing),
            {name: replace(spec, model=self.model) for name, spec in SPECS.items()},
            self.clock,
            at_rest=at_rest,
            away=away,
            report=self.notices.append,
            changed=self.changed,
            loop=by_hand(self.timeline),
        )

    def make(self, specs: Mapping[str, JointSpec]) -> DynamixelJoints:
        return DynamixelJoints(ServoBus("nowhere", self.clock), specs, self.clock)

    def truth(self, joint: str) -> float:
        spec = SPECS[joint]
        return (self.chain.servo(spec.id).angle - spec.zero) * spec.direction

    def overload(self, joint: str) -> None:
        self.chain.servo(SPECS[joint].id).overload()

    def turn_by_hand(self, joint: str, angle: float) -> None:
        spec = SPECS[joint]
        self.chain.servo(spec.id).turn_by_hand(spec.zero + spec.direction * angle)

    def exchange(self, joint: str, angle: float) -> None:
        self.chain.servo(SPECS[joint].id).power_cycle()
        self.turn_by_hand(joint, angle)

    def unplug(self) -> None:
        self.line.plugged = False

    def plug_in(self) -> None:
        self.line.plugged = True

    def close(self) -> None:
        self.device.close()


class SdkJoints(WireJoints):
    """The same driver with the vendor's packet code."""

    framing: Framing = "sdk"


class FeetechJoints(WireJoints):
    """The same driver with Feetech servos."""

    model = "STS3215"


class TwinJoints(InSimulatedTime, JointsRig):
    def __init__(self, at_rest: Literal["hold", "relax"] = "hold", away: ReconnectPolicy = PATIENT) -> None:
        super().__init__()
        self.device = JointsTwin(
            SPECS, self.clock, at_rest=at_rest, away=away, report=self.notices.append, changed=self.changed
        )
        self.twin = self.device
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def make(self, specs: Mapping[str, JointSpec]) -> JointsTwin:
        return JointsTwin(specs, self.clock)

    def truth(self, joint: str) -> float:
        return self.twin.true_angle(joint, self.clock.now())

    def overload(self, joint: str) -> None:
        self.twin.overload(joint)

    def turn_by_hand(self, joint: str, angle: float) -> None:
        self.twin.turn_by_hand(joint, angle)

    def exchange(self, joint: str, angle: float) -> None:
        self.twin.replace_servo(joint, angle)

    def unplug(self) -> None:
        self.twin.plug.unplug()

    def plug_in(self) -> None:
        self.twin.plug.plug_in()

    def close(self) -> None:
        self.device.close()


RIGS = [
    simulated(WireJoints, "wire"),
    simulated(SdkJoints, "sdk"),
    simulated(FeetechJoints, "feetech"),
    simulated(TwinJoints, "twin"),
]


@pytest.fixture(params=RIGS)
def rig(request: pytest.FixtureRequest) -> Iterator[JointsRig]:
    rig: JointsRig = request.param()
    yield rig
    rig.close()


@pytest.fixture
def arm(rig: JointsRig) -> JointsRig:
    """A rig whose arm is there."""
    rig.start()
    return rig


def test_both_are_joints(rig: JointsRig) -> None:
    device: Joints = rig.device
    assert device.name == "arm"


def test_unopened_device_is_offline_and_has_no_readings(rig: JointsRig) -> None:
    health = rig.device.health()
    assert (health.online, health.detail != "") == (False, True)
    assert {reading.quality for reading in rig.device.states().values()} == {Quality.NONE}
    assert {reading.value for reading in rig.device.states().values()} == {None}
    with pytest.raises(NotConnected, match="arm"):
        rig.device.move({"elbow": 0.1})
    rig.device.rest()
    rig.device.close()
    assert rig.notices == []


def test_all_invalid_joint_specs_are_reported_together(rig: JointsRig) -> None:
    specs = {"a": JointSpec(1, model="AX-99"), "b": JointSpec(1, speed=nan)}
    with pytest.raises(BadRequest, match=r"AX-99.*nan.*servo 1 is a already"):
        rig.make(specs)


def test_joint_limits_are_in_the_order_of_the_robot_file(rig: JointsRig) -> None:
    limits = rig.device.limits
    assert list(limits) == list(rig.device.states()) == ["wrist", "elbow", "shoulder"]
    assert (limits["wrist"].lower, limits["wrist"].upper, limits["wrist"].speed) == (-1.0, 1.0, 4.0)
    assert limits["shoulder"].speed == pytest.approx(MODELS[rig.model].top_speed)


def test_opened_arm_comes_online_limp_with_one_notice(arm: JointsRig) -> None:
    health = arm.device.health()
    assert (health.online, health.detail, health.hint) == (True, "", "")
    assert [notice.kind for notice in arm.notices] == ["online"]
    state = arm.state("elbow")
    assert (state.torque, state.goal, state.moving, state.velocity, state.load) == (False, None, False, 0.0, 0.0)
    assert (state.voltage, state.temperature) == (MODELS[arm.model].nominal_voltage, 35.0)
    assert state.position == pytest.approx(0.0, abs=TICK)
    changes = arm.changes
    arm.until(lambda: arm.changes > changes)


def test_joints_move_together_to_their_goals(arm: JointsRig) -> None:
    goals = {"elbow": 0.8, "wrist": -0.6}
    assert arm.device.move(goals) == goals
    arm.until(lambda: all(arm.at(joint, goal) for joint, goal in goals.items()))
    arm.until(lambda: not arm.state("elbow").moving)
    assert arm.state("elbow").goal == 0.8
    assert arm.state("elbow").torque
    assert not arm.state("shoulder").torque
    assert arm.at("shoulder", 0.0)


def test_a_goal_beyond_the_limits_is_clamped(arm: JointsRig) -> None:
    assert arm.device.move({"wrist": 2.0, "elbow": -9.0}) == {"wrist": 1.0, "elbow": -1.5}
    arm.until(lambda: arm.at("wrist", 1.0) and arm.at("elbow", -1.5))

    arm.until(lambda: arm.told("fault", "the goal of wrist was clamped to 57.3 deg: 114.6 deg is beyond its limits"))
    assert arm.told("fault", "the goal of elbow was clamped")
    assert all(notice.hint for notice in arm.notices if notice.kind == "fault")
    for _ in range(5):
        arm.device.move({"wrist": 2.0})
    assert sum("of wrist was clamped" in notice.message for notice in arm.notices) == 1


def test_position_error_is_independent_of_mounting_direction(arm: JointsRig) -> None:
    assert arm.state("elbow").error is None
    arm.device.move({"elbow": 1.0, "shoulder": 1.0}, speeds={"elbow": 0.5, "shoulder": 0.5})
    for joint in ("elbow", "shoulder"):
        state = arm.fresh(joint)
        assert state.error == pytest.approx(state.position - 1.0)
        assert -1.1 < state.position - 1.0 < -0.5


def test_joint_moves_at_the_requested_speed(arm: JointsRig) -> None:
    began = arm.clock.now()
    arm.device.move({"elbow": -0.5}, speeds={"elbow": 1.0})
    arm.until(lambda: arm.state("elbow").moving)
    state = arm.state("elbow")
    assert state.velocity == pytest.approx(-1.0, abs=0.02)
    assert -0.2 < state.load < 0.0
    arm.until(lambda: arm.at("elbow", -0.5))
    assert arm.clock.now() - began > 0.45


@pytest.mark.parametrize(
    ("goals", "speeds", "complaint"),
    [
        ({"knee": 0.1}, {}, "no joint 'knee'"),
        ({"elbow": 0.1}, {"toe": 1.0}, "no joint 'toe'"),
        ({"elbow": nan}, {}, "a goal of nan"),
        ({"elbow": 0.1, "wrist": -inf}, {}, "a goal of -inf"),
        ({"elbow": 0.1}, {"elbow": inf}, "a speed of inf"),
    ],
)
def test_invalid_move_is_refused_as_a_whole(
    arm: JointsRig, goals: dict[str, float], speeds: dict[str, float], complaint: str
) -> None:
    with pytest.raises(BadRequest, match=complaint):
        arm.device.move(goals, speeds=speeds)
    assert not arm.fresh("elbow").torque
    assert arm.at("elbow", 0.0)


def test_held_arm_stops_with_torque(arm: JointsRig) -> None:
    arm.device.move({"shoulder": 2.0}, speeds={"shoulder": 1.5})
    arm.until(lambda: arm.state("shoulder").position > 0.3)
    arm.device.hold()
    arm.until(lambda: not arm.fresh("shoulder").moving)
    held = arm.truth("shoulder")
    assert 0.25 < held < 1.5
    arm.wait(0.1)
    assert arm.truth("shoulder") == held
    assert all(arm.state(joint).torque for joint in SPECS)


def test_relaxed_arm_has_no_torque_and_no_goal(arm: JointsRig) -> None:
    arm.device.move({"shoulder": 2.0}, speeds={"shoulder": 1.5})
    arm.until(lambda: arm.state("shoulder").position > 0.3)
    arm.device.relax()
    state = arm.fresh("shoulder")
    assert (state.torque, state.goal) == (False, None)
    there = arm.truth("shoulder")
    arm.wait(0.1)
    assert arm.truth("shoulder") == there


def test_hold_and_relax_affect_only_the_named_joints(arm: JointsRig) -> None:
    arm.device.hold(["wrist", "elbow"])
    assert [arm.fresh(joint).torque for joint in SPECS] == [True, True, False]
    arm.device.move({"wrist": 0.8, "elbow": 0.8}, speeds={"wrist": 1.0, "elbow": 1.0})
    arm.device.relax(["elbow"])
    arm.until(lambda: arm.at("wrist", 0.8))
    assert not arm.fresh("elbow").torque
    assert arm.truth("elbow") < 0.5
    arm.device.hold([])
    arm.device.relax([])
    assert [arm.fresh(joint).torque for joint in SPECS] == [True, False, False]
    for refused in (arm.device.hold, arm.device.relax):
        with pytest.raises(BadRequest, match=r"no joint 'knee' \(there are wrist, elbow, shoulder\)"):
            refused(["wrist", "knee"])
    assert arm.fresh("wrist").torque


def test_follower_follows_its_limp_leader(arm: JointsRig) -> None:
    arm.device.follow([Coupling("elbow", "wrist", scale=-0.5, offset=0.1)])
    arm.until(lambda: arm.at("wrist", 0.1))
    for angle in (0.8, -0.6):
        arm.turn_by_hand("elbow", angle)
        arm.until(partial(arm.near, "wrist", 0.1 - 0.5 * angle))
    assert arm.fresh("wrist").torque
    assert not arm.fresh("elbow").torque
    assert not arm.fresh("shoulder").torque


def test_follower_is_clamped_to_its_limits_with_one_notice(arm: JointsRig) -> None:
    arm.device.follow([Coupling("elbow", "wrist", scale=2.0)])
    arm.turn_by_hand("elbow", 1.2)
    arm.until(lambda: arm.at("wrist", 1.0))
    assert sum("goal of wrist was clamped" in notice.message for notice in arm.notices) == 1


def test_uncoupled_follower_stays_where_it_is(arm: JointsRig) -> None:
    arm.device.follow([Coupling("elbow", "wrist"), Coupling("elbow", "shoulder")])
    arm.turn_by_hand("elbow", 0.3)
    arm.until(lambda: arm.at("wrist", 0.3) and arm.at("shoulder", 0.3))
    arm.device.follow([Coupling("elbow", "shoulder")])
    arm.turn_by_hand("elbow", 0.6)
    arm.until(lambda: arm.at("shoulder", 0.6))
    assert arm.at("wrist", 0.3)
    arm.device.follow(())
    arm.turn_by_hand("elbow", 0.0)
    arm.until(lambda: arm.at("elbow", 0.0))
    arm.wait(0.1)
    assert arm.at("wrist", 0.3)
    assert arm.at("shoulder", 0.6)
    assert arm.fresh("wrist").torque
    assert arm.fresh("shoulder").torque
    arm.device.follow(())


@pytest.mark.parametrize("command", ["move", "hold", "relax"])
def test_command_to_a_follower_ends_its_coupling(arm: JointsRig, command: str) -> None:
    arm.device.follow([Coupling("elbow", "wrist"), Coupling("elbow", "shoulder")])
    arm.turn_by_hand("elbow", 0.3)
    arm.until(lambda: arm.at("wrist", 0.3) and arm.at("shoulder", 0.3))
    match command:
        case "move":
            arm.device.move({"wrist": 0.2})
        case "hold":
            arm.device.hold(["wrist"])
        case _:
            arm.device.relax(["wrist"])
    arm.turn_by_hand("elbow", -0.3)
    arm.until(lambda: arm.at("shoulder", -0.3))
    assert arm.at("wrist", 0.2 if command == "move" else 0.3)
    assert arm.fresh("wrist").torque == (command != "relax")


def test_invalid_couplings_are_refused_without_changes(arm: JointsRig) -> None:
    arm.device.follow([Coupling("elbow", "wrist")])
    for wrong, words in (
        ([Coupling("knee", "wrist")], "no joint 'knee'"),
        ([Coupling("elbow", "wrist"), Coupling("shoulder", "wrist")], "follows another joint already"),
        ([Coupling("elbow", "wrist"), Coupling("wrist", "shoulder")], "cannot follow as well"),
        ([Coupling("elbow", "wrist", scale=nan)], "must be finite"),
    ):
        with pytest.raises(BadRequest, match=words):
            arm.device.follow(wrong)
    arm.turn_by_hand("elbow", 0.4)
    arm.until(lambda: arm.at("wrist", 0.4))


def test_couplings_of_an_unplugged_arm_can_end_but_not_begin(arm: JointsRig) -> None:
    arm.device.follow([Coupling("elbow", "wrist")])
    arm.turn_by_hand("elbow", 0.4)
    arm.until(lambda: arm.at("wrist", 0.4))
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    with pytest.raises(NotConnected, match="arm"):
        arm.device.follow([Coupling("elbow", "shoulder")])
    arm.device.follow(())
    arm.plug_in()
    arm.until(lambda: arm.device.health().online and arm.device.states()["elbow"].good)
    arm.turn_by_hand("elbow", 0.1)
    arm.until(lambda: arm.at("elbow", 0.1))
    arm.wait(0.1)
    assert arm.at("wrist", 0.4)


def test_replugged_follower_resumes_following(arm: JointsRig) -> None:
    arm.device.follow([Coupling("elbow", "wrist")])
    arm.turn_by_hand("elbow", 0.4)
    arm.until(lambda: arm.at("wrist", 0.4))
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    arm.turn_by_hand("elbow", 0.1)
    arm.plug_in()
    arm.until(lambda: arm.at("wrist", 0.1))


@pytest.mark.parametrize("kind", RIGS)
def test_arm_rests_after_a_disconnect_and_is_latched_after_a_long_one(
    kind: type[WireJoints | TwinJoints],
) -> None:
    rig = kind(away=ReconnectPolicy(decide_after=0.4, latch_after=1.5))
    try:
        rig.device.open()
        rig.until(lambda: rig.device.health().online and all(each.good for each in rig.device.states().values()))
        for gone, latched in ((0.6, False), (2.0, True)):
            rig.device.follow([Coupling("elbow", "wrist")])
            rig.device.move({"shoulder": 1.2}, speeds={"shoulder": 0.3})
            rig.until(lambda: rig.state("shoulder").velocity > 0.1)
            before = rig.device.health().reconnected_at
            rig.unplug()
            rig.wait(gone)
            rig.plug_in()
            rig.until(partial(rig.is_back, before))
            rig.wait(0.5)
            here = rig.truth("shoulder")
            rig.turn_by_hand("elbow", rig.truth("elbow") + 0.3)
            rig.wait(0.5)
            assert rig.truth("shoulder") == here < 1.1
            assert abs(rig.truth("wrist") - rig.truth("elbow")) > 0.2
            assert bool(rig.device.latched) is latched
            if latched:
                with pytest.raises(DeviceFault, match="arm: stopped: it was away for"):
                    rig.device.move({"shoulder": 0.0})
                rig.device.enable()
            rig.device.move({"shoulder": 0.0})
            rig.until(lambda: rig.at("shoulder", 0.0))
    finally:
        rig.close()


def test_distant_follower_approaches_slowly_also_after_a_reconnect(arm: JointsRig) -> None:
    began = arm.clock.now()
    arm.turn_by_hand("elbow", 1.0)
    arm.device.follow([Coupling("elbow", "wrist")])
    arm.until(partial(arm.near, "wrist", 1.0))
    assert arm.clock.now() - began > 0.95 * (1.0 - FOLLOWING_TOLERANCE) / MAX_APPROACH_SPEED
    arm.turn_by_hand("elbow", -1.0)
    arm.until(lambda: arm.state("wrist").velocity < -2 * MAX_APPROACH_SPEED)
    arm.until(partial(arm.near, "wrist", -1.0))
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    arm.turn_by_hand("elbow", 0.0)
    began = arm.clock.now()
    arm.plug_in()
    arm.until(partial(arm.near, "wrist", 0.0))
    assert arm.clock.now() - began > 0.95 * (1.0 - FOLLOWING_TOLERANCE) / MAX_APPROACH_SPEED


@pytest.mark.parametrize("at_rest", ["hold", "relax"])
@pytest.mark.parametrize("kind", RIGS)
def test_resting_arm_holds_or_relaxes_as_configured(kind: type[WireJoints | TwinJoints], at_rest: str) -> None:
    rig = kind(at_rest="hold" if at_rest == "hold" else "relax")
    try:
        rig.start()
        rig.device.move({"elbow": 0.3})
        rig.until(lambda: rig.at("elbow", 0.3))
        rig.device.rest()
        rig.device.rest()
        assert rig.fresh("elbow").torque == (at_rest == "hold")
        assert rig.at("elbow", 0.3)
    finally:
        rig.close()


def test_unplugged_arm_gives_the_reason_while_its_servos_stop(arm: JointsRig) -> None:
    arm.device.move({"elbow": 1.2}, speeds={"elbow": 2.0})
    arm.until(lambda: arm.state("elbow").position > 0.1)
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    (notice,) = [notice for notice in arm.notices if notice.kind == "offline"]
    assert (notice.device, notice.hint != "") == ("arm", True)
    health = arm.device.health()
    assert (health.online, health.detail != "", health.hint != "") == (False, True, True)
    with pytest.raises(NotConnected, match="arm") as caught:
        arm.device.move({"elbow": 0.1})
    assert caught.value.hint
    arm.wait(0.5)
    rested = arm.truth("elbow")
    assert 0.1 < rested < 1.1
    arm.wait(STALE_AFTER)
    assert arm.truth("elbow") == rested
    readings = arm.device.states().values()
    assert {reading.quality for reading in readings} == {Quality.STALE}
    arm.device.hold()
    arm.device.relax()


def test_failed_rest_is_reported_once_without_shut_down_servos(arm: JointsRig) -> None:
    arm.device.move({"elbow": 0.3, "wrist": 0.3})
    arm.until(lambda: arm.at("elbow", 0.3) and arm.at("wrist", 0.3))
    arm.overload("elbow")
    arm.until(lambda: arm.told("fault", "elbow (servo 2) has shut down"))
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    arm.device.rest()
    arm.device.close()
    arm.device.rest()
    (notice,) = [notice for notice in arm.notices if "could not be" in notice.message]
    assert notice.message == "could not be held: wrist (servo 3), shoulder (servo 1)"
    assert notice.hint == "switch their power off by hand"


def test_failed_hold_is_reported_once_and_repeated_after_a_reconnect(arm: JointsRig) -> None:
    arm.device.move({"elbow": 1.2}, speeds={"elbow": 0.5})
    arm.until(lambda: arm.state("elbow").position > 0.1)
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    for _ in range(3):
        arm.device.hold(["elbow"])
    (notice,) = [notice for notice in arm.notices if "could not be" in notice.message]
    assert (notice.kind, notice.message) == ("fault", "could not be held: elbow (servo 2)")
    assert notice.hint
    arm.device.relax(["wrist"])
    assert arm.told("fault", "could not be relaxed: wrist (servo 3)")
    arm.notices.clear()
    arm.plug_in()
    arm.until(lambda: arm.told("online") and arm.device.states()["elbow"].good)
    arm.until(lambda: arm.fresh("elbow").torque and not arm.fresh("elbow").moving)
    assert arm.truth("elbow") < 1.0
    arm.device.hold()
    assert not arm.told("fault")


def test_replugged_arm_holds_its_position(arm: JointsRig) -> None:
    arm.device.move({"elbow": 1.2}, speeds={"elbow": 0.5})
    arm.until(lambda: arm.state("elbow").position > 0.1)
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    arm.notices.clear()
    arm.plug_in()
    arm.until(lambda: arm.told("online") and arm.device.states()["elbow"].good)
    state = arm.fresh("elbow")
    assert state.torque
    assert state.goal is not None
    assert 0.05 < state.goal < 1.15
    assert not arm.state("shoulder").torque
    arm.device.move({"elbow": 0.0})
    arm.until(lambda: arm.at("elbow", 0.0))


def test_exchanged_servo_is_reported_and_moves_on_slowly(
    arm: JointsRig,
) -> None:
    arm.device.move({"elbow": 0.7, "wrist": 0.2})
    arm.until(lambda: arm.at("elbow", 0.7) and arm.at("wrist", 0.2))
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    arm.exchange("elbow", 0.0)
    arm.notices.clear()
    arm.plug_in()
    arm.until(lambda: arm.told("online") and arm.device.states()["elbow"].good)
    (notice,) = [notice for notice in arm.notices if notice.kind == "fault"]
    there, before = (float(word) for word in notice.message.split() if word.strip("-").replace(".", "").isdigit())
    assert notice.message.startswith("elbow (servo 2) stands at ")
    assert (there, before) == pytest.approx((0.0, degrees(0.7)), abs=0.4)
    assert "slowly" in notice.hint
    assert arm.fresh("elbow").torque
    assert arm.near("elbow", 0.0)
    began = arm.clock.now()
    arm.device.move({"elbow": 0.7})
    arm.until(lambda: arm.at("elbow", 0.7))
    assert arm.clock.now() - began > 0.95 * (0.7 - FOLLOWING_TOLERANCE) / MAX_APPROACH_SPEED
    began = arm.clock.now()
    arm.device.move({"elbow": 0.0})
    arm.until(lambda: arm.state("elbow").velocity < -2 * MAX_APPROACH_SPEED)


@pytest.mark.parametrize("after", [0.3, 0.31, 0.33])
def test_hold_after_a_finished_move_while_unplugged_moves_nothing(arm: JointsRig, after: float) -> None:
    arm.device.move({"elbow": 1.4}, speeds={"elbow": 2.0})
    arm.wait(after)
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    arm.wait(0.5)
    stood = arm.truth("elbow")
    arm.device.hold()
    arm.plug_in()
    arm.until(lambda: arm.told("online") and arm.device.states()["elbow"].good)
    arm.wait(0.3)
    assert arm.truth("elbow") == pytest.approx(stood, abs=1e-9)


def test_joints_keep_goal_or_limpness_over_a_disconnect(arm: JointsRig) -> None:
    arm.device.move({"elbow": 1.4}, speeds={"elbow": 2.0})
    arm.until(lambda: arm.state("elbow").position > 0.2)
    arm.unplug()
    arm.until(lambda: arm.told("offline"))
    arm.turn_by_hand("shoulder", 1.0)
    arm.wait(0.5)
    arm.notices.clear()
    arm.plug_in()
    arm.until(lambda: arm.told("online") and arm.device.states()["shoulder"].good)
    assert not arm.told("fault")


def test_servo_that_shuts_down_is_reported_and_left_out(arm: JointsRig) -> None:
    arm.device.move({"elbow": 0.3})
    arm.until(lambda: arm.at("elbow", 0.3))
    arm.overload("elbow")
    arm.until(lambda: arm.told("fault", "elbow (servo 2) reports overload"))
    arm.until(lambda: arm.told("fault", "elbow (servo 2) has shut down"))
    assert all(notice.hint for notice in arm.notices if notice.kind == "fault")
    health = arm.device.health()
    assert (health.online, "elbow (servo 2) has shut down" in health.detail) == (True, True)
    assert health.hint
    assert not arm.fresh("elbow").torque
    arm.device.move({"elbow": -0.3, "wrist": 0.2})
    arm.until(lambda: arm.told("fault", "a move left elbow (servo 2) out: it has shut down"))
    arm.until(lambda: arm.at("wrist", 0.2))
    assert arm.at("elbow", 0.3)
    arm.device.hold()
    assert not arm.fresh("elbow").torque


def test_recovered_servo_holds_its_position(arm: JointsRig) -> None:
    arm.device.move({"elbow": 0.3})
    arm.until(lambda: arm.at("elbow", 0.3))
    assert arm.device.recover() == ()
    arm.overload("elbow")
    arm.until(lambda: arm.told("fault", "has shut down"))
    assert arm.device.recover() == ("elbow",)
    assert arm.fresh("elbow").torque
    assert arm.at("elbow", 0.3)
    arm.device.move({"elbow": 0.0})
    arm.until(lambda: arm.at("elbow", 0.0))
    assert arm.device.health().detail == ""


def test_closed_arm_holds_and_moves_again_once_opened(arm: JointsRig) -> None:
    arm.device.move({"shoulder": 2.0}, speeds={"shoulder": 1.5})
    arm.until(lambda: arm.state("shoulder").position > 0.3)
    arm.device.close()
    arm.device.close()
    arm.device.rest()
    assert not arm.device.health().online
    assert [notice.kind for notice in arm.notices] == ["online"]
    arm.wait(0.05)
    held = arm.truth("shoulder")
    arm.wait(0.1)
    assert arm.truth("shoulder") == held < 1.5
    with pytest.raises(NotConnected):
        arm.device.move({"shoulder": 0.0})
    arm.start()
    arm.device.move({"shoulder": 0.0})
    arm.until(lambda: arm.at("shoulder", 0.0))
