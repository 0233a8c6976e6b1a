"""The walking engine: its pressure stays within the soles, by itself and by the masses of the whole body."""

from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest

from drivers.api import ZERO_VELOCITY, DeviceStatus, Quality, Velocity
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.legs.body import SIDES, Floats, LeggedBody, body_of
from drivers.legs.declared import LegsKeys, StrideKeys
from drivers.legs.engine import (
    CONTROL_INTERVAL,
    AttitudeEstimate,
    LegPosture,
    WalkingEngine,
    WalkPlan,
    plan_walk,
    walk_parameters,
    whole_body_pose,
)
from drivers.legs.kinematics import (
    FootOdometry,
    centre_of_mass,
    centre_over_legs,
    forward_kinematics,
    link_centres,
    rotation_about,
)
from drivers.legs.pattern_generator import (
    GRAVITY,
    FloorPose,
    WalkPatternGenerator,
    advance_pendulum,
    hull_edges,
    pendulum_rate,
    polygon_margin,
    sway_share,
)
from drivers.legs.twin import LegsTwin
from drivers.legs.twin import make as make_legs
from drivers.servos.declared import DynamixelKeys
from drivers.servos.twin import JointsTwin
from drivers.servos.twin import make as make_arm
from drivers.sim.context import SimContext
from drivers.sim.timeline import Timeline
from drivers.sim.world import ORIGIN
from missions.library.drivers import load_robot

ROBOTS = Path(__file__).parents[2] / "config" / "robots"
WALKS = [
    ("humanoid", (0.28, 0.0, 0.0)),
    ("humanoid", (0.1, 0.0, 0.4)),
    ("op3", (0.2, 0.0, 0.0)),
    ("op3", (0.1, 0.02, 0.3)),
]


def described(name: str) -> tuple[LeggedBody, StrideKeys, DynamixelKeys]:
    robot = load_robot(ROBOTS / f"{name}.yaml")
    keys, arm = robot.keys(LegsKeys), robot.keys(DynamixelKeys)
    assert keys is not None
    assert arm is not None
    return body_of(keys.body), keys.stride, arm


def pressure(body: LeggedBody, stride: StrideKeys, walk: WalkPlan) -> Floats:
    """Return where all the masses of the body, as they are moved, press on the floor: (M, 2)."""
    placed = forward_kinematics(body, whole_body_pose(body, walk.angles))
    turned = rotation_about(np.array([0.0, 0, 1]), walk.heading) @ rotation_about(
        np.array([0.0, 1, 0]), np.array(stride.lean)
    )
    links = walk.trunk[:, None] + (turned[:, None] @ link_centres(body, placed)[..., None])[..., 0]
    places = np.concatenate((links, (walk.trunk + turned @ body.trunk.centre)[:, None]), axis=1)
    mass = np.append(body.mass, body.trunk.mass)
    push = np.gradient(np.gradient(places, CONTROL_INTERVAL, axis=0), CONTROL_INTERVAL, axis=0)
    weight = mass * (push[..., 2] + GRAVITY)
    sums = [(weight * places[..., axis] - mass * push[..., axis] * places[..., 2]).sum(axis=1) for axis in (0, 1)]
    found: Floats = np.stack(sums, axis=1) / weight.sum(axis=1)[:, None]
    return found


@pytest.mark.parametrize(("name", "command"), WALKS)
def test_the_masses_of_the_whole_body_press_within_the_soles(name: str, command: tuple[float, float, float]) -> None:
    body, stride, _ = described(name)
    walk = plan_walk(body, stride, command, 5.0)
    assert not walk.reason.any()
    there = pressure(body, stride, walk)
    leg, worst = body.legs["left"], 1.0
    for moment, p in list(zip(walk.patterns, there, strict=True))[3:-3]:
        on = [side for side in SIDES if moment.support in (side, "both")]
        spots = [FloorPose(x, y, heading) for x, y, _, heading in (moment.feet[side] for side in on)]
        corners = [(u * leg.length / 2, v * leg.width / 2) for u in (-1, 1) for v in (-1, 1)]
        support = hull_edges([spot.offset(*corner).point for spot in spots for corner in corners])
        worst = min(worst, polygon_margin(support, (float(p[0]), float(p[1]))))
    assert worst > 0.01
    assert min(moment.margin for moment in walk.patterns) > 0.03


