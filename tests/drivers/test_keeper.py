"""Who holds two actuators for a driver: its lines, its watchdog, its ramp, and what befalls both ends of the wire."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from math import radians
from pathlib import Path
from random import Random
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.diagnostics import InvalidFileError
from drivers.api import DeviceStatus, HeadPose, Velocity
from drivers.base.diff_drive import DiffDriveBase
from drivers.base.reckoning import TwoWheels
from drivers.errors import DeviceFault, DriverError
from drivers.head.axis import ServoAxis
from drivers.head.guardian_head import OFFLINE_TIMEOUT, GuardianHead
from drivers.pi_car.driver import GuardianProtocol
from drivers.sim.base_body import BaseBody
from drivers.sim.timeline import Timeline
from drivers.transport import guardian_wire
from drivers.transport.guardian import SERVO_SPEED, ActuatorGuardian, GuardianServos, GuardianWheels
from drivers.transport.link import SerialLink
from drivers.virtual.guardian import VirtualCar, VirtualServos
from missions.executive.events import Event, Logged
from missions.library.drivers import load_robot
from missions.request import RunRequest
from missions.runner import Runner
from tests.drivers.cranked import PERIOD, HandWire, pass_until
from tests.drivers.damaged import MISHAPS, Damaged
from tests.machines import walk
from tests.tries import tries

TRANSACTIONS = tries(2500, most=10_000)
SPEED = 120
STEP = SERVO_SPEED * 0.02 + 1
"""Degrees of the widest step: what a keeper leads a servo between two looks at the time, in whole degrees."""


class Hands:
    """Keeps what they are told."""

    def __init__(self) -> None:
        self.aimed: list[tuple[int, int]] = []
        self.rests = 0

    def set_goals(self, first: int, second: int, now: float) -> None:  # noqa: ARG002
        self.aimed.append((first, second))

    def rest(self, now: float) -> None:  # noqa: ARG002
        self.rests += 1

    def advance(self, now: float) -> None:
        pass

    def positions(self) -> tuple[int, int]:
        return self.aimed[-1] if self.aimed else (0, 0)


class Bench:
    """A car and a pan/tilt, each with its driver, on wires that are turned by hand."""

    def __init__(self, *, warm: bool = True) -> None:
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        self.notices: list[DeviceStatus] = []
        self.car = VirtualCar(BaseBody(), TwoWheels(0.2, 0.5))
        self.servos = VirtualServos((90, 90), knows_angles=warm)
        self.car_wire, self.head_wire = HandWire(self.car, self.timeline), HandWire(self.servos, self.timeline)
        self.base = DiffDriveBase(
            self.car_wire.link("base"), self.clock, GuardianProtocol(0.2, 0.5), report=self.notices.append
        )
        self.head = GuardianHead(
            self.head_wire.link("head"),
            self.clock,
            pan=ServoAxis(0, radians(-80), radians(80), start=90),
            tilt=ServoAxis(1, radians(-60), radians(20), flip=True, start=90),
            speed=radians(SPEED),
            acceleration=radians(400),
            report=self.notices.append,
        )

    def start(self) -> "Bench":
        self.base.open()
        self.head.open()
        self.until(lambda: self.base.health().online and self.head.health().online)
        return self

    def until(self, holds: object) -> None:
        pass_until(self.timeline, holds)  # type: ignore[arg-type]

    def passes(self, seconds: float) -> None:
        self.timeline.run_until(self.clock.now() + seconds)

    def drives(self, linear: float, seconds: float) -> None:
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            self.base.drive(Velocity(linear, 0.0))
            self.passes(0.05)

    def close(self) -> None:
        self.base.close()
        self.head.close()


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.close()


# --- lines ------------------------------------------------------------------------------------------------------------


def test_guardian_lines_round_trip_with_a_standard_crc() -> None:
    assert guardian_wire.parse_line(guardian_wire.REPORT_REQUEST.strip()) == guardian_wire.ReportRequest()
    assert guardian_wire.parse_line(
        guardian_wire.pack_command(7, -1000, 1000).strip()
    ) == guardian_wire.GuardianCommand(7, -1000, 1000)
    assert guardian_wire.parse_line(guardian_wire.pack_report(32000, 0, -1).strip()) == guardian_wire.GuardianReport(
        32000, 0, -1
    )
    assert guardian_wire._make_line("123456789").endswith(b"*29B1\n")


@given(st.binary(max_size=60))
def test_noise_is_no_line(noise: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        guardian_wire.parse_line(noise)


@given(st.integers(1, 32000), st.integers(-1000, 1000), st.integers(-1000, 1000), st.data())
def test_a_line_with_one_bit_turned_over_is_none(boot: int, first: int, second: int, data: st.DataObject) -> None:
    line = bytearray(guardian_wire.pack_command(boot, first, second).strip())
    line[data.draw(st.integers(0, len(line) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(ValueError, match=r"."):
        guardian_wire.parse_line(bytes(line))


# --- the keeper -------------------------------------------------------------------------------------------------------


def test_guardian_rests_on_silence_and_ignores_other_boots() -> None:
    hands = Hands()
    keeper = ActuatorGuardian(hands, boot=5, now=0.0)
    assert keeper.feed(guardian_wire.pack_command(5, 300, 400), 1.0) == b""
    assert keeper.feed(
        guardian_wire.pack_command(4, 900, 900) + b"noise\n" + guardian_wire.REPORT_REQUEST, 1.1
    ) == guardian_wire.pack_report(5, 300, 400)
    assert hands.aimed == [(300, 400)]
    keeper.poll(1.1 + guardian_wire.WATCHDOG_TIMEOUT - 0.001)
    assert hands.rests == 0
    keeper.poll(1.1 + guardian_wire.WATCHDOG_TIMEOUT + 0.001)
    keeper.poll(9.0)
    assert hands.rests == 1


def test_wheels_take_no_more_than_full_power_and_stand_at_first() -> None:
    told: list[tuple[float, float]] = []
    wheels = GuardianWheels(lambda left, right: told.append((left, right)))
    wheels.set_goals(2000, -500, 0.0)
    wheels.set_goals(2000, -500, 0.1)
    wheels.rest(0.2)
    assert told == [(0.0, 0.0), (1.0, -0.5), (0.0, 0.0)]


def test_guardian_servos_are_speed_limited_and_stop_at_the_watchdog() -> None:
    sent: list[tuple[int, int]] = []
    servos = GuardianServos(lambda number, degree: sent.append((number, degree)), (90, None))
    servos.set_goals(180, 40, 0.0)
    assert sent == [(1, 40)], "one that has got no pulse yet goes at once"
    for step in range(1, 11):
        servos.advance(0.01 * step)
    assert servos.positions() == (120, 40)
    servos.rest(0.1)
    for step in range(10):
        servos.advance(0.1 + 0.1 * step)
    assert servos.positions() == (120, 40)
    pans = [90, *(degree for number, degree in sent if number == 0)]
    assert max(abs(one - other) for one, other in pairwise(pans)) <= 3


# --- both ends --------------------------------------------------------------------------------------------------------


def test_head_with_unknown_servo_angles_does_not_move_before_a_command() -> None:
    bench = Bench(warm=False).start()
    bench.passes(1.0)
    assert bench.servos.pulse_count == 0
    assert [notice.kind for notice in bench.notices] == ["fault"]
    assert "may leap" in bench.notices[0].message
    bench.head.look(HeadPose(radians(20), 0.0))
    bench.passes(1.0)
    assert bench.servos.angle(0, bench.clock.now()) == pytest.approx(110)
    assert bench.servos.max_step <= STEP
    bench.close()


def test_guardian_restart_in_mid_move_ends_the_motion(bench: Bench) -> None:
    bench.start()
    bench.head.look(HeadPose(radians(70), 0.0))
    bench.drives(0.4, 0.3)
    bench.servos.reset()
    bench.car.reset()
    bench.passes(0.2)
    here, shares = bench.servos.angle(0, bench.clock.now()), bench.car.shares
    bench.passes(1.0)
    assert bench.servos.angle(0, bench.clock.now()) == here < 90 + 65
    assert shares == bench.car.shares == (0.0, 0.0)
    assert sum("begun anew" in notice.message or "restarted" in notice.message for notice in bench.notices) == 2
    assert bench.head.health().reconnected_at is not None
    assert bench.base.health().reconnected_at is not None
    bench.head.look(HeadPose(0.0, 0.0))
    bench.passes(2.0)
    assert bench.servos.angle(0, bench.clock.now()) == 90
    assert bench.servos.max_step <= STEP


def test_guardian_events_cover_every_transition_safely(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def connect(bench: Bench, _: Random) -> None:
        sent.clear()
        bench.head.on_connected()
        bench.head.on_poll()
        assert not any(isinstance(guardian_wire.parse_line(line), guardian_wire.GuardianCommand) for line in sent)

    def answer(bench: Bench, chance: Random) -> None:
        bench.head.on_data(guardian_wire.pack_report(chance.choice((7, 8)), 90, 90))

    def fall_silent(bench: Bench, _: Random) -> None:
        bench.clock.advance(OFFLINE_TIMEOUT + 0.01)
        bench.head.on_poll()

    sent = list[bytes]()
    monkeypatch.setattr(SerialLink, "write", lambda _, data: sent.extend(data.splitlines()))
    monkeypatch.setattr(SerialLink, "set_dtr", lambda *_, **__: None)
    table = walk(monkeypatch, "drivers.head.guardian_head.TRANSITIONS", Bench, [connect, answer, fall_silent])
    assert table.visited == set(table)
    assert not table.missing


def test_replugged_guardian_rests_until_a_new_command(bench: Bench) -> None:
    bench.start()
    bench.head.look(HeadPose(radians(70), 0.0))
    bench.drives(0.4, 0.4)
    for each in (bench.car_wire, bench.head_wire):
        each.unplug()
    bench.passes(1.5)
    here, there = bench.servos.angle(0, bench.clock.now()), bench.car.pose(bench.clock.now())
    for each in (bench.car_wire, bench.head_wire):
        each.plug_in()
    bench.until(lambda: bench.base.health().online and bench.head.health().online)
    bench.passes(1.0)
    assert bench.servos.angle(0, bench.clock.now()) == here
    assert bench.car.pose(bench.clock.now()) == there
    assert bench.head.health().reconnected_at is not None
    assert bench.base.health().reconnected_at is not None
    for each in (bench.car_wire, bench.head_wire):
        each.unplug()
    bench.passes(6.0)
    for each in (bench.car_wire, bench.head_wire):
        each.plug_in()
    bench.until(lambda: bench.base.health().online and bench.head.health().online)
    with pytest.raises(DeviceFault, match="away"):
        bench.head.look(HeadPose(0.0, 0.0))
    with pytest.raises(DeviceFault, match="away"):
        bench.base.drive(Velocity(0.1, 0.0))
    assert bench.servos.max_step <= STEP


@pytest.mark.parametrize("seed", range(2))
def test_thousands_of_questions_with_every_mishap_both_ways_and_no_wrong_value(bench: Bench, seed: int) -> None:
    random = Random(seed)  # noqa: S311 - it must be repeatable, and guards nothing
    bench.start()
    sent: set[tuple[int, int]] = set()
    taken: list[tuple[int, int]] = []
    keeper = bench.car.guardian
    assert keeper is not None
    aim = keeper._actuators.set_goals

    def aimed(first: int, second: int, now: float) -> None:
        taken.append((first, second))
        aim(first, second, now)

    keeper._actuators.set_goals = aimed  # type: ignore[method-assign]
    drive = bench.base.protocol.drive

    def drives(velocity: Velocity, now: float) -> bytes:
        half = 0.2 * velocity.angular / 2
        left, right = velocity.linear - half, velocity.linear + half
        excess = max(1.0, abs(left) / 0.5, abs(right) / 0.5)
        sent.add((round(left / excess * 2000), round(right / excess * 2000)))
        return drive(velocity, now)

    bench.base.protocol.drive = drives  # type: ignore[method-assign]
    wheels, servos = Damaged(bench.car_wire, seed), Damaged(bench.head_wire, seed + 100)
    lost = 0
    while bench.base.health().counters["reports"] < TRANSACTIONS:
        with suppress(DriverError):
            bench.base.drive(Velocity(random.uniform(-0.4, 0.4), random.uniform(-1.0, 1.0)))
            bench.head.look(HeadPose(radians(random.uniform(-80, 80)), radians(random.uniform(-60, 20))))
        bench.passes(random.choice((0.05, 0.2)))
        lost += not bench.base.health().online
    assert set(taken) <= sent
    assert len(taken) > 0.5 * TRANSACTIONS
    assert bench.servos.max_step <= STEP
    assert bench.base.health().counters["malformed"] > TRANSACTIONS / 100
    assert lost == 0
    for faults in (wheels.faults, servos.faults):
        assert min(faults.happened[kind] for kind in MISHAPS) > TRANSACTIONS / 500
    bench.car_wire.distort = bench.head_wire.distort = bytes
    bench.head.look(HeadPose(radians(33), radians(7)))
    bench.passes(4.0 + PERIOD)
    assert bench.servos.angle(0, bench.clock.now()) == pytest.approx(90 + 33)


# --- in a robot file --------------------------------------------------------------------------------------------------

ROBOT = """\
robot: nodding
head:
  driver: arduino
  protocol: lines
  port: /dev/nano
  pan: {servo: 0}
  tilt: {servo: 1}
