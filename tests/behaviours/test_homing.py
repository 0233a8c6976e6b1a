"""The way onto a dock, step by step: from what is heard to what is done, without a tree and without a world."""

import math
from dataclasses import replace
from random import Random
from typing import Any

import pytest

from behaviours.docking import (
    BACK_OFF_DISTANCE,
    BEAM_HOLD_TIME,
    BEAM_TIMEOUT,
    CONTACT_SPEED,
    MAX_SEARCH_ANGLE,
    MAX_TRIES,
    SWEEP_RATE,
    DockLeaf,
    Homing,
    HomingStage,
    step,
)
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from drivers.api import (
    BaseState,
    DockBeam,
    DockSignals,
    GoalState,
    Pose2D,
    Progress,
    Sides,
    Source,
    Steering,
    Velocity,
)
from missions.plugins.testing.recorders import STOP, LeafTestBench, good
from tests.machines import walk

STILL = Velocity(0.0, 0.0)
FAR, NEAR = DockBeam.FAR_CENTRE, DockBeam.NEAR_CENTRE
TICK = 0.05


def at(x: float = 0.0, heading: float = 0.0, **felt: Any) -> BaseState:
    return replace(BaseState(Pose2D(x, 0.0, heading), STILL), **felt)


def centre(beams: DockBeam) -> DockSignals:
    return DockSignals(centre=beams)


class Path:
    """A base that does what it is told at once, and a dock at a bearing that its receivers hear within a view."""

    def __init__(self, memory: Homing, *, bearing: float = 2.0, beams: DockBeam = FAR, view: float = 0.6) -> None:
        self.memory = memory
        self.bearing, self.beams, self.view = bearing, beams, view
        self.now = self.x = self.heading = 0.0
        self.velocity = STILL

    def signals(self) -> DockSignals:
        off = math.remainder(self.bearing - self.heading, math.tau)
        heard = [self.beams if abs(off - look) <= self.view else DockBeam(0) for look in (1.05, 0.0, -1.05)]
        return DockSignals(*heard)

    def go(self, *, until: HomingStage | None = None, seconds: float = 60.0, **felt: Any) -> None:
        """Go on until a stage begins, or it has failed, or for ``seconds``."""
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            self.heading += self.velocity.angular * TICK
            self.x += self.velocity.linear * TICK
            state = at(self.x, self.heading, dock=self.signals(), **felt)
            self.memory, self.velocity = step(self.memory, state, self.now, 0.1)
            if self.memory.failure or self.memory.stage is until:
                return


def begin(stage: HomingStage = HomingStage.LEAVE, **memory: Any) -> Homing:
    return replace(Homing(Pose2D(0.0, 0.0, 0.0), 0.0, stage), **memory)


def test_random_docks_take_every_transition_and_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    def go(path: Path, chance: Random) -> None:
        path.bearing += chance.choice((0.0, 0.0, 0.0, 0.3, -1.0))
        path.beams = chance.choice((FAR, FAR, NEAR, DockBeam.FAR_LEFT, DockBeam.NEAR_RIGHT, DockBeam(0)))
        path.go(seconds=chance.choice((0.1, 1.0, 3.0)), bumper=chance.choice((Sides(), Sides(centre=True))))
        if path.memory.failure:
            path.memory = begin(path.memory.stage)

    table = walk(monkeypatch, "behaviours.docking.TRANSITIONS", lambda: Path(begin()), [go], walks=60)
    assert table.visited == set(table)
    assert not table.missing


def test_dock_is_in_the_middle_of_the_headings_with_beams() -> None:
    path = Path(begin(), bearing=2.0)
    path.go(until=HomingStage.AIM)
    assert path.memory.course == pytest.approx(2.0, abs=0.03)
    path.go(until=HomingStage.DRIVE)
    assert path.heading == pytest.approx(2.0, abs=0.03)


