"""The range guard of a base: it stops before what the range finder sees, and nobody is kept from leaving it."""

import subprocess
import sys
from math import cos, hypot, pi, radians, remainder, sin
from time import perf_counter, process_time

import numpy as np
import pytest

from drivers.api import Pose2D, RangeScan, Sides, Source, Velocity, is_guarded
from drivers.api.steering import (
    OBSTACLE_REASON,
    OUT_OF_SIGHT_REASON,
    SCANS_LATE_REASON,
    SCANS_MISSING_REASON,
    RangeGuardKeys,
)
from drivers.base.footprint import PathPoses, PolygonOutline, RoundOutline
from drivers.base.range_guard import RENEWAL_INTERVAL
from drivers.base.seen_points import SeenPoints
from drivers.sim.people import Person
from drivers.sim.room import Room
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import WorldBox
from tests.drivers.guarded import HALL, START, GuardedBase, ScriptedRanger

CORNERS = ((0.2, 0.15), (0.2, -0.15), (-0.2, -0.15), (-0.2, 0.15))


def hall_with(*places: tuple[float, float], size: float = 0.1) -> SimulatedWorld:
    boxes = (WorldBox(f"post {n}", x, y, (size, size, 1.0), (90, 90, 90)) for n, (x, y) in enumerate(places))
    return SimulatedWorld(room=Room(40.0, 40.0, centre=(0.0, 0.0), fixtures=()), furniture=tuple(boxes))


def after(linear: float, angular: float, seconds: float) -> Pose2D:
    """Return where a base is that was at the origin and went on like that."""
    turned = angular * seconds
    if angular == 0.0:
        return Pose2D(linear * seconds, 0.0, 0.0)
    return Pose2D(linear / angular * sin(turned), linear / angular * (1 - cos(turned)), turned)


# --- the swept area ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [0.1, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_guard_stops_the_gap_before_a_wall(speed: float, lag: float) -> None:
    room = GuardedBase(SimulatedWorld(room=Room(3.0, 3.0, centre=(0.0, 0.0), fixtures=())), speed=speed, lag=lag)
    room.drive(speed, seconds=20.0)
    assert room.base.body.velocity == Velocity(0.0, 0.0)
    assert 0.03 <= room.least_clear <= 0.08
    assert room.because.startswith(OBSTACLE_REASON)
    assert room.because.endswith("ahead")


@pytest.mark.parametrize("linear", [0.4, -0.4])
@pytest.mark.parametrize("angular", [0.0, 0.3, -0.3, 0.9, -0.9, 1.8, -1.8])
@pytest.mark.parametrize("side", [-0.15, 0.0, 0.15])
def test_guard_stops_on_every_arc_before_the_swept_obstacle(linear: float, angular: float, side: float) -> None:
    there = after(linear, angular, 2.0)
    x, y = there.x - side * sin(there.heading), there.y + side * cos(there.heading)
    if hypot(x, y) < 0.3:
        return  # it begins there
    room = GuardedBase(hall_with((x, y), size=0.04))
    room.drive(linear, angular, seconds=8.0)
    assert not room.touched_moving
    assert room.least_clear > 0.015
    assert room.because.startswith(OBSTACLE_REASON)
    assert room.base.body.velocity == Velocity(0.0, 0.0)


def test_guard_ignores_obstacles_beside_the_path() -> None:
    room = GuardedBase(hall_with((1.0, 0.30), (1.5, -0.30)))
    room.drive(0.3, seconds=8.0)
    assert room.pose.x > 2.0


@pytest.mark.parametrize("angle", [0, 20, 45, 90, 135, 180, -90])
def test_base_beside_a_wall_can_turn_and_leave(angle: float) -> None:
    wall = SimulatedWorld(room=Room(10.0, 10.0, centre=(0.0, 0.0), fixtures=()))  # its walls are 5 m away
    room = GuardedBase(wall, start=Pose2D(5.0 - 0.177 - 0.03, 0.0, radians(angle)))
    before = room.pose
    room.drive(0.0, 1.5, seconds=4.0)
    assert abs(room.pose.heading - before.heading) > 4.0
    while abs(remainder(room.pose.heading - pi, 2 * pi)) > 0.1:
        room.drive(0.0, 1.5, seconds=0.05)
    room.drive(0.3, seconds=3.0)
    assert room.pose.x < before.x - 0.4


