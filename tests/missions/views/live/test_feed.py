"""What a run tells its view, and what a view can ask of it."""

import json
import signal
from collections.abc import Sequence
from enum import Enum
from random import Random
from threading import Thread
from types import FrameType

import pytest

from drivers.clock import ManualClock
from missions.executive import executive
from missions.executive.events import Event, Logged, NodeChanged, Ticked, VariableSet
from missions.executive.executive import Executive, RunMode, RunModeEvent
from missions.executive.parts import PartStatus
from missions.executive.stream import EventStream
from missions.trees.feed import MAX_LOG_LINES, ViewFeed
from perception.api import Box, Face, Scene
from tests.machines import RecordingTable, tables, walk
from tests.missions.views.pictures.drawn import plan_of, ready


class Fed:
    """A mission that waits for ever, ticked by hand, with its feed."""

    def __init__(self, *, in_tick: bool = False) -> None:
        self.clock, self.wall = ManualClock(), ManualClock()
        root, run = ready(plan_of("  wait: 1000 s\n"), self.clock)
        self.stream = EventStream()
        self.executive = Executive(root, run, self.stream)
        self.looks = 0
        self.feed = ViewFeed(self.executive, self.wall, look=self.look, lines=self.lines, in_tick=in_tick)
        self.stream.listeners.append(self.feed)

    def look(self) -> Sequence[PartStatus]:
        self.looks += 1
        if self.looks == 3:
            raise RuntimeError("a driver with a fault of its own")
        return (PartStatus("base", "OK", 0.5, {"x": 1.0}),)

    def lines(self, event: Event) -> Sequence[str]:
        return event.text.splitlines() if isinstance(event, Logged) else ()


def test_changes_are_sent_once_and_only_the_latest() -> None:
    fed = Fed()
    for number in range(100_000):
        fed.feed(NodeChanged(float(number), number, "1", "wait", "wait", 3, "running", f"{number}\n!"))
        fed.feed(VariableSet(float(number), number, "", "count", number))
        fed.feed(Logged(float(number), "info", f"line {number}\x1b"))
    told = fed.feed.take_changes()
    assert told["changed"] == {"1": ("running", "99999 !", 99_999.0)}
    assert told["variables"] == {"count": "99999"}
    log = told["log"]
    assert isinstance(log, list)
    assert len(log) == MAX_LOG_LINES
    assert log[-1] == "line 99999\N{REPLACEMENT CHARACTER}"
    assert not {"changed", "variables", "log"} & set(fed.feed.take_changes())


def test_running_node_is_sent_with_its_current_feedback() -> None:
    fed = Fed()
    fed.executive.tick()
    assert fed.feed.take_changes()["changed"] == {"1": ("running", "", 0.0)}
    fed.executive.root.feedback_message = "2.5 of\n1000 s"
    assert fed.feed.take_changes()["changed"] == {"1": ("running", "2.5 of 1000 s", 0.0)}
    assert "changed" not in fed.feed.take_changes()
    fed.clock.advance(1000.0)
    fed.executive.tick()
    fed.executive.root.feedback_message = "not asked for any more"
    assert fed.feed.take_changes()["changed"] == {"1": ("success", "", 1000.0)}
    assert "changed" not in fed.feed.take_changes()


def test_ticks_are_sent_with_the_number_of_late_ones() -> None:
    fed = Fed()
    fed.clock.advance(2.5)
    fed.executive.tick()
    fed.feed(Ticked(2.5, 7, "running", 0.3))
    told = fed.feed.take_changes()
    assert (told["t"], told["tick"], told["lates"], told["paused"], told["stopping"]) == (2.5, 7, 1, False, False)


def test_visited_keys_are_those_of_the_last_tick() -> None:
    clock, stream = ManualClock(), EventStream()
    root, run = ready(plan_of("  sequence:\n    - wait: 1 s\n    - wait: 1000 s\n"), clock)
    executive = Executive(root, run, stream)
    feed = ViewFeed(executive, clock, look=lambda: (), lines=lambda _: ())
    stream.listeners.append(feed)
    visited = []
    for _ in range(3):
        executive.tick()
        visited.append(feed.visited_keys())
        clock.advance(1.0)
    assert visited == [["1.1", "1"], ["1.1", "1.2", "1"], ["1.2", "1"]]


def test_values_are_sent_as_short_text() -> None:
    fed = Fed()
    face = Face(1, 1.0, Box(0, 0, 9, 9), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.5)
    values: dict[str, object] = {
        "yes": True,
        "gone": None,
        "long": "x" * 1000,
        "scene": Scene(1.0, 100.0, 20.0),
        "who": face,
    }
    for name, value in values.items():
        fed.feed(VariableSet(0.0, 1, "1.2", name, value))
    told = fed.feed.take_changes()["variables"]
    assert told == {
        "1.2 yes": "yes",
        "1.2 gone": None,
        "1.2 long": "x" * 119 + "…",
        "1.2 scene": "Scene: stamp 1, brightness 100, contrast 20",
        "1.2 who": "face 1, 1.5 m, straight ahead",
    }


