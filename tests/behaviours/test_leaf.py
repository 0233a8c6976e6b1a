"""What every leaf can count on: how it starts, how it ends, and that it is always stopped."""

import logging
import threading
from collections.abc import Callable
from typing import Any

import pytest
from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf, argument
from behaviours.robot import Robot
from drivers.errors import DeviceFault, NoReply
from missions.plugins.testing.recorders import OFFLINE_ERROR, LeafTestBench

INVALID = Status.INVALID

BASE = frozenset({"base"})


class Puppet(Leaf):
    """Does what it is told, and writes down what was asked of it."""

    tag = "puppet"
    drives = BASE
    starts: Callable[[], None] | None = None
    works: Callable[[], Any] | None = None
    at_end: Callable[[], None] | None = None
    still_halting = 0
    halts: Callable[[], None] | None = None

    def __init__(self, name: str = "puppet") -> None:
        super().__init__(name)
        self.asked: list[object] = []

    def initialise(self) -> None:
        self.asked.append("initialise")
        if self.starts:
            self.starts()

    def update(self) -> Status:
        self.asked.append("update")
        status: Status = RUNNING if self.works is None else self.works()
        return status

    def terminate(self, new_status: Status) -> None:
        self.asked.append(new_status)
        if self.at_end:
            self.at_end()

    def halting(self) -> bool:
        self.asked.append("halting")
        if self.halts:
            self.halts()
        self.still_halting -= 1
        return self.still_halting >= 0


class Boom(Exception):
    """What a leaf may raise."""


def fails_with(error: Exception) -> Callable[[], Any]:
    def act() -> Any:
        raise error

    return act


def gives(*statuses: object) -> Callable[[], Any]:
    rest = iter(statuses)
    return lambda: next(rest)


# --- start, update, end ----------------------------------------------------------------------------------------------


def test_a_leaf_starts_once_and_ends_once() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=gives(RUNNING, RUNNING, SUCCESS))
    assert [bench.tick(leaf) for _ in range(3)] == [RUNNING, RUNNING, SUCCESS]
    assert leaf.asked == ["initialise", "update", "update", "update", SUCCESS]
    assert bench.safe_stops == []


class Careless(Leaf):
    """Says nothing of how it stops."""

    tag = "careless"
    drives = BASE
    works: Callable[[], Any]

    def update(self) -> Status:
        status: Status = self.works()
        return status


def test_leaf_without_terminate_is_safe_stopped_on_halt() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Careless("careless"), works=gives(RUNNING))
    bench.tick(leaf)
    assert bench.safe_stops == []
    assert bench.halt(leaf)
    assert bench.safe_stops == [BASE]


@pytest.mark.parametrize("works", [gives(FAILURE), fails_with(Boom("no")), gives("nonsense")])
def test_leaf_without_terminate_is_safe_stopped_on_failure(works: Callable[[], Any]) -> None:
    bench = LeafTestBench()
    assert bench.tick(bench.put(Careless("careless"), works=works)) is FAILURE
    assert bench.safe_stops == [BASE]


def test_leaf_without_terminate_is_not_stopped_on_success() -> None:
    bench = LeafTestBench()
    assert bench.tick(bench.put(Careless("careless"), works=gives(SUCCESS))) is SUCCESS
    assert bench.safe_stops == []


def test_leaf_restarts_after_success_failure_and_halt() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=gives(SUCCESS, FAILURE, RUNNING, RUNNING))
    bench.tick(leaf)
    bench.tick(leaf)
    bench.tick(leaf)
    assert bench.halt(leaf)
    bench.tick(leaf)
    assert leaf.asked[:6] == ["initialise", "update", SUCCESS, "initialise", "update", FAILURE]
    assert leaf.asked[6:] == ["initialise", "update", INVALID, "halting", "initialise", "update"]


def test_elapsed_counts_from_each_start() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=gives(RUNNING, SUCCESS, RUNNING))
    bench.tick(leaf)
    bench.tick(leaf, after=2.0)
    assert leaf.elapsed == pytest.approx(2.0)
    bench.tick(leaf, after=5.0)
    assert leaf.elapsed == 0.0


def test_elapsed_counts_from_the_first_tick_despite_a_disconnect() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=fails_with(OFFLINE_ERROR))
    bench.tick(leaf)
    bench.tick(leaf, after=3.0)
    assert leaf.elapsed == pytest.approx(3.0)