@pytest.mark.parametrize(("name", "command"), WALKS)
def test_walk_stays_within_joint_limits_and_speeds(name: str, command: tuple[float, float, float]) -> None:
    body, stride, arm = described(name)
    walk = plan_walk(body, stride, command, 5.0)
    limits = [arm.limits[joint] for joint in body.leg_joints]
    assert (walk.angles > [each.lower for each in limits]).all()
    assert (walk.angles < [each.upper for each in limits]).all()
    assert (
        np.abs(np.gradient(walk.angles, CONTROL_INTERVAL, axis=0)).max(axis=0) < [each.speed for each in limits]
    ).all()


@pytest.mark.parametrize("name", ["humanoid", "op3"])
@pytest.mark.parametrize("more", [-0.005, 0.0, 0.005])
def test_sway_is_as_configured_and_reduces_the_margin(name: str, more: float) -> None:
    body, stride, _ = described(name)
    plain = walk_parameters(body, stride)
    share = sway_share(pendulum_rate(plain.com_height), plain.step_time, plain.double_support)
    stride = replace(stride, sway=share * plain.foot_spacing / 2 + more)
    moments = plan_walk(body, stride, (0.1, 0.0, 0.0), 8.0).patterns[400:]
    assert max(abs(moment.centre[1]) for moment in moments) == pytest.approx(stride.sway, abs=5e-4)
    assert min(moment.margin for moment in moments) == pytest.approx(plain.sole_width / 2 - abs(more) / share, abs=2e-3)


def test_excessive_sway_is_refused_with_the_possible_range() -> None:
    body, stride, _ = described("humanoid")
    with pytest.raises(BadRequest, match="a sway of 100 mm presses outside of the soles") as refused:
        walk_parameters(body, replace(stride, sway=0.1))
    assert "give sway 8 to 31 mm" in str(refused.value.hint)


@pytest.mark.parametrize("name", ["humanoid", "op3"])
def test_random_commands_keep_the_walker_balanced(name: str) -> None:
    body, stride, _ = described(name)
    manner = walk_parameters(body, stride)
    for seed in range(8):
        chance = Random(seed)  # noqa: S311 - chance, not a secret
        walker, worst = WalkPatternGenerator(manner), 1.0
        for _ in range(40):
            some = chance.uniform(-0.25, 0.25), chance.choice((0, 0.05, -0.05)), chance.choice((0, 0.6, -0.6))
            walker.command(*(some if chance.random() > 0.35 else (0.0, 0.0, 0.0)))
            for _ in range(chance.randrange(1, 120)):
                moment = walker.advance(CONTROL_INTERVAL)
                worst = min(worst, moment.margin)
                off = np.hypot(moment.centre[0] - moment.pose.x, moment.centre[1] - moment.pose.y)
                assert off < 0.15
        assert worst > 0.01
        walker.command(0.0, 0.0, 0.0)
        for _ in range(400):
            moment = walker.advance(CONTROL_INTERVAL)
        assert walker.is_standing
        assert moment.centre == moment.pose.point


@pytest.mark.parametrize("after", np.arange(1.0, 3.0, 0.13).tolist())
def test_a_halt_ends_in_a_stand_within_two_steps(after: float) -> None:
    body, stride, _ = described("humanoid")
    walker = WalkPatternGenerator(walk_parameters(body, stride))
    walker.command(0.2, 0.0, 0.1)
    before = [walker.advance(CONTROL_INTERVAL).support for _ in range(round(after / CONTROL_INTERVAL))][-1]
    walker.command(0.0, 0.0, 0.0)
    landings = 0
    for _ in range(300):
        moment = walker.advance(CONTROL_INTERVAL)
        landings += before != "both" == moment.support
        before = moment.support
    assert walker.is_standing
    assert landings <= 2
    left, right = (moment.feet[side] for side in SIDES)
    assert np.hypot(left[0] - right[0], left[1] - right[1]) == pytest.approx(walker.manner.foot_spacing)


