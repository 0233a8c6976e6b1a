"""WitMotion's IMUs: packets cut anywhere and damaged, the driver over its wire, its twin, and how it is recognised."""

from dataclasses import replace
from math import radians

import pytest

from config.diagnostics import SourceText
from config.robot import parse_robot
from drivers.api import Pose2D, Quality
from drivers.sim.context import SimContext
from drivers.sim.timeline import Timeline
from drivers.witmotion import wire
from drivers.witmotion.driver import STALE_AFTER, WitMotionImu
from drivers.witmotion.probe import probe
from drivers.witmotion.twin import ImuTwin
from drivers.witmotion.virtual import CONFIGURED_INTERVAL, VirtualWitMotion
from missions.library.drivers import DriverTable
from tests.drivers.cranked import HandWire, pass_until

LEANING = wire.WitMotionReport((0.5, 0.0, 9.7), (0.0, 1.5, 0.0), (radians(3), radians(-8), radians(170)))

DOCUMENTED = bytes.fromhex("5551 0000 0000 0008 6400 12")
"""1 g down, at 1 degC, as the protocol's document works it out: 0x0800 steps of 16 g / 32768."""


def test_packet_is_parsed_as_documented() -> None:
    finder = wire.WitMotionReportFinder()
    list(finder.feed(DOCUMENTED + wire.packet(wire.RATES, (0.0, 0.0, 0.0), wire.RATE_PER_STEP)))
    (report,) = finder.feed(wire.packet(wire.ANGLES, (0.0, 0.0, 0.0), wire.ANGLE_PER_STEP))
    assert report.forces == pytest.approx((0.0, 0.0, 9.80665))


def test_reports_are_found_for_any_chunking() -> None:
    data = b"\x55\x51junk" + wire.pack(LEANING) + wire.packet(0x54, (1.0, 2.0, 3.0), 1.0) + b"\x55" + wire.pack(LEANING)
    for size in (1, 2, 5, 11, 500):
        finder = wire.WitMotionReportFinder()
        found = [each for at in range(0, len(data), size) for each in finder.feed(data[at : at + size])]
        assert len(found) == 2
        for report in found:
            assert report.angles == pytest.approx(LEANING.angles, abs=1e-4)
            assert report.rates == pytest.approx(LEANING.rates, abs=2e-3)


def test_a_damaged_packet_is_no_report() -> None:
    data = bytearray(wire.pack(LEANING))
    data[25] ^= 0x10
    finder = wire.WitMotionReportFinder()
    assert list(finder.feed(bytes(data))) == []
    assert finder.malformed == 1


class Bench:
    def __init__(self) -> None:
        self.timeline = Timeline()
        self.device = VirtualWitMotion()
        self.wire = HandWire(self.device, self.timeline)
        self.imu = WitMotionImu(self.wire.link("imu"), self.timeline.clock, level=(radians(1), 0.0))
        self.imu.open()
        pass_until(self.timeline, lambda: self.imu.health().online)

    def passes(self, seconds: float) -> None:
        self.timeline.run_until(self.timeline.clock.now() + seconds)


def test_imu_is_set_to_100_hz_and_returns_the_newest_report() -> None:
    bench = Bench()
    assert bench.device.interval == CONFIGURED_INTERVAL
    bench.device.report = LEANING
    bench.passes(0.05)
    reading = bench.imu.attitude()
    assert reading.good
    assert reading.value is not None
    assert reading.value.roll == pytest.approx(radians(2), abs=1e-3)
    assert reading.value.pitch == pytest.approx(radians(-8), abs=1e-3)
    assert reading.value.rates[1] == pytest.approx(1.5, abs=2e-3)
    bench.imu.close()


def test_unplugged_imu_is_stale_and_resumes_when_replugged() -> None:
    bench = Bench()
    bench.wire.unplug()
    bench.passes(2 * STALE_AFTER)
    assert bench.imu.attitude().quality is Quality.STALE
    assert not bench.imu.health().online
    bench.wire.plug_in()
    bench.passes(0.5)
    assert bench.imu.attitude().good
    bench.imu.close()


def test_silent_imu_gives_a_hint() -> None:
    bench = Bench()
    bench.wire.distort = lambda _: b""
    bench.passes(2 * STALE_AFTER)
    health = bench.imu.health()
    assert "115200 baud" in health.hint
    assert not health.online
    bench.imu.close()


def test_imu_is_recognised_by_its_reports() -> None:
    asking = probe()
    ask = next(asking)
    assert ask.send == b""
    with pytest.raises(StopIteration) as end:
        asking.send(wire.pack(LEANING))
    assert end.value.value.keys == {"baud": 115_200}
    silent = probe()
    next(silent)
    assert silent.send(b"\x55\x51abc").baud == 9_600


def test_imu_twin_reports_an_upright_turning_base() -> None:
    timeline = Timeline()
    twin = ImuTwin(SimContext(timeline.clock, None, lambda _: Pose2D(0.0, 0.0, 0.4)))
    assert twin.attitude().quality is Quality.NONE
    twin.open()
    felt = twin.attitude().value
    assert felt is not None
    assert (felt.roll, felt.pitch, felt.yaw) == (0.0, 0.0, 0.4)
    twin.plug.unplug()
    assert twin.attitude() == replace(twin.attitude(), quality=Quality.STALE)
    twin.close()


def test_level_accepts_any_two_angles() -> None:
    text = "robot: r\nimu: {driver: witmotion, port: /dev/imu, level: [2 deg, -1 deg]}\n"
    keys = parse_robot(SourceText("r.yaml", text), DriverTable())
    assert keys.sections["imu"].keys.level == pytest.approx((radians(2), radians(-1)))
