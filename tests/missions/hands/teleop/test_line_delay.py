"""Driving by the keys of a far terminal: how late they are, and how long the base moves on, in simulated time."""

import os
import pty
import re
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from math import inf
from pathlib import Path
from random import Random

import pytest

from drivers.base.twin import BaseTwin
from drivers.clock import ManualClock
from drivers.head.twin import ServoHeadTwin
from drivers.sim.timeline import Timeline
from missions.cli.keys import KeyReader
from missions.control.pilot import MAX_STATE_AGE, Pilot
from missions.plugins.teleop.command import ancestors, measure_line
from missions.plugins.teleop.hand_driving import (
    ANSWER_TIMEOUT,
    FIRST_ANSWER_TIMEOUT,
    MAX_OPEN_QUERIES,
    LineDelay,
    drive_by_hand,
)
from tests.drivers.test_twins import PAN, TILT
from tests.tries import tries

ASKED = re.compile(r"\x1b7\x1b\[(\d+);(\d+)H\x1b\[6n\x1b8")
HELD_EVERY = 0.03
BRAKING = 0.3
"""Seconds that the base takes to stand, and until the next look at the keys."""


class FarTerminal:
    """A person at a terminal who holds a key until a time; what is shown and typed takes its time."""

    def __init__(self, up: Callable[[float], float], down: Callable[[float], float], *, until: float) -> None:
        self.timeline = Timeline()
        self.clock = self.timeline.clock
        self.base = BaseTwin(self.clock)
        self.head = ServoHeadTwin(self.clock, pan=PAN, tilt=TILT, speed=2.0)
        self.base.open()
        self.head.open()
        self.up, self.down, self.until = up, down, until
        self.sent = self.shown = 0.0  # when the newest of each direction comes
        self.came: list[str] = []
        self.moved: list[float] = []
        self.words: list[str] = []
        self.line = LineDelay(self.show, self.clock, lambda: (80, 24))
        self.timeline.call_every(BaseTwin.STEP_INTERVAL, self._step)
        self.timeline.call_every(HELD_EVERY, self._hold, start=1.0)
        self.timeline.call_at(until + 12.0, partial(self.came.append, "escape"))

    def drive(self) -> float:
        """Return for how many seconds the base moves on after the key was let go."""
        pilot = Pilot(self.base, self.head)
        drive_by_hand(pilot, self._typed, None, self.clock, self.words.append, self.line)
        return max((at - self.until for at in self.moved), default=0.0)

    def show(self, text: str) -> None:
        found = ASKED.fullmatch(text)
        assert found is not None
        self.shown = max(self.shown, self.clock.now() + self.down(self.clock.now()))
        self.timeline.call_at(self.shown, partial(self._send, f"{found[1]};{found[2]}"))

    def _send(self, what: str) -> None:
        self.sent = max(self.sent, self.clock.now() + self.up(self.clock.now()))
        self.timeline.call_at(self.sent, partial(self.came.append, what))

    def _hold(self) -> None:
        if self.clock.now() < self.until:
            self._send("i")

    def _typed(self, seconds: float) -> str:
        """Return a key as ``KeyReader.read`` does: replies and keys come in one stream, read without a pause."""
        until = self.clock.now() + seconds
        while True:
            while self.came:
                what = self.came.pop(0)
                if ";" not in what:
                    return what
                self.line.on_answer(*map(int, what.split(";")))
                until = self.clock.now()
            if self.clock.now() >= until:
                return ""
            self.timeline.run_until(until, lambda: bool(self.came))

    def _step(self) -> None:
        self.base.step()
        self.head.step()
        if self.base.body.velocity.linear:
            self.moved.append(self.clock.now())


def constant(delay: float) -> Callable[[float], float]:
    return lambda _: delay


@pytest.mark.parametrize(("up", "down"), [(0.6, 0.0), (0.0, 0.6), (1.0, 1.0), (5.0, 0.0), (0.0, 5.0)])
def test_over_a_slow_line_a_key_drives_nothing(up: float, down: float) -> None:
    far = FarTerminal(constant(up), constant(down), until=6.0)
    far.drive()
    assert far.moved == []
    assert any("line too slow" in line for line in far.words)


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3])
def test_over_a_quick_line_a_key_drives(delay: float) -> None:
    far = FarTerminal(constant(delay / 2), constant(delay / 2), until=4.0)
    assert far.drive() <= MAX_STATE_AGE + BRAKING
    assert max(far.moved) > 3.9
    assert not any("slow" in line for line in far.words)


def test_after_a_slow_moment_the_key_is_to_be_let_go_once() -> None:
    far = FarTerminal(lambda now: 2.0 if 2.0 <= now < 2.1 else 0.01, constant(0.01), until=6.0)
    far.drive()
    assert max(far.moved) < 2.0 + MAX_STATE_AGE + BRAKING


def test_over_a_slow_line_the_arrows_do_not_turn_the_head() -> None:
    far = FarTerminal(constant(1.0), constant(1.0), until=0.0)
    for number in range(10):
        far.timeline.call_at(8.0 + 0.2 * number, partial(far._send, "left"))
    far.timeline.run_until(4.0)
    before = far.head.pose().value
    far.drive()
    assert far.head.pose().value == before


def drawn(chance: Random) -> Callable[[float], float]:
    jumps = sorted(chance.uniform(0.0, 7.0) for _ in range(chance.randint(0, 4)))
    delays = [chance.choice((0.0, 0.05, 0.2, chance.uniform(0.0, 5.0))) for _ in "12345"]
    return lambda now: delays[sum(now >= jump for jump in jumps)]


