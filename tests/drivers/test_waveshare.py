"""The rovers of Waveshare: their lines, their heartbeat, and what a line without a checksum may do to a base."""

import json
from collections.abc import Iterator
from random import Random

import pytest

from drivers.api import DeviceStatus, Velocity
from drivers.base.reckoning import Reckoning, TwoWheels
from drivers.sim.base_body import BaseBody
from drivers.sim.timeline import Timeline
from drivers.transport.lines import LineFinder
from drivers.waveshare import wire
from drivers.waveshare.driver import HEARTBEAT_TIMEOUT, waveshare_base
from drivers.waveshare.virtual import BATTERY_VOLTAGE, VirtualWaveshare
from tests.drivers.cranked import HandWire, pass_until
from tests.drivers.fault_injection import FaultInjection
from tests.tries import tries

TRACK = 0.2

TRANSACTIONS = tries(2500, most=10_000)


class Bench:
    """A rover, and its driver on a wire that is turned by hand."""

    def __init__(self, *, encoders: bool = True, echoes: bool = True) -> None:
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        unit = 1.0 if encoders else wire.FULL_POWER / 1.25
        self.rover = VirtualWaveshare(BaseBody(), track=TRACK, unit=unit, encoders=encoders, echoes=echoes)
        self.wire = HandWire(self.rover, self.timeline)
        self.notices: list[DeviceStatus] = []
        self.base = waveshare_base(
            self.wire.link("base", report=self.notices.append),
            self.clock,
            track=TRACK,
            encoders=encoders,
            speed_at_full=1.25,
            report=self.notices.append,
        )

    def start(self) -> "Bench":
        self.base.open()
        pass_until(self.timeline, lambda: self.base.health().online)
        return self

    def passes(self, seconds: float) -> None:
        self.timeline.run_until(self.clock.now() + seconds)

    def drives(self, linear: float, angular: float, seconds: float) -> None:
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            self.base.drive(Velocity(linear, angular))
            self.passes(0.05)


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.base.close()


@pytest.fixture
def open_loop() -> Iterator[Bench]:
    bench = Bench(encoders=False)
    yield bench
    bench.base.close()


# --- lines ------------------------------------------------------------------------------------------------------------


def test_lines_are_found_for_any_chunking_and_overlong_ones_dropped() -> None:
    finder = LineFinder(max_length=20)
    stream = b"first\r\n\n second \n" + b"x" * 1000 + b"\nthird\n" + b"y" * 21 + b"\nfourth\nbegun"
    found = [line for at in range(0, len(stream), 3) for line in finder.feed(stream[at : at + 3])]
    assert found == [b"first", b"second", b"third", b"fourth"]
    assert finder.overlong == 2


@pytest.mark.parametrize(
    ("line", "volts"),
    [
        (b'{"T":1001,"L":0.1,"R":-0.2,"r":1.2,"p":0.3,"y":"null","v":12.05}', 12.05),  # ugv_base_general
        (b'{"T":1001,"L":0.1,"R":-0.2,"r":1.2,"p":0.3,"y":2.0,"q0":1,"odl":12,"odr":11,"v":1205}', 12.05),
    ],
    ids=["volts", "hundredths"],
)
def test_vendor_report_is_parsed(line: bytes, volts: float) -> None:
    assert wire.parse_line(line) == wire.WaveshareFeedback(0.1, -0.2, volts)


