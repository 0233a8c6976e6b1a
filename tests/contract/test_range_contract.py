"""What ``drivers.api.Ranger`` promises, kept by the RPLIDAR's driver over its wire and by its twin."""

from collections.abc import Iterator
from math import isnan, pi, radians

import numpy as np
import pytest

from drivers.api import Pose2D, Quality
from tests.contract.range_rigs import PLACE, RangeRig, TopicRange, TwinRange, WireRange, WireRangeA2
from tests.contract.rigs import simulated


@pytest.fixture(
    params=[
        simulated(WireRange, "wire"),
        simulated(WireRangeA2, "wire a2"),
        simulated(TopicRange, "ros2"),
        simulated(TwinRange, "twin"),
    ]
)
def rig(request: pytest.FixtureRequest) -> Iterator[RangeRig]:
    made: RangeRig = request.param()
    yield made
    made.close()


def test_unopened_range_finder_is_offline_and_has_no_scan(rig: RangeRig) -> None:
    reading = rig.device.scan()
    assert (reading.value, reading.quality) == (None, Quality.NONE)
    assert not rig.device.health().online
    rig.device.rest()
    rig.device.close()
    rig.device.close()


def test_range_finder_has_its_name_and_mounting(rig: RangeRig) -> None:
    assert rig.device.name == "range"
    assert rig.device.place == PLACE


def test_scan_measures_the_room_in_base_coordinates(rig: RangeRig) -> None:
    rig.start()
    scan = rig.next_scan()
    narrow = radians(10)
    assert scan.nearest(0.0, narrow) == pytest.approx(4.9, rel=0.05)
    assert scan.nearest(pi, narrow) == pytest.approx(3.1, rel=0.05)
    assert scan.nearest(pi / 2, narrow) == pytest.approx(1.0, rel=0.05)
    assert np.isnan(scan.ranges[np.abs(scan.bearings() + pi / 2) < narrow]).all()  # 15 m: further than it sees
    assert scan.nearest() == pytest.approx(1.0, rel=0.05)


def test_scan_turns_with_the_base(rig: RangeRig) -> None:
    rig.start()
    rig.base = Pose2D(0.0, 0.0, pi)
    scan = rig.next_scan(3)
    assert scan.nearest(0.0, radians(10)) == pytest.approx(2.9, rel=0.05)
    assert scan.nearest(-pi / 2, radians(10)) == pytest.approx(1.0, rel=0.05)


def test_nothing_is_seen_in_the_blind_sectors(rig: RangeRig) -> None:
    rig.start()
    scan = rig.next_scan()
    off = np.abs(scan.bearings() - radians(110))
    assert np.isnan(scan.ranges[off < radians(10)]).all()
    assert not isnan(float(scan.ranges[np.argmin(np.abs(scan.bearings() - radians(90)))]))


def test_scans_are_in_order_and_each_is_reported(rig: RangeRig) -> None:
    rig.start()
    first, told = rig.scan(), rig.changes
    later = rig.next_scan(3)
    now = rig.clock.now()
    assert later.number >= first.number + 3
    assert first.stamp < later.stamp <= now
    assert rig.device.scan().stamp >= later.stamp
    assert rig.changes >= told + 3
    assert (later.least, later.most) == (0.15, 12.0)


def test_scans_are_noisy_but_not_much(rig: RangeRig) -> None:
    rig.start()
    one, two = rig.scan().ranges, rig.next_scan().ranges
    both = np.isfinite(one) & np.isfinite(two) & (one < 3.0) & (two < 3.0)
    share = (one[both] - two[both]) / two[both]
    assert 0.002 < float(np.median(np.abs(share))) < 0.05


def test_unplugged_range_finder_is_offline_with_a_stale_scan(rig: RangeRig) -> None:
    rig.start()
    rig.unplug()
    rig.until(lambda: not rig.device.health().online and rig.told("offline"))
    assert rig.device.health().hint
    rig.until(lambda: rig.device.scan().quality is Quality.STALE)
    last = rig.scan().number
    rig.plug_in()
    rig.until(lambda: rig.device.scan().good)
    assert rig.scan().number > last
    assert rig.device.health().online


def test_closed_range_finder_can_be_opened_again(rig: RangeRig) -> None:
    rig.start()
    rig.device.close()
    assert not rig.device.health().online
    rig.device.open()
    last = rig.scan().number
    rig.until(lambda: rig.scan().number > last and rig.device.scan().good)
