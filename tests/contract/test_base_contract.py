"""What ``drivers.api.Base`` promises, kept by the Kobuki's driver over its wire and by its twin."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from math import hypot, inf, nan, pi

import pytest

from drivers.api import (
    BASE_RADIUS,
    COMMAND_TIMEOUT,
    ZERO_VELOCITY,
    Base,
    BaseState,
    Lamp,
    Pose2D,
    Quality,
    Sides,
    Source,
    Tune,
    Velocity,
)
from drivers.base.twin import BaseTwin
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.kobuki.driver import kobuki_base
from drivers.kobuki.twin import KobukiTwinOdometry
from drivers.kobuki.virtual import VirtualKobuki
from drivers.sim.base_body import NO_SIDES, BaseBody
from drivers.sim.world_objects import OpenFloor
from tests.contract.rigs import InSimulatedTime, Rig, simulated
from tests.drivers.cranked import HandWire

LIGHTS = {1: (0x0100, 0x0200), 2: (0x0400, 0x0800)}
"""The bits of the lights in the word of the outputs, red and green (protocol table of the vendor)."""

WALL = 0.5
"""Where a wall stands across the way, in metres ahead."""


class Room(OpenFloor):
    """A ``Ground`` with one wall."""

    def contact_directions(self, x: float, y: float, radius: float, time: float) -> Sequence[float]:
        del y, time
        return (0.0,) if x + radius >= WALL else ()


class BaseRig(Rig):
    device: Base

    @abstractmethod
    def truth(self) -> Pose2D:
        """Where the base really is."""

    @abstractmethod
    def touch(self, bumper: Sides = NO_SIDES, cliff: Sides = NO_SIDES) -> None:
        """Make it feel this."""

    @abstractmethod
    def lift(self, *, up: bool) -> None:
        """Take it off the floor, or put it back."""

    @abstractmethod
    def shines(self, number: int) -> Lamp:
        """Which colour a light really shows."""

    def start(self) -> None:
        self.device.open()
        self.until(lambda: self.device.health().online and self.told("online"))

    def state(self) -> BaseState:
        value = self.device.state().value
        assert value is not None
        return value

    def drive(self, linear: float, angular: float, holds: Callable[[], object]) -> None:
        """Ask for a velocity again and again until something holds."""

        def asked() -> bool:
            self.device.drive(Velocity(linear, angular))
            return bool(holds())

        self.until(asked)

    def stands(self) -> bool:
        """Whether it stands still by its own account, which is fresh."""
        return self.device.state().good and self.state().velocity == ZERO_VELOCITY

    def comes_to_rest(self) -> None:
        """Wait until it really moves no more."""
        places = [self.truth()]

        def rests() -> bool:
            places.append(self.truth())
            return len(places) > 10 and places[-10:] == [places[-1]] * 10

        self.until(rests)


class WireBase(InSimulatedTime, BaseRig):
    def __init__(self) -> None:
        super().__init__()
        self.kobuki = VirtualKobuki(ground=Room())
        self.wire = HandWire(self.kobuki, self.timeline)
        link = self.wire.link("base", report=self.notices.append)
        self.device = kobuki_base(link, self.clock, report=self.notices.append, changed=self.changed)

    def truth(self) -> Pose2D:
        return self.kobuki.pose(self.clock.now())

    def touch(self, bumper: Sides = NO_SIDES, cliff: Sides = NO_SIDES) -> None:
        self.kobuki.bumper, self.kobuki.cliff = bumper, cliff

    def lift(self, *, up: bool) -> None:
        self.kobuki.wheel_drop = Sides(left=up, right=up)

    def shines(self, number: int) -> Lamp:
        red, green = LIGHTS[number]
        word = self.kobuki.outputs
        return {(0, 0): Lamp.OFF, (1, 0): Lamp.RED, (0, 1): Lamp.GREEN, (1, 1): Lamp.ORANGE}[
            bool(word & red), bool(word & green)
        ]

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()

    def close(self) -> None:
        self.device.close()


class TwinBase(InSimulatedTime, BaseRig):
    def __init__(self) -> None:
        super().__init__()
        self.twin = BaseTwin(
            self.clock,
            odometry=KobukiTwinOdometry(),
            report=self.notices.append,
            changed=self.changed,
            body=BaseBody(ground=Room()),
            seed=3,
        )
        self.device = self.twin
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def truth(self) -> Pose2D:
        return self.twin.true_pose(self.clock.now())

    def touch(self, bumper: Sides = NO_SIDES, cliff: Sides = NO_SIDES) -> None:
        self.twin.press(bumper, cliff=cliff)

    def lift(self, *, up: bool) -> None:
        self.twin.lift(up=up)

    def shines(self, number: int) -> Lamp:
        return self.twin.panel.colours[number]

    def unplug(self) -> None:
        self.twin.plug.unplug()

    def plug_in(self) -> None:
        self.twin.plug.plug_in()

    def close(self) -> None:
        self.device.close()


@pytest.fixture(params=[simulated(WireBase, "wire"), simulated(TwinBase, "twin")])
def rig(request: pytest.FixtureRequest) -> Iterator[BaseRig]:
    rig: BaseRig = request.param()
    yield rig
    rig.close()


@pytest.fixture
def base(rig: BaseRig) -> BaseRig:
    """A rig whose base is there."""
    rig.start()
    return rig


def test_unopened_device_is_offline_and_has_no_readings(rig: BaseRig) -> None:
    health = rig.device.health()
    assert (health.online, health.detail != "") == (False, True)
    assert (rig.device.state().value, rig.device.state().quality) == (None, Quality.NONE)
    assert rig.device.heading_at(rig.clock.now()) is None
    with pytest.raises(NotConnected, match="base"):
        rig.device.drive(Velocity(0.1, 0.0))
    rig.device.stop()
    rig.device.rest()
    rig.device.close()


def test_opened_base_comes_online_with_one_notice(base: BaseRig) -> None:
    health = base.device.health()
    assert (health.online, health.detail, health.hint) == (True, "", "")
    assert base.device.state().good
    assert base.state().pose == Pose2D(0.0, 0.0, 0.0)
    assert [notice.kind for notice in base.notices] == ["online"]
    base.device.open()
    base.wait(0.1)
    assert [notice.kind for notice in base.notices] == ["online"]


@pytest.mark.parametrize(
    ("linear", "angular"), [(2.0, 1.0), (0.1, 9.0), (-3.0, 0.0), (0.2, -0.4), (0.0, -5.0), (0.0, 0.0)]
)
def test_too_fast_velocity_is_scaled_down_as_a_whole(base: BaseRig, linear: float, angular: float) -> None:
    accepted = base.device.drive(Velocity(linear, angular))
    excess = max(1.0, abs(linear) / 0.5, abs(angular) / 1.9)
    assert (accepted.linear, accepted.angular) == pytest.approx((linear / excess, angular / excess))


def test_forward_is_forward_and_left_is_anticlockwise(base: BaseRig) -> None:
    base.drive(0.2, 0.0, lambda: base.state().pose.x > 0.05)
    assert base.truth().x > 0.05
    base.device.stop()
    base.drive(0.0, 1.0, lambda: base.state().pose.heading > 0.3)
    assert base.truth().heading > 0.3


def test_base_accelerates_gently_and_keeps_its_velocity(base: BaseRig) -> None:
    base.device.drive(Velocity(-0.4, 0.0))
    base.wait(0.05)
    assert base.state().velocity.linear > -0.3
    base.drive(-0.4, 0.0, lambda: base.state().velocity.linear < -0.35)


def test_command_expires_without_renewal(base: BaseRig) -> None:
    base.drive(-0.3, 0.0, lambda: base.state().velocity.linear < -0.25)
    base.until(base.stands)
    at_rest = base.truth()
    base.wait(COMMAND_TIMEOUT)
    assert base.truth() == at_rest
    assert base.state().velocity == ZERO_VELOCITY


def test_stop_is_at_once_and_without_a_ramp(base: BaseRig) -> None:
    base.drive(-0.4, 0.0, lambda: base.state().velocity.linear < -0.35)
    base.device.stop()
    base.device.stop()
    before = base.truth().x
    base.comes_to_rest()
    # The ramp alone would take 13 cm; a loaded machine may take a moment to say so to the base.
    assert abs(base.truth().x - before) < 0.1
    base.wait(0.1)
    assert base.stands()


@pytest.mark.parametrize(
    "wrong", [Velocity(nan, 0.0), Velocity(0.0, nan), Velocity(inf, 0.0), Velocity(0.1, -inf)], ids=str
)
def test_velocity_that_is_not_finite_is_refused(base: BaseRig, wrong: Velocity) -> None:
    with pytest.raises(BadRequest, match="base") as caught:
        base.device.drive(wrong)
    assert caught.value.hint
    base.wait(0.1)
    assert base.state().velocity == ZERO_VELOCITY


def test_unplugged_base_gives_the_reason_refuses_commands_and_stops(base: BaseRig) -> None:
    base.drive(-0.2, 0.0, lambda: base.state().pose.x < -0.02)
    base.unplug()
    base.until(lambda: base.told("offline"))
    (notice,) = [notice for notice in base.notices if notice.kind == "offline"]
    assert (notice.device, notice.hint != "") == ("base", True)
    health = base.device.health()
    assert (health.online, health.detail != "", health.hint != "") == (False, True, True)
    with pytest.raises(NotConnected, match="base") as caught:
        base.device.drive(Velocity(0.1, 0.0))
    assert caught.value.hint
    base.device.stop()
    base.comes_to_rest()
    base.until(lambda: base.device.state().quality is Quality.STALE)
    assert base.device.state().value is not None


def test_replugged_base_is_online_at_rest_with_its_pose(base: BaseRig) -> None:
    base.drive(-0.2, 0.0, lambda: base.state().pose.x < -0.05)
    base.unplug()
    base.until(lambda: base.told("offline"))
    seen = base.state().pose.x
    base.comes_to_rest()
    base.notices.clear()
    base.plug_in()
    base.until(lambda: base.told("online") and base.device.health().online and base.device.state().good)
    here = base.truth()
    base.wait(0.2)
    assert base.truth() == here
    assert base.state().pose.x == pytest.approx(seen, abs=0.03)
    base.drive(-0.2, 0.0, lambda: base.state().pose.x < seen - 0.05)


def test_past_heading_is_interpolated(base: BaseRig) -> None:
    began = base.device.state().stamp
    base.drive(0.0, 1.5, lambda: base.state().pose.heading > 1.0)
    newest = base.device.state()
    assert newest.value is not None
    headings = [base.device.heading_at(began + share / 20 * (newest.stamp - began)) for share in range(21)]
    known = [heading for heading in headings if heading is not None]
    assert len(known) == 21
    assert known == sorted(known)
    assert (known[0], known[-1]) == pytest.approx((0.0, newest.value.pose.heading), abs=1e-6)
    assert 0.0 < known[15] < known[-1]
    assert base.device.heading_at(began - 10.0) is None


@pytest.mark.parametrize("side", ["left", "centre", "right"])
def test_a_bumper_forbids_forward_but_not_back_and_round(base: BaseRig, side: str) -> None:
    changes = base.changes
    base.touch(bumper=Sides(**{side: True}))
    base.until(lambda: getattr(base.state().bumper, side) and base.changes > changes)
    assert base.device.drive(Velocity(0.2, 0.5)) == Velocity(0.0, 0.5)
    assert base.device.drive(Velocity(-0.2, 0.5)) == Velocity(-0.2, 0.5)
    base.touch()
    base.until(lambda: not base.state().bumper)
    assert base.device.drive(Velocity(0.2, 0.0)) == Velocity(0.2, 0.0)


@pytest.mark.parametrize("side", ["left", "centre", "right"])
def test_base_at_a_cliff_only_drives_straight_back(base: BaseRig, side: str) -> None:
    base.touch(cliff=Sides(**{side: True}))
    base.until(lambda: base.told("fault", f"cliff {side}"))
    assert base.device.drive(Velocity(0.2, 0.5)) == ZERO_VELOCITY
    assert base.device.drive(Velocity(0.0, 0.5)) == ZERO_VELOCITY
    assert base.device.drive(Velocity(-0.2, 0.5)) == Velocity(-0.2, 0.0)
    base.touch()
    base.until(lambda: not base.state().cliff)
    assert base.device.drive(Velocity(0.0, 0.5)) == ZERO_VELOCITY
    here = base.state().pose.x
    base.drive(-0.2, 0.0, lambda: base.state().pose.x < here - 0.1)
    base.until(lambda: base.device.drive(Velocity(0.2, 0.5)) == Velocity(0.2, 0.5))


def test_base_backs_off_after_a_bump(base: BaseRig) -> None:
    base.drive(0.3, 0.0, lambda: base.state().velocity.linear > 0.2)
    base.touch(bumper=Sides(left=True))
    base.until(lambda: base.device.steering().source is Source.SAFETY)
    assert base.device.steering().reason == "backing off: bumper left"
    assert base.device.drive(Velocity(0.3, 0.0)) == ZERO_VELOCITY
    hit = base.state().pose
    base.until(lambda: base.state().velocity.linear < 0.0)
    base.touch()
    base.until(lambda: base.device.steering().source is not Source.SAFETY)
    back = base.state().pose
    assert 0.02 < hypot(back.x - hit.x, back.y - hit.y) < 0.15
    assert back.heading < hit.heading


def test_a_person_has_the_wheels_before_the_mission_and_a_while_after(base: BaseRig) -> None:
    device = base.device

    def steered() -> bool:
        device.drive(Velocity(0.0, 0.5), source=Source.TELEOP)
        return base.state().velocity.angular > 0.2

    base.until(steered)
    assert device.drive(Velocity(-0.2, 0.0)) == ZERO_VELOCITY
    assert device.steering().source is Source.TELEOP
    device.stop(source=Source.MISSION)
    assert device.steering().source is Source.TELEOP
    asked = base.clock.now()
    device.drive(Velocity(0.0, 0.5), source=Source.TELEOP)
    base.until(base.stands)
    base.until(lambda: device.drive(Velocity(-0.2, 0.0)) == Velocity(-0.2, 0.0))
    assert base.clock.now() - asked >= 0.99


def test_command_with_source_safety_is_refused(base: BaseRig) -> None:
    with pytest.raises(BadRequest, match="safety"):
        base.device.drive(Velocity(0.1, 0.0), source=Source.SAFETY)


def test_latched_base_refuses_all_commands_until_enabled(base: BaseRig) -> None:
    base.drive(-0.3, 0.0, lambda: base.state().velocity.linear < -0.2)
    base.device.latch("somebody shouted")
    base.device.latch("and again")
    assert base.device.latched == "somebody shouted"
    for source in (Source.MISSION, Source.TELEOP):
        with pytest.raises(DeviceFault, match="somebody shouted") as caught:
            base.device.drive(Velocity(0.1, 0.0), source=source)
        assert "enable" in caught.value.hint
    base.until(base.stands)
    here = base.truth()
    base.wait(0.2)
    assert base.truth() == here
    base.device.enable()
    assert base.device.latched == ""
    base.wait(0.1)
    assert base.stands(), "what was commanded before is not in force"
    base.drive(-0.2, 0.0, lambda: base.state().velocity.linear < -0.1)


def test_base_plays_sounds_and_refuses_unknown_lights(base: BaseRig) -> None:
    sounds, lights = base.device.sounds, base.device.lights
    assert sounds is not None
    assert lights is not None
    assert (sounds.name, lights.name, base.device.legs) == ("base", "base", None)
    sounds.play(Tune.RECHARGE)
    sounds.tone(440.0, 0.2)
    lights.light(1, Lamp.ORANGE)
    with pytest.raises(BadRequest, match="light 3"):
        lights.light(3, Lamp.RED)
    with pytest.raises(BadRequest, match="tone"):
        sounds.tone(440.0, 3.0)
    base.until(lambda: base.shines(1) is Lamp.ORANGE and base.shines(2) is Lamp.OFF)


def test_sounds_and_lights_of_an_unplugged_base_are_not_connected(base: BaseRig) -> None:
    sounds, lights = base.device.sounds, base.device.lights
    assert sounds is not None
    assert lights is not None
    base.unplug()
    base.until(lambda: not base.device.health().online)
    with pytest.raises(NotConnected, match="base"):
        sounds.play(Tune.ON)
    with pytest.raises(NotConnected, match="base"):
        sounds.tone(440.0, 0.1)
    with pytest.raises(NotConnected, match="base"):
        lights.light(2, Lamp.GREEN)


def test_cliff_stops_a_forward_drive(base: BaseRig) -> None:
    base.drive(0.2, 0.0, lambda: base.state().velocity.linear > 0.1)
    base.touch(cliff=Sides(centre=True))
    base.drive(0.2, 0.0, lambda: base.state().velocity.linear == 0.0)


def test_base_with_dropped_wheels_does_not_drive(base: BaseRig) -> None:
    base.lift(up=True)
    base.until(lambda: base.state().wheel_drop)
    base.until(lambda: base.told("fault", "wheel drop"))
    assert base.device.drive(Velocity(-0.2, 0.5)) == ZERO_VELOCITY
    base.lift(up=False)
    base.until(lambda: not base.state().wheel_drop)
    assert base.device.drive(Velocity(-0.2, 0.5)) == Velocity(-0.2, 0.5)


def test_wall_stops_the_base_which_can_back_off(base: BaseRig) -> None:
    base.drive(0.5, 0.0, lambda: base.state().bumper)
    assert base.state().bumper == Sides(centre=True)
    assert base.truth().x == pytest.approx(WALL - BASE_RADIUS, abs=0.001)
    assert base.device.drive(Velocity(0.5, 0.0)) == ZERO_VELOCITY
    base.drive(-0.2, 0.0, lambda: not base.state().bumper)
    assert base.truth().x < WALL - BASE_RADIUS


def test_heading_continues_beyond_a_full_turn(base: BaseRig) -> None:
    base.drive(0.0, 1.9, lambda: base.state().pose.heading > pi + 0.2)
    assert base.truth().heading == pytest.approx(base.state().pose.heading, abs=0.2)


def test_closed_base_stops_and_drives_again_once_opened(base: BaseRig) -> None:
    base.drive(-0.3, 0.0, lambda: base.state().velocity.linear < -0.25)
    base.device.close()
    base.device.close()
    base.comes_to_rest()
    assert not base.device.health().online
    assert not base.told("offline"), "it was closed on purpose"
    with pytest.raises(NotConnected):
        base.device.drive(Velocity(0.1, 0.0))
    base.device.open()
    base.until(lambda: base.device.health().online)
    before = base.state().pose.x
    base.drive(-0.2, 0.0, lambda: base.state().pose.x < before - 0.03)
