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


def test_the_dock_is_in_the_middle_of_the_headings_at_which_it_was_heard() -> None:
    path = Path(begin(), bearing=2.0)
    path.go(until=HomingStage.AIM)
    assert path.memory.course == pytest.approx(2.0, abs=0.03)
    path.go(until=HomingStage.DRIVE)
    assert path.heading == pytest.approx(2.0, abs=0.03)


def test_a_dock_that_it_hears_at_once_is_left_first_so_as_to_hear_both_of_its_ends() -> None:
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
def test_from_beside_the_middle_it_crosses_into_it_and_looks_again(beams: DockBeam, side: float) -> None:
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


def test_with_no_dock_to_be_heard_it_turns_once_round_and_gives_up() -> None:
    path = Path(begin(), beams=DockBeam(0))
    path.go()
    assert path.memory.failure == "no dock beam received in a full turn"
    assert MAX_SEARCH_ANGLE <= path.heading < MAX_SEARCH_ANGLE + 0.2
    assert path.now < MAX_SEARCH_ANGLE / SWEEP_RATE + 1.0
    assert path.velocity == STILL


def test_a_report_that_misses_the_beams_does_not_end_the_sweep() -> None:
    path = Path(begin(), bearing=2.0)
    path.go(until=HomingStage.SEARCH)
    while path.memory.first_heading is None:
        path.go(seconds=TICK)
    path.beams = DockBeam(0)
    path.go(seconds=BEAM_HOLD_TIME - 2 * TICK)
    path.beams = FAR
    path.go(until=HomingStage.AIM)
    assert path.memory.course == pytest.approx(2.0, abs=0.03)


def test_it_takes_aim_once_more_when_it_comes_near_and_goes_slowly_then() -> None:
    path = Path(begin(HomingStage.DRIVE), bearing=0.0)
    path.go(seconds=1.0)
    assert path.velocity.linear == 0.1
    path.beams = NEAR
    path.go(until=HomingStage.LEAVE, seconds=1.0)
    assert path.memory.near
    path.go(until=HomingStage.DRIVE)
    path.go(seconds=1.0)
    assert path.velocity.linear == CONTACT_SPEED


def test_a_dock_that_falls_silent_on_the_way_is_looked_for_anew() -> None:
    path = Path(begin(HomingStage.DRIVE), bearing=0.0)
    path.go(seconds=1.0)
    path.beams = DockBeam(0)
    path.go(seconds=BEAM_TIMEOUT - TICK)
    assert path.memory.stage is HomingStage.DRIVE
    path.go(seconds=3 * TICK)
    assert path.memory.stage is not HomingStage.DRIVE


def test_a_way_that_leads_beside_the_middle_is_left() -> None:
    path = Path(begin(HomingStage.DRIVE), bearing=0.0)
    path.beams = DockBeam.FAR_LEFT | DockBeam.FAR_CENTRE
    path.go(until=HomingStage.LEAVE, seconds=1.0)
    assert path.memory.stage is HomingStage.LEAVE


def test_one_that_touches_the_dock_beside_its_contacts_backs_off_and_gives_up_in_the_end() -> None:
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


def test_on_the_dock_it_stops_and_succeeds_once_it_is_sure() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DockLeaf("dock"))
    leaf.output_variable = "charge"
    bench.base.reading = good(at(docked=True, battery_percent=64.0))
    assert bench.tick(leaf) is RUNNING
    assert bench.tick(leaf, after=0.3) is RUNNING
    assert bench.tick(leaf, after=0.15) is SUCCESS
    assert bench.base.commands == [STOP]
    assert bench.run.variables["charge"] == 64.0


def test_a_robot_that_docks_by_itself_is_asked_to_and_no_longer_homed() -> None:
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


def test_a_topic_or_a_service_called_dock_leaves_it_to_find_the_dock_by_infrared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = LeafTestBench()
    monkeypatch.setattr(bench.ros2, "offers", lambda name: name == "dock")
    leaf = bench.put(DockLeaf("dock"))
    bench.base.reading = good(at(dock=centre(FAR)))
    assert bench.tick(leaf) is RUNNING
    assert bench.ros2.commands == []
    assert bench.base.commands != []


def test_where_it_does_not_dock_it_fails_with_its_reason() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    leaf = bench.put(DockLeaf("dock"))
    bench.tick(leaf)
    bench.ros2.goal_progress = Progress(GoalState.FAILED, "/dock: it was aborted")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "/dock: it was aborted"


def test_halted_while_it_docks_by_itself_it_cancels_that_and_waits_for_its_end() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    leaf = bench.put(DockLeaf("dock"))
    bench.tick(leaf)
    assert not bench.halt(leaf)
    assert bench.ros2.commands[-1] == ("cancel", 1)
    bench.ros2.goal_progress = Progress(GoalState.CANCELLED)
    assert bench.halt(leaf)
    assert bench.base.commands[-1] == STOP


def test_on_the_dock_it_asks_for_nothing() -> None:
    bench = LeafTestBench()
    bench.ros2.nav2 = True
    leaf = bench.put(DockLeaf("dock"))
    bench.base.reading = good(at(docked=True))
    bench.tick(leaf)
    assert bench.ros2.commands == []


def test_contacts_that_meet_for_a_moment_only_are_not_enough() -> None:
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
def test_what_it_feels_fails_it(felt: dict[str, Any], reason: str) -> None:
    bench = LeafTestBench()
    leaf = bench.put(DockLeaf("dock"))
    bench.tick(leaf)
    bench.base.reading = good(at(**felt))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == reason
    assert bench.base.commands[-1] == STOP


def test_a_failure_on_the_way_is_its_reason() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DockLeaf("dock"))
    bench.tick(leaf)
    bench.base.reading = good(at(heading=MAX_SEARCH_ANGLE + 1.0))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "no dock beam received in a full turn"


def test_after_a_person_has_had_the_wheels_it_looks_for_the_dock_anew() -> None:
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
