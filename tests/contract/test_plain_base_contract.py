"""What ``drivers.api.Base`` promises, kept by bases that feel nothing: over their wires, and by their twin."""

from collections.abc import Iterator

import pytest

from drivers.api import BASE_RADIUS, Lamp, Pose2D
from drivers.base.diff_drive import DiffDriveBase
from drivers.base.reckoning import TwoWheels
from drivers.base.twin import BaseTwin, WheelTwinOdometry
from drivers.pi_car.driver import GuardianProtocol
from drivers.sim.base_body import BaseBody
from drivers.virtual.guardian import VirtualCar
from drivers.waveshare.driver import waveshare_base
from drivers.waveshare.virtual import VirtualWaveshare
from drivers.waveshare.wire import FULL_POWER
from tests.contract.rigs import InSimulatedTime, simulated
from tests.contract.test_base_contract import (  # noqa: F401 - what a base without senses promises as well
    WALL,
    Room,
    test_a_command_that_nobody_renews_ends_by_itself,
    test_a_full_turn_goes_on_counting,
    test_a_past_heading_lies_between_those_measured_before_and_after,
    test_a_person_has_the_wheels_before_the_mission_and_a_while_after,
    test_a_velocity_that_is_no_number_is_refused_and_changes_nothing,
    test_before_it_is_opened_it_says_so_and_knows_nothing,
    test_closed_it_stands_still_and_opened_again_it_drives,
    test_it_gathers_speed_gently_and_keeps_it_while_asked,
    test_latched_it_stands_whoever_commands_until_it_is_enabled,
    test_nobody_commands_in_the_name_of_safety,
    test_opened_it_comes_online_and_says_so_once,
    test_plugged_in_again_it_is_back_at_rest_where_it_was,
    test_stop_is_at_once_and_without_a_ramp,
    test_unplugged_it_says_why_refuses_to_drive_and_comes_to_rest,
    test_what_is_asked_for_is_slowed_down_as_a_whole,
)
from tests.contract.test_base_contract import BaseRig as FeelingRig
from tests.drivers.cranked import HandWire

TRACK = 0.2


class PlainRig(FeelingRig):
    """One that nothing touches, and that has no lights."""

    reckoned: bool
    _was: Pose2D | None = None

    def stands(self) -> bool:
        """Whether it stands, in truth as well: what is reckoned knows nothing of how it rolls out."""
        before, self._was = self._was, self.truth()
        return super().stands() and before in (None, self._was)

    def touch(self, *_: object, **__: object) -> None:
        raise AssertionError("it feels nothing")

    def lift(self, *, up: bool) -> None:
        raise AssertionError(f"it would not notice: {up=}")

    def shines(self, number: int) -> Lamp:
        raise AssertionError(f"it has no light {number}")

    def close(self) -> None:
        self.device.close()


class Waveshare(InSimulatedTime, PlainRig):
    reckoned = False

    def __init__(self) -> None:
        super().__init__()
        unit = FULL_POWER / 1.25 if self.reckoned else 1.0
        self.rover = VirtualWaveshare(BaseBody(ground=Room()), track=TRACK, unit=unit, encoders=not self.reckoned)
        self.wire = HandWire(self.rover, self.timeline)
        self.device = waveshare_base(
            self.wire.link("base", report=self.notices.append),
            self.clock,
            track=TRACK,
            encoders=not self.reckoned,
            speed_at_full=1.25,
            report=self.notices.append,
            changed=self.changed,
        )

    def truth(self) -> Pose2D:
        return self.rover.pose(self.clock.now())

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()


class WaveRover(Waveshare):
    reckoned = True


class PiCar(InSimulatedTime, PlainRig):
    reckoned = True

    def __init__(self) -> None:
        super().__init__()
        self.car = VirtualCar(BaseBody(ground=Room()), TwoWheels(TRACK, 1.25))
        self.wire = HandWire(self.car, self.timeline)
        self.device = DiffDriveBase(
            self.wire.link("base", report=self.notices.append),
            self.clock,
            GuardianProtocol(TRACK, 1.25, hint="look at it"),
            report=self.notices.append,
            changed=self.changed,
        )

    def truth(self) -> Pose2D:
        return self.car.pose(self.clock.now())

    def unplug(self) -> None:
        self.wire.unplug()

    def plug_in(self) -> None:
        self.wire.plug_in()


