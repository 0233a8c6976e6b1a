"""The tick loop does what the specification says, on a clock that only its waits move: no test here waits in real time
but the two with threads.
"""

from collections.abc import Callable
from threading import Event, Thread
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.clock import ManualClock, SystemClock
from missions.executive import events
from missions.executive.executive import STOP_POLL_INTERVAL, Result
from tests.conformance.scene import PERIOD, Scene, Simulated


@pytest.fixture
def scene() -> Simulated:
    return Simulated()


def test_run_succeeds_with_its_tree() -> None:
    assert Simulated("probe: [running, running, success]").play() == Result("run", "success", "", about(2 * PERIOD), 3)


def test_run_fails_with_the_reason_of_its_tree() -> None:
    result = Simulated("probe: {outcomes: [running, failure], because: no face for 60 s}").play()
    assert (result.result, result.reason, result.ticks) == ("failure", "no face for 60 s", 2)


def test_ticks_follow_an_absolute_schedule(scene: Simulated) -> None:
    scene.at_tick = lambda number: _spend(scene.clock, 0.1 if number % 2 else 0.0)
    scene.play({0.7: scene.stop})
    assert scene.ticks == about([0.0, 0.125, 0.25, 0.375, 0.5, 0.625])
    assert scene.executive.overruns == 0


def test_missed_ticks_are_counted_and_not_repeated(scene: Simulated) -> None:
    scene.at_tick = lambda number: _spend(scene.clock, 0.3) if number == 2 else None
    scene.play({0.7: scene.stop})
    assert scene.ticks == about([0.0, 0.125, 0.5, 0.625])  # the second lasted until 0.425
    assert scene.executive.overruns == 2


def test_late_tick_reports_its_delay(scene: Simulated) -> None:
    scene.play({0.1: lambda: _spend(scene.clock, 0.3), 0.6: scene.stop})  # as if the machine had been busy
    late = [event.late for event in scene.told if isinstance(event, events.Ticked)]
    assert late[0] is None
    assert late[1] == about(0.4 - PERIOD)
    assert scene.executive.overruns == 2


def test_a_wake_up_brings_the_next_tick_forward_and_leaves_the_schedule_alone(scene: Simulated) -> None:
    scene.play({0.05: scene.run.wake, 0.2: scene.run.wake, 0.4: scene.stop})
    assert scene.ticks == about([0.0, 0.05, 0.125, 0.2, 0.25, 0.375])
    assert scene.executive.overruns == 0


def test_a_wake_up_during_a_tick_makes_the_next_one_follow_at_once(scene: Simulated) -> None:
    scene.at_tick = lambda number: scene.run.wake() if number == 1 else None
    scene.play({0.2: scene.stop})
    assert scene.ticks == about([0.0, 0.0, 0.125])


@settings(deadline=None)
@given(st.lists(st.integers(1, 199), unique=True), st.integers(0, 30))
def test_no_wake_up_is_ever_slept_through(wakes: list[int], cost: int) -> None:
    scene = Simulated()
    scene.at_tick = lambda _: _spend(scene.clock, cost / 100)
    times = [wake / 100 for wake in wakes]
    scene.play({**dict.fromkeys(times, scene.run.wake), 2.0: scene.stop})
    for time in times:
        assert any(time <= tick <= time + cost / 100 + 1e-9 for tick in scene.ticks), f"nothing came of {time}"


def test_stop_halts_the_tree_at_once_with_its_reason() -> None:
    scene = Simulated("{probe: running, name: a}")
    result = scene.play({0.3: lambda: scene.executive.stop("Ctrl-C")})
    assert result == Result("run", "interrupted", "Ctrl-C", about(0.3), 3)
    assert scene.run.log == ["a starts", "a halts"]
    last = scene.told[-1]
    assert isinstance(last, events.NodeChanged)
    assert (last.name, last.status) == ("a", "idle")


def test_a_stop_before_the_first_tick_starts_nothing(scene: Simulated) -> None:
    scene.stop()
    assert scene.play() == Result("run", "interrupted", "told to", 0.0, 0)
    assert scene.told == []


def test_stop_takes_no_lock_and_is_safe_in_signal_handlers() -> None:
    class Held(Event):
        def set(self) -> None:
            pytest.fail("a handler that has interrupted whoever holds this event's lock would wait for ever here")

    scene = Scene("probe: running", ManualClock(), woken=Held())
    scene.executive.stop("Ctrl-C")
    assert scene.executive.loop() == Result("run", "interrupted", "Ctrl-C", 0.0, 0)


def test_a_stop_is_seen_soon_even_where_ticks_are_rare() -> None:
    scene = Simulated("probe: running", rate=0.1)
    assert scene.play({3.0: scene.stop}).seconds == about(3.0, within=STOP_POLL_INTERVAL)
    assert scene.ticks == [0.0]


def test_stop_in_the_last_tick_keeps_the_result() -> None:
    scene = Simulated("probe: success")
    scene.at_tick = lambda _: scene.stop()
    assert scene.play().result == "success"


def test_final_halt_gets_its_ticks() -> None:
    scene = Simulated("{probe: {outcomes: running, halts_in: 2}, name: a}")
    result = scene.play({0.3: scene.stop})
    assert (result.result, result.seconds) == ("interrupted", about(0.3 + 2 * PERIOD))
    assert scene.run.log == ["a starts", "a halts"]


