"""What the guard tells of the base, what expressions read of that, and when it ends a mission."""

from dataclasses import replace
from typing import Any

import pytest
from py_trees.common import Status

from behaviours.driving.motion import DriveLeaf, StopLeaf
from drivers.api import BaseState, Pose2D, Reflexes, Sides, Source, Steering, Velocity
from drivers.errors import NotConnected
from missions.executive.events import Event, NodeChanged, ReflexFired, Ticked
from missions.executive.executive import HALT_TIMEOUT, Executive
from missions.executive.guard import CONFIRM_TIME, CONTACTS, REFLEXES, BaseGuard
from missions.executive.state import state_of
from missions.executive.stream import EventStream
from missions.plugins.testing.recorders import STOP, LeafTestBench, good, none, stale

REST = BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0), battery_percent=80.0)
STILL = Velocity(0.0, 0.0)
LEFT, FRONT = Sides(left=True), Sides(left=True, centre=True)


class Watched:
    """A guard over a recorded base, and what it has told."""

    def __init__(self, reflexes: Reflexes | None = None) -> None:
        self.bench = LeafTestBench()
        self.events: list[Event] = []
        self.stream = EventStream([self.events.append])
        self.bench.base.reading = good(REST)
        self.guard = BaseGuard(self.bench.base, reflexes or Reflexes(), self.bench.run, self.stream)

    def look(self, *, after: float = 0.05, **felt: Any) -> str:
        """Let the base feel this, and look."""
        self.bench.clock.advance(after)
        if felt:
            self.bench.base.reading = good(replace(REST, **felt))
        return self.guard.check()

    def told(self) -> list[tuple[str, str, bool]]:
        """Return what was told since the last time."""
        found = [(event.condition, event.where, event.on) for event in self.events if isinstance(event, ReflexFired)]
        self.events.clear()
        return found


@pytest.fixture
def watched() -> Watched:
    return Watched()


# What the guard tells


def test_hazards_are_reported_at_begin_and_end(watched: Watched) -> None:
    for hazards in ({"stall left"}, {"stall left", "hazard of type 9"}, set[str](), set[str]()):
        watched.look(hazards=frozenset(hazards))
    assert watched.told() == [
        ("hazard", "stall left", True),
        ("hazard", "hazard of type 9", True),
        ("hazard", "hazard of type 9", False),
        ("hazard", "stall left", False),
    ]


@pytest.mark.parametrize("contact", CONTACTS)
def test_contact_is_reported_with_its_sides_until_it_ends(watched: Watched, contact: str) -> None:
    for sides in (LEFT, LEFT, FRONT, Sides(), Sides()):
        felt: dict[str, Any] = {contact: sides}
        assert not watched.look(**felt)
    assert watched.told() == [
        (contact, "left", True),
        (contact, "left and centre", True),
        (contact, "left and centre", False),
    ]


def test_buttons_dock_and_charger_are_reported(watched: Watched) -> None:
    watched.look(buttons=frozenset({0, 2}))
    watched.look(buttons=frozenset({2}), docked=True)
    watched.look(docked=True, charging=True)
    watched.look()
    watched.look(charging=False)
    assert watched.told() == [
        ("button", "0", True),
        ("button", "2", True),
        ("button", "0", False),
        ("docked", "", True),
        ("button", "2", False),
        ("charging", "", True),
        ("docked", "", False),
        ("charging", "", False),
    ]


def test_initial_latch_and_dock_are_reported(watched: Watched) -> None:
    watched.bench.base.latched = "button 0 was pressed"
    watched.look(docked=True)
    assert watched.told() == [("latched", "button 0 was pressed", True), ("docked", "", True)]


def test_latch_is_reported_with_its_reason_without_base_reports(watched: Watched) -> None:
    watched.bench.base.reading = none()
    watched.bench.base.latch("cliff left")
    watched.look()
    watched.look()
    watched.bench.base.enable()
    watched.look()
    assert watched.told() == [("latched", "cliff left", True), ("latched", "cliff left", False)]


def test_a_stale_report_changes_nothing(watched: Watched) -> None:
    watched.look(bumper=LEFT)
    watched.bench.base.reading = stale(REST)
    watched.look()
    watched.bench.base.reading = none()
    watched.look()
    assert watched.told() == [("bumper", "left", True)]


def test_low_battery_is_reported_and_critical_battery_ends_the_mission(watched: Watched) -> None:
    assert not watched.look(battery_percent=20.0)
    assert not watched.look(after=CONFIRM_TIME)
    assert watched.told() == [("battery_low", "20 %", True)]
    assert not watched.look(battery_percent=9.0)
    assert watched.look(after=CONFIRM_TIME) == "battery critical: 9 %"
    assert watched.told() == [("battery_critical", "9 %", True)]
    assert watched.look(battery_percent=8.0) == "battery critical: 8 %"
    assert not watched.look(battery_percent=8.0, charging=True)
    assert watched.told() == [
        ("charging", "", True),
        ("battery_low", "8 %", False),
        ("battery_critical", "8 %", False),
    ]


