"""The queue: what becomes of tasks, whatever becomes of the attempts at them."""

import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from missions.plugins.tasks.task import AttemptOutcome, How, RetryPolicy, State, TaskError
from tests.missions.service.small_queue import CHANNELS, RETRY, START, Shop, new, shop


@pytest.fixture
def queue(tmp_path: Path) -> Iterator[Shop]:
    with shop(tmp_path / "tasks.db") as opened:
        yield opened


def test_tasks_are_claimed_in_order_of_their_due_times(queue: Shop) -> None:
    later, sooner, last = (queue.add(new(due=START + after)) for after in (2.0, 1.0, 2.0))
    assert queue.queue.claim(queue.now) is None
    queue.now += 3.0
    assert [queue.attempt("success").id for _ in range(3)] == [sooner, later, last]
    assert queue.queue.claim(queue.now) is None


def test_due_task_with_the_highest_priority_is_first(queue: Shop) -> None:
    plain, low, high = queue.add(new()), queue.add(new(priority=-1)), queue.add(new(due=START + 1.0, priority=5))
    also_high, ahead = queue.add(new(due=START + 2.0, priority=5)), queue.add(new(due=START + 1e6, priority=9))
    assert [task.id for task in queue.queue.tasks()] == [ahead, high, also_high, plain, low]
    queue.now += 3.0
    assert [queue.attempt("success").id for _ in range(4)] == [high, also_high, plain, low]


def test_repetition_keeps_its_priority(queue: Shop) -> None:
    queue.add(new(priority=5, every="60 s"))
    queue.attempt("success")
    assert [task.priority for task in queue.queue.tasks(ended=False)] == [5]


def test_task_without_a_time_is_ordered_by_its_addition(queue: Shop) -> None:
    timed = queue.add(new(due=START + 1.0))
    queue.now += 2.0
    at_once = queue.add(new(due=0.0))
    assert [queue.attempt("success").id for _ in range(2)] == [timed, at_once]


def test_the_order_is_read_from_an_index(queue: Shop) -> None:
    statements: list[str] = []
    queue.connection.set_trace_callback(statements.append)
    queue.queue.claim(queue.now)
    (due,) = [statement for statement in statements if "LIMIT 1" in statement]
    plan = [row["detail"] for row in queue.connection.execute(f"EXPLAIN QUERY PLAN {due}")]
    assert plan == ["SCAN task USING INDEX waiting"]


def test_text_that_is_not_utf_8_is_refused(queue: Shop) -> None:
    for task in (replace(new(), mission="Ren\udce9.yaml"), replace(new(), params={"to": "Ren\udce9"})):
        with pytest.raises(TaskError, match=r"'Ren\\udce9.*' cannot be stored: it is not UTF-8"):
            queue.add(task)
    assert queue.queue.tasks() == []


def test_users_mission_is_named_after_its_file(queue: Shop) -> None:
    assert [new(name).name for name in ("greet", "motions/square", "/missions/my/tell.yaml")] == [
        "greet",
        "motions/square",
        "tell",
    ]
    number = queue.add(new("/missions/tell.yaml"))
    queue.attempt("success")
    (letter, _) = queue.outbox.notices_of(number)
    assert (letter.notice.text, letter.notice.mission) == (f"tell (task {number}) is done", "/missions/tell.yaml")


def test_stored_task_equals_the_added_one(queue: Shop) -> None:
    wanted = replace(new("mine.yaml", due=START, late=60.0), robot="r.yaml", options=("--simulate=fast",))
    number = queue.add(wanted)
    wanted = replace(wanted, channels=CHANNELS)  # as they are now
    task = queue.queue.task(number)
    assert {name: getattr(task, name) for name in type(wanted).__dataclass_fields__} == {
        name: getattr(wanted, name) for name in type(wanted).__dataclass_fields__
    }
    assert (task.state, task.attempts, task.has_ended) == ("waiting", 0, False)


def test_success_is_reported_to_every_channel_once(queue: Shop) -> None:
    number = queue.add(new())
    assert queue.attempt("success").state == "done"
    for channel in ("home", "away"):
        assert queue.told(number, channel) == [f"greet (task {number}) is done"]
    assert len({letter.notice.id for letter in queue.outbox.notices_of(number)}) == 1


@pytest.mark.parametrize(
    ("policy", "hows", "state", "kinds"),
    [
        (RetryPolicy(), ["failure"], "failed", ["failed"]),
        (RetryPolicy(retries=1), ["failure", "success"], "done", ["retried", "done"]),
        (RetryPolicy(retries=1), ["error", "failure"], "failed", ["retried", "failed"]),
        (RETRY, ["interrupted", "interrupted", "success"], "done", ["interrupted", "interrupted", "done"]),
        (RETRY, ["interrupted"] * 3, "given_up", ["interrupted", "interrupted", "given_up"]),
        (RetryPolicy("give-up"), ["interrupted"], "given_up", ["given_up"]),
        (RetryPolicy("retry", retries=1), ["interrupted", "cancelled"], "cancelled", ["interrupted", "cancelled"]),
        (
            RetryPolicy("retry", retries=1),
            ["interrupted", "failure", "interrupted", "failure"],
            "failed",
            ["interrupted", "retried", "interrupted", "failed"],
        ),
    ],
)
def test_unsuccessful_task_is_retried_by_its_policy(
    queue: Shop, policy: RetryPolicy, hows: list[How], state: State, kinds: list[str]
) -> None:
    number = queue.add(new(policy=policy))
    states = [queue.attempt(how, "why").state for how in hows]
    assert states == ["waiting"] * (len(hows) - 1) + [state]
    assert queue.kinds(number) == kinds
    assert [attempt.how for attempt in queue.queue.attempts(number)] == hows
    assert queue.queue.claim(queue.now + 1e6) is None