def test_base_at_a_wall_can_leave_but_not_approach() -> None:
    wall = SimulatedWorld(room=Room(10.0, 10.0, centre=(0.0, 0.0), fixtures=()))
    near = 5.0 - 0.177 - 0.035
    ahead = GuardedBase(wall, start=Pose2D(near, 0.0, 0.0))
    ahead.drive(0.3, seconds=5.0)
    assert ahead.pose.x == pytest.approx(near, abs=0.002)
    ahead.drive(-0.3, seconds=2.0)
    assert ahead.pose.x < near - 0.3
    along = GuardedBase(wall, start=Pose2D(near, 0.0, pi / 2))
    along.drive(0.3, seconds=6.0)
    assert along.pose.y > 1.0


def test_guard_does_not_creep_up_to_a_wall() -> None:
    room = GuardedBase(SimulatedWorld(room=Room(3.0, 3.0, centre=(0.0, 0.0), fixtures=())), noise=0.02)
    room.drive(0.5, seconds=10.0)
    there = room.pose.x
    room.drive(0.5, seconds=60.0)
    assert room.pose.x == pytest.approx(there, abs=0.015)
    assert room.least_clear > 0.02


# --- its shape --------------------------------------------------------------------------------------------------------


def test_outline_clearance_is_a_lower_bound() -> None:
    here = PathPoses(np.zeros(1), np.zeros(1), np.array([radians(30)]))
    x = np.tile(np.linspace(-1, 1, 41), 41)
    y = np.repeat(np.linspace(-1, 1, 41), 41)
    outline = PolygonOutline(CORNERS)
    u, v = x * cos(radians(30)) + y * sin(radians(30)), y * cos(radians(30)) - x * sin(radians(30))
    true = np.hypot(np.maximum(abs(u) - 0.2, 0), np.maximum(abs(v) - 0.15, 0))
    told = outline.clearance(x, y, here)[:, 0]
    assert (told <= true + 1e-9).all()
    assert (told >= true / 1.5 - 1e-9)[true > 0].all()
    assert ((told > 0) == (true > 0)).all()
    assert RoundOutline(0.2).clearance(x, y, here)[:, 0] == pytest.approx(np.hypot(x, y) - 0.2)


def test_rectangular_base_turns_only_with_room_for_its_corners() -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger, guard=RangeGuardKeys(footprint=CORNERS, gap=0.03))
    wall = [(x / 50, 0.21) for x in range(-20, 21)]

    def look() -> None:
        turned = room.pose.heading
        seen = [(x * cos(turned) + y * sin(turned), y * cos(turned) - x * sin(turned)) for x, y in wall]
        ranger.see(room.now, *seen)

    look()
    room.drive(0.0, 1.0, seconds=3.0, each=look)
    assert 0.02 < room.pose.heading < 0.4  # its corners are 25 cm from its middle
    wall[:] = [(x, 0.4) for x, _ in wall]
    room.drive(0.0, 1.0, seconds=5.0, each=look)  # for a second that wall might come on
    assert room.pose.heading > 2.0


@pytest.mark.parametrize("corners", [(), ((0.1, 0.1),), ((0.1, 0.1), (0.2, 0.1), (0.1, 0.2))])
def test_a_footprint_must_enclose_the_middle_of_the_base(corners: tuple[tuple[float, float], ...]) -> None:
    assert [each.at for each in RangeGuardKeys(footprint=corners).diagnostics()] == [("footprint",)]
    assert not [*RangeGuardKeys(footprint=CORNERS).diagnostics()]


def test_points_on_the_robot_itself_do_not_stop_the_base() -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger)
    posts = [(0.12, 0.08), (0.12, -0.08), (-0.12, 0.08)]
    room.drive(0.3, seconds=2.0, each=lambda: ranger.see(room.now, *posts))
    assert room.pose.x > 0.4


# --- whoever commands -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("source", [Source.MISSION, Source.TELEOP])
def test_guard_applies_to_every_source_and_reports_the_reason(source: Source) -> None:
    room = GuardedBase(SimulatedWorld(room=Room(3.0, 3.0, centre=(0.0, 0.0), fixtures=())))
    room.drive(0.5, seconds=10.0, source=source)
    steering = room.base.steering()
    assert steering.source is source
    assert is_guarded(steering)
    assert steering.allowed == Velocity(0.0, 0.0)
    assert room.base.drive(Velocity(0.5, 0.0), source=source) == Velocity(0.0, 0.0)


def test_back_off_is_guarded_against_obstacles_behind() -> None:
    room = GuardedBase(hall_with((-0.26, 0.0)), speed=0.3)
    before = room.clear()
    room.base.press(Sides(left=True))
    room.drive(0.2, seconds=2.0)
    assert room.least_clear >= min(before, 0.05) - 0.015


