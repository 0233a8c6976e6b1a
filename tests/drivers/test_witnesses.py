"""Range finder and IMU as witnesses: they tell of a base that does not move as it believes, measured or reckoned."""

from collections.abc import Callable
from math import pi

import numpy as np
import pytest

from drivers.api import ZERO_VELOCITY, Attitude, BaseState, Pose2D, Quality, RangeScan, Reading, Velocity
from drivers.base.footprint import RoundOutline
from drivers.base.progress_monitor import ProgressMonitor
from drivers.base.reckoning import Reckoning
from drivers.base.witnesses import ImuWitness, ScanWitness
from missions.plugins.testing.recorders import LeafTestBench

PERIOD, BEAMS = 0.1, 360
AHEAD, LEFT = Velocity(0.2, 0.0), Velocity(0.0, 0.6)

Truth = Callable[[float], Pose2D]


def room(pose: Pose2D, *, open_field: bool = False) -> np.ndarray:
    """Return a scan from a pose in a room of 5 m by 4 m, with noise of 1 %."""
    bearings = 2 * pi * np.arange(BEAMS) / BEAMS + pose.heading
    with np.errstate(divide="ignore"):
        along = np.where(np.cos(bearings) > 0, 2.5 - pose.x, -2.5 - pose.x) / np.cos(bearings)
        across = np.where(np.sin(bearings) >= 0, 2.0 - pose.y, -2.0 - pose.y) / np.sin(bearings)
    ranges = np.minimum(along, across) * (1 + 0.01 * np.random.default_rng(1).standard_normal(BEAMS))
    return np.full(BEAMS, np.nan, np.float32) if open_field else ranges.astype(np.float32)


def drive(
    velocity: Velocity,
    truth: Truth,
    *,
    open_field: bool = False,
    reckoned: bool = True,
    see: Callable[[Pose2D], np.ndarray] | None = None,
) -> str:
    """Let a base believe in its commands for 6 s, while it truly is elsewhere; return the fault, or nothing."""
    bench, monitor, believed = LeafTestBench(), ProgressMonitor(), Reckoning()
    monitor.witnesses += [ScanWitness(bench.ranger, RoundOutline(0.177)), ImuWitness(bench.others["imu"])]
    imu = bench.others["imu"]
    began = bench.clock.now()
    for number in range(60):
        now = bench.clock.advance(PERIOD)
        here = truth(now - began)
        ranges = room(here, open_field=open_field) if see is None else see(here)
        scan = RangeScan(ranges, 0.0, 2 * pi / max(len(ranges), 1), now, number, 0.15, 12.0)
        bench.ranger.reading = Reading(scan, now, Quality.GOOD)
        felt = Attitude(0.0, 0.0, here.heading, (0.0, 0.0, 0.0), (0.0, 0.0, 9.81))
        imu.attitude = lambda felt=felt, now=now: Reading(felt, now, Quality.GOOD)  # type: ignore[attr-defined]
        believed.advance(now, velocity)
        fault = monitor.update(now, velocity, BaseState(believed.pose, velocity, reckoned=reckoned))
        if fault is not None:
            return fault.reason
    return ""


def going(velocity: Velocity, share: float = 1.0) -> Truth:
    """Return where a base is that does a share of what it is commanded."""

    def truth(time: float) -> Pose2D:
        way = Reckoning()
        way.advance(0.0, Velocity(share * velocity.linear, share * velocity.angular))
        way.advance(time)
        return way.pose

    return truth


@pytest.mark.parametrize("velocity", [AHEAD, Velocity(-0.2, 0.0), LEFT, Velocity(0.2, 0.4)])
@pytest.mark.parametrize("share", [0.8, 1.0, 1.1])
def test_base_moving_as_believed_is_not_stopped(velocity: Velocity, share: float) -> None:
    assert drive(velocity, going(velocity, share)) == ""


@pytest.mark.parametrize("velocity", [AHEAD, Velocity(-0.2, 0.0)])
@pytest.mark.parametrize("reckoned", [True, False])
def test_unchanged_scan_reveals_a_standing_base(velocity: Velocity, reckoned: bool) -> None:
    assert "view of its range finder does not change" in drive(velocity, going(ZERO_VELOCITY), reckoned=reckoned)


def test_scan_reveals_a_base_driving_the_wrong_way() -> None:
    assert "move the other way" in drive(AHEAD, going(AHEAD, -1.0))


def test_imu_reveals_a_base_that_does_not_turn_or_turns_the_wrong_way() -> None:
    assert "its IMU does not turn" in drive(LEFT, going(ZERO_VELOCITY), open_field=True)
    assert "its IMU turns the other way" in drive(LEFT, going(LEFT, -1.0), open_field=True)


def test_open_field_gives_no_evidence() -> None:
    assert drive(AHEAD, going(ZERO_VELOCITY), open_field=True) == ""


def with_parts(scan: np.ndarray, degrees: float, distance: float) -> np.ndarray:
    """Return a scan in which a part of the robot hides so many degrees, with noise of 5 mm."""
    hidden = scan.copy()
    count = round(degrees * len(scan) / 360)
    hidden[:count] = distance + 0.005 * np.random.default_rng(2).standard_normal(count)
    return hidden


@pytest.mark.parametrize("degrees", [30, 60, 120, 250, 360])
@pytest.mark.parametrize("distance", [0.05, 0.12, 0.177])
def test_robot_parts_in_the_scan_are_not_an_unchanged_view(degrees: float, distance: float) -> None:
    def see(pose: Pose2D) -> np.ndarray:
        return with_parts(room(pose, open_field=True), degrees, distance)

    assert drive(AHEAD, going(AHEAD), see=see) == ""


@pytest.mark.parametrize("degrees", [30, 60, 120])
def test_standing_base_is_detected_beside_its_own_parts(degrees: float) -> None:
    assert "does not change" in drive(
        AHEAD, going(ZERO_VELOCITY), see=lambda pose: with_parts(room(pose), degrees, 0.12)
    )


@pytest.mark.parametrize("beams", [360, 720, 1440])
def test_accompanying_person_is_not_an_unchanged_view(beams: int) -> None:
    def see(pose: Pose2D) -> np.ndarray:
        del pose
        return with_parts(np.full(beams, np.nan, np.float32), 30, 0.9)

    assert drive(AHEAD, going(AHEAD), see=see) == ""


def test_an_empty_scan_is_not_a_fault_of_the_wheels() -> None:
    assert drive(AHEAD, going(AHEAD), see=lambda _: np.empty(0, np.float32)) == ""
