"""The queue and time: what is due, missed, repeated and tried again, also where the clock is put back."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from missions.plugins.tasks.queue import RETRY_INTERVAL
from missions.plugins.tasks.task import AttemptOutcome, How, NewTask, RetryPolicy
from tests.missions.service.small_queue import START, Shop, new, shop


@pytest.fixture
def queue(tmp_path: Path) -> Iterator[Shop]:
    with shop(tmp_path / "tasks.db") as opened:
        yield opened


def test_repetition_is_scheduled_after_any_result(queue: Shop) -> None:
    first = queue.add(new(every="day 12:00", policy=RetryPolicy("give-up")))
    hows: list[How] = ["success", "failure", "interrupted"]
    for days, how in enumerate(hows, start=1):
        queue.attempt(how)
        (task,) = queue.queue.tasks(ended=False)
        assert (task.due, task.series) == (START + days * 86400.0, first)
        assert (task.attempts, task.failures, task.policy) == (0, 0, RetryPolicy("give-up"))
        queue.now = task.due


def test_repetitions_missed_during_a_run_are_skipped(queue: Shop) -> None:
    queue.add(new(every="60 s"))
    claim = queue.claim()
    queue.now += 200.0
    queue.queue.finish(claim, AttemptOutcome("success"), queue.now)
    (task,) = queue.queue.tasks(ended=False)
    assert task.due == START + 240.0


def test_task_without_a_time_ignores_the_clock(queue: Shop) -> None:
    number = queue.add(NewTask(mission="greet", late=3600.0))
    queue.now -= 10 * 365 * 86400.0
    assert queue.claim().task.id == number


def test_lateness_of_a_task_without_time_counts_from_its_addition(queue: Shop) -> None:
    number = queue.add(new(due=0.0, late=60.0))
    queue.now += 61.0
    assert queue.queue.claim(queue.now) is None
    assert queue.told(number) == [
        f"greet (task {number}) was missed: it was due at 2026-11-21 12:00, and does not begin more than 60 s later"
    ]


@pytest.mark.parametrize(("every", "due"), [("1800 s", 1800.0), ("day 12:00", 0.0), ("day 18:00", 6 * 3600.0)])
def test_distant_repetition_is_rescheduled_after_the_clock_is_set_back(queue: Shop, every: str, due: float) -> None:
    right, years = queue.now - 60.0, 4 * 365 * 86400.0
    queue.now += years
    queue.add(new(due=queue.now, every=every))
    queue.attempt("success")
    queue.now = right
    assert queue.queue.claim(queue.now) is None
    (task,) = queue.queue.tasks(ended=False)
    assert task.due == (right + due if every == "1800 s" else START + due)
    queue.now = task.due
    assert queue.attempt("success").state == "done"


def test_expected_time_of_a_distant_repetition_needs_no_server(queue: Shop) -> None:
    right, years = queue.now, 174 * 365 * 86400.0
    queue.now += years
    queue.add(new(due=queue.now, every="1800 s"))
    queue.attempt("success")
    (task,) = queue.queue.tasks(ended=False)
    assert task.due > right + years
    assert queue.queue.expected_time(task, right) == right + 1800.0


def test_later_task_is_not_rescheduled(queue: Shop) -> None:
    queue.add(new(due=START + 30 * 86400.0, every="1800 s"))
    queue.queue.claim(queue.now)
    assert [task.due for task in queue.queue.tasks()] == [START + 30 * 86400.0]


def test_clock_jitter_does_not_repeat_a_daily_task(queue: Shop) -> None:
    queue.add(new(every="day 12:00"))
    queue.attempt("success")
    queue.now = START - 0.5
    assert queue.queue.claim(queue.now) is None
    assert [task.due for task in queue.queue.tasks(ended=False)] == [START + 86400.0]


def test_unreadable_repetition_ends_with_a_reason(queue: Shop) -> None:
    number = queue.add(new(every="1e15 s"))
    task = queue.attempt("failure", "no camera")
    assert (task.state, task.reason) == (
        "failed",
        "no camera; it is not repeated: '1e15 s' is too rare: at most a year, 8784 h",
    )
    assert [each.id for each in queue.queue.tasks()] == [number]


def test_missed_task_is_reported_and_its_repetition_waits(queue: Shop) -> None:
    number = queue.add(new(due=START, late=3600.0, every="day 12:00"))
    other = queue.add(new(due=START + 1.0))
    queue.now += 5 * 3600.0
    assert queue.claim().task.id == other
    task = queue.queue.task(number)
    assert (task.state, task.attempts) == ("given_up", 0)
    assert queue.told(number) == [
        f"greet (task {number}) was missed: it was due at 2026-11-21 12:00, and does not begin more than 3600 s later"
    ]
    assert [each.due for each in queue.queue.tasks(ended=False) if each.state == "waiting"] == [START + 86400.0]


def test_task_within_its_lateness_limit_runs(queue: Shop) -> None:
    number = queue.add(new(due=START, late=3600.0))
    queue.now += 3600.0
    assert queue.claim().task.id == number


def test_interrupted_task_that_began_in_time_is_not_missed(queue: Shop) -> None:
    number = queue.add(new(due=START, late=60.0))
    queue.attempt("interrupted")
    queue.now += 3600.0
    assert queue.claim().task.id == number


def test_retry_waits_while_other_tasks_run(queue: Shop) -> None:
    number, other = queue.add(new(policy=RetryPolicy(retries=1))), queue.add(new())
    queue.queue.finish(queue.claim(), AttemptOutcome("error", "no camera"), queue.now)
    assert queue.queue.finish(queue.claim(), AttemptOutcome("success"), queue.now).id == other
    queue.now += RETRY_INTERVAL - 1.0
    assert queue.queue.claim(queue.now) is None
    assert queue.queue.has_pausing_task(queue.now)
    queue.now += 1.0
    assert not queue.queue.has_pausing_task(queue.now)
    assert queue.claim().task.id == number


def test_a_pause_is_over_when_the_clock_is_put_back(queue: Shop) -> None:
    number = queue.add(new(due=0.0, policy=RetryPolicy(retries=1)))
    queue.queue.finish(queue.claim(), AttemptOutcome("error", "no camera"), queue.now)
    queue.now -= 86400.0
    assert queue.claim().task.id == number