def test_started_at_is_available_in_initialise() -> None:
    bench = LeafTestBench()
    asked: list[float] = []
    leaf = bench.put(Puppet(), works=gives(RUNNING, SUCCESS, RUNNING))
    leaf.starts = lambda: asked.append(leaf.started_at)
    for after in (1.0, 1.0, 5.0):
        bench.tick(leaf, after=after)
    assert asked == [101.0, 107.0]
    assert leaf.started_at == 107.0


def test_reason_is_cleared_at_the_next_tick() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet())
    leaf.works = lambda: leaf.wait("for the bus")
    bench.tick(leaf)
    assert leaf.reason == "for the bus"
    leaf.works = gives(SUCCESS)
    bench.tick(leaf)
    assert leaf.reason == ""


def test_idle_leaf_runs_until_halted() -> None:
    class Idle(Leaf):
        """Do nothing."""

    bench = LeafTestBench()
    leaf = bench.put(Idle("idle"))
    assert bench.tick(leaf) is RUNNING
    assert bench.halt(leaf)
    assert leaf.status is INVALID


# --- what goes wrong -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "reason"), [(Boom("too hot"), "Boom: too hot"), (Boom(), "Boom"), (RuntimeError("x"), "RuntimeError: x")]
)
def test_exception_in_a_leaf_is_a_failure_with_reason_and_traceback(
    caplog: pytest.LogCaptureFixture, error: Exception, reason: str
) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet("the shelf"), works=fails_with(error))
    leaf.line = 12
    with caplog.at_level(logging.ERROR):
        assert bench.tick(leaf) is FAILURE
    assert leaf.reason == f"the shelf (line 12): {reason}"
    assert leaf.asked[-1] is FAILURE
    (record,) = caplog.records
    assert record.message == "the shelf (line 12) raised"
    assert record.exc_info is not None


@pytest.mark.parametrize("error", [NoReply("base: no answer"), DeviceFault("base: too hot")])
def test_device_error_is_a_failure_without_traceback(caplog: pytest.LogCaptureFixture, error: Exception) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=fails_with(error))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == str(error)
    assert caplog.records == []


def test_leaf_that_raised_in_initialise_is_stopped_and_can_restart() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), starts=fails_with(Boom("no")))
    assert bench.tick(leaf) is FAILURE
    assert leaf.asked == ["initialise", FAILURE]
    leaf.starts = None
    assert bench.tick(leaf) is RUNNING
    assert leaf.asked[2:] == ["initialise", "update"]


@pytest.mark.parametrize("nonsense", [None, True, "success", 0, INVALID, [SUCCESS]])
def test_leaf_that_returns_no_status_fails(nonsense: object) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=gives(nonsense))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == f"puppet: returned {nonsense!r} instead of a status"
    assert leaf.asked[-1] is FAILURE


@pytest.mark.parametrize("status", [RUNNING, SUCCESS, FAILURE])
def test_reason_that_is_not_text_is_shown_as_text(status: Status) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet())

    def grumble() -> Status:
        setattr(leaf, "feedback_message", ValueError("too dark"))  # noqa: B010 - mypy would not have it otherwise
        return status

    leaf.works = grumble
    assert bench.tick(leaf) is status
    assert leaf.reason == "ValueError('too dark')"


def test_a_lost_device_is_waited_for_in_update() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=fails_with(OFFLINE_ERROR))
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    leaf.works = gives(RUNNING, SUCCESS)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == ""
    assert bench.tick(leaf) is SUCCESS
    assert leaf.asked.count("initialise") == 1


def test_initialise_is_retried_until_the_device_is_online() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), starts=fails_with(OFFLINE_ERROR))
    assert [bench.tick(leaf) for _ in range(3)] == [RUNNING] * 3
    assert leaf.reason == "waiting: the cable is out"
    assert leaf.asked == ["initialise"] * 3
    leaf.starts = None
    bench.tick(leaf, after=7.0)
    assert leaf.asked[3:] == ["initialise", "update"]
    assert leaf.elapsed == 0.0


def test_leaf_halted_during_initialise_is_stopped() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), starts=fails_with(OFFLINE_ERROR))
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert leaf.asked == ["initialise", INVALID, "halting"]


@pytest.mark.parametrize("status", [SUCCESS, FAILURE])
def test_leaf_that_raises_in_terminate_is_safe_stopped(caplog: pytest.LogCaptureFixture, status: Status) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=gives(status), at_end=fails_with(Boom("stuck")))
    assert bench.tick(leaf) is status
    assert bench.safe_stops == [BASE]
    assert "raised while it stopped" in caplog.text


