"""Scanning, nodding, shaking the head and sweeping, on the twin of a Rodney head in simulated time."""

from itertools import pairwise
from math import degrees, pi, radians

import pytest
from py_trees.common import Status

from behaviours.head import LookLeaf
from behaviours.head_motion import Nod, ShakeHead, SweepHead
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.robot import Robot
from behaviours.scan import Scan, step_towards
from drivers.api import HeadPose
from drivers.head.axis import ServoAxis
from drivers.head.twin import ServoHeadTwin
from drivers.sim.timeline import Timeline
from missions.plugins.testing.recorders import OFFLINE_ERROR, STOP, LeafTestBench, good, none


class Stage:
    """A leaf on a head that takes its time, ticked 20 times a second; ``seen`` keeps (time, pan, tilt) in degrees."""

    head_speed = radians(120)

    def __init__(self, leaf: Leaf, **arguments: object) -> None:
        self.timeline = Timeline()
        self.head = ServoHeadTwin(
            self.timeline.clock,
            pan=ServoAxis(0, radians(-80), radians(80)),
            tilt=ServoAxis(1, radians(-60), radians(20), flip=True),
            speed=self.head_speed,
        )
        self.bench = LeafTestBench(self.timeline.clock)
        self.bench.robot = Robot(head_part=self.head)
        self.leaf = self.bench.put(leaf, **arguments)
        self.timeline.call_every(self.head.STEP_INTERVAL, self.head.step)
        self.head.open()
        self.timeline.run_until(1.5)
        self.seen: list[tuple[float, float, float]] = []
        self.reasons: list[str] = []

    def tick(self) -> Status:
        self.look_on()
        self.bench.run.tick += 1
        status = self.leaf.execute_tick()
        self.reasons.append(self.leaf.reason)
        return status

    def look_on(self) -> None:
        """Let the time of a tick pass, and see where the head is."""
        now = self.timeline.clock.now() + 0.05
        self.timeline.run_until(now)
        pose = self.head.true_pose(now)
        self.seen.append((now, degrees(pose.pan), degrees(pose.tilt)))

    def run(self, seconds: float = 60.0) -> Status:
        """Tick until it has ended, or for so long."""
        for _ in range(round(seconds / 0.05)):
            status = self.tick()
            if status is not RUNNING:
                for _ in range(6):  # the servos are a little behind what they were sent
                    self.look_on()
                return status
        return RUNNING

    def turning_points(self, axis: int) -> list[float]:
        """Where the head turned back, to a degree, in this axis (1 is pan, 2 is tilt)."""
        angles = [place[axis] for place in self.seen]
        points = [angles[0]]
        for angle in angles:
            if len(points) > 1 and (angle - points[-1]) * (points[-1] - points[-2]) >= 0:
                points[-1] = angle
            elif abs(angle - points[-1]) > 1.0:
                points.append(angle)
        return points[1:]


class SlowStage(Stage):
    """A head that is slower than what it is told."""

    head_speed = radians(20)


def test_a_scan_looks_row_by_row_from_the_lowest_to_and_fro() -> None:
    area = {"pan": (radians(-40), radians(40)), "tilt": (radians(-20), radians(10))}
    stage = Stage(Scan("scan"), **area, step=radians(40), rows=2, dwell=0.2)
    assert stage.run() is SUCCESS
    stood = [(round(b[1]), round(b[2])) for a, b in pairwise(stage.seen) if a[1:] == b[1:]]
    places = [(-40, 10), (0, 10), (40, 10), (40, -20), (0, -20), (-40, -20)]
    assert [place for place in dict.fromkeys(stood) if place in places] == places
    assert any(reason.startswith("look 4 of 6: ") and reason.endswith("to +40, -20 deg") for reason in stage.reasons)
    looks = stage.leaf.result
    assert isinstance(looks, HeadPose)
    assert (looks.pan, looks.tilt) == pytest.approx((radians(-40), radians(-20)), abs=radians(1.1))


