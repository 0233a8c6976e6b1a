"""The Kobuki at the level of its wire: what it reports of its world, what it does when told, and how it goes wrong."""

from math import pi
from random import Random

import pytest

from drivers.api import BASE_RADIUS, DockBeam, Lamp, Pose2D, Sides, Tune, Velocity
from drivers.base.twin import BaseTwin
from drivers.clock import ManualClock
from drivers.kobuki import commands
from drivers.kobuki.commands import (
    BaseControl,
    GetGains,
    KobukiOutput,
    KobukiSound,
    SetGains,
    SetOutputs,
    SoundSequence,
)
from drivers.kobuki.feedback import (
    FEEDBACK,
    Charger,
    Core,
    DockInfrared,
    Inputs,
    KobukiGains,
    MotorCurrent,
)
from drivers.kobuki.odometry import KobukiStateBuilder, battery_percent
from drivers.kobuki.virtual import REPORT_INTERVAL, VirtualKobuki
from drivers.kobuki.wire import KobukiFrameFinder, KobukiSubpayload, decode, encode
from drivers.sim.battery import INTERNAL_RESISTANCE, Battery
from drivers.sim.room import Room
from drivers.sim.wheels import SimulatedWheels
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import DOCK_SIZE, Edge, WorldDock
from drivers.virtual.terminal import TimedDevice

DOCK = WorldDock(-2.95, 0.0, 0.0)
ON_DOCK = Pose2D(DOCK.x + DOCK_SIZE[0] / 2 + BASE_RADIUS + 0.005, 0.0, pi)
"""Where a base stands on the contacts."""


class Bench:
    """A virtual Kobuki, the reports of which are read as they come."""

    def __init__(self, device: VirtualKobuki | None = None) -> None:
        self.device = device or VirtualKobuki()
        self.now = 0.0
        self._finder = KobukiFrameFinder()
        self.reports: list[dict[type[KobukiSubpayload], KobukiSubpayload]] = []
        self._read(self.device.poll(0.0))

    def tell(self, *parts: KobukiSubpayload) -> None:
        self.device.feed(encode(*parts), self.now)

    def run(self, seconds: float, velocity: Velocity | None = None) -> None:
        """Let time pass, and renew a velocity as the driver does."""
        for _ in range(round(seconds / REPORT_INTERVAL)):
            if velocity is not None:
                self.tell(BaseControl.of(velocity.linear, velocity.angular))
            self.now += REPORT_INTERVAL
            self._read(self.device.poll(self.now))

    def core(self) -> Core:
        core = self.reports[-1][Core]
        assert isinstance(core, Core)
        return core

    def newest(self, kind: type[KobukiSubpayload]) -> KobukiSubpayload:
        return self.reports[-1][kind]

    def _read(self, data: bytes) -> None:
        for payload in self._finder.feed(data):
            self.reports.append({type(part): part for part in decode(payload, FEEDBACK).parts})


def at(pose: Pose2D, battery: Battery | None = None) -> Bench:
    world = SimulatedWorld(dock=DOCK)
    return Bench(VirtualKobuki(wheels=SimulatedWheels(pose=pose), ground=world, battery=battery))


# --- timing -----------------------------------------------------------------------------------------------------------


def test_virtual_kobuki_reports_at_50_hz() -> None:
    device = VirtualKobuki()
    assert isinstance(device, TimedDevice)
    assert device.next_poll_time() is None
    device.poll(3.0)
    due = [device.next_poll_time()]
    device.poll(3.01)
    due.append(device.next_poll_time())
    device.poll(3.02)
    due.append(device.next_poll_time())
    assert due == pytest.approx([3.02, 3.02, 3.04])


def test_late_poll_returns_all_reports_with_their_times() -> None:
    bench = Bench()
    bench._read(bench.device.poll(0.1))
    times = [core.time_ms for report in bench.reports if isinstance(core := report[Core], Core)]
    assert times == [0, 20, 40, 60, 80, 100]


# --- what it feels of the world ---------------------------------------------------------------------------------------


def test_virtual_kobuki_detects_walls_edges_and_wheel_drops() -> None:
    world = SimulatedWorld(
        room=Room.with_default_fixtures(4.0, 4.0, 2.6, (0.0, 0.0)), edges=(Edge(0.0, 1.5, 4.0, 0.6),)
    )
    bench = Bench(VirtualKobuki(ground=world))
    bench.run(5.0, Velocity(0.5, 0.0))
    assert bench.core().bumper == 2
    bench = Bench(VirtualKobuki(ground=world, wheels=SimulatedWheels(pose=Pose2D(0.0, 0.0, pi / 2))))
    bench.run(2.4, Velocity(0.5, 0.0))
    assert (bench.core().cliff, bench.core().wheel_drop) == (7, 0)
    bench.run(1.0, Velocity(0.5, 0.0))
    assert bench.core().wheel_drop == 3