def test_dock_received_at_the_start_is_left_before_the_sweep() -> None:
    path = Path(begin(), bearing=0.2)
    path.go(until=HomingStage.SEARCH)
    assert path.heading < 0.2 - 0.6
    path.go(until=HomingStage.AIM)
    assert path.memory.course == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize(
    ("beams", "side"),
    [
        (DockBeam.FAR_LEFT, 1.0),
        (DockBeam.FAR_LEFT | DockBeam.FAR_CENTRE, 1.0),
        (DockBeam.NEAR_RIGHT, -1.0),
        (DockBeam.NEAR_RIGHT | DockBeam.NEAR_CENTRE, -1.0),
    ],
)
def test_homing_beside_the_middle_crosses_and_searches_again(beams: DockBeam, side: float) -> None:
    path = Path(begin(), bearing=2.0, beams=beams)
    path.go(until=HomingStage.ASIDE)
    assert path.memory.course == pytest.approx(2.0 + side * math.radians(50), abs=0.03)
    path.go(until=HomingStage.CROSS)
    path.go(seconds=2.0)
    assert path.velocity.linear > 0.0
    path.beams = FAR
    path.go(until=HomingStage.LEAVE, seconds=2 * TICK)
    assert path.memory.stage is HomingStage.LEAVE
    assert path.memory.side == -side


def test_homing_without_beams_turns_once_and_fails() -> None:
    path = Path(begin(), beams=DockBeam(0))
    path.go()
    assert path.memory.failure == "no dock beam received in a full turn"
    assert MAX_SEARCH_ANGLE <= path.heading < MAX_SEARCH_ANGLE + 0.2
    assert path.now < MAX_SEARCH_ANGLE / SWEEP_RATE + 1.0
    assert path.velocity == STILL


def test_short_gap_in_the_beams_does_not_end_the_sweep() -> None:
    path = Path(begin(), bearing=2.0)
    path.go(until=HomingStage.SEARCH)
    while path.memory.first_heading is None:
        path.go(seconds=TICK)
    path.beams = DockBeam(0)
    path.go(seconds=BEAM_HOLD_TIME - 2 * TICK)
    path.beams = FAR
    path.go(until=HomingStage.AIM)
    assert path.memory.course == pytest.approx(2.0, abs=0.03)


def test_homing_aims_again_near_the_dock_and_slows_down() -> None:
    path = Path(begin(HomingStage.DRIVE), bearing=0.0)
    path.go(seconds=1.0)
    assert path.velocity.linear == 0.1
    path.beams = NEAR
    path.go(until=HomingStage.LEAVE, seconds=1.0)
    assert path.memory.near
    path.go(until=HomingStage.DRIVE)
    path.go(seconds=1.0)
    assert path.velocity.linear == CONTACT_SPEED


def test_dock_without_beams_on_the_way_is_searched_again() -> None:
    path = Path(begin(HomingStage.DRIVE), bearing=0.0)
    path.go(seconds=1.0)
    path.beams = DockBeam(0)
    path.go(seconds=BEAM_TIMEOUT - TICK)
    assert path.memory.stage is HomingStage.DRIVE
    path.go(seconds=3 * TICK)
    assert path.memory.stage is not HomingStage.DRIVE


def test_course_beside_the_middle_is_left() -> None:
    path = Path(begin(HomingStage.DRIVE), bearing=0.0)
    path.beams = DockBeam.FAR_LEFT | DockBeam.FAR_CENTRE
    path.go(until=HomingStage.LEAVE, seconds=1.0)
    assert path.memory.stage is HomingStage.LEAVE


def test_contact_beside_the_dock_backs_off_and_finally_fails() -> None:
    path = Path(begin(HomingStage.DRIVE, near=True), bearing=0.0, beams=NEAR)
    for missed in range(1, MAX_TRIES):
        path.go(seconds=TICK, bumper=Sides(centre=True))
        assert (path.memory.stage, path.memory.misses) == (HomingStage.BACK, missed)
        came = path.x
        path.go(until=HomingStage.LEAVE)
        assert came - path.x == pytest.approx(BACK_OFF_DISTANCE, abs=0.02)
        path.memory = replace(path.memory, stage=HomingStage.DRIVE)
    path.go(seconds=TICK, bumper=Sides(centre=True))
    assert path.memory.failure == "missed the dock's contacts 3 times"


