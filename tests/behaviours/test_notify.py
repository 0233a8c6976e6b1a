"""The leaf that tells somebody who is not there."""

import logging

import pytest

from behaviours.basics import Notify
from behaviours.leaf import SUCCESS
from missions.executive.events import Event, Notified
from missions.executive.executive import Executive
from missions.executive.stream import EventStream
from missions.plugins.testing.recorders import LeafTestBench


def test_notify_calls_the_callback_and_succeeds_at_once() -> None:
    bench = LeafTestBench()
    told: list[str] = []
    bench.run.notify = told.append
    leaf = bench.put(Notify("notify"), text="Ana has the message")
    assert bench.tick(leaf) is SUCCESS
    assert told == ["Ana has the message"]
    assert leaf.reason == "Ana has the message"


def test_notify_without_a_callback_writes_to_the_log(caplog: pytest.LogCaptureFixture) -> None:
    bench = LeafTestBench()
    with caplog.at_level(logging.INFO, logger="missiontree"):
        bench.tick(bench.put(Notify("notify"), text="done"))
    assert [record.message for record in caplog.records] == ["notice: done"]


def test_notify_in_a_run_is_an_event() -> None:
    bench = LeafTestBench()
    heard: list[Event] = []
    leaf = bench.put(Notify("notify"), text="done")
    executive = Executive(leaf, bench.run, EventStream([heard.append]))
    assert executive.tick() is SUCCESS
    (event,) = (each for each in heard if isinstance(each, Notified))
    assert (event.tick, event.text, event.t) == (1, "done", bench.clock.now())
    assert event.as_dict()["event"] == "notice"
