"""The queue: what becomes of tasks, whatever becomes of the attempts at them."""

import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from missions.tasks.task import How, Outcome, Policy, State, TaskError
from tests.missions.tasks.small_queue import START, Shop, new, shop


@pytest.fixture
def queue(tmp_path: Path) -> Iterator[Shop]:
    with shop(tmp_path / "tasks.db") as opened:
        yield opened


def test_tasks_are_done_in_the_order_in_which_they_are_due(queue: Shop) -> None:
    later, sooner, last = (queue.add(new(due=START + after)) for after in (2.0, 1.0, 2.0))
    assert queue.queue.claim(queue.now) is None
    queue.now += 3.0
    assert [queue.attempt("success").id for _ in range(3)] == [sooner, later, last]
    assert queue.queue.claim(queue.now) is None


def test_a_task_is_what_was_added(queue: Shop) -> None:
    wanted = replace(new("mine.yaml", due=START, late=60.0), robot="r.yaml", options=("--simulate=fast",))
    number = queue.add(wanted)
    task = queue.queue.task(number)
    assert {name: getattr(task, name) for name in type(wanted).__dataclass_fields__} == {
        name: getattr(wanted, name) for name in type(wanted).__dataclass_fields__
    }
    assert (task.state, task.attempts, task.ended) == ("waiting", 0, False)


def test_success_is_told_to_every_channel_once(queue: Shop) -> None:
    number = queue.add(new())
    assert queue.attempt("success").state == "done"
    for channel in ("home", "away"):
        assert queue.told(number, channel) == [f"greet (task {number}) is done"]
    assert len({letter.notice.id for letter in queue.outbox.of(number)}) == 1


@pytest.mark.parametrize(
    ("policy", "hows", "state", "kinds"),
    [
        (Policy(), ["failure"], "failed", ["failed"]),
        (Policy(retries=1), ["failure", "success"], "done", ["retried", "done"]),
        (Policy(retries=1), ["error", "failure"], "failed", ["retried", "failed"]),
        (Policy(), ["interrupted", "interrupted", "success"], "done", ["interrupted", "interrupted", "done"]),
        (Policy(), ["interrupted"] * 3, "given_up", ["interrupted", "interrupted", "given_up"]),
        (Policy("give-up"), ["interrupted"], "given_up", ["given_up"]),
        (
            Policy(retries=1),
            ["interrupted", "failure", "interrupted", "failure"],
            "failed",
            ["interrupted", "retried", "interrupted", "failed"],
        ),
    ],
)
def test_what_did_not_succeed_is_tried_again_as_its_policy_says(
    queue: Shop, policy: Policy, hows: list[How], state: State, kinds: list[str]
) -> None:
    number = queue.add(new(policy=policy))
    states = [queue.attempt(how, "why").state for how in hows]
    assert states == ["waiting"] * (len(hows) - 1) + [state]
    assert queue.kinds(number) == kinds
    assert [attempt.how for attempt in queue.queue.attempts(number)] == hows
    assert queue.queue.claim(queue.now + 1e6) is None


def test_an_end_is_told_with_its_reason(queue: Shop) -> None:
    number = queue.add(new())
    queue.attempt("failure", "Ana was not found")
    assert queue.told(number) == [f"greet (task {number}) failed: Ana was not found"]
    assert queue.queue.task(number).reason == "Ana was not found"


def test_what_a_crash_cut_off_is_interrupted_and_goes_first_again(queue: Shop) -> None:
    number, other = queue.add(new()), queue.add(new())
    queue.claim()
    queue.now += 60.0
    (task,) = queue.queue.recover(queue.now)
    assert (task.id, task.state) == (number, "waiting")
    assert queue.told(number) == [
        f"greet (task {number}) was interrupted: the machine or the server went down; it is tried again"
    ]
    assert [queue.attempt("success").id for _ in range(2)] == [number, other]
    assert queue.queue.recover(queue.now) == []


def test_an_attempt_ends_once(queue: Shop) -> None:
    queue.add(new())
    claim = queue.claim()
    queue.queue.recover(queue.now)
    with pytest.raises(TaskError, match="has ended already"):
        queue.queue.finish(claim, Outcome("success"), queue.now)
    assert queue.attempt("success").state == "done"
    with pytest.raises(TaskError, match="has ended already"):
        queue.queue.finish(claim, Outcome("success"), queue.now)


def test_the_database_itself_refuses_what_must_never_be(queue: Shop) -> None:
    number, other = queue.add(new()), queue.add(new())
    queue.attempt("success")
    with pytest.raises(sqlite3.IntegrityError, match="this task has ended already"):
        queue.connection.execute("UPDATE task SET state = 'waiting' WHERE id = ?", (number,))
    again = "INSERT INTO attempt (task, number, began, ended, how) VALUES (?, 2, 0, 1, 'success')"
    with pytest.raises(sqlite3.IntegrityError):
        queue.connection.execute(again, (number,))
    queue.claim()
    third = queue.add(new())
    with pytest.raises(sqlite3.IntegrityError):
        queue.connection.execute("UPDATE task SET state = 'running' WHERE id = ?", (third,))
    with pytest.raises(sqlite3.IntegrityError):
        queue.connection.execute("UPDATE task SET state = 'lost' WHERE id = ?", (other,))