def test_whatever_the_delay_of_the_line_the_base_rests_soon_after_the_key_is_let_go(
    record_property: Callable[[str, object], None],
) -> None:
    rests = {}
    for seed in range(tries(40, most=2000)):
        chance = Random(f"lines {seed}")  # noqa: S311 - a draw is no secret
        far = FarTerminal(drawn(chance), drawn(chance), until=6.0)
        far.timeline.run_until(0.0)
        rests[seed] = far.drive()
    record_property("figure", f"{len(rests)} seeds: rest {max(rests.values()):.2f} s after the key at most")
    assert {seed: rest for seed, rest in rests.items() if rest > MAX_STATE_AGE + BRAKING} == {}


# --- questions and answers --------------------------------------------------------------------------------------------


def test_an_answer_belongs_to_one_question_and_whatever_else_looks_like_one_to_none() -> None:
    clock, asked = ManualClock(), list[str]()
    line = LineDelay(asked.append, clock, lambda: (3, 2))
    line.send_query()
    line.send_query()  # a moment ago
    clock.advance(0.2)
    line.send_query()
    assert len(asked) == 2
    first, second = (tuple(map(int, found)) for found in (ASKED.findall(text)[0] for text in asked))
    assert first != second
    line.on_answer(1, 2)  # Shift and F3
    assert line.status_text() == "delay unknown: the terminal does not answer"
    clock.advance(0.1)
    line.on_answer(*second)
    assert line.status_text() == "100 ms"
    line.on_answer(*first)
    line.on_answer(*second)  # once more
    clock.advance(MAX_STATE_AGE - 0.1)
    assert line.refusal == "line too slow: 0.5 s (0.5 s at most)"


@pytest.mark.parametrize("size", [(80, 24), (1, 1), (200, 1), (1, 60)])
def test_open_queries_to_a_silent_terminal_are_limited(size: tuple[int, int]) -> None:
    clock, asked = ManualClock(), list[str]()
    line = LineDelay(asked.append, clock, lambda: size)
    for _ in range(200):
        line.send_query()
        clock.advance(0.1)
    assert len(asked) <= MAX_OPEN_QUERIES or min(size) == max(size) == 1
    assert line.refusal == ""  # by now
    clock.advance(ANSWER_TIMEOUT)
    before = len(asked)
    line.send_query()
    assert len(asked) == before + 1


@pytest.mark.parametrize(
    ("relay", "refusal"),
    [("", "the terminal does not answer"), ("mosh-server", "mosh-server answers for the terminal")],
)
def test_keys_do_not_drive_while_a_remote_delay_is_unknown(relay: str, refusal: str) -> None:
    clock = ManualClock()
    line, good = (
        LineDelay(str, clock, lambda: (80, 24), remote=True, relay=relay, allow_unknown=each) for each in (False, True)
    )
    clock.advance(2 * FIRST_ANSWER_TIMEOUT)
    assert (refusal in line.refusal, good.refusal) == (True, "")


@contextmanager
def terminal() -> Iterator[tuple[int, int]]:
    """Give both ends of a pseudo-terminal: that of a person, and that of a program."""
    ends = pty.openpty()
    tty.setraw(ends[1])
    try:
        yield ends
    finally:
        for end in ends:
            os.close(end)


@pytest.mark.parametrize(
    ("typed", "keys", "answers"),
    [
        (b"\x1b[5;17Ri", ["i"], [(5, 17)]),
        (b"\x1b[5;17R\x1b[5;18R\x1b[A", ["up"], [(5, 17), (5, 18)]),
        (b"i\x1b[5;17Rk", ["i", "k"], [(5, 17)]),
        (b"\x1b[1;2A\x1b[R", ["up", "other"], []),
        (b"\x1b[5;17R", [], [(5, 17)]),
        (b"\x1b[5;R", ["other"], []),
        (b"\x1b[999999;1R", ["other"], []),
        (b"\x1bOR ", ["other", " "], []),
    ],
)
def test_terminal_answers_are_separated_from_keys(
    typed: bytes, keys: list[str], answers: list[tuple[int, int]]
) -> None:
    found: list[tuple[int, int]] = []
    with terminal() as (person, program), KeyReader(program, lambda row, column: found.append((row, column))) as reader:
        os.write(person, typed)
        read = [key for _ in range(len(keys) + 1) if (key := reader.read(0.0))]
    assert (read, found) == (keys, answers)


def test_a_question_goes_to_the_terminal_of_the_keys_and_the_last_answers_are_taken_from_the_shell(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("TMUX", "STY", "ZELLIJ"):
        monkeypatch.delenv(name, raising=False)
    clock = ManualClock()
    with terminal() as (person, program), measure_line(program, clock) as (line, settle):
        with KeyReader(program, line.on_answer) as keys:
            line.send_query()
            asked = ASKED.fullmatch(os.read(person, 100).decode())
            assert asked is not None
            os.write(person, f"\x1b[{asked[1]};{asked[2]}R".encode())
            settle(keys.read)
        assert line.status_text() == "0 ms"
        os.write(person, b"\x1b[3;3R")  # one that comes still later
        settle(lambda seconds: str(clock.advance(seconds))[:0])
        os.set_blocking(program, False)
        with pytest.raises(BlockingIOError):
            os.read(program, 1)


def test_ancestors_are_parsed_from_any_process_name(tmp_path: Path) -> None:
    for process, name, parent in ((30, "python", 20), (20, "tmux: server) x (", 10), (10, "sshd", 1), (1, "init", 0)):
        (tmp_path / str(process)).mkdir()
        (tmp_path / str(process) / "stat").write_text(f"{process} ({name}) S {parent} 1 1")
    assert [*ancestors(30, tmp_path)] == ["python", "tmux: server) x (", "sshd"]
    assert [*ancestors(40, tmp_path)] == []
    assert inf > len([*ancestors(os.getpid())])
