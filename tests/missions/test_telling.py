"""What the stream hears of commands of the base that no behaviour gives."""

import pytest

from behaviours.run import RunState
from drivers.api import Source, Steering, Velocity
from drivers.clock import ManualClock
from missions.executive.event_reporter import EventReporter
from missions.executive.events import CommandSent, Event
from missions.executive.stream import EventStream

STILL = Velocity(0.0, 0.0)


@pytest.fixture
def events() -> list[Event]:
    return []


@pytest.fixture
def teller(events: list[Event]) -> EventReporter:
    return EventReporter(RunState(ManualClock()), EventStream([events.append]))


def commands(events: list[Event]) -> list[tuple[str, object]]:
    return [(event.source, event.values) for event in events if isinstance(event, CommandSent)]


def test_mission_steering_is_not_reported_twice(events: list[Event], teller: EventReporter) -> None:
    ahead = Velocity(0.2, 0.0)
    teller.on_steering(Steering(Source.MISSION, ahead, ahead))
    teller.on_steering(Steering(Source.MISSION, ahead, STILL, "bumper centre"))
    teller.on_steering(Steering(None, STILL, STILL))
    assert commands(events) == []


def test_reflex_is_reported_with_velocity_reason_and_end(events: list[Event], teller: EventReporter) -> None:
    back = Velocity(-0.1, 0.4)
    teller.on_steering(Steering(Source.SAFETY, back, back, "backing off: bumper right"))
    teller.on_steering(Steering(None, STILL, STILL))
    assert commands(events) == [
        ("safety", {"linear": -0.1, "angular": 0.4, "reason": "backing off: bumper right"}),
        ("safety", {"linear": 0.0, "angular": 0.0}),
    ]


def test_teleop_is_reported_with_requested_and_permitted_velocity(events: list[Event], teller: EventReporter) -> None:
    teller.on_steering(Steering(Source.TELEOP, Velocity(0.7, 0.0), Velocity(0.3, 0.0), "limited"))
    assert commands(events) == [
        (
            "teleop",
            {"linear": 0.3, "angular": 0.0, "requested_linear": 0.7, "requested_angular": 0.0, "reason": "limited"},
        )
    ]


def test_latched_base_is_reported_with_source_safety(events: list[Event], teller: EventReporter) -> None:
    ahead = Velocity(0.2, 0.0)
    teller.on_steering(Steering(Source.MISSION, ahead, ahead))
    teller.on_steering(Steering(None, STILL, STILL, "button 0 was pressed"))
    teller.on_steering(Steering(None, STILL, STILL))
    assert commands(events) == [("safety", {"linear": 0.0, "angular": 0.0, "reason": "button 0 was pressed"})]
