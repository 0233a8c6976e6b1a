"""What listeners read of a run: every change of every node, true as of its moment, in one order with all the rest."""

import threading
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from behaviours.basics import Fail, Pretend
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.run import RunState
from drivers.clock import ManualClock
from missions.executive import stream as streaming
from missions.executive.composites import Selector, Sequence
from missions.executive.events import Event, Logged, NodeChanged
from missions.executive.executive import Executive
from missions.executive.parent import Composite, set_children
from missions.executive.stream import EventStream
from tests.waiting import wait_until

OUTCOMES = st.lists(st.sampled_from([RUNNING, SUCCESS, FAILURE]), min_size=1, max_size=4)


class Grumble(Leaf):
    """Fail for another reason at every tick."""

    def update(self) -> Status:
        return self.fail(f"tick {self.run.tick} is not my day")


def tree(run: RunState, composite: Composite, *leaves: Leaf) -> Composite:
    """Put leaves into a composite, and the whole into a run."""
    set_children(composite, leaves)
    for place, node in enumerate((composite, *leaves)):
        node.run, node.key, node.kind, node.line = run, f"1.{place}", type(node).__name__.lower(), place + 1
    return composite


def pretend(outcomes: list[Status]) -> Pretend:
    leaf = Pretend("pretend")
    leaf.outcomes = outcomes
    return leaf


def executive(stream: EventStream, composite: Composite, *leaves: Leaf) -> tuple[Executive, ManualClock]:
    clock = ManualClock()
    run = RunState(clock)
    return Executive(tree(run, composite, *leaves), run, stream), clock


def changes(heard: list[Event]) -> list[tuple[str, str, str]]:
    return [(event.name, event.status, event.reason) for event in heard if isinstance(event, NodeChanged)]


def log(text: str) -> Logged:
    return Logged(0.0, "info", text)


# --- complete and true -----------------------------------------------------------------------------------------------


@settings(deadline=None)
@given(st.sampled_from([Sequence, Selector]), st.lists(OUTCOMES, min_size=1, max_size=4), st.integers(1, 6))
def test_queued_events_equal_immediate_events(
    kind: Callable[[str], Composite], outcomes: list[list[Status]], ticks: int
) -> None:
    at_once: list[Event] = []
    later: list[Event] = []
    kept = EventStream([later.append])
    kept.open()
    for stream in (EventStream([at_once.append]), kept):
        runner, clock = executive(stream, kind("all"), *map(pretend, outcomes))
        for _ in range(ticks):
            clock.advance(0.1)
            runner.root.execute_tick()  # without the end of a tick, which would wake the stream's thread
            runner.run.tick += 1
        runner.root.halt()
    kept.close()
    assert later == at_once
    assert len(later) > 0


def test_queued_change_keeps_the_status_of_its_time() -> None:
    heard: list[Event] = []
    stream = EventStream([heard.append])
    stream.open()
    runner, clock = executive(stream, Selector("s"), Grumble("a"))
    for run_tick in (1, 2):
        clock.advance(0.5)
        runner.run.tick = run_tick
        runner.root.execute_tick()
    assert heard == []  # nothing has come to wake the thread
    stream.close()
    assert heard == [
        NodeChanged(0.5, 1, "1.1", "a", "grumble", 2, "failure", "tick 1 is not my day"),
        NodeChanged(0.5, 1, "1.0", "s", "selector", 1, "failure", "tick 1 is not my day"),
        NodeChanged(1.0, 2, "1.1", "a", "grumble", 2, "idle", ""),
        NodeChanged(1.0, 2, "1.1", "a", "grumble", 2, "failure", "tick 2 is not my day"),
    ]


def test_changes_and_other_events_keep_their_order() -> None:
    class Talk(Leaf):
        """Say something."""

        def update(self) -> Status:
            stream.emit(log("hello"))
            return SUCCESS

    heard: list[Event] = []
    stream = EventStream([heard.append])
    stream.open()
    runner, _ = executive(stream, Sequence("s"), pretend([SUCCESS]), Talk("t"))
    runner.tick()
    stream.close()
    assert [event.event for event in heard] == ["node_changed", "log", "node_changed", "node_changed", "tick"]


def test_tick_end_delivers_changes_to_listeners() -> None:
    ticked = threading.Event()
    heard: list[Event] = []

    def listen(event: Event) -> None:
        heard.append(event)
        if event.event == "tick":
            ticked.set()

    stream = EventStream([listen])
    stream.open()
    runner, _ = executive(stream, Sequence("s"), pretend([SUCCESS]))
    runner.tick()
    assert ticked.wait(5.0)
    assert changes(heard) == [("pretend", "success", ""), ("s", "success", "")]
    stream.close()


def test_idle_ticks_are_delivered_together() -> None:
    heard: list[Event] = []
    told = threading.Event()

    def listen(event: Event) -> None:
        heard.append(event)
        if event.event == "tick" and event.t > 9.0 + streaming.IDLE_TICK_DELAY:
            told.set()

    stream = EventStream([listen])
    stream.open()
    runner, clock = executive(stream, Sequence("s"), pretend([RUNNING] * 9))
    clock.advance(9.0)
    runner.tick()
    wait_until(lambda: len(heard) == 3)
    clock.advance(streaming.IDLE_TICK_DELAY / 2)
    runner.tick()
    assert len(heard) == 3  # though the thread that tells has nothing else to do
    clock.advance(streaming.IDLE_TICK_DELAY)
    runner.tick()
    assert told.wait(5.0)
    assert [event.event for event in heard[3:]] == ["tick", "tick"]
    stream.close()


def test_reset_emits_idle_nodes_from_the_leaves_up() -> None:
    heard: list[Event] = []
    runner, _ = executive(EventStream([heard.append]), Selector("s"), Fail("a"), Fail("b"))
    runner.tick()
    heard.clear()
    runner.root.reset()
    runner.root.reset()
    assert changes(heard) == [("a", "idle", ""), ("b", "idle", ""), ("s", "idle", "")]


# --- listeners that are slow, broken or many -------------------------------------------------------------------------


def test_failing_listener_does_not_affect_other_listeners() -> None:
    first: list[Event] = []
    last: list[Event] = []

    def breaks(event: Event) -> None:
        if isinstance(event, NodeChanged) and event.status == "idle":
            raise RuntimeError("I cannot draw that")

    stream = EventStream([first.append, breaks, last.append])
    runner, _ = executive(stream, Selector("s"), Fail("a"), Fail("b"))
    runner.tick()
    runner.tick()
    assert first == last
    assert len(changes(first)) == 7
    assert stream.failed_listeners == ["function: I cannot draw that"]


def test_dropped_changes_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streaming, "MAX_QUEUED_EVENTS", 3)
    heard: list[Event] = []
    stream = EventStream([heard.append])
    stream.open()
    runner, _ = executive(stream, Sequence("s"), *(pretend([SUCCESS]) for _ in range(5)))
    runner.root.execute_tick()
    stream.close()
    assert len(heard) == 3
    assert stream.dropped_count == 3  # two leaves and the sequence


def test_reopened_stream_emits_at_once_while_closed() -> None:
    heard: list[Event] = []
    stream = EventStream([heard.append])
    for text in ("one", "two"):
        stream.open()
        stream.open()
        stream.emit(log(text))
        stream.close()
        stream.close()
        stream.emit(log(f"after {text}"))
        assert heard[-1] == log(f"after {text}")
    assert [event.as_dict()["text"] for event in heard] == ["one", "after one", "two", "after two"]