def test_scan_stays_within_its_limits_and_speed() -> None:
    stage = Stage(Scan("scan"), pan=(-pi, pi), tilt=(-pi / 2, pi / 2), step=radians(60), dwell=0.0, speed=radians(30))
    assert stage.run(120) is SUCCESS
    pans, tilts = [place[1] for place in stage.seen], [place[2] for place in stage.seen]
    assert (min(pans), max(pans)) == pytest.approx((-80, 80), abs=1)
    assert (min(tilts), max(tilts)) == pytest.approx((-60, 20), abs=1)
    rates = [abs(b - a) / 0.5 for a, b in zip(pans, pans[10:], strict=False)]
    assert max(rates) <= 34


def test_a_smooth_scan_goes_along_each_row_without_a_halt() -> None:
    area = {"pan": (radians(-40), radians(40)), "tilt": (radians(-20), radians(0))}
    stage = Stage(Scan("scan"), **area, rows=3, smooth=True, speed=radians(40))
    assert stage.run() is SUCCESS
    assert stage.turning_points(1)[:3] == pytest.approx([-40, 40, -40], abs=2)
    middle = [place for place in stage.seen if abs(place[1]) < 30 and place[0] > stage.seen[0][0] + 1.5]
    rates = [abs(b[1] - a[1]) / 0.2 for a, b in zip(middle, middle[4:], strict=False) if b[0] - a[0] < 0.21]
    assert min(rates) > 20
    assert max(rates) < 60


def test_smooth_scan_waits_for_a_slow_head_at_the_end() -> None:
    pan, tilt = (radians(-40), radians(40)), (radians(-20), radians(0))
    stage = SlowStage(Scan("scan"), pan=pan, tilt=tilt, rows=2, smooth=True, speed=radians(60))
    while stage.tick() is RUNNING:
        pass
    pose = stage.head.true_pose(stage.timeline.clock.now())
    assert stage.leaf.status is SUCCESS
    assert (degrees(pose.pan), degrees(pose.tilt)) == pytest.approx((-40, -20), abs=1.5)


def test_a_scan_of_one_row_and_one_place_is_one_look_in_the_middle() -> None:
    stage = Stage(Scan("scan"), pan=(0.2, 0.3), tilt=(-0.2, 0.0), rows=1, step=radians(30), dwell=0.0)
    assert stage.run() is SUCCESS
    assert "look 2 of 2" in stage.reasons[-2]
    assert stage.seen[-1][2] == pytest.approx(degrees(-0.1), abs=1)


def test_scan_repeats_as_often_as_scans_or_forever() -> None:
    area = {"pan": (-0.3, 0.3), "tilt": (-0.1, 0.0), "rows": 1, "dwell": 0.0, "step": 1.0}
    twice = Stage(Scan("scan"), **area, scans=2)
    assert twice.run() is SUCCESS
    assert len(twice.turning_points(1)) == 4
    assert Stage(Scan("scan"), **area, scans=0).run(30) is RUNNING


def test_a_scan_of_nothing_within_the_limits_fails_before_anything_moves() -> None:
    stage = Stage(Scan("scan"), pan=(radians(85), radians(90)), tilt=(-0.1, 0.1))
    assert stage.run() is FAILURE
    assert stage.leaf.reason == "no part of the area is within the head's limits"
    assert stage.seen[-1][1:] == pytest.approx((0, 0), abs=0.1)


@pytest.mark.parametrize(("leaf", "axis", "amplitude"), [(Nod("nod"), 2, 8), (ShakeHead("shake_head"), 1, 15)])
def test_head_gesture_goes_to_both_sides_and_returns(leaf: Leaf, axis: int, amplitude: int) -> None:
    stage = Stage(leaf, times=3)
    assert stage.run() is SUCCESS
    assert stage.turning_points(axis) == pytest.approx([amplitude, -amplitude] * 3 + [0], abs=1.1)
    other = [place[3 - axis] for place in stage.seen]
    assert max(map(abs, other)) < 0.1
    assert "2 of 3" in stage.reasons


def test_head_gesture_near_a_limit_moves_away_and_returns() -> None:
    stage = Stage(Nod("nod"), times=1)
    stage.head.look(HeadPose(0.0, radians(20)))
    stage.timeline.run_until(3.0)
    assert stage.run() is SUCCESS
    assert stage.turning_points(2) == pytest.approx([4, 20], abs=1.1)


