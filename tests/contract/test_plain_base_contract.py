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
    test_a_person_has_the_wheels_before_the_mission_and_a_while_after,
    test_base_accelerates_gently_and_keeps_its_velocity,
    test_closed_base_stops_and_drives_again_once_opened,
    test_command_expires_without_renewal,
    test_command_with_source_safety_is_refused,
    test_heading_continues_beyond_a_full_turn,
    test_latched_base_refuses_all_commands_until_enabled,
    test_opened_base_comes_online_with_one_notice,
    test_past_heading_is_interpolated,
    test_replugged_base_is_online_at_rest_with_its_pose,
    test_stop_is_at_once_and_without_a_ramp,
    test_too_fast_velocity_is_scaled_down_as_a_whole,
    test_unopened_device_is_offline_and_has_no_readings,
    test_unplugged_base_gives_the_reason_refuses_commands_and_stops,
    test_velocity_that_is_not_finite_is_refused,
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


def test_base_state_marks_dead_reckoning(base: PlainRig) -> None:
    assert base.state().reckoned is base.reckoned


def test_plain_base_has_no_sounds_lights_or_legs(base: PlainRig) -> None:
    assert (base.device.sounds, base.device.lights, base.device.legs) == (None, None, None)


def test_dead_reckoning_continues_at_a_wall(base: PlainRig) -> None:
    base.drive(0.5, 0.0, lambda: base.truth().x > WALL - BASE_RADIUS - 0.001)
    asked = base.clock.now()
    base.drive(0.5, 0.0, lambda: base.clock.now() - asked > 1.0)
    assert not base.state().bumper
    assert base.truth().x == pytest.approx(WALL - BASE_RADIUS, abs=0.001)
    assert base.state().pose.x > WALL


def test_device_is_latched_after_a_long_disconnect(base: PlainRig) -> None:
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


def test_turn_matches_the_track_width(base: PlainRig) -> None:
    base.drive(0.0, 1.5, lambda: base.state().pose.heading > 2.0)
    base.device.stop()
    base.comes_to_rest()
    assert base.truth().heading == pytest.approx(base.state().pose.heading, abs=0.12)