def test_pendulum_matches_its_differential_equation() -> None:
    c, xi, p, w = (0.01, -0.02), (0.03, 0.01), (0.0, 0.005), 4.8
    fine, capture = c, xi
    for _ in range(100_000):  # Euler, in tiny steps
        fine = tuple(a + w * (b - a) * 2e-6 for a, b in zip(fine, capture, strict=True))  # type: ignore[assignment]
        capture = tuple(b + w * (b - q) * 2e-6 for b, q in zip(capture, p, strict=True))  # type: ignore[assignment]
    there, after = advance_pendulum(c, xi, p, w, 0.2)
    assert there == pytest.approx(fine, abs=1e-6)
    assert after == pytest.approx(capture, abs=1e-6)


def test_the_quick_centre_of_mass_is_the_centre_of_mass() -> None:
    for name in ("humanoid", "op3"):
        body, _, _ = described(name)
        angles = np.random.default_rng(6).normal(size=(20, 12)) / 2
        slow = centre_of_mass(body, forward_kinematics(body, whole_body_pose(body, angles)))
        assert np.allclose(centre_over_legs(body, angles.reshape(-1, 2, 6)), slow, atol=1e-12)


def test_stepwise_walk_equals_the_planned_walk() -> None:
    body, stride, _ = described("humanoid")
    engine = WalkingEngine(body, stride)
    engine.command(0.2, 0.0, 0.0)
    walked = np.array([engine.step().angles for _ in range(300)])
    assert np.abs(walked - plan_walk(body, stride, (0.2, 0.0, 0.0), 3.0).angles).max() < np.radians(1)


def test_foot_odometry_measures_the_walk() -> None:
    body, stride, _ = described("humanoid")
    engine = WalkingEngine(body, stride)
    engine.command(0.2, 0.0, 0.15)
    led = FootOdometry(body, ORIGIN)
    for step in range(800):
        pose = led.update(whole_body_pose(body, engine.step().angles))
        if step == 500:
            engine.halt()
    assert engine.is_standing
    told = engine.pose[0]
    assert np.hypot(pose.x - told.x, pose.y - told.y) < 0.04  # of 0.8 m
    assert pose.heading == pytest.approx(told.heading, abs=0.06)


class Legs:
    """A humanoid's twin, with its legs."""

    def __init__(self) -> None:
        robot = load_robot(ROBOTS / "humanoid.yaml")
        arm, keys = robot.keys(DynamixelKeys), robot.keys(LegsKeys)
        assert arm is not None
        assert keys is not None
        self.told: list[DeviceStatus] = []
        self.line = Timeline()
        stage = SimContext(self.line.clock, None, lambda _: ORIGIN, report=self.told.append)
        self.arm: JointsTwin = make_arm(arm, stage)
        self.base: LegsTwin = make_legs(keys, replace(stage, parts={"arm": self.arm}))
        self.legs = self.base._engine.body.leg_joints
        self.jumps = 0.0
        for each in (self.arm, self.base):
            each.open()
            self.line.call_every(each.STEP_INTERVAL, each.step)
        self.line.call_every(CONTROL_INTERVAL, self._look)
        self._before = self.angles()
        self.pass_(0.1)

    def angles(self) -> Floats:
        return np.array([self.arm.true_angle(name, self.line.clock.now()) for name in self.legs])

    def _look(self) -> None:
        now = self.angles()
        self.jumps, self._before = max(self.jumps, float(np.abs(now - self._before).max())), now

    def pass_(self, seconds: float, velocity: Velocity | None = None) -> None:
        clock = self.line.clock
        until = clock.now() + seconds
        while clock.now() < until - 1e-9:
            if velocity is not None:
                self.base.drive(velocity)
            self.line.run_until(min(until, clock.now() + 0.05))


@pytest.fixture
def legs() -> Legs:
    return Legs()


def test_walk_starts_from_a_stand_and_stops_when_the_command_expires(legs: Legs) -> None:
    legs.pass_(8.0, Velocity(0.15, 0.0))
    state = legs.base.state()
    assert state.value is not None
    assert state.value.reckoned
    assert state.value.velocity.linear == pytest.approx(0.15)
    legs.pass_(2.5)  # the command is valid for 0.3 s
    assert not legs.base.is_walking
    state = legs.base.state()
    assert state.value is not None
    assert state.value.velocity == ZERO_VELOCITY
    assert state.value.pose.x > 0.5
    before = legs.angles()
    legs.pass_(1.0)
    assert np.array_equal(legs.angles(), before)
    assert legs.jumps < np.radians(300) * CONTROL_INTERVAL  # no joint faster than it may