def test_device_lost_during_stop_is_safe_stopped_without_traceback(caplog: pytest.LogCaptureFixture) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), at_end=fails_with(OFFLINE_ERROR))
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.safe_stops == [BASE]
    assert caplog.records == []


def test_a_leaf_without_actuators_has_nothing_to_settle() -> None:
    class Thinker(Puppet):
        """Think."""

        drives = frozenset()

    bench = LeafTestBench()
    leaf = bench.put(Thinker(), works=gives(FAILURE), at_end=fails_with(Boom("stuck")))
    assert bench.tick(leaf) is FAILURE
    assert bench.safe_stops == []


def test_failed_safe_stop_does_not_end_the_run(caplog: pytest.LogCaptureFixture) -> None:
    bench = LeafTestBench()
    bench.run.safe_stop = lambda claims: fails_with(Boom(f"{sorted(claims)} on fire"))()
    leaf = bench.put(Puppet(), at_end=fails_with(Boom("stuck")))
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert leaf.status is INVALID
    assert "its actuators could not be stopped" in caplog.text


def test_missing_part_is_a_failure_with_its_name() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet())
    leaf.robot = Robot()
    leaf.works = lambda: leaf.robot.voice.say("hello")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "this robot has no voice"


# --- halting ---------------------------------------------------------------------------------------------------------


def test_only_a_running_leaf_is_halted_and_only_once() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=gives(RUNNING, SUCCESS))
    assert bench.halt(leaf)
    assert leaf.asked == []
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.halt(leaf)
    assert leaf.asked == ["initialise", "update", INVALID, "halting"]
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert leaf.asked[4:] == ["initialise", "update", SUCCESS]


def test_halt_takes_as_many_ticks_as_the_leaf_needs() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), still_halting=2)
    bench.tick(leaf)
    assert [bench.halt(leaf) for _ in range(3)] == [False, False, True]
    assert leaf.asked == ["initialise", "update", INVALID, "halting", "halting", "halting"]
    assert leaf.status is INVALID
    assert bench.safe_stops == []


def test_halting_is_called_once_per_tick() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), still_halting=1)
    bench.tick(leaf)
    assert not leaf.halt()
    assert not leaf.halt()
    assert leaf.asked.count("halting") == 1
    assert bench.halt(leaf)
    assert leaf.halt()
    assert leaf.asked.count("halting") == 2


def test_actuators_are_safe_stopped_after_the_halt_limit() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), still_halting=1000)
    bench.tick(leaf)
    asked = 0
    while not bench.halt(leaf, after=0.25):
        asked += 1
        assert bench.safe_stops == []
    assert asked * 0.25 == leaf.halt_limit
    assert bench.safe_stops == [BASE]
    assert leaf.status is INVALID


def test_leaf_can_raise_its_halt_limit() -> None:
    class Ponderous(Puppet):
        """Take your time."""

        halt_limit = 3.0

    bench = LeafTestBench()
    leaf = bench.put(Ponderous(), still_halting=1000)
    bench.tick(leaf)
    assert not bench.halt(leaf)
    assert not bench.halt(leaf, after=2.9)
    assert bench.halt(leaf, after=0.2)


def test_exception_in_halting_ends_the_halt_with_a_safe_stop(caplog: pytest.LogCaptureFixture) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), halts=fails_with(Boom("stuck")))
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert bench.safe_stops == [BASE]
    assert "raised while it stopped" in caplog.text


def test_leaf_ticked_while_stopping_comes_to_rest_before_it_restarts() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), still_halting=2)
    bench.tick(leaf)
    assert not bench.halt(leaf)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "still stopping"
    assert bench.tick(leaf) is RUNNING
    assert leaf.asked == ["initialise", "update", INVALID, "halting", "halting", "halting", "initialise", "update"]
    assert bench.halt(leaf)
    assert leaf.asked[8:] == [INVALID, "halting"]


def test_a_deadline_of_an_earlier_halt_is_forgotten() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), still_halting=1)
    bench.tick(leaf)
    bench.halt(leaf)
    bench.halt(leaf)
    bench.tick(leaf, after=60.0)
    leaf.still_halting = 2
    assert not bench.halt(leaf)
    assert bench.safe_stops == []


# --- arguments and results -------------------------------------------------------------------------------------------