def test_every_message_is_json() -> None:
    fed = Fed()
    fed.feed(NodeChanged(0.0, 1, "1", "wait", "wait", 3, "running", "why"))
    told = json.loads(json.dumps(fed.feed.take_changes()))
    assert told["changed"] == {"1": ["running", "why", 0.0]}
    assert told["parts"][0] == {
        "part": "base",
        "level": "OK",
        "age": 0.5,
        "values": {"x": 1.0},
        "detail": "",
        "hint": "",
    }


def test_parts_are_polled_periodically_and_a_raising_driver_is_skipped() -> None:
    fed = Fed()
    seen = []
    for _ in range(20):
        seen.append("parts" in fed.feed.take_changes())
        fed.wall.advance(0.125)
    assert [place for place, new in enumerate(seen) if new] == [0, 4, 12, 16]


def test_in_simulated_time_parts_are_looked_at_by_the_tick_alone() -> None:
    fed = Fed(in_tick=True)
    assert "parts" not in fed.feed.take_changes()
    fed.executive.tick()
    assert "parts" in fed.feed.take_changes()


def test_closing_parts_are_not_polled() -> None:
    fed = Fed()
    fed.feed(Ticked(1.0, 20, "success"))
    assert "parts" not in fed.feed.take_changes()
    stopped = Fed()
    stopped.executive.stop("enough")
    assert "parts" not in stopped.feed.take_changes()


def test_a_view_stops_the_run_and_nonsense_does_nothing() -> None:
    fed = Fed()
    for message in ({}, {"do": 3}, {"do": "fly"}, {"do": "step"}):
        fed.feed.execute(message)
    assert not fed.executive.stopping
    fed.feed.execute({"do": "stop"})
    assert fed.feed.take_changes()["stopping"] is True
    assert fed.executive.loop().reason == "stopped from the view"


def test_a_step_is_made_only_while_paused() -> None:
    fed = Fed()
    fed.feed.execute({"do": "step"})
    assert fed.executive._steps == 0
    fed.feed.execute({"do": "pause"})
    assert fed.feed.take_changes()["paused"] is True
    fed.feed.execute({"do": "step"})
    assert fed.executive._steps == 1
    fed.feed.execute({"do": "resume"})
    assert fed.feed.take_changes()["paused"] is False


def test_random_requests_take_every_transition_and_a_hold_outlasts_all_but_an_alarm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def request(fed: Fed, chance: Random) -> None:
        run = fed.executive
        was_held = run._mode is RunMode.HELD
        chance.choice((run.pause, run.resume, run.step))()
        assert not was_held or run._mode is RunMode.HELD

    def hold(fed: Fed, chance: Random) -> None:
        fed.executive.hold(held=chance.random() < 0.5)

    def alarm(fed: Fed, _: Random) -> None:
        fed.executive._change_mode(RunModeEvent.ALARM)

    actions = [request, request, hold, alarm]
    table = walk(monkeypatch, "missions.executive.executive.TRANSITIONS", Fed, actions, walks=20)
    assert table.visited == set(table)
    assert not table.missing


def test_concurrent_resume_does_not_undo_a_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    class SlowTable(RecordingTable):
        """The table as a thread finds it that is interrupted by a stop at its first look-up."""

        stop: Thread | None = None

        def __getitem__(self, pair: tuple[Enum, Enum]) -> Enum:
            if self.stop is None:
                self.stop = Thread(target=fed.executive.hold, kwargs={"held": True})
                self.stop.start()
                self.stop.join(0.1)  # it waits for the lock: else its hold would be lost
            return super().__getitem__(pair)

    fed = Fed()
    fed.executive.pause()
    table = SlowTable(tables()["missions.executive.executive.TRANSITIONS"])
    monkeypatch.setattr(executive, "TRANSITIONS", table)
    fed.executive.resume()
    assert table.stop is not None
    table.stop.join(5)
    assert fed.executive._mode is RunMode.HELD


def test_an_interrupt_is_a_signal_as_from_the_keyboard() -> None:
    heard: list[int] = []

    def hear(number: int, frame: FrameType | None) -> None:
        del frame
        heard.append(number)

    before = signal.signal(signal.SIGINT, hear)
    try:
        Fed().feed.execute({"do": "interrupt"})
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [signal.SIGINT]


def test_paused_run_is_stopped_when_its_view_is_lost() -> None:
    fed = Fed()
    fed.feed.on_view_lost()
    assert not fed.executive.stopping
    fed.feed.execute({"do": "pause"})
    fed.feed.on_view_lost()
    assert fed.executive.loop().reason == "the view ended while the mission was paused"