# --- the leaf --------------------------------------------------------------------------------------------------------


def test_dock_stops_and_succeeds_once_contact_is_confirmed() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DockLeaf("dock"))
    leaf.output_variable = "charge"
    bench.base.reading = good(at(docked=True, battery_percent=64.0))
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=0.3) is RUNNING
    assert bench.tick(leaf, after=0.15) is SUCCESS
    assert bench.base.commands == [STOP]
    assert bench.run.variables["charge"] == 64.0


def test_dock_uses_the_dock_action_of_the_robot() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    leaf = bench.put(DockLeaf("dock"))
    bench.base.reading = good(at(battery_percent=64.0))
    assert bench.tick(leaf) is RUNNING
    assert bench.ros2.commands == [("begin", "dock", "irobot_create_msgs/action/Dock", "{}")]
    assert bench.base.commands == []
    bench.ros2.goal_progress = Progress(GoalState.SUCCEEDED)
    assert bench.tick(leaf) is SUCCESS
    assert (leaf.result, bench.base.commands) == (64.0, [STOP])


def test_dock_ignores_topics_and_services_named_dock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = LeafTestBench()
    monkeypatch.setattr(bench.ros2, "offers", lambda name: name == "dock")
    leaf = bench.put(DockLeaf("dock"))
    bench.base.reading = good(at(dock=centre(FAR)))
    assert bench.tick(leaf) is RUNNING
    assert bench.ros2.commands == []
    assert bench.base.commands != []


def test_dock_fails_with_the_reason_of_the_dock_action() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    leaf = bench.put(DockLeaf("dock"))
    bench.tick(leaf)
    bench.ros2.goal_progress = Progress(GoalState.FAILED, "/dock: it was aborted")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "/dock: it was aborted"


def test_dock_cancels_its_action_on_halt_and_waits_for_the_end() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    leaf = bench.put(DockLeaf("dock"))
    bench.tick(leaf)
    assert not bench.halt(leaf)
    assert bench.ros2.commands[-1] == ("cancel", 1)
    bench.ros2.goal_progress = Progress(GoalState.CANCELLED)
    assert bench.halt(leaf)
    assert bench.base.commands[-1] == STOP


def test_dock_sends_no_goal_while_on_the_dock() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    leaf = bench.put(DockLeaf("dock"))
    bench.base.reading = good(at(docked=True))
    bench.tick(leaf)
    assert bench.ros2.commands == []


def test_brief_dock_contacts_are_not_enough() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DockLeaf("dock"))
    for docked in (True, False, True, False):
        bench.base.reading = good(at(docked=docked))
        assert bench.tick(leaf, after=0.3) is RUNNING


@pytest.mark.parametrize(
    ("felt", "reason"),
    [
        ({"cliff": Sides(left=True)}, "a cliff ahead: the only way is straight back"),
        ({"wheel_drop": Sides(left=True)}, "a wheel has dropped"),
    ],
)
def test_dock_fails_and_stops_on_contact(felt: dict[str, Any], reason: str) -> None:
    bench = LeafTestBench()
    leaf = bench.put(DockLeaf("dock"))
    bench.tick(leaf)
    bench.base.reading = good(at(**felt))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == reason
    assert bench.base.commands[-1] == STOP


def test_dock_reports_the_failure_of_its_homing() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DockLeaf("dock"))
    bench.tick(leaf)
    bench.base.reading = good(at(heading=MAX_SEARCH_ANGLE + 1.0))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "no dock beam received in a full turn"


def test_dock_searches_again_after_teleoperation() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DockLeaf("dock"))
    bench.base.reading = good(at(dock=centre(FAR)))
    assert bench.tick(leaf) is RUNNING
    bench.base.steers = Steering(Source.TELEOP, STILL, STILL)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "teleoperation has control"
    bench.base.steers, bench.base.reading = Steering(None, STILL, STILL), good(at(heading=5.0))
    assert bench.tick(leaf, after=1.0) is RUNNING
    assert leaf.reason == HomingStage.SEARCH