class Twin(InSimulatedTime, PlainRig):
    reckoned = True

    def __init__(self) -> None:
        super().__init__()
        self.twin = BaseTwin(
            self.clock,
            odometry=WheelTwinOdometry(TwoWheels(TRACK, 1.25), reckoned=self.reckoned),
            feels=False,
            capabilities=(),
            report=self.notices.append,
            changed=self.changed,
            body=BaseBody(ground=Room()),
        )
        self.device = self.twin
        self.timeline.call_every(self.twin.STEP_INTERVAL, self.twin.step)

    def truth(self) -> Pose2D:
        return self.twin.true_pose(self.clock.now())

    def unplug(self) -> None:
        self.twin.plug.unplug()

    def plug_in(self) -> None:
        self.twin.plug.plug_in()


class MeasuredTwin(Twin):
    reckoned = False


RIGS = [
    simulated(Waveshare, "waveshare"),
    simulated(WaveRover, "wave_rover"),
    simulated(PiCar, "pi_car"),
    simulated(Twin, "twin"),
    simulated(MeasuredTwin, "measured twin"),
]


@pytest.fixture(params=RIGS)
def rig(request: pytest.FixtureRequest) -> Iterator[PlainRig]:
    rig: PlainRig = request.param()
    yield rig
    rig.close()


@pytest.fixture
def base(rig: PlainRig) -> PlainRig:
    """A rig whose base is there."""
    rig.start()
    return rig


def test_forward_is_forward_and_left_is_anticlockwise(base: PlainRig) -> None:
    base.drive(0.2, 0.0, lambda: base.state().pose.x > 0.06)
    assert base.truth().x > 0.04
    base.device.stop()
    base.drive(0.0, 1.0, lambda: base.state().pose.heading > 0.4)
    assert base.truth().heading > 0.3


def test_it_says_whether_its_pose_is_dead_reckoning(base: PlainRig) -> None:
    assert base.state().reckoned is base.reckoned


def test_it_has_no_sounds_no_lights_and_no_legs(base: PlainRig) -> None:
    assert (base.device.sounds, base.device.lights, base.device.legs) == (None, None, None)


def test_a_wall_holds_it_up_unfelt_and_dead_reckoning_believes_that_it_went_on(base: PlainRig) -> None:
    base.drive(0.5, 0.0, lambda: base.truth().x > WALL - BASE_RADIUS - 0.001)
    asked = base.clock.now()
    base.drive(0.5, 0.0, lambda: base.clock.now() - asked > 1.0)
    assert not base.state().bumper
    assert base.truth().x == pytest.approx(WALL - BASE_RADIUS, abs=0.001)
    assert base.state().pose.x > WALL


def test_away_for_long_it_stays_at_rest_until_it_is_enabled(base: PlainRig) -> None:
    base.drive(-0.2, 0.0, lambda: base.state().pose.x < -0.05)
    base.unplug()
    base.wait(6.0)
    here = base.truth()
    base.plug_in()
    base.until(lambda: base.device.health().online)
    assert base.device.health().reconnected_at is not None
    assert "away" in base.device.latched
    base.wait(0.5)
    assert base.truth() == here
    base.device.enable()
    base.wait(0.5)
    assert base.truth() == here, "what was commanded before is not in force"
    base.drive(-0.2, 0.0, lambda: base.state().velocity.linear < -0.1)


def test_a_turn_is_as_wide_as_the_track_says(base: PlainRig) -> None:
    base.drive(0.0, 1.5, lambda: base.state().pose.heading > 2.0)
    base.device.stop()
    base.comes_to_rest()
    assert base.truth().heading == pytest.approx(base.state().pose.heading, abs=0.12)