def test_reflex_names_are_complete_and_unique() -> None:
    assert set(REFLEXES) >= {*CONTACTS, "battery_low", "battery_critical"}
    assert len(set(REFLEXES)) == len(REFLEXES)


def test_battery_state_in_expressions_comes_from_the_guard(watched: Watched) -> None:
    state = state_of(watched.bench.robot, watched.bench.clock, watched.guard)
    watched.look(battery_percent=20.0)
    watched.look(after=CONFIRM_TIME)
    battery, unwatched = state["battery"], state_of(watched.bench.robot, watched.bench.clock)["battery"]
    assert [getattr(battery, name) for name in ("low", "critical")] == [True, False]
    assert [getattr(unwatched, name) for name in ("low", "critical")] == [None, None]
    watched.bench.base.reading = stale(REST)
    for name in ("low", "critical", "percent", "voltage", "charging"):
        with pytest.raises(NotConnected, match="the base does not report"):
            getattr(battery, name)


def test_base_state_in_expressions_has_driver_dock_and_button(watched: Watched) -> None:
    base = state_of(watched.bench.robot, watched.bench.clock)["base"]

    def read() -> list[object]:
        return [getattr(base, name) for name in ("driver", "stopped", "docked", "button")]

    assert read() == ["", False, False, None]
    watched.bench.base.steers = Steering(Source.TELEOP, STILL, STILL)
    watched.bench.base.latched = "button 0 was pressed"
    watched.look(docked=True, buttons=frozenset({1, 2}))
    assert read() == ["teleop", True, True, 1]


# The end of a mission


class Slow(DriveLeaf):
    """A drive that takes some ticks to stop; for ever, where there are none."""

    tag = "slow_drive"
    ticks = 3
    halt_limit = 2 * HALT_TIMEOUT

    def halting(self) -> bool:
        self.ticks -= 1
        return self.ticks != 0


def executive(watched: Watched, leaf: DriveLeaf | StopLeaf) -> Executive:
    watched.bench.put(leaf, distance=5.0)
    made = Executive(leaf, watched.bench.run, watched.stream, guard=watched.guard)
    watched.bench.run.wait = lambda seconds: bool(watched.bench.clock.advance(seconds))
    return made


def critical(watched: Watched) -> None:
    watched.look(battery_percent=9.0)
    watched.look(after=CONFIRM_TIME)


def test_a_critical_battery_halts_the_tree_and_is_the_reason_of_the_failure(watched: Watched) -> None:
    run = executive(watched, DriveLeaf("drive"))
    assert run.tick() is Status.RUNNING
    critical(watched)
    assert run.tick() is Status.FAILURE
    assert watched.bench.base.commands[-1] == STOP
    (last,) = [event for event in watched.events[-2:] if isinstance(event, NodeChanged)]
    assert (last.status, last.reason) == ("failure", "battery critical: 9 %")
    assert isinstance(watched.events[-1], Ticked)
    result = run.loop()
    assert (result.result, result.reason) == ("failure", "battery critical: 9 %")


def test_critical_battery_gives_the_tree_time_to_halt(watched: Watched) -> None:
    run = executive(watched, Slow("slow"))
    run.tick()
    critical(watched)
    assert [run.tick() for _ in range(3)] == [Status.RUNNING, Status.RUNNING, Status.FAILURE]


def test_tree_that_never_halts_is_safe_stopped(watched: Watched) -> None:
    leaf = Slow("slow")
    leaf.ticks = -1
    run = executive(watched, leaf)
    run.tick()
    critical(watched)
    result = run.loop()
    assert (result.result, result.reason) == ("failure", "battery critical: 9 %")
    assert watched.bench.safe_stops == [frozenset({"base"})]
    assert HALT_TIMEOUT <= result.seconds - 100.0 - CONFIRM_TIME <= HALT_TIMEOUT + 0.5


def test_mission_restarts_once_the_battery_is_charged(watched: Watched) -> None:
    run = executive(watched, DriveLeaf("drive"))
    run.tick()
    critical(watched)
    assert [run.tick(), run.tick()] == [Status.FAILURE, Status.FAILURE]
    watched.look(battery_percent=60.0)
    assert run.tick() is Status.RUNNING
    assert isinstance(watched.bench.base.commands[-1], Velocity)


def test_signal_interrupts_a_mission_that_is_halting(watched: Watched) -> None:
    run = executive(watched, Slow("slow"))
    run.tick()
    critical(watched)
    run.tick()
    run.stop("SIGINT")
    assert run.loop().result == "interrupted"


def test_enable_button_enables_all_parts(watched: Watched) -> None:
    bench, enabled = watched.bench, []
    guard = BaseGuard(
        bench.base,
        Reflexes(enable_button=2),
        bench.run,
        watched.stream,
        lambda: enabled.append(bench.clock.now()),
    )
    bench.base.latch("it was away for 7 s")
    guard.check()
    assert not enabled
    bench.base.enable()
    guard.check()
    guard.check()
    assert len(enabled) == 1
    for pressed in ((), (0,), (2,), (2,), ()):
        bench.base.reading = good(replace(REST, buttons=frozenset(pressed)))
        guard.check()
    assert len(enabled) == 2
