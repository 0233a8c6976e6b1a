"""A person's stop: all parts are told, by however few threads get a turn, and whichever part hangs."""

from threading import Event, Thread, current_thread

import pytest

from missions.executive.stop_latch import StopLatch

PARTS = ("base", "head", "arm", "voice")
PATIENCE = 20.0


class Stilled:
    """What makes parts still: it keeps which, and on which thread; ``hangs`` waits until it is let go."""

    def __init__(self, hangs: str = "") -> None:
        self.hangs, self.let_go = hangs, Event()
        self.parts: dict[str, int] = {}

    def __call__(self, parts: frozenset[str]) -> None:
        (part,) = parts
        if part == self.hangs:
            self.let_go.wait(PATIENCE)
        self.parts[part] = current_thread().native_id or 0


def latch_of(stilled: Stilled) -> StopLatch:
    return StopLatch({}, PARTS, None, stilled, lambda _: None, lambda: None)


@pytest.fixture
def starting_slowly(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine so busy that who starts a thread goes on only once that has done what it can."""
    start = Thread.start

    def slowly(self: Thread) -> None:
        start(self)
        self.join(PATIENCE)

    monkeypatch.setattr(Thread, "start", slowly)


@pytest.mark.usefixtures("starting_slowly")
def test_the_last_part_waits_for_no_second_thread_on_a_busy_machine() -> None:
    stilled = Stilled()
    assert latch_of(stilled).stop("Ada") == list(PARTS)
    assert len(set(stilled.parts.values())) == 1


@pytest.mark.parametrize("hangs", PARTS)
def test_hanging_part_does_not_prevent_the_stop_of_others(hangs: str) -> None:
    stilled = Stilled(hangs)
    told = latch_of(stilled).stop("Ada")
    stilled.let_go.set()
    assert told == [part for part in PARTS if part != hangs]


def test_raising_part_does_not_prevent_the_stop_of_others() -> None:
    stilled = Stilled()

    def still(parts: frozenset[str]) -> None:
        if parts == {"base"}:
            raise OSError("unplugged")
        stilled(parts)

    latch = StopLatch({}, PARTS, None, still, lambda _: None, lambda: None)
    assert latch.stop("Ada") == list(PARTS[1:])


def test_one_stop_press_counts_once() -> None:
    latch = latch_of(Stilled())
    for by, press in (("operator 1", "a"), ("operator 2", "a"), ("operator 3", "a")):
        latch.stop(by, press)
    assert (latch.stop_count, latch.reason) == (1, "stopped by operator 1")
    latch.stop("operator 1", "b")
    latch.stop("operator 2", "a")  # lost on its way, and sent again
    assert latch.stop_count == 2
    assert latch.release(2)
    latch.stop("operator 1", "b")  # which comes late: nobody knows that it is no new one
    assert (latch.stop_count, latch.reason) == (3, "stopped by operator 1")
    latch.stop("Ada")
    latch.stop("Ada")
    assert latch.stop_count == 5
