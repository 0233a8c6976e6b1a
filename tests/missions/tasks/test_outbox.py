"""Notices wait until they are delivered, and a channel that is away holds up nobody else."""

from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Event

import pytest

from drivers.clock import ManualClock
from missions.tasks.courier import Courier
from missions.tasks.notice import Channel, Notice, notice_of
from missions.tasks.outbox import LONG, LONGEST, delay
from tests.missions.tasks.small_queue import Shop, new, shop
from tests.waiting import wait_until


@pytest.fixture
def queue(tmp_path: Path) -> Iterator[Shop]:
    with shop(tmp_path / "tasks.db") as opened:
        yield opened


class Post:
    """Two channels that take notices, or not; and a courier whose clocks the test owns."""

    def __init__(self, shop: Shop, path: Path) -> None:
        self.shop, self.clock = shop, ManualClock()
        self.taken: list[tuple[str, str]] = []
        self.away: dict[str, str] = {}
        self.told: list[str] = []
        self.courier = Courier(path, self.channel_of, lambda: shop.now, self.told.append, clock=self.clock)

    def channel_of(self, name: str) -> Channel:
        def take(notice: Notice) -> None:
            if name in self.away:
                raise ConnectionError(self.away[name])
            self.taken.append((name, notice.id))

        return take

    def round(self) -> None:
        """Try all that is due once."""
        while (letter := self.shop.outbox.due(self.shop.now, self.courier.resting())) is not None:
            self.courier.deliver(self.shop.outbox, letter)

    def wait(self, seconds: float) -> None:
        self.shop.now += seconds
        self.clock.advance(seconds)


@pytest.fixture
def post(queue: Shop, tmp_path: Path) -> Post:
    return Post(queue, tmp_path / "tasks.db")


def test_each_try_waits_twice_as_long_as_the_one_before_but_ten_minutes_at_most() -> None:
    assert [delay(failures) for failures in (1, 2, 3, 4, 10, 11, 1000)] == [1, 2, 4, 8, 512, LONGEST, LONGEST]


def test_a_notice_says_the_same_each_time_that_it_is_sent(queue: Shop) -> None:
    number = queue.add(new())
    queue.attempt("failure", "naïve “reasons”\n…")
    (letter, _) = queue.outbox.of(number)
    assert notice_of(letter.notice.as_json()) == letter.notice
    assert letter.notice.time == "2026-11-21T11:00:01+00:00"


def test_what_is_away_is_tried_again_until_it_is_there(post: Post) -> None:
    post.shop.add(new())
    post.shop.attempt("success")
    post.away["home"] = "nobody answers"
    post.round()
    assert [channel for channel, _ in post.taken] == ["away"]
    tries = 0
    for _ in range(2000):
        post.wait(30.0)
        post.round()
    (letter, _) = post.shop.outbox.of(1)
    tries = letter.tries
    assert 60_000 / LONGEST <= tries <= 60_000 / LONGEST + 12
    assert (letter.last_error, letter.delivered) == ("nobody answers", None)
    assert post.shop.outbox.waiting() == 1
    del post.away["home"]
    post.wait(LONGEST)
    post.round()
    assert [channel for channel, _ in post.taken] == ["away", "home"]
    assert post.shop.outbox.waiting() == 0
    assert post.told == [
        "a notice of task 1 is not delivered yet: nobody answers",
        "notices are delivered again to home",
    ]


def test_a_thousand_notices_for_a_dead_broker_are_not_tried_one_by_one(post: Post) -> None:
    for _ in range(100):
        post.shop.add(new())
    for _ in range(100):
        post.shop.attempt("success")
    tried = 0
    real = post.channel_of

    def counted(name: str) -> Channel:
        nonlocal tried
        tried += name == "home"
        return real(name)

    post.away["home"] = "dead"
    post.courier = Courier(Path(), counted, lambda: post.shop.now, post.told.append, clock=post.clock)
    post.round()
    assert tried == 1
    assert len(post.taken) == 100
    post.wait(1.0)
    post.round()
    assert tried == 2
    del post.away["home"]
    post.wait(2.0)
    post.round()
    assert (
        len(set(post.taken))
        == len(post.taken)
        == 200 - sum(letter.delivered is None for number in range(1, 101) for letter in post.shop.outbox.of(number))
    )
    post.wait(2.0)
    post.round()
    assert post.shop.outbox.waiting() == 0


def test_a_notice_that_is_never_taken_lets_the_others_past(post: Post) -> None:
    for _ in range(2):
        post.shop.add(new())
        post.shop.attempt("success")
    poison = post.shop.outbox.of(1)[0].notice.id
    took: list[str] = []

    def channel_of(name: str) -> Channel:
        del name

        def take(notice: Notice) -> None:
            if notice.id == poison:
                raise ValueError("too long for me")
            took.append(notice.id)

        return take

    post.courier = Courier(Path(), channel_of, lambda: post.shop.now, post.told.append, clock=post.clock)
    for _ in range(5):
        post.round()
        post.wait(5.0)
    assert post.shop.outbox.of(2)[0].notice.id in took


def test_a_clock_that_was_put_back_delays_no_notice_for_years(post: Post) -> None:
    post.shop.add(new())
    post.shop.attempt("success")
    post.away["home"] = post.away["away"] = "away"
    post.shop.now += 10 * 365 * 86400.0
    post.round()
    post.away.clear()
    post.shop.now -= 10 * 365 * 86400.0
    post.clock.advance(LONGEST)
    post.round()
    assert len(post.taken) == 2


def test_after_a_week_it_is_said_once_more(post: Post) -> None:
    post.shop.add(new())
    post.shop.attempt("success")
    post.away["home"] = "gone for good"
    for _ in range(int(LONG / LONGEST) + 20):
        post.round()
        post.wait(LONGEST)
    assert [line for line in post.told if "week" in line] == [
        "a notice of task 1 is not delivered for a week now: gone for good"
    ]


def test_a_notice_that_a_courier_left_when_it_died_is_delivered_by_the_next(queue: Shop, tmp_path: Path) -> None:
    queue.add(new())
    queue.attempt("success")
    taken: list[str] = []
    with Courier(tmp_path / "tasks.db", lambda _: lambda notice: taken.append(notice.id), lambda: queue.now, print):
        wait_until(lambda: len(taken) == 2)
    assert taken[0] == taken[1]
    assert queue.outbox.waiting() == 0


def test_the_courier_flushes_what_is_due_and_ends_in_the_middle_of_a_delivery(queue: Shop, tmp_path: Path) -> None:
    begun, go_on = Event(), Event()

    def channel_of(_: str) -> Channel:
        def take(notice: Notice) -> None:
            del notice
            begun.set()
            assert go_on.wait(30.0)

        return take

    told: list[str] = []
    with Courier(tmp_path / "tasks.db", channel_of, lambda: queue.now, told.append) as courier:
        courier.flush(30.0)
        queue.add(new())
        queue.attempt("success")
        assert begun.wait(30.0)
        go_on.set()
        courier.flush(30.0)
        assert queue.outbox.waiting() == 0
    assert told == []


def test_a_queue_that_cannot_be_opened_is_told(tmp_path: Path) -> None:
    (tmp_path / "tasks.db").write_text("no database" * 1000, encoding="utf-8")
    told: list[str] = []
    channel_of: Callable[[str], Channel] = lambda _: print  # noqa: E731 - never called
    with Courier(tmp_path / "tasks.db", channel_of, lambda: 0.0, told.append) as courier:
        courier.flush(30.0)
    assert told[0].startswith("notices are not delivered: ")