def test_task_that_a_person_has_ended_runs_at_its_next_time(queue: Shop) -> None:
    number = queue.add(new(every="60 s"))
    assert queue.attempt("cancelled", "halted by Ann").state == "cancelled"
    assert queue.told(number) == ["greet (task 1) was ended: halted by Ann; it is not tried again"]
    queue.now += 60.0
    assert queue.claim().task.id > number


def test_failure_is_reported_with_its_reason(queue: Shop) -> None:
    number = queue.add(new())
    queue.attempt("failure", "Ana was not found")
    assert queue.told(number) == [f"greet (task {number}) failed: Ana was not found"]
    assert queue.queue.task(number).reason == "Ana was not found"


def test_task_interrupted_by_a_crash_is_claimed_first(queue: Shop) -> None:
    number, other = queue.add(new()), queue.add(new())
    queue.claim()
    queue.now += 60.0
    (task,) = queue.queue.recover(queue.now)
    assert (task.id, task.state) == (number, "waiting")
    assert queue.told(number) == [
        f"greet (task {number}) was interrupted: the computer or the server went down; it is tried again"
    ]
    assert [queue.attempt("success").id for _ in range(2)] == [number, other]
    assert queue.queue.recover(queue.now) == []


def test_an_attempt_ends_once(queue: Shop) -> None:
    queue.add(new())
    claim = queue.claim()
    queue.queue.recover(queue.now)
    with pytest.raises(TaskError, match="has ended already"):
        queue.queue.finish(claim, AttemptOutcome("success"), queue.now)
    assert queue.attempt("success").state == "done"
    with pytest.raises(TaskError, match="has ended already"):
        queue.queue.finish(claim, AttemptOutcome("success"), queue.now)


def test_database_constraints_refuse_invalid_states(queue: Shop) -> None:
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


def test_interruption_by_server_stop_is_not_counted(queue: Shop) -> None:
    number = queue.add(new(policy=RetryPolicy("retry", most=2)))
    for _ in range(5):
        claim = queue.claim()
        task = queue.queue.finish(
            claim, AttemptOutcome("interrupted", "the server was stopped", stopped=True), queue.now
        )
        assert (task.state, task.interruptions) == ("waiting", 0)
    assert queue.kinds(number) == ["interrupted"] * 5
    assert queue.attempt("interrupted").state == "waiting"
    task = queue.queue.finish(
        queue.claim(), AttemptOutcome("interrupted", "the server was stopped", stopped=True), queue.now
    )
    assert task.state == "waiting", "though the next that counts is the last"
    assert queue.attempt("interrupted").state == "given_up"
    given_up = queue.add(new(policy=RetryPolicy("give-up")))
    task = queue.queue.finish(
        queue.claim(), AttemptOutcome("interrupted", "the server was stopped", stopped=True), queue.now
    )
    assert (task.id, task.state) == (given_up, "given_up")


# Cancelling


def test_waiting_task_is_cancelled_at_once(queue: Shop) -> None:
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
def test_running_task_is_cancelled_unless_it_ends_first(queue: Shop, how: How, state: State, kind: str) -> None:
    number = queue.add(new(policy=RetryPolicy(retries=5), every="day 12:00"))
    claim = queue.claim()
    assert not queue.queue.is_cancelling(claim)
    assert queue.queue.cancel(number, queue.now) == "running"
    assert queue.queue.is_cancelling(claim)
    assert queue.queue.finish(claim, AttemptOutcome(how), queue.now).state == state
    assert queue.kinds(number) == [kind]
    assert queue.queue.tasks(ended=False) == [], "it does not come again"


def test_cancelled_task_stays_cancelled_after_a_crash(queue: Shop) -> None:
    number = queue.add(new())
    queue.claim()
    queue.queue.cancel(number, queue.now)
    (task,) = queue.queue.recover(queue.now)
    assert task.state == "cancelled"


def test_task_that_cannot_be_cancelled_gives_the_reason(queue: Shop) -> None:
    number = queue.add(new())
    queue.attempt("success")
    with pytest.raises(TaskError, match=f"task {number} has already ended: it is done"):
        queue.queue.cancel(number, queue.now)
    with pytest.raises(TaskError, match="there is no task 99") as raised:
        queue.queue.cancel(99, queue.now)
    assert raised.value.hint == "mission task list --all"


def test_mission_notices_are_sent_verbatim(queue: Shop) -> None:
    number = queue.add(new())
    claim = queue.claim()
    for turn, text in enumerate(("Ana is here", "Ana is here"), start=1):
        queue.queue.post_message(claim, turn, text, queue.now)
    letters = [letter for letter in queue.outbox.notices_of(number) if letter.channel == "away"]
    assert [letter.notice.text for letter in letters] == ["Ana is here", "Ana is here"]
    assert len({letter.notice.id for letter in letters}) == 2


def test_each_repetition_needs_its_own_approval(queue: Shop) -> None:
    task = replace(new(every="1 h", late=600.0), needs_approval=True)
    number = queue.add(task)
    assert queue.queue.claim(queue.now) is None
    queue.queue.approve(number, queue.now, "ana")
    assert queue.attempt("success").state == "done"
    queue.now = START + 3600.0
    (second,) = queue.queue.tasks(ended=False)
    assert second.awaits_approval
    assert queue.queue.claim(queue.now) is None
    queue.now += 601.0
    assert queue.queue.claim(queue.now) is None
    assert queue.queue.task(second.id).state == "given_up"
    (third,) = queue.queue.tasks(ended=False)
    with pytest.raises(sqlite3.IntegrityError, match="nobody has approved this task"):
        queue.connection.execute("UPDATE task SET state = 'running' WHERE id = ?", (third.id,))