class Poet(Leaf):
    """Recite."""

    tag = "poet"
    lines: int = argument("count", "how many", default=4, low=1)
    text: str = argument("text", "what", principal=True)


def test_arguments_are_declared_with_their_names_and_defaults() -> None:
    assert list(Poet.arguments) == ["lines", "text"]
    assert Poet.arguments["text"].required
    assert Poet.arguments["text"].principal
    assert not Poet.arguments["lines"].required
    assert Poet.arguments["lines"].low == 1
    assert Poet("p").lines == 4
    assert not hasattr(Poet("p"), "text")


def test_subclass_adds_to_the_arguments_of_its_base() -> None:
    class Bard(Poet):
        """Sing."""

        tune: str = argument("text", "which", default="greensleeves")

    assert list(Bard.arguments) == ["lines", "text", "tune"]
    assert list(Poet.arguments) == ["lines", "text"]


def test_computed_arguments_are_evaluated_at_each_start() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), works=gives(RUNNING, SUCCESS, SUCCESS))
    counter = iter(range(10))
    leaf.computed = {"count": lambda: next(counter)}
    bench.tick(leaf)
    bench.tick(leaf)
    assert vars(leaf)["count"] == 0
    bench.tick(leaf)
    assert vars(leaf)["count"] == 1


@pytest.mark.parametrize("error", [ValueError("there is no 'visitor' yet"), LookupError("there is no 'visitor' yet")])
def test_failed_argument_evaluation_fails_the_leaf_before_its_start(
    caplog: pytest.LogCaptureFixture, error: Exception
) -> None:
    bench = LeafTestBench()
    other = bench.put(Puppet("other"))
    bench.tick(other)
    bench.run.preemptible.append(other)
    leaf = bench.put(Puppet(), computed={"text": fails_with(error)})
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "puppet: text: there is no 'visitor' yet"
    assert leaf.asked == []
    assert other.status is RUNNING
    assert caplog.records == []


def test_as_keeps_the_result_of_a_success_only() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), output_variable="found")

    def find(value: object, status: Status) -> Callable[[], Any]:
        def act() -> Status:
            leaf.result = value
            return status

        return act

    leaf.works = find("a lie", FAILURE)
    bench.tick(leaf)
    assert bench.run.variables == {}
    leaf.works = find("the key", SUCCESS)
    bench.tick(leaf)
    assert bench.run.variables == {"found": "the key"}
    leaf.works = gives(SUCCESS)
    bench.tick(leaf)
    assert bench.run.variables == {"found": None}


def test_output_variable_follows_the_result_of_a_running_leaf() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Puppet(), output_variable="seen")
    bench.tick(leaf)
    assert bench.run.variables == {}
    leaf.result = "a face"
    bench.tick(leaf)
    assert bench.run.variables == {"seen": "a face"}

    bench.halt(leaf)
    bench.run.variables.clear()
    bench.tick(leaf)
    assert bench.run.variables == {}


# --- making way ------------------------------------------------------------------------------------------------------


def test_preempted_leaf_is_at_rest_before_the_next_starts() -> None:
    bench = LeafTestBench()
    slow = bench.put(Puppet("slow"), still_halting=1)
    bench.tick(slow)
    bench.run.preemptible.append(slow)
    leaf = bench.put(Puppet())
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting for another behaviour to stop"
    assert leaf.asked == []
    bench.tick(leaf)
    assert slow.status is INVALID
    assert leaf.asked == ["initialise", "update"]


def test_leaf_waiting_for_preemption_has_nothing_to_stop() -> None:
    bench = LeafTestBench()
    slow = bench.put(Puppet("slow"), still_halting=5)
    bench.tick(slow)
    bench.run.preemptible.append(slow)
    leaf = bench.put(Puppet())
    bench.tick(leaf)
    assert bench.halt(leaf)
    assert leaf.asked == []


def test_leaf_without_claims_preempts_no_leaf() -> None:
    class Thinker(Puppet):
        """Think."""

        drives = frozenset()

    bench = LeafTestBench()
    other = bench.put(Puppet("other"))
    bench.tick(other)
    bench.run.preemptible.append(other)
    bench.tick(bench.put(Thinker()))
    assert other.status is RUNNING


def test_wake_from_another_thread_arrives() -> None:
    bench = LeafTestBench()
    thread = threading.Thread(target=bench.run.wake)
    thread.start()
    assert bench.run.wake_event.wait(5.0)
    thread.join()