def test_guard_off_lets_the_base_drive() -> None:
    room = GuardedBase(SimulatedWorld(room=Room(3.0, 3.0, centre=(0.0, 0.0), fixtures=())), guard="off")  # type: ignore[arg-type]
    room.drive(0.5, seconds=10.0)
    assert room.touched_moving


# --- what moves -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pace", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("speed", [0.25, 0.5])
@pytest.mark.parametrize("angle", [0, 40, 90, -60])
def test_guarded_base_stands_before_a_person_walks_into_contact(pace: float, speed: float, angle: float) -> None:
    # They meet where the base would be after 4 s.
    meet, way = speed * 4.0, 4.0 * pace
    x, y = meet + way * cos(radians(angle)), way * sin(radians(angle))
    end = (meet - cos(radians(angle)), -sin(radians(angle)))
    anna = Person("Anna", x=x, y=y, path=(end,), speed=pace, start=0.6, loop=False)
    room = GuardedBase(
        SimulatedWorld(room=Room(40.0, 40.0, centre=(0.0, 0.0), fixtures=()), people=(anna,)), speed=speed
    )
    room.drive(speed, seconds=6.0)
    assert not room.touched_moving


def test_ignoring_obstacle_speed_would_hit_a_walking_person(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.base.seen_points.MAX_SPEED", 0.0)
    anna = Person("Anna", x=6.0, y=0.0, path=((1.0, 0.0),), speed=1.0, start=0.6, loop=False)
    room = GuardedBase(SimulatedWorld(room=Room(40.0, 40.0, centre=(0.0, 0.0), fixtures=()), people=(anna,)), speed=0.5)
    room.drive(0.5, seconds=6.0)
    assert room.touched_moving


def test_base_follows_a_person_who_walks_away() -> None:
    anna = Person("Anna", x=0.9, y=0.0, path=((6.0, 0.0),), speed=0.4, start=0.6, loop=False)
    room = GuardedBase(SimulatedWorld(room=Room(40.0, 40.0, centre=(0.0, 0.0), fixtures=()), people=(anna,)))
    room.drive(0.4, seconds=8.0)
    assert room.pose.x > 2.2


# --- what it cannot see -----------------------------------------------------------------------------------------------


def test_late_scans_slow_down_and_missing_scans_stop_the_base() -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger)
    ranger.see(room.now)
    room.drive(0.5, seconds=0.4)
    assert room.base.body.velocity.linear > 0.15
    room.drive(0.5, seconds=0.6)
    assert room.base.body.velocity.linear == pytest.approx(0.1, abs=0.005)
    assert room.because == SCANS_LATE_REASON
    room.drive(0.5, seconds=1.3)
    assert room.base.body.velocity == Velocity(0.0, 0.0)
    assert room.because == SCANS_MISSING_REASON
    assert [each.partition(":")[0] for each in room.faults] == [SCANS_LATE_REASON, SCANS_MISSING_REASON]
    ranger.see(room.now, number=1)
    room.drive(0.5, seconds=0.4)
    assert room.base.body.velocity.linear > 0.15


def test_obstacle_seen_before_late_scans_stops_the_base() -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger)
    ranger.see(room.now, (0.37, 0.0))
    room.drive(0.5, seconds=1.9)
    assert room.pose.x == pytest.approx(0.37 - 0.177 - 0.05, abs=0.02)


@pytest.mark.parametrize("value", [None, RuntimeError("no such thing"), OSError()])
def test_missing_or_failing_range_finder_stops_the_base(value: Exception | None) -> None:
    ranger = ScriptedRanger()
    ranger.value = value
    room = GuardedBase(ranger=ranger)
    room.drive(0.5, 0.5, seconds=3.0)
    assert room.pose == START
    assert room.because.startswith(SCANS_MISSING_REASON)
    assert (str(value) if value else "") in room.because
    assert len(room.faults) == 1


def test_scans_with_stamps_of_the_future_or_long_ago_do_not_stay_fresh() -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger)
    ranger.see(room.now + 100.0)
    room.drive(0.5, seconds=3.0)
    assert room.because == SCANS_MISSING_REASON
    numbers = iter(range(1, 10_000))
    room.drive(0.5, seconds=3.0, each=lambda: ranger.see(room.now - 10.0, number=next(numbers)))
    assert room.because == SCANS_MISSING_REASON