"""

CAR = """\
robot: car
base:
  driver: pi_car
  motors: gpio
  left: {forward: 17, backward: 27}
  right: {forward: 2, backward: 3}
  speed_at_full: 0.5 m/s
  max_speed: 0.3 m/s
head:
  driver: pca9685
  pan: {servo: 0}
  tilt: {servo: 1}
"""

MISSION = """\
mission: m
tree:
  sequence:
    - look: {pan: 30 deg, tilt: -10 deg}
    - log: "${round(head.pan / 10 deg)} ${round(head.tilt / 10 deg)}"
"""


@pytest.mark.parametrize("simulate", ["fast", pytest.param("wire", marks=pytest.mark.real_time)])
def test_a_head_with_our_sketch_is_simulated_as_every_head(simulate: Literal["fast", "wire"], tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(ROBOT, encoding="utf-8")
    (tmp_path / "m.yaml").write_text(MISSION, encoding="utf-8")
    events: list[Event] = []
    order = RunRequest(str(tmp_path / "m.yaml"), robot=str(tmp_path / "robot.yaml"), simulate=simulate)
    assert Runner(order, listeners=[events.append]).run().result == "success"
    assert [event.text for event in events if isinstance(event, Logged) and event.level == "info"] == ["3 -1"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (ROBOT.replace("servo: 0", "servo: 2"), "'pan' must be servo 0 with 'protocol: lines'"),
        (CAR.replace("backward: 27", "backward: 17"), "GPIO 17 is used twice"),
        (CAR.replace("motors: gpio", "motors: pca9685"), "a PCA9685 has channels 0 to 15, not 27"),
        (CAR.replace("max_speed: 0.3 m/s", "max_speed: 0.6 m/s"), "it cannot go that fast"),
        (CAR.replace("motors: gpio", "motors: pca9685").replace("27", "7").replace("17", "1"), "channel 1 is used by"),
        (CAR.replace("servo: 0", "servo: 1"), "'pan' and 'tilt' are both on servo 1"),
    ],
)
def test_invalid_guardian_robot_file_is_refused(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InvalidFileError, match=told):
        load_robot(tmp_path / "robot.yaml")
