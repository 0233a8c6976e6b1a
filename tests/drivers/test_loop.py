"""Turns on a thread of their own."""

from threading import current_thread

import pytest

from drivers.transport.loop import ThreadLoop
from tests.waiting import wait_until

pytestmark = pytest.mark.real_time


def test_loop_turns_and_final_call_run_once_on_its_thread() -> None:
    turns: list[str] = []
    last: list[str] = []

    def turn() -> float:
        turns.append(current_thread().name)
        return 0.0

    loop = ThreadLoop("link head", turn, lambda: last.append(current_thread().name))
    loop.end()
    for run in (1, 2):
        turns.clear()
        loop.start()
        loop.start()
        assert loop.is_alive
        wait_until(lambda: len(turns) >= 3)
        loop.end()
        loop.end()
        assert last == ["link head"] * run
        assert set(turns) == {"link head"}
    assert not loop.is_alive


def test_a_pause_ends_with_the_loop() -> None:
    turns: list[int] = []

    def turn() -> float:
        turns.append(1)
        return 3600.0

    loop = ThreadLoop("patient", turn, turns.clear)
    loop.start()
    wait_until(lambda: turns)
    loop.end()
    assert turns == []