def test_docked_virtual_kobuki_charges_until_full() -> None:
    bench = at(ON_DOCK, Battery(99.9, drain=60.0))
    bench.run(0.1)
    assert bench.core().charger == Charger.POWERED | Charger.CHARGING
    bench.run(1.0)
    assert bench.core().charger == Charger.POWERED
    assert bench.core().voltage == 16.5
    bench.run(1.0, Velocity(-0.2, 0.0))
    assert bench.core().charger == 0


def test_virtual_kobuki_receives_dock_beams() -> None:
    bench = at(Pose2D(-1.5, 0.0, pi))
    assert bench.newest(DockInfrared) == DockInfrared(centre=DockBeam.FAR_CENTRE)
    bench = at(Pose2D(-2.5, 0.25, 2.0))
    assert bench.newest(DockInfrared) == DockInfrared(left=DockBeam.NEAR_LEFT)


def test_battery_drains_and_its_voltage_drops_under_load() -> None:
    bench = Bench(VirtualKobuki(battery=Battery(50.0, drain=1000.0, resistance=INTERNAL_RESISTANCE)))
    rested = bench.core().voltage
    bench.run(2.0)
    assert battery_percent(bench.core().voltage) == pytest.approx(39.0, abs=4.0)
    assert bench.core().voltage < rested
    driven = Bench(VirtualKobuki(battery=Battery(50.0, drain=1000.0, resistance=INTERNAL_RESISTANCE)))
    driven.run(2.0, Velocity(0.5, 0.0))
    assert driven.core().voltage < bench.core().voltage


def test_motor_current_rises_with_load_to_an_overload() -> None:
    bench = Bench(VirtualKobuki(ground=SimulatedWorld()))
    assert bench.newest(MotorCurrent) == MotorCurrent(0, 0)
    bench.run(1.0, Velocity(0.0, 0.5))
    turning = bench.newest(MotorCurrent)
    assert isinstance(turning, MotorCurrent)
    assert 10 < turning.left_10ma < 100
    assert bench.core().overcurrent == 0
    bench.run(15.0, Velocity(0.7, 0.0))
    assert bench.newest(MotorCurrent) == MotorCurrent(255, 255)
    assert bench.core().overcurrent == 3
    assert bench.core().left_pwm == 127
    bench.run(1.0, Velocity(-0.3, 0.0))
    assert bench.core().overcurrent == 0


# --- by hand ----------------------------------------------------------------------------------------------------------


def test_buttons_are_down_while_pressed() -> None:
    bench = Bench()
    bench.device.press(0)
    bench.device.press(2)
    bench.run(0.02)
    assert bench.core().buttons == 0b101
    bench.device.press(0, down=False)
    bench.device.press(1, down=False)
    bench.run(0.02)
    assert bench.core().buttons == 0b100
    with pytest.raises(ValueError, match="no button 3"):
        bench.device.press(3)


def test_manual_values_override_battery_and_dock() -> None:
    bench = at(ON_DOCK)
    bench.device.battery_voltage, bench.device.charger = 13.1, int(Charger.POWERED | Charger.ADAPTER)
    bench.device.sockets = Inputs(digital=0b1010, analogue_1=4095)
    bench.run(0.02)
    assert (bench.core().voltage, bench.core().charger) == (13.1, 18)
    assert bench.newest(Inputs) == Inputs(digital=0b1010, analogue_1=4095)


# --- what it is told --------------------------------------------------------------------------------------------------


def test_tunes_tones_and_lights_are_stored() -> None:
    bench = Bench()
    bench.tell(
        SoundSequence(commands.KobukiTune.RECHARGE), SoundSequence(99), KobukiSound.of(440.0, 0.1), KobukiSound(0, 10)
    )
    tune, tone = bench.device.played
    assert tune is Tune.RECHARGE
    assert isinstance(tone, tuple)
    assert tone == pytest.approx((440.0, 0.1), abs=1.0)
    assert bench.device.lights == {1: Lamp.OFF, 2: Lamp.OFF}
    bench.tell(SetOutputs(KobukiOutput.LED1_GREEN | KobukiOutput.LED2_RED | KobukiOutput.LED2_GREEN))
    assert bench.device.lights == {1: Lamp.GREEN, 2: Lamp.ORANGE}
    bench.tell(SetOutputs(KobukiOutput.LED1_RED))
    assert bench.device.lights == {1: Lamp.RED, 2: Lamp.OFF}


@pytest.mark.parametrize(("firmware", "knows"), [((1, 1, 4), False), ((1, 2, 0), True), ((2, 0, 0), True)])
def test_gains_are_known_since_a_firmware(firmware: tuple[int, int, int], knows: bool) -> None:
    bench = Bench(VirtualKobuki(firmware=firmware))
    bench.tell(SetGains(1, 5, 6, 7), GetGains())
    bench.run(0.02)
    assert bench.reports[-1].get(KobukiGains) == (KobukiGains(1, 5, 6, 7) if knows else None)


