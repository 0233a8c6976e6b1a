"""Notices wait until they are delivered, in order, and a channel that is away holds up nobody else."""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from threading import Event

import pytest

from config.notices import CommandNotice, TerminalNotice, WebhookNotice, encode_notice
from drivers.clock import ManualClock
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.notice import Channel, Notice
from missions.plugins.tasks.notice_delivery import (
    MAX_BLOCKING_TRIES,
    MAX_NOTICE_AGE,
    MAX_RETRY_DELAY,
    MIN_TRIES,
    DeliverySchedule,
    NoticeSender,
    retry_delay,
)
from missions.plugins.tasks.notices import channel_of
from missions.plugins.tasks.outbox import Outbox
from missions.plugins.tasks.queue import TaskQueue
from missions.plugins.tasks.queue_database import open_db
from missions.plugins.tasks.task import NewTask, RetryPolicy
from tests.missions.service.small_queue import BERLIN, START, Shop, new, shop
from tests.waiting import wait_until


@pytest.fixture
def queue(tmp_path: Path) -> Iterator[Shop]:
    with shop(tmp_path / "tasks.db") as opened:
        yield opened


def alive(process: int) -> bool:
    """Say whether a process goes on; one that is dead and that nobody has asked about does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="ascii").split()[2] != "Z"
    except OSError:
        return False


class Post:
    """Two channels that take notices, or not, whose clocks the test owns."""

    def __init__(self, shop: Shop) -> None:
        self.shop, self.clock = shop, ManualClock()
        self.taken: list[tuple[str, str]] = []
        self.tried: list[tuple[str, str]] = []
        self.away: dict[str, str] = {}
        self.poison: set[str] = set()
        self.told: list[str] = []
        self.restart()

    def restart(self) -> None:
        self.turns = DeliverySchedule(self.shop.outbox, lambda: self.shop.now, self.clock, self.told.append)

    def round(self) -> None:
        """Try all that is due once."""
        while letters := self.turns.due_notices():
            for letter in letters:
                self.tried.append((letter.channel, letter.notice.id))
                if letter.channel in self.away:
                    self.turns.on_failed(letter, self.away[letter.channel])
                elif letter.notice.id in self.poison:
                    self.turns.on_failed(letter, "too long for me")
                else:
                    self.taken.append(self.tried[-1])
                    self.turns.on_delivered(letter)

    def rounds(self, number: int, seconds: float) -> None:
        """Try so many times, with so many seconds after each."""
        for _ in range(number):
            self.round()
            self.shop.now += seconds
            self.clock.advance(seconds)

    def done(self, tasks: int) -> list[str]:
        """Do so many new tasks; return the ids of their notices."""
        found = []
        for _ in range(tasks):
            number = self.shop.add(new(due=self.shop.now))
            self.shop.attempt("success")
            found.append(self.shop.outbox.notices_of(number)[0].notice.id)
        return found

    def taken_by(self, channel: str) -> list[str]:
        return [notice for each, notice in self.taken if each == channel]


@pytest.fixture
def post(queue: Shop) -> Post:
    return Post(queue)


def test_each_try_waits_twice_as_long_as_the_one_before_but_ten_minutes_at_most() -> None:
    assert [retry_delay(failures) for failures in (1, 2, 3, 4, 10, 11, 1000)] == [
        1,
        2,
        4,
        8,
        512,
        MAX_RETRY_DELAY,
        MAX_RETRY_DELAY,
    ]


def test_notice_is_identical_in_every_delivery(queue: Shop) -> None:
    number = queue.add(new())
    queue.attempt("failure", "naïve “reasons”\n…")
    (letter, _) = queue.outbox.notices_of(number)
    assert Notice(**json.loads(letter.notice.as_json())) == letter.notice
    assert letter.notice.time == "2026-11-21T11:00:01+00:00"


# Turns


def test_unreachable_channel_is_retried_until_delivery(post: Post) -> None:
    post.done(1)
    post.away["home"] = "nobody answers"
    post.round()
    assert [channel for channel, _ in post.taken] == ["away"]
    post.rounds(2000, 30.0)
    (letter, _) = post.shop.outbox.notices_of(1)
    assert 60_000 / MAX_RETRY_DELAY <= letter.tries <= 60_000 / MAX_RETRY_DELAY + 12
    assert (letter.last_error, letter.delivered) == ("nobody answers", None)
    assert post.shop.outbox.pending_count() == 1
    del post.away["home"]
    post.rounds(2, MAX_RETRY_DELAY)
    assert [channel for channel, _ in post.taken] == ["away", "home"]
    assert post.shop.outbox.pending_count() == 0
    assert post.told == [
        "a notice of task 1 is not delivered yet: nobody answers",
        "notices are delivered again to home",
    ]


def test_a_hundred_notices_for_a_dead_broker_are_not_tried_one_by_one(post: Post) -> None:
    post.done(100)
    post.away["home"] = "dead"
    post.round()
    assert len(post.taken_by("away")) == 100
    post.rounds(60, 60.0)
    assert 0 < len(post.tried) - 100 < 40  # once for each rest, and once more to see whether it is the notice


@pytest.mark.parametrize("outage", [1.0, 40.0, 600.0, 100_000.0])
def test_notices_come_in_the_order_in_which_things_happened_however_long_the_channel_was_away(
    post: Post, outage: float
) -> None:
    ids = post.done(2)
    post.away["home"] = "away"
    post.rounds(20, outage / 20)
    ids += post.done(5)
    post.rounds(20, outage / 20)
    ids += post.done(1)
    post.away.clear()
    post.rounds(3, MAX_RETRY_DELAY)
    assert post.taken_by("home") == ids


def test_notices_keep_their_order_after_a_restart(post: Post) -> None:
    number = post.shop.add(new(policy=RetryPolicy("retry")))
    post.away["home"] = "away"
    post.shop.attempt("interrupted")
    post.round()
    post.restart()
    post.away.clear()
    post.shop.now += 60.0
    post.shop.attempt("success")
    post.round()
    assert post.shop.kinds(number) == ["interrupted", "done"]
    assert post.taken_by("home") == [
        each.notice.id for each in post.shop.outbox.notices_of(number) if each.channel == "home"
    ]


def test_undeliverable_notice_lets_others_pass_after_some_tries(post: Post) -> None:
    poison, *others = post.done(4)
    post.poison.add(poison)
    post.rounds(MAX_BLOCKING_TRIES + 1, 20.0)
    assert post.taken_by("home") == others
    others += post.done(3)
    post.rounds(2, 1.0)
    assert post.taken_by("home") == others


def test_two_undeliverable_notices_let_others_pass(post: Post) -> None:
    first, second, *others = post.done(5)
    post.poison |= {first, second}
    post.rounds(40, 30.0)
    assert sorted(post.taken_by("home")) == sorted(others)


def test_clock_set_back_does_not_delay_notices(post: Post) -> None:
    post.done(1)
    post.away["home"] = post.away["away"] = "away"
    post.shop.now += 10 * 365 * 86400.0
    post.round()
    post.away.clear()
    post.shop.now -= 10 * 365 * 86400.0
    post.clock.advance(MAX_RETRY_DELAY)
    post.round()
    assert len(post.taken) == 2


def test_notices_expire_after_a_week_and_that_is_reported_once(post: Post) -> None:
    post.done(3)
    post.away["home"] = "gone for good"
    post.rounds(int(MAX_NOTICE_AGE / 7200.0) + 20, 7200.0)
    assert [line for line in post.told if "week" in line] == [
        "after a week, waiting notices for home are given up (3): gone for good"
    ]
    tried = len(post.tried)
    post.rounds(20, MAX_RETRY_DELAY)
    post.restart()
    post.round()
    assert len(post.tried) == tried
    assert post.shop.outbox.pending_count() == 0
    assert [(letter.given_up, letter.delivered is None) for letter in post.shop.outbox.notices_of(2)] == [
        (letter.channel == "home",) * 2 for letter in post.shop.outbox.notices_of(2)
    ]
    fresh = post.done(1)
    post.away.clear()
    post.round()
    assert post.taken_by("home") == fresh


def test_clock_set_after_the_start_expires_no_notice(post: Post) -> None:
    post.shop.now = 0.0  # a machine without a battery for its clock, and without a network yet
    post.shop.add(new(due=0.0))
    post.shop.attempt("success")
    post.away["home"] = "no network"
    post.rounds(3, 2.0)
    post.shop.now = START
    post.rounds(MIN_TRIES - 10, 2.0)
    post.away.clear()
    post.rounds(2, MAX_RETRY_DELAY)
    assert len(post.taken_by("home")) == 1


def test_the_log_names_channels_without_their_secrets(queue: Shop) -> None:
    ways = [
        encode_notice(WebhookNotice("https://ntfy.sh/secret-topic")),
        encode_notice(CommandNotice(("mail", "secret"))),
    ]
    number = TaskQueue(queue.connection, lambda _: ways, BERLIN).add(new(), START)
    claim = queue.claim()
    TaskQueue(queue.connection, lambda _: ways, BERLIN).post_message(claim, 1, "hello", START)
    assert [letter.channel for letter in queue.outbox.notices_of(number)] == ["webhook https://ntfy.sh", "command mail"]
    told: list[str] = []
    turns = DeliverySchedule(queue.outbox, lambda: START, ManualClock(), told.append)
    letter = next(letter for letter in turns.due_notices() if letter.channel == ways[0])
    turns.on_failed(letter, "away")
    turns.on_delivered(letter)
    assert not any("secret" in line for line in told)
    assert told[-1] == "notices are delivered again to webhook https://ntfy.sh"


# The courier


def test_notice_left_by_a_killed_sender_is_delivered_by_the_next(queue: Shop, tmp_path: Path) -> None:
    queue.add(new())
    queue.attempt("success")
    taken: list[str] = []
    with NoticeSender(
        tmp_path / "tasks.db", lambda _: lambda notice: taken.append(notice.id), lambda: queue.now, print
    ):
        wait_until(lambda: len(taken) == 2)
    assert taken[0] == taken[1]
    assert queue.outbox.pending_count() == 0


def test_hung_channel_does_not_block_others(queue: Shop, tmp_path: Path) -> None:
    go_on, taken, told = Event(), list[str](), list[str]()

    def channel_of(name: str) -> Channel:
        def take(notice: Notice) -> None:
            assert name == "away" or go_on.wait(60.0)
            taken.append(f"{name} {notice.task}")

        return take

    with NoticeSender(tmp_path / "tasks.db", channel_of, lambda: queue.now, told.append) as courier:
        for _ in range(3):
            queue.add(new())
            queue.attempt("success")
        wait_until(lambda: len(taken) == 3)
        assert taken == ["away 1", "away 2", "away 3"]
        go_on.set()
        courier.flush(30.0)
        assert taken[3:] == ["home 1", "home 2", "home 3"]
    assert (told, queue.outbox.pending_count()) == ([], 0)


def test_latest_notices_are_tried_before_the_sender_ends(queue: Shop, tmp_path: Path) -> None:
    taken: list[str] = []
    for number in range(1, 6):
        with NoticeSender(
            tmp_path / "tasks.db", lambda _: lambda each: taken.append(each.text), lambda: queue.now, print
        ):
            queue.add(new())
            queue.attempt("success")
        assert len(taken) == 2 * number
    assert queue.outbox.pending_count() == 0


@pytest.mark.real_time
def test_hung_command_does_not_outlive_the_sender(queue: Shop, tmp_path: Path) -> None:
    number = tmp_path / "number"
    way = encode_notice(CommandNotice(("sh", "-c", f"sleep 600 & echo $! > {number}; wait")))
    told: list[str] = []
    with NoticeSender(
        tmp_path / "tasks.db", lambda _: channel_of(way, print), lambda: queue.now, told.append, flush_timeout=0.1
    ):
        queue.add(new())
        queue.attempt("success")
        wait_until(lambda: number.exists() and number.read_text(encoding="ascii").strip())
    child = int(number.read_text(encoding="ascii"))
    wait_until(lambda: not alive(child), 5.0)
    (letter, _) = queue.outbox.notices_of(1)
    assert letter.last_error == "sh: was still running when the server ended"
    assert queue.outbox.pending_count() == 2


def test_full_disk_is_reported_once_and_notices_are_not_sent_twice(
    queue: Shop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    queue.add(new())
    queue.attempt("success")
    taken, told, room, tries = list[str](), list[str](), Event(), list[int]()
    delivered = Outbox.mark_delivered

    def delivered_if_there_is_room(*arguments: object) -> None:
        tries.append(1)
        if not room.is_set():
            raise sqlite3.OperationalError("database or disk is full")
        delivered(*arguments)  # type: ignore[arg-type]  # as they came

    monkeypatch.setattr(Outbox, "mark_delivered", delivered_if_there_is_room)
    with NoticeSender(
        tmp_path / "tasks.db", lambda _: lambda each: taken.append(each.id), lambda: queue.now, told.append
    ) as courier:
        wait_until(lambda: len(tries) > 2)
        room.set()
        courier.flush(30.0)
    assert (len(taken), queue.outbox.pending_count()) == (2, 0)
    (said,) = told
    assert said.startswith(f"notices wait: {tmp_path / 'tasks.db'}: database or disk is full; retrying")


def test_queue_that_cannot_be_opened_is_reported(tmp_path: Path) -> None:
    (tmp_path / "tasks.db").write_text("no database" * 1000, encoding="utf-8")
    told: list[str] = []
    with NoticeSender(tmp_path / "tasks.db", lambda _: print, lambda: 0.0, told.append) as courier:
        courier.flush(30.0)
    (line,) = told
    assert line.startswith("notices are not delivered any more: ")


@pytest.mark.parametrize("damage", [sqlite3.DatabaseError("database disk image is malformed"), TypeError("no text")])
def test_damaged_queue_is_reported_once_and_ends_only_the_sender(
    queue: Shop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: Exception
) -> None:
    broken, told = Event(), list[str]()
    channels = Outbox.channels

    def channels_unless_broken(outbox: Outbox) -> list[str]:
        if broken.is_set():
            raise damage
        return channels(outbox)

    monkeypatch.setattr(Outbox, "channels", channels_unless_broken)
    with NoticeSender(tmp_path / "tasks.db", lambda _: print, lambda: queue.now, told.append) as courier:
        courier.flush(30.0)
        assert told == []
        broken.set()
        wait_until(lambda: told)
        courier.flush(30.0)
    assert told == [f"notices are not delivered any more: {damage}"]


def test_unknown_channel_is_reported_and_retried(queue: Shop, tmp_path: Path) -> None:
    queue.add(new())
    queue.attempt("success")
    told: list[str] = []
    with NoticeSender(tmp_path / "tasks.db", lambda name: channel_of(name, print), lambda: queue.now, told.append):
        wait_until(lambda: len(told) == 2)
    assert queue.outbox.pending_count() == 2
    assert "no way to send notices" in told[0]


# Where they go


def test_task_keeps_its_channels_if_the_robot_file_breaks_later(tmp_path: Path) -> None:
    robot = tmp_path / "mine.yaml"
    robot.write_text("robot: mine\nnotices:\n  - command: [notify-send, Robot]\n", encoding="utf-8")
    way = encode_notice(CommandNotice(("notify-send", "Robot")))
    with closing(open_db(tmp_path / "tasks.db")) as connection:
        queue, outbox = TaskQueue(connection, channels_of), Outbox(connection)
        number = queue.add(NewTask(mission="greet", robot=str(robot), due=START), START)
        assert channels_of(queue.task(number)) == (way,)
        robot.write_text("robot: [", encoding="utf-8")
        claim = queue.claim(START)
        assert claim is not None
        queue.post_message(claim, 1, "where is my file?", START)
        assert outbox.channels() == [way]
        robot.unlink()
        assert channels_of(queue.task(number)) == (way,)


def test_task_without_notices_in_its_robot_file_uses_the_terminal(queue: Shop) -> None:
    assert channels_of(queue.queue.task(queue.add(new()))) == (encode_notice(TerminalNotice()),)