# Cancelling


def test_one_that_waits_is_cancelled_at_once_and_never_runs(queue: Shop) -> None:
    number = queue.add(new())
    assert queue.queue.cancel(number, queue.now) == "cancelled"
    assert queue.queue.claim(queue.now) is None
    assert queue.told(number) == [], "who cancels knows"


@pytest.mark.parametrize(
    ("how", "state", "kind"),
    [
        ("interrupted", "cancelled", "cancelled"),
        ("success", "done", "done"),
        ("failure", "failed", "failed"),
    ],
)
def test_one_that_runs_is_cancelled_unless_it_ends_first(queue: Shop, how: How, state: State, kind: str) -> None:
    number = queue.add(new(policy=Policy(retries=5), every="day 12:00"))
    claim = queue.claim()
    assert not queue.queue.cancelling(claim)
    assert queue.queue.cancel(number, queue.now) == "running"
    assert queue.queue.cancelling(claim)
    assert queue.queue.finish(claim, Outcome(how), queue.now).state == state
    assert queue.kinds(number) == [kind]
    assert queue.queue.tasks(ended=False) == [], "it does not come again"


def test_a_task_that_was_to_be_cancelled_when_all_went_down_is(queue: Shop) -> None:
    number = queue.add(new())
    queue.claim()
    queue.queue.cancel(number, queue.now)
    (task,) = queue.queue.recover(queue.now)
    assert task.state == "cancelled"


def test_what_cannot_be_cancelled_says_why(queue: Shop) -> None:
    number = queue.add(new())
    queue.attempt("success")
    with pytest.raises(TaskError, match=f"task {number} has ended already: it is done"):
        queue.queue.cancel(number, queue.now)
    with pytest.raises(TaskError, match="there is no task 99") as raised:
        queue.queue.cancel(99, queue.now)
    assert raised.value.hint == "mission task list --all"


# Time


def test_a_repetition_comes_again_however_it_ended(queue: Shop) -> None:
    first = queue.add(new(every="day 12:00", policy=Policy("give-up")))
    hows: list[How] = ["success", "failure", "interrupted"]
    for days, how in enumerate(hows, start=1):
        queue.attempt(how)
        (task,) = queue.queue.tasks(ended=False)
        assert (task.due, task.series) == (START + days * 86400.0, first)
        assert (task.attempts, task.failures, task.policy) == (0, 0, Policy("give-up"))
        queue.now = task.due


def test_repetitions_that_passed_while_it_ran_are_not_made_up_for(queue: Shop) -> None:
    queue.add(new(every="60 s"))
    claim = queue.claim()
    queue.now += 200.0
    queue.queue.finish(claim, Outcome("success"), queue.now)
    (task,) = queue.queue.tasks(ended=False)
    assert task.due == START + 240.0


def test_a_task_that_was_missed_is_told_and_the_next_one_waits(queue: Shop) -> None:
    number = queue.add(new(due=START, late=3600.0, every="day 12:00"))
    other = queue.add(new(due=START + 1.0))
    queue.now += 5 * 3600.0
    assert queue.claim().task.id == other
    task = queue.queue.task(number)
    assert (task.state, task.attempts) == ("given_up", 0)
    assert queue.told(number) == [
        f"greet (task {number}) was missed: it was due at 2026-11-21 12:00, and is not begun more than 3600 s later"
    ]
    assert [each.due for each in queue.queue.tasks(ended=False) if each.state == "waiting"] == [START + 86400.0]


def test_a_task_that_is_late_within_its_limit_runs(queue: Shop) -> None:
    number = queue.add(new(due=START, late=3600.0))
    queue.now += 3600.0
    assert queue.claim().task.id == number


def test_one_that_was_begun_in_time_and_interrupted_is_not_missed(queue: Shop) -> None:
    number = queue.add(new(due=START, late=60.0))
    queue.attempt("interrupted")
    queue.now += 3600.0
    assert queue.claim().task.id == number


def test_what_a_mission_says_is_told_in_its_words(queue: Shop) -> None:
    number = queue.add(new())
    claim = queue.claim()
    for turn, text in enumerate(("Ana is here", "Ana is here"), start=1):
        queue.queue.say(claim, turn, text, queue.now)
    letters = [letter for letter in queue.outbox.of(number) if letter.channel == "away"]
    assert [letter.notice.text for letter in letters] == ["Ana is here", "Ana is here"]
    assert len({letter.notice.id for letter in letters}) == 2