# --- how it goes wrong ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("identifier", [1, 3, 4, 5, 6, 13, 16])
def test_shortened_or_unknown_subpayload_leaves_the_frame_valid(identifier: int) -> None:
    bench = Bench()
    bench.device.shortened, bench.device.chatty = identifier, True
    (payload,) = KobukiFrameFinder().feed(bench.device.poll(REPORT_INTERVAL))
    decoded = decode(payload, FEEDBACK)
    assert (decoded.malformed, decoded.unknown, len(decoded.parts)) == (1, 1, 6)


def test_requests_to_a_frozen_kobuki_are_answered_later_in_several_reports() -> None:
    kobuki = VirtualKobuki()
    kobuki.poll(0.0)
    kobuki.frozen = True
    for _ in range(20):
        kobuki.feed(encode(GetGains()), 0.01)
    kobuki.frozen = False
    said = kobuki.poll(1.0)
    gains = [
        part
        for payload in KobukiFrameFinder().feed(said)
        for part in decode(payload, FEEDBACK).parts
        if isinstance(part, KobukiGains)
    ]
    assert len(gains) == 20


def test_frozen_kobuki_is_silent_and_stops() -> None:
    bench = Bench()
    bench.run(1.0, Velocity(0.3, 0.0))
    count = len(bench.reports)
    bench.device.frozen = True
    bench.run(1.0)
    assert len(bench.reports) == count
    assert bench.device.body.velocity == Velocity(0.0, 0.0)
    bench.device.frozen = False
    bench.run(0.1)
    assert len(bench.reports) == count + 5


def test_noise_among_commands_is_ignored() -> None:
    bench, random = Bench(), Random(4)  # noqa: S311 - noise, not a secret
    for _ in range(50):
        noise = random.randbytes(40).replace(b"\xaa", b"\x00")
        assert bench.device.feed(noise, bench.now) == b""
    bench.run(0.2)
    assert bench.device.body.velocity == Velocity(0.0, 0.0)
    bench.run(0.2, Velocity(0.2, 0.0))
    assert bench.device.body.velocity.linear == pytest.approx(0.2)


# --- its twin, over the same dock and battery -------------------------------------------------------------------------


class TwinBench:
    """The twin of the base in the same place."""

    def __init__(self, pose: Pose2D, battery: Battery | None = None) -> None:
        device = VirtualKobuki(wheels=SimulatedWheels(pose=pose), ground=SimulatedWorld(dock=DOCK), battery=battery)
        self.clock = ManualClock()
        self.twin = BaseTwin(self.clock, body=device.body)
        self.twin.open()

    def run(self, seconds: float, velocity: Velocity | None = None) -> None:
        for _ in range(round(seconds / BaseTwin.STEP_INTERVAL)):
            if velocity is not None:
                self.twin.drive(velocity)
            self.clock.advance(BaseTwin.STEP_INTERVAL)
            self.twin.step()


@pytest.mark.parametrize(
    "pose", [ON_DOCK, Pose2D(-1.5, 0.0, pi), Pose2D(-1.5, 0.2, pi / 2), Pose2D(3.0, 0.0, 0.0)], ids=str
)
def test_twin_reports_dock_and_battery_like_the_driver(pose: Pose2D) -> None:
    def battery() -> Battery:
        return Battery(60.0, drain=20.0, resistance=INTERNAL_RESISTANCE)

    bench, twin = at(pose, battery()), TwinBench(pose, battery())
    bench.run(5.0)
    twin.run(5.0)
    report = bench.reports[-1].values()
    inertia = next(part for part in report if type(part).__name__ == "Inertia")
    read = KobukiStateBuilder().update(bench.core(), inertia, 5.0, bench.newest(DockInfrared))  # type: ignore[arg-type]
    state = twin.twin.state().value
    assert read is not None
    assert state is not None
    assert (state.docked, state.charging, state.dock) == (read.docked, read.charging, read.dock)
    assert state.battery_voltage == pytest.approx(read.battery_voltage, abs=0.06)
    assert state.battery_percent == pytest.approx(read.battery_percent, abs=2.0)


def test_twin_driving_onto_its_dock_is_docked_before_a_bump() -> None:
    felt: list[tuple[bool, Sides]] = []
    twin = TwinBench(Pose2D(-2.2, 0.0, pi), Battery(12.0, drain=100.0))

    def state() -> tuple[bool, Sides]:
        value = twin.twin.state().value
        assert value is not None
        return value.docked, value.bumper

    for _ in range(600):
        twin.run(0.02, Velocity(0.05, 0.0))
        felt.append(state())
        if felt[-1][0]:
            break
    assert felt[-1] == (True, Sides())
    assert not any(docked or bumper for docked, bumper in felt[:-1])
    twin.run(10.0)
    value = twin.twin.state().value
    assert value is not None
    assert value.charging
    assert value.battery_percent > 20.0


def test_twin_reports_overcurrent_of_spinning_wheels() -> None:
    twin = TwinBench(Pose2D(-2.6, 2.0, 0.0))
    twin.run(2.0, Velocity(-0.3, 0.0))  # into the wall behind it, where it has no bumper; later its monitor stops it
    value = twin.twin.state().value
    assert value is not None
    assert (value.overcurrent, value.bumper) == (Sides(left=True, right=True), Sides())