def test_a_chain_unplugged_in_mid_step_is_no_leap(legs: Legs) -> None:
    legs.pass_(6.23, Velocity(0.2, 0.0))
    assert legs.base.is_walking
    legs.arm.plug.unplug()
    before = legs.angles()
    legs.pass_(0.5)
    assert np.abs(legs.angles() - before).max() < np.radians(20)  # to the end of what the servos were told
    assert legs.base.state().quality is Quality.STALE
    with pytest.raises(NotConnected):
        legs.base.drive(Velocity(0.1, 0.0))
    held = legs.angles()
    legs.arm.plug.plug_in()
    legs.pass_(0.5)
    assert np.abs(legs.angles() - held).max() < np.radians(1)  # it stays until somebody commands it
    legs.jumps = 0.0
    legs.pass_(0.3, Velocity(0.1, 0.0))
    assert legs.jumps < np.radians(60) * CONTROL_INTERVAL  # slowly, to where a walk begins
    legs.pass_(6.0, Velocity(0.1, 0.0))
    assert legs.base.is_walking


def test_sitting_legs_refuse_to_walk(legs: Legs) -> None:
    legs.arm.move({"left_hip_pitch": 1.56, "right_hip_pitch": 1.56, "left_knee": 1.9, "right_knee": 1.9})
    legs.pass_(2.0)
    before = legs.angles()
    with pytest.raises(DeviceFault, match="from where a walk begins"):
        legs.base.drive(Velocity(0.1, 0.0))
    legs.pass_(0.5)
    assert np.array_equal(legs.angles(), before)


def test_walk_after_a_manual_sit_is_refused(legs: Legs) -> None:
    legs.pass_(3.0, Velocity(0.1, 0.0))
    legs.pass_(3.0)
    assert not legs.base.is_walking
    legs.arm.move({"left_hip_pitch": 1.56, "right_hip_pitch": 1.56, "left_knee": 1.9, "right_knee": 1.9})
    legs.pass_(3.0)
    before = legs.angles()
    with pytest.raises(DeviceFault, match="from where a walk begins"):
        legs.base.drive(Velocity(0.1, 0.0))
    legs.pass_(0.5)
    assert np.array_equal(legs.angles(), before)


def test_unreachable_foot_ends_the_walk(legs: Legs) -> None:
    legs.pass_(4.0, Velocity(0.1, 0.0))
    engine = legs.base._engine
    step = engine.step

    def short(dt: float, felt: AttitudeEstimate | None) -> LegPosture:
        return replace(step(dt, felt), refused="left leg: too far")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "step", short)
        legs.pass_(0.05)
    assert legs.base.latched == "left leg: too far"
    with pytest.raises(DeviceFault, match="too far"):
        legs.base.drive(Velocity(0.1, 0.0))
    legs.pass_(3.0)
    assert not legs.base.is_walking


def test_limp_leg_latches_the_walk(legs: Legs) -> None:
    legs.pass_(6.0, Velocity(0.2, 0.0))
    legs.arm.overload("left_knee")
    legs.pass_(0.1)
    assert "left_knee went limp" in legs.base.latched
    before = legs.angles()
    legs.pass_(1.0)
    assert np.abs(legs.angles() - before).max() < np.radians(20)


@pytest.mark.parametrize("act", ["stand", "sit"])
@pytest.mark.parametrize("after", [0.0, 0.5, 20.0])
def test_shut_down_leg_ends_stand_and_sit(legs: Legs, act: str, after: float) -> None:
    legs.arm.relax(list(legs.arm.limits))
    perform(legs, act, after)
    legs.arm.overload("left_knee")
    perform(legs, "sit" if act == "stand" else "stand", 0.0 if after < 20.0 else 3.0)
    perform(legs, act, 3.0)
    assert "left_knee went limp" in legs.base.latched
    legs.base.enable()
    legs.pass_(0.1)
    perform(legs, act, 3.0)
    assert "left_knee went limp" in legs.base.latched