def test_too_fast_head_gesture_takes_longer_and_is_complete() -> None:
    stage = Stage(ShakeHead("shake_head"), times=1, amplitude=radians(60), period=0.2)
    assert stage.run() is SUCCESS
    assert stage.turning_points(1)[:2] == pytest.approx([60, -60], abs=1.5)


def test_a_sweep_is_a_sine_about_where_the_head_looked_and_never_ends() -> None:
    stage = Stage(SweepHead("sweep_head"), amplitude=radians(30), period=4.0)
    stage.head.look(HeadPose(radians(10), 0.0))
    stage.timeline.run_until(3.0)
    assert stage.run(12.2) is RUNNING
    assert stage.turning_points(1)[:6] == pytest.approx([40, -20, 40, -20, 40, -20], abs=1.6)
    highs = [time for time, pan, _ in stage.seen if pan > 38]
    gaps = [b - a for a, b in pairwise(highs) if b - a > 1.0]
    assert gaps == pytest.approx([4.0 - 0.6] * len(gaps), abs=0.4)
    assert stage.leaf.reason.startswith("at ")


def test_vertical_sweep_stays_within_limits_and_head_speed() -> None:
    stage = Stage(SweepHead("sweep_head"), amplitude=radians(80), period=0.5, vertical=True)
    assert stage.run(10.0) is RUNNING
    points = stage.turning_points(2)
    assert (max(points), min(points)) == pytest.approx((20, -60), abs=4)


@pytest.mark.parametrize(
    "leaf", [LookLeaf("look"), Scan("scan"), Nod("nod"), ShakeHead("shake_head"), SweepHead("sweep_head")]
)
def test_halted_the_head_comes_to_rest_and_holds(leaf: Leaf) -> None:
    stage = Stage(leaf, **({"pan": 1.0, "tilt": -0.5} if isinstance(leaf, LookLeaf) else {}))
    for _ in range(8):
        assert stage.tick() is RUNNING
    assert stage.leaf.halt()
    stage.timeline.run_until(stage.timeline.clock.now() + 0.5)
    held = stage.head.true_pose(stage.timeline.clock.now())
    stage.timeline.run_until(stage.timeline.clock.now() + 0.5)
    assert stage.head.true_pose(stage.timeline.clock.now()) == held


@pytest.mark.parametrize("leaf", [Scan("scan"), Nod("nod"), ShakeHead("shake_head"), SweepHead("sweep_head")])
def test_head_leaves_wait_for_an_offline_head(leaf: Leaf) -> None:
    bench = LeafTestBench()
    bench.put(leaf)
    bench.head.reading = none()
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "the head has not reported its pose yet"
    bench.head.reading, bench.head.trouble = good(HeadPose(0.0, 0.0)), OFFLINE_ERROR
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    bench.head.trouble = None
    assert bench.tick(leaf) is RUNNING
    assert len(bench.head.commands) == 1
    assert bench.halt(leaf)
    assert bench.head.commands[-1] == STOP


@pytest.mark.parametrize("leaf", [Scan("scan"), Nod("nod"), ShakeHead("shake_head")])
def test_head_leaves_report_a_blocked_head(leaf: Leaf) -> None:
    bench = LeafTestBench()
    bench.put(leaf)
    bench.head.reading = good(HeadPose(0.9, -0.9))
    bench.tick(leaf)
    bench.head.reading = good(HeadPose(0.0, 0.0))
    for _ in range(200):
        if bench.tick(leaf) is not RUNNING:
            break
    assert leaf.status is FAILURE
    assert "the head rests at +0, +0 deg and does not re" in leaf.reason


def test_towards_goes_straight_and_not_past_the_goal() -> None:
    goal = HeadPose(1.0, 0.5)
    on_the_way = step_towards(goal, HeadPose(0.0, 0.0), 0.2)
    assert (on_the_way.pan, on_the_way.tilt) == pytest.approx((0.2, 0.1))
    assert step_towards(goal, HeadPose(0.0, 0.0), 5.0) == goal
    assert step_towards(goal, goal, 0.0) == goal
