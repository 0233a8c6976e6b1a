"""Simulated time: what is due happens in order, at its time, and never by the machine's clock."""

from functools import partial

from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.timeline import Timeline

times = st.floats(0.0, 100.0)


@given(st.lists(times))
def test_timeline_calls_are_in_order_of_time(due: list[float]) -> None:
    timeline = Timeline()
    happened: list[tuple[float, float]] = []

    def happen(time: float) -> None:
        happened.append((time, timeline.clock.now()))

    for time in due:
        timeline.call_at(time, partial(happen, time))
    timeline.run_until(100.0)
    assert [asked for asked, _ in happened] == sorted(due)
    assert all(asked == was for asked, was in happened)
    assert timeline.clock.now() == 100.0


def test_simultaneous_calls_are_in_order_of_request() -> None:
    timeline = Timeline()
    happened: list[str] = []
    for word in ("one", "two", "three"):
        timeline.call_at(1.0, partial(happened.append, word))
    timeline.run_until(2.0)
    assert happened == ["one", "two", "three"]


def test_repeated_calls_follow_an_absolute_schedule() -> None:
    timeline = Timeline()
    ticks: list[float] = []
    timeline.call_every(0.1, lambda: ticks.append(timeline.clock.now()))
    timeline.run_until(100.0)
    assert ticks == [number * 0.1 for number in range(1001)]


def test_run_until_stops_at_its_condition() -> None:
    timeline = Timeline()
    ticks: list[float] = []
    timeline.call_every(1.0, lambda: ticks.append(timeline.clock.now()))
    timeline.run_until(10.0, lambda: len(ticks) == 3)
    assert timeline.clock.now() == 2.0
    timeline.run_until(10.0)
    assert len(ticks) == 11


def test_overdue_call_happens_at_the_next_step() -> None:
    timeline = Timeline()
    timeline.run_until(5.0)
    happened: list[float] = []
    timeline.call_at(1.0, lambda: happened.append(timeline.clock.now()))
    timeline.run_until(5.0)
    assert happened == [5.0]