@pytest.mark.parametrize(
    "line",
    [
        b"UGV started.",
        b'{"T":1001,"L":0.1,"R":0.2',
        b'{"T":1001,"L":0.1,"v":12}',
        b'{"T":1001,"L":NaN,"R":0.2,"v":12}',
        b'{"T":1001,"L":1e999,"R":0.2,"v":12}',
        b'{"T":1001,"L":true,"R":0.2,"v":12}',
        b'{"T":1001,"L":"0.1","R":0.2,"v":12}',
        b'{"T":1001,"L":99999999,"R":0.2,"v":12}',
        b'{"T":1001,"L":' + b"9" * 400 + b',"R":0.2,"v":12}',  # more than a float holds
        b'{"T":true}',
        b"[1001]",
        b"[" * 500,
        b"1" * 500,
        b"\xff\xfe{}",
        b"null",
    ],
)
def test_invalid_report_is_refused(line: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        wire.parse_line(line)


def test_rover_command_is_json_with_floats() -> None:
    assert wire.speeds(1, -0.25) == b'{"T":1,"L":1.000,"R":-0.250}\n'
    assert json.loads(wire.command(wire.HEARTBEAT, cmd=400)) == {"T": 136, "cmd": 400}


# --- reckoning --------------------------------------------------------------------------------------------------------


def test_circle_by_dead_reckoning_closes_at_any_step_rate() -> None:
    reckoning = Reckoning()
    reckoning.advance(5.0, Velocity(0.5, 1.0))
    for step in range(1, 8):
        reckoning.advance(5.0 + step * 6.283185307179586 / 7)
    pose = reckoning.pose
    assert (pose.x, pose.y, pose.heading) == pytest.approx((0.0, 0.0, 6.283185307), abs=1e-9)
    reckoning.pause()
    reckoning.advance(100.0)
    assert reckoning.pose == pose


def test_wheel_speed_limit_scales_the_whole_velocity() -> None:
    wheels = TwoWheels(0.2, 0.5)
    given = wheels.within(Velocity(0.5, 2.0))
    assert max(map(abs, wheels.rims(given))) == pytest.approx(0.5)
    assert given.angular / given.linear == pytest.approx(4.0)
    back = wheels.velocity(*wheels.rims(given))
    assert (back.linear, back.angular) == pytest.approx((given.linear, given.angular))


# --- the driver -------------------------------------------------------------------------------------------------------


def test_heartbeat_is_set_and_confirmed_before_driving(bench: Bench) -> None:
    bench.start()
    bench.passes(0.2)
    assert bench.rover.heartbeat == HEARTBEAT_TIMEOUT
    assert [notice.kind for notice in bench.notices] == ["online"]
    echoed = bench.rover.feed(b'{"T":130}\n', bench.clock.now())
    assert not echoed.startswith(b'{"T":130}')


def test_unconfirmed_heartbeat_is_reported_and_set_anyway() -> None:
    bench = Bench(echoes=False).start()
    bench.passes(4.0)
    faults = [notice.message for notice in bench.notices if notice.kind == "fault"]
    assert len(faults) == 1
    assert "may roll on for 3 s" in faults[0]
    assert bench.rover.heartbeat == HEARTBEAT_TIMEOUT
    bench.base.close()


def test_dead_driver_stops_the_rover_by_heartbeat(bench: Bench) -> None:
    bench.start()
    bench.drives(0.4, 0.0, 2.0)
    bench.wire.unplug()  # nobody says anything any more
    before = bench.rover.pose(bench.clock.now())
    bench.passes(HEARTBEAT_TIMEOUT + 0.5)
    at_rest = bench.rover.pose(bench.clock.now())
    bench.passes(1.0)
    assert bench.rover.pose(bench.clock.now()) == at_rest
    assert at_rest.x - before.x < 0.4 * (HEARTBEAT_TIMEOUT + 0.2)


def test_restarted_rover_is_configured_again_before_driving(bench: Bench) -> None:
    bench.start()
    bench.drives(0.3, 0.0, 1.0)
    bench.rover.reset(bench.clock.now())
    bench.passes(0.4)
    assert not bench.base.health().online
    pass_until(bench.timeline, lambda: bench.base.health().online)
    assert bench.rover.heartbeat == HEARTBEAT_TIMEOUT
    assert bench.rover.commanded == (0.0, 0.0)


def test_full_power_without_encoders_is_the_configured_speed(open_loop: Bench) -> None:
    open_loop.start()
    open_loop.drives(0.5, 0.0, 2.0)
    assert open_loop.rover.commanded == pytest.approx((0.2, 0.2), abs=0.001)
    state = open_loop.base.state().value
    assert state is not None
    assert state.reckoned
    assert state.battery_percent == pytest.approx(100 * (BATTERY_VOLTAGE - 9.0) / 3.6)
    assert state.pose.x == pytest.approx(open_loop.rover.pose(open_loop.clock.now()).x, abs=0.1)


def test_wheel_commands_are_limited_to_full_power(open_loop: Bench) -> None:
    open_loop.base = waveshare_base(
        open_loop.wire.link("base"), open_loop.clock, track=TRACK, encoders=False, speed_at_full=0.3, max_linear=0.3
    )
    open_loop.start()
    open_loop.drives(0.3, 1.9, 2.0)
    assert max(map(abs, open_loop.rover.commanded)) <= wire.FULL_POWER


def test_foreign_lines_are_harmless(bench: Bench) -> None:
    bench.start()
    for noise in (b"[missionPlay abort.]\r\n", b'{"T":1003,"mac":"x"}\r\n', b"\x00\xff" * 400 + b"\n", b"[" * 3000):
        bench.wire.take(noise)
        bench.passes(0.1)
    bench.wire.take(b"\n")
    bench.passes(0.1)
    assert bench.base.health().online
    assert bench.base.health().counters["malformed"] >= 1
    assert bench.base.health().counters["overlong"] >= 1


def test_replugged_rover_stays_at_rest(bench: Bench) -> None:
    bench.start()
    bench.drives(0.4, 0.0, 1.0)
    bench.wire.unplug()
    bench.passes(1.5)
    here = bench.rover.pose(bench.clock.now())
    bench.wire.plug_in()
    pass_until(bench.timeline, lambda: bench.base.health().online)
    bench.passes(1.0)
    assert bench.rover.pose(bench.clock.now()) == here
    assert bench.base.health().reconnected_at is not None


@pytest.mark.parametrize("seed", range(3))
def test_thousands_of_reports_with_every_mishap_and_no_wrong_value(bench: Bench, seed: int) -> None:
    """A digit that turns over makes another number, which no checksum tells: the middle one of five does.

    What is told is what a wheel did within the last quarter of a second: a digit that turned over within that is none.
    """
    faults = FaultInjection(seed, drop=0.01, truncate=0.01, flip=0.01, split=0.01, late=0.01, noise=0.01, echo=0.01)
    random = Random(seed)  # noqa: S311 - it must be repeatable, and guards nothing
    bench.start()
    waiting: list[tuple[float, bytes]] = []

    def distort(said: bytes) -> bytes:
        now = bench.clock.now()
        for line in said.splitlines(keepends=True):
            waiting.extend((now + late, piece) for late, piece in faults.disturb(line))
            if faults.echoes():
                waiting.append((now, wire.speeds(0.1, 0.1)))
        due = [piece for at, piece in waiting if at <= now]
        waiting[:] = [(at, piece) for at, piece in waiting if at > now]
        return b"".join(due)

    bench.wire.distort = distort
    truths = [0.0]
    wrong, believed, most = 0, 0, 0
    reports = bench.base.health().counters["reports"]
    wanted = 0.0
    while bench.base.health().counters["reports"] - reports < TRANSACTIONS:
        if random.random() < 0.02:
            wanted = random.uniform(-0.4, 0.4)
        if bench.base.health().online:
            bench.base.drive(Velocity(wanted, 0.0))
        bench.passes(0.02)
        truths = [*truths[-12:], bench.rover.body.wheels.speeds[0]]
        reading = bench.base.state()
        if reading.value is None:
            continue
        believed += 1
        rims = TwoWheels(TRACK, 2.0).rims(reading.value.velocity)
        wrong += not all(min(truths) - 0.01 <= rim <= max(truths) + 0.01 for rim in rims)
        wrong += not 12.0 < reading.value.battery_voltage < 12.2
        most = max(most, bench.base.health().counters["malformed"])
    assert believed > 0.9 * TRANSACTIONS
    assert wrong == 0
    assert most > TRANSACTIONS / 100
    kinds = ("drop", "truncate", "flip", "split", "late", "noise", "echo")
    assert min(faults.happened[kind] for kind in kinds) > TRANSACTIONS / 200
    end = bench.base.state().value
    assert end is not None
    assert end.pose.x == pytest.approx(bench.rover.pose(bench.clock.now()).x, abs=0.5)