@pytest.mark.parametrize("linear", [-0.4, 0.4])
def test_base_drives_slowly_out_of_sight_of_the_range_finder(linear: float) -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger)
    room.drive(linear, seconds=3.0, each=lambda: ranger.see(room.now, width=240.0))
    expected = 0.4 if linear > 0 else -0.1
    assert room.base.body.velocity.linear == pytest.approx(expected, abs=0.005)
    assert room.because == ("" if linear > 0 else OUT_OF_SIGHT_REASON)
    free = GuardedBase(ranger=ranger, guard=RangeGuardKeys(unseen="free"))
    free.drive(linear, seconds=3.0, each=lambda: ranger.see(free.now, width=240.0))
    assert free.base.body.velocity.linear == pytest.approx(linear, abs=0.005)


def test_obstacle_too_near_to_measure_is_remembered() -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger)
    ranger.see(room.now, (0.25, 0.0))
    room.run(0.2)
    room.drive(0.3, seconds=0.9, each=lambda: ranger.see(room.now))
    assert room.pose.x < 0.03


# --- docking ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("speed", "near", "arrives"), [(0.05, True, True), (0.05, False, False), (0.15, True, False)])
def test_base_near_its_dock_may_touch_the_dock_gently(
    speed: float, near: bool, arrives: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = GuardedBase(hall_with((0.6, 0.0), size=0.2))
    monkeypatch.setattr(room.base, "_near_dock", lambda: near)
    monkeypatch.setattr(room.base._mux.guard, "_near_dock", lambda: near)
    room.drive(speed, seconds=12.0)
    assert (room.clear() < 0.005) is arrives


@pytest.mark.parametrize("wanted", [0.05, 0.06])
@pytest.mark.parametrize("going", [0.4, 0.2, 0.08, -0.4, -0.05])
def test_fast_or_reversing_base_near_its_dock_is_guarded(
    going: float, wanted: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = GuardedBase(hall_with((0.29, 0.0), (-0.29, 0.0)))  # 6 cm from its rim, on both sides
    guard = room.base._mux.guard
    assert guard is not None
    monkeypatch.setattr(guard, "_near_dock", lambda: True)
    sent, why = guard.limit(Velocity(going, 0.0), Velocity(wanted, 0.0), room.base._mux._limits, room.now)
    assert abs(sent.linear) < min(abs(going), 0.06)
    assert why.startswith(OBSTACLE_REASON)


# --- what it costs ----------------------------------------------------------------------------------------------------


def test_robot_without_a_range_finder_imports_no_numpy() -> None:
    code = "import sys, drivers.kobuki.driver; print('numpy' in sys.modules, 'drivers.base.range_guard' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


@pytest.mark.real_time
def test_a_renewal_costs_less_than_a_third_of_a_millisecond() -> None:
    ranger = ScriptedRanger()
    room = GuardedBase(ranger=ranger)
    around = [(0.45 * cos(radians(a)), 0.45 * sin(radians(a))) for a in range(360)]
    ranger.see(room.now, *around)
    guard, limits = room.base._mux.guard, room.base._mux._limits
    assert guard is not None
    times = []
    for _ in range(300):
        begun = perf_counter()
        guard.limit(Velocity(0.4, 0.8), Velocity(0.5, 1.0), limits, room.now)
        times.append(perf_counter() - begun)
    assert sorted(times)[len(times) // 2] < 0.0003


@pytest.mark.real_time
@pytest.mark.parametrize("crowd", [False, True])
def test_a_scan_costs_less_than_a_third_of_a_renewal_however_much_moves(crowd: bool) -> None:
    points, bearings, times = SeenPoints((0.0, 0.0, 0.0)), 2 * pi * np.arange(720) / 720, []
    for number in range(40):
        # A base whose wheels slip sees everything come nearer; a crowd comes from all sides.
        ranges = 4.0 + 0.5 * np.sin(3 * bearings) - 0.06 * (number % 30)
        if crowd:
            ranges = np.where(bearings % 0.3 < 0.26, 5.0 - 0.08 * ((number + bearings // 0.3 * 3) % 45), 6.0)
        scan = RangeScan(ranges.astype(np.float32), 0.0, 2 * pi / 720, number * 0.1, number, 0.1, 12.0)
        begun = process_time()
        points.add(scan, (0.0, 0.0, 0.0), number * 0.1)
        times.append(process_time() - begun)
    assert points.moving
    assert sorted(times)[len(times) // 2] < RENEWAL_INTERVAL / 3


def test_open_floor_is_as_free_as_without_a_guard() -> None:
    with_guard, without = GuardedBase(HALL), GuardedBase(HALL, guard="off")  # type: ignore[arg-type]
    for room in (with_guard, without):
        room.drive(0.5, seconds=3.0)
    assert with_guard.pose == without.pose