def perform(legs: Legs, act: str, seconds: float) -> None:
    """Ask for an act as a leaf does, at every tick, until the legs are latched."""
    for _ in range(round(seconds / 0.05)):
        if legs.base.latched:
            return
        legs.base.perform(act)
        legs.pass_(0.05)


def test_fall_latches_and_relaxes_the_legs(legs: Legs) -> None:
    attitude = AttitudeEstimate(0.0, 0.1)
    legs.base._read_attitude = lambda: attitude
    legs.pass_(6.0, Velocity(0.1, 0.0))
    attitude = AttitudeEstimate(0.0, 1.2)
    legs.pass_(0.1)
    state = legs.base.state().value
    assert state is not None
    assert state.fallen
    assert legs.base.latched == "it has fallen"
    torque = [
        reading.value.torque for name, reading in legs.arm.states().items() if reading.value and name in legs.legs
    ]
    assert not any(torque)
    legs.pass_(1.0)
    elbows = [legs.arm.states()[f"{side}_elbow"].value for side in SIDES]
    assert [each and each.position for each in elbows] == pytest.approx([np.radians(110)] * 2, abs=0.02)  # drawn in
    legs.base.enable()  # as the release of a stop does
    with pytest.raises(DeviceFault, match="it has fallen"):
        legs.base.drive(Velocity(0.1, 0.0))
    legs.base._read_attitude = lambda: None
    legs.pass_(0.1)
    state = legs.base.state().value
    assert state is not None
    assert state.lean is None  # nothing measures it any more


def test_unloaded_legs_latch_and_stay_stiff(legs: Legs) -> None:
    legs.pass_(6.0, Velocity(0.1, 0.0))
    legs.base._fall_detector.fallen = True
    legs.pass_(0.1)
    assert legs.base.latched == "it has fallen"
    states = [legs.arm.states()[name].value for name in legs.legs]
    assert all(state and state.torque for state in states)
    arms_stay(legs)


def arms_stay(legs: Legs) -> None:
    """The arms are where they were, and nobody has told them to go elsewhere."""
    legs.pass_(1.0)
    elbows = [legs.arm.states()[f"{side}_elbow"].value for side in SIDES]
    assert [each and each.position for each in elbows] == pytest.approx([0.0, 0.0], abs=0.02)


def test_arms_stay_in_place_when_unused_legs_fall(legs: Legs) -> None:
    legs.base._read_attitude = lambda: AttitudeEstimate(0.0, 1.2)  # it lies, and was never stood up
    legs.pass_(0.2)
    assert legs.base.latched == "it has fallen"
    arms_stay(legs)


def test_arms_stay_in_place_when_a_stopped_robot_is_tilted(legs: Legs) -> None:
    attitude = AttitudeEstimate(0.0, 0.0)
    legs.base._read_attitude = lambda: attitude
    legs.pass_(6.0, Velocity(0.1, 0.0))
    legs.base.latch("stopped")
    legs.pass_(3.0)
    attitude = AttitudeEstimate(0.0, 1.2)
    legs.pass_(0.2)
    arms_stay(legs)


@pytest.mark.parametrize("part", ["_read_attitude", "_update_state"])
def test_exception_in_mid_walk_leaves_the_legs_until_enabled(
    legs: Legs, part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    legs.pass_(6.23, Velocity(0.2, 0.0))
    assert legs.base.is_walking

    def broken(*_: object) -> None:
        raise RuntimeError("broken")

    with monkeypatch.context() as patched:
        patched.setattr(legs.base, part, broken)
        with pytest.raises(RuntimeError, match="broken"):
            legs.base.step()
    assert legs.base.latched == "the walk failed: RuntimeError: broken"
    legs.pass_(0.5)  # to the end of what the servos were told
    before = legs.angles()
    with pytest.raises(DeviceFault, match="the walk failed"):
        legs.base.drive(Velocity(0.2, 0.0))
    legs.pass_(1.0)
    assert np.array_equal(legs.angles(), before)
    legs.base.enable()
    legs.pass_(8.0, Velocity(0.15, 0.0))
    assert legs.base.is_walking