def test_leaf_that_does_not_halt_is_safe_stopped_at_the_end() -> None:
    scene = Simulated("{base_probe: {outcomes: running, halts_in: 99}, name: a}")
    result = scene.play({0.25: scene.stop})
    assert (result.result, result.seconds) == ("interrupted", about(1.25))
    assert scene.run.log == ["a starts", "a halts", "base settled"]


def test_final_halt_is_limited_to_two_seconds() -> None:
    scene = Simulated("{patient_probe: {outcomes: running, halts_in: 99}, name: a}")
    result = scene.play({0.25: scene.stop})
    assert (result.result, result.seconds) == ("interrupted", about(2.25))
    assert scene.run.log == ["a starts", "a halts", "base settled"]
    last = scene.told[-1]
    assert isinstance(last, events.NodeChanged)
    assert (last.name, last.status) == ("a", "idle")


def test_paused_mission_keeps_its_place_and_its_actuators_hold() -> None:
    scene = Simulated("{sequence: [{probe: success, name: a}, {base_probe: running, name: b}]}")
    settled = scene.settled()
    scene.play({0.2: scene.executive.pause, 0.6: scene.executive.resume, 0.8: scene.stop})
    assert scene.ticks == about([0.0, 0.125, 0.6, 0.725])
    assert settled == about([0.2])
    assert scene.run.log == ["a starts", "a ends success", "b starts", "b halts"]
    assert scene.executive.overruns == 0


def test_a_wake_up_does_not_tick_a_paused_mission(scene: Simulated) -> None:
    scene.play({0.2: scene.executive.pause, 0.3: scene.run.wake, 0.5: scene.stop})
    assert scene.ticks == about([0.0, 0.125])


def test_a_paused_mission_can_be_stepped_one_tick_at_a_time() -> None:
    scene = Simulated("base_probe: running")
    settled = scene.settled()
    step = scene.executive.step
    scene.play({0.2: scene.executive.pause, 0.3: step, 0.8: step, 1.5: scene.stop})
    assert scene.ticks == about([0.0, 0.125, 0.3, 0.8])
    assert settled == about([0.2, 0.3 + PERIOD, 0.8 + PERIOD])  # a step lasts as long as any tick


def test_mission_can_be_paused_before_its_start(scene: Simulated) -> None:
    scene.executive.pause()
    scene.play({0.5: scene.executive.step, 1.0: scene.stop})
    assert scene.ticks == about([0.5])


def test_a_stop_ends_a_paused_mission() -> None:
    scene = Simulated("{base_probe: running, name: a}")
    result = scene.play({0.2: scene.executive.pause, 9.0: lambda: scene.executive.stop("SIGTERM")})
    assert (result.result, result.reason, result.seconds) == (
        "interrupted",
        "SIGTERM",
        about(9.0, within=STOP_POLL_INTERVAL),
    )
    assert scene.run.log == ["a starts", "base settled", "a halts"]


def test_run_emits_its_events_in_order() -> None:
    scene = Simulated("{probe: [running, success], name: a}")
    scene.executive.emit_start(file="run.yaml", robot="probes", params={})
    scene.executive.emit_end(scene.play())
    assert [event.event for event in scene.told] == ["started", "node_changed", "tick", "node_changed", "tick", "ended"]
    assert [event.tick for event in scene.told if isinstance(event, events.Ticked)] == [1, 2]


def test_wake_from_another_thread_ticks_at_once() -> None:
    scene = Scene("probe: running", SystemClock(), rate=0.01)  # by the schedule, the second tick is 100 s away

    def wake_often() -> None:
        for number in range(1, 51):
            _until(scene, number)
            scene.run.wake()
        _until(scene, 51)

    _beside(scene, wake_often)
    assert len(scene.ticks) == 51


def test_no_step_is_lost_from_however_many_threads() -> None:
    scene = Scene("probe: running", SystemClock(), rate=2000.0)
    scene.executive.pause()

    def step_often() -> None:
        for _ in range(50):
            scene.executive.step()

    def all_step() -> None:
        threads = [Thread(target=step_often) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        _until(scene, 200)

    _beside(scene, all_step)
    assert len(scene.ticks) == 200


def _beside(scene: Scene, act: Callable[[], object]) -> None:
    """Run the loop on a thread of its own while ``act`` is done; stop it then, whatever happens."""
    loop = Thread(target=scene.executive.loop)
    loop.start()
    try:
        act()
    finally:
        scene.executive.stop("the test is over")
        loop.join(10.0)


def _until(scene: Scene, ticks: int) -> None:
    """Wait in real time, but not for ever, for that many ticks."""
    pause, clock = Event(), SystemClock()
    while len(scene.ticks) < ticks:
        assert clock.now() < 20.0, f"only {len(scene.ticks)} of {ticks} ticks"
        pause.wait(0.001)


def about(expected: Any, *, within: float = 1e-9) -> Any:
    """Compare times but for their rounding."""
    return pytest.approx(expected, abs=within)


def _spend(clock: ManualClock, seconds: float) -> None:
    clock.advance(seconds)
