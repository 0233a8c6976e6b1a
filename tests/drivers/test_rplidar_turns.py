"""From nodes to scans: directions, blind sectors, what is lost, and which turn counts."""

from math import degrees, inf, isnan, nan, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import RangeScan
from drivers.base.scan_mounting import BEAMS, Mounting, beam, bearings
from drivers.rplidar.make import MAX_NODES, ScanAssembler
from drivers.rplidar.models import MODELS, SAMPLE_RATE
from drivers.rplidar.nodes import STEPS_PER_TURN, Nodes

A1 = MODELS["a1"]


def turn(*, near: int = 0, metres: float = 2.0, count: int = 360, elsewhere: float = 4.0, new: bool = True) -> Nodes:
    """One turn; something is ``metres`` away at ``near`` degrees clockwise from the finder's own front."""
    angle = np.arange(count) * STEPS_PER_TURN // count
    distance = np.full(count, elsewhere)
    distance[(angle + 32) // 64 % 360 == near % 360] = metres
    first = np.zeros(count, dtype=np.bool_)
    first[0] = new
    steps = (distance * 4000).astype(np.uint16)
    return Nodes(first, np.full(count, 15, dtype=np.uint8), angle.astype(np.uint16), steps)


def scanned(turns: ScanAssembler, *parts: Nodes) -> RangeScan:
    """The scan of these nodes, which come a tenth of a second apart, and of the first of a further turn."""
    for number, part in enumerate(parts):
        turns.add(part, 0.1 * number)
    scan = turns.add(turn(), 0.1 * len(parts))
    assert scan is not None
    return scan


def seen_at(scan: RangeScan) -> float:
    """The bearing in degrees of what is nearest."""
    return degrees(scan.bearings()[int(np.nanargmin(scan.ranges))])


def at(scan: RangeScan, bearing: float) -> float:
    """The range at a bearing in degrees."""
    return float(scan.ranges[beam(np.array(radians(bearing)))])


@pytest.mark.parametrize(
    ("clockwise", "yaw", "bearing"),
    [(0, 0, 0), (90, 0, -90), (270, 0, 90), (0, 180, -180), (90, 180, 90), (30, 90, 60), (10, -90, -100)],
)
def test_clockwise_angles_become_bearings_of_the_base(clockwise: int, yaw: float, bearing: float) -> None:
    scan = scanned(ScanAssembler(A1, Mounting((0.1, 0.0, radians(yaw)))), turn(near=clockwise))
    assert seen_at(scan) == pytest.approx(bearing, abs=0.01)
    assert scan.nearest(radians(bearing), radians(4)) == pytest.approx(2.0)
    assert scan.nearest(radians(bearing + 90), radians(90)) == pytest.approx(4.0)
    assert scan.ranges.shape == (BEAMS,)
    assert scan.ranges.dtype == np.float32


@pytest.mark.parametrize(("sector", "blind", "seen"), [((100, 120), 110, 130), ((170, -170), 180, 160)])
def test_nothing_is_measured_in_a_blind_sector(sector: tuple[float, float], blind: float, seen: float) -> None:
    mounting = Mounting((0.0, 0.0, pi), (((radians(sector[0])), radians(sector[1])),))
    scan = scanned(ScanAssembler(A1, mounting), turn())
    assert isnan(at(scan, blind))
    assert isnan(at(scan, sector[0]))
    assert isnan(at(scan, sector[1]))
    assert at(scan, seen) == pytest.approx(4.0)
    assert np.isnan(scan.ranges).sum() == 21


@given(st.floats(-10, 10))
def test_bearing_belongs_to_its_beam(bearing: float) -> None:
    points = bearings()[int(beam(np.array(bearing)))]
    assert abs((points - bearing + pi) % (2 * pi) - pi) <= radians(0.5) + 1e-9


@pytest.mark.parametrize("wrong", [nan, inf])
def test_a_place_or_sector_must_be_finite(wrong: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        Mounting((0.0, wrong, 0.0))
    with pytest.raises(ValueError, match="not finite"):
        Mounting(blind=((0.0, wrong),))


@pytest.mark.parametrize("metres", [0.0, 0.14, 12.1])
def test_out_of_range_distance_is_nan(metres: float) -> None:
    scan = scanned(ScanAssembler(A1, Mounting()), turn(near=0, metres=metres))
    assert isnan(at(scan, 0))
    assert at(scan, 1) == pytest.approx(4.0)
    assert (scan.least, scan.most) == (0.15, 12.0)


def test_of_several_measurements_in_one_beam_the_nearest_counts() -> None:
    nodes = turn(count=1440)
    nodes.distance[::2] = 0
    nodes.distance[1::2] = 5000
    scan = scanned(ScanAssembler(A1, Mounting()), nodes)
    assert np.nanmax(scan.ranges) == np.nanmin(scan.ranges) == pytest.approx(1.25)
    assert not np.isnan(scan.ranges).any()


def test_sparse_range_finder_leaves_no_gaps() -> None:
    scan = scanned(ScanAssembler(MODELS["a2"], Mounting()), turn(near=90, count=200))
    assert not np.isnan(scan.ranges).any()
    assert at(scan, -90) == pytest.approx(2.0)


def test_the_stamp_is_the_middle_of_the_turn_and_numbers_rise() -> None:
    turns = ScanAssembler(A1, Mounting())
    nodes, whole = turn(), 359 / SAMPLE_RATE  # the first node of a turn came so long before its last
    assert turns.add(nodes, 5.0 + whole) is None
    first, second = turns.add(nodes, 5.2 + whole), turns.add(nodes, 5.4 + whole)
    assert first is not None
    assert second is not None
    assert (first.number, second.number) == (0, 1)
    assert (first.stamp, second.stamp) == pytest.approx((5.1, 5.3))


def test_newest_of_two_turns_wins() -> None:
    turns = ScanAssembler(A1, Mounting())
    one, two, three = turn(metres=1.0), turn(metres=2.0), turn(metres=3.0)
    nodes = Nodes(
        *(np.concatenate([getattr(part, name) for part in (one, two, three)]) for name in Nodes.__dataclass_fields__)
    )
    scan = turns.add(nodes, 0.0)
    assert scan is not None
    assert at(scan, 0) == pytest.approx(2.0)
    assert scan.number == 1


def test_a_turn_of_which_much_was_lost_is_none() -> None:
    turns = ScanAssembler(A1, Mounting())
    whole = turn()
    turns.add(Nodes(whole.new[:200], whole.quality[:200], whole.angle[:200], whole.distance[:200]), 0.0)
    assert turns.add(turn(), 0.1) is None
    assert turns.partial_scans == 1
    assert turns.add(turn(), 0.2) is not None


def test_when_the_beginning_of_a_turn_was_lost_the_newer_of_both_counts() -> None:
    scan = scanned(ScanAssembler(A1, Mounting()), turn(near=10, metres=1.0), turn(near=20, metres=1.5, new=False))
    assert at(scan, -20) == pytest.approx(1.5)
    assert at(scan, -10) == pytest.approx(4.0)
    assert scan.stamp == pytest.approx(0.15 - 359 / SAMPLE_RATE)


def test_nodes_without_a_new_turn_are_limited() -> None:
    turns = ScanAssembler(A1, Mounting())
    for number in range(100):
        turns.add(turn(new=False), 0.1 * number)
        assert sum(len(part[0]) for part in turns._parts) <= MAX_NODES + 360
