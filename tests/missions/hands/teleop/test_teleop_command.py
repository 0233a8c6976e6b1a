"""``mission teleop`` as a process at a terminal: it drives, and however it ends the base is at rest."""

import os
import pty
import re
import select
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from config.library import find_file
from drivers.clock import SystemClock
from missions.control.pilot import MAX_STATE_AGE
from missions.library.drivers import load_robot
from tests.forked import Forked
from tests.missions.command import command
from tests.missions.lone_base import LONE_ROBOT, LoneBase, lone_base
from tests.waiting import wait_until

ASKED = re.compile(r"\x1b\[(\d+);(\d+)H\x1b\[6n")

ROBOT = load_robot(find_file("robots", "turtlebot2")).base
HALF = 0.5 * ROBOT.max_speed if ROBOT is not None else 0.0
"""m/s at which it begins."""


class Terminal:
    """A person at a terminal in which ``mission teleop`` runs."""

    def __init__(self, master: int, process: Forked, delay: float) -> None:
        self.process = process
        self.text = ""
        self.delay = delay  # seconds after which it answers where its cursor is
        self._master = master
        self._clock, self._answers = SystemClock(), deque[tuple[float, str]]()
        self._seen = 0

    def type(self, keys: bytes) -> None:
        os.write(self._master, keys)

    def hold(self) -> bool:
        """Send one repeat of a key that is held, and answer as terminals do."""
        self.type(b"i")
        self.shows("")
        return True

    def shows(self, words: str) -> bool:
        """Read on, and say whether these words were shown."""
        while select.select([self._master], [], [], 0.0)[0]:
            try:
                self.text += os.read(self._master, 4096).decode(errors="replace")
            except OSError:  # the process has ended
                break
        for asked in ASKED.finditer(self.text, self._seen):
            self._answers.append((self._clock.now() + self.delay, f"\x1b[{asked[1]};{asked[2]}R"))
            self._seen = asked.end()
        while self._answers and self._answers[0][0] <= self._clock.now():
            self.type(self._answers.popleft()[1].encode())
        return words in self.text

    def hang_up(self) -> None:
        """Close the terminal, as a line that breaks does."""
        if self._master >= 0:
            os.close(self._master)
            self._master = -1


@contextmanager
def teleop(*arguments: str, delay: float = 0.0) -> Iterator[Terminal]:
    """Run the command in a terminal of its own, of whose session it is the leader."""
    master, slave = pty.openpty()
    process = Forked("missions", "teleop", *arguments, stdin=slave, stdout=slave, stderr=slave, leader=True)
    os.close(slave)
    terminal = Terminal(master, process, delay)
    try:
        yield terminal
    finally:
        terminal.hang_up()
        process.kill()
        process.wait()


@contextmanager
def driving() -> Iterator[tuple[Terminal, LoneBase]]:
    """A base that a person drives with a key held."""
    with lone_base() as base, teleop("--robot", LONE_ROBOT, "--port", base.port) as terminal:
        wait_until(lambda: terminal.shows("Ctrl-C ends"))
        wait_until(lambda: terminal.hold() and base.seen().moving, pause=0.02)
        yield terminal, base


@pytest.mark.real_time
def test_a_key_drives_and_escape_ends_with_the_base_at_rest() -> None:
    with driving() as (terminal, base):
        wait_until(lambda: terminal.hold() and terminal.shows("teleop"), pause=0.02)
        wait_until(lambda: terminal.hold() and base.seen().top > 0.99 * HALF, pause=0.02)
        wait_until(lambda: not base.seen().moving)  # nobody holds it any more
        terminal.type(b"\x1b")
        assert terminal.process.wait(20.0) == 0
        assert base.seen().top == pytest.approx(HALF, abs=0.002)


@pytest.mark.real_time
def test_slow_line_blocks_driving_and_shows_the_reason() -> None:
    with lone_base() as base, teleop("--robot", LONE_ROBOT, "--port", base.port, delay=1.0) as terminal:
        wait_until(lambda: terminal.shows("Ctrl-C ends"))
        wait_until(lambda: terminal.shows("line too slow: 1."), pause=0.02)  # before anybody presses a key
        base.seen(forget=True)
        clock = SystemClock()
        wait_until(lambda: terminal.hold() and clock.now() > 2.0, pause=0.03)
        assert base.seen().top == 0.0
        terminal.delay, before = 0.0, len(terminal.text)
        wait_until(lambda: terminal.shows("") and " ms | 50 %" in terminal.text[before:], pause=0.02)  # it was let go
        wait_until(lambda: terminal.hold() and base.seen().moving, pause=0.02)
        terminal.delay = 5.0
        since = base.seen().heard_at
        wait_until(lambda: terminal.hold() and not base.seen().moving, pause=0.02)
        assert base.seen().rest_at - since < MAX_STATE_AGE + 0.3
        terminal.type(b"\x1b")
        assert terminal.process.wait(20.0) == 0


def test_unknown_line_delay_blocks_driving_unless_allowed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TMUX", "/tmp/tmux-1000/default,1,0")  # noqa: S108 - a name, and no file
    with teleop("--world", "corridor") as terminal:
        wait_until(lambda: terminal.shows("delay unknown: tmux answers for the terminal"))
        assert "\x1b[6n" not in terminal.text
    with teleop("--world", "corridor", "--unknown-delay") as terminal:
        wait_until(lambda: terminal.hold() and terminal.shows("+0.25 m/s"), pause=0.02)


def test_sigterm_ends_teleop_with_the_base_at_rest() -> None:
    with driving() as (terminal, base):
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.process.wait(20.0) == 130
        wait_until(lambda: not base.seen().moving)


def test_closed_output_ends_teleop() -> None:
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "missions", "teleop"],
        stdin=slave,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    with process:
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(20.0) == 130
    os.close(slave)
    os.close(master)


def test_broken_line_ends_teleop_with_the_base_at_rest() -> None:
    with driving() as (terminal, base):
        terminal.hang_up()
        terminal.process.wait(20.0)
        wait_until(lambda: not base.seen().moving)


@pytest.mark.real_time
def test_teleop_drives_a_virtual_robot_without_a_robot_file() -> None:
    with teleop("--world", "corridor", "--speed", "30 %") as terminal:
        wait_until(lambda: terminal.shows("30 % | "))
        wait_until(lambda: terminal.hold() and terminal.shows("+0.15 m/s"), pause=0.02)
        terminal.type(b"\x04")
        assert terminal.process.wait(20.0) == 0


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((), 2, "the keys need a terminal"),
        (("--pad", "/dev/input/event999"), 3, "no such device"),
        (("--port", "/dev/kobuki"), 2, "--port names a real port"),
        (("--robot", "turtlebot2", "--world", "empty"), 2, "--world is for a simulated robot"),
        (("--speed", "fast"), 2, "needs a share"),
        (("--speed", "200 %"), 2, "not within 5% and 100%"),
        (("--pad", "/dev/null"), 3, "/dev/null: not the event node of a game pad"),  # as /dev/input/js0
        (("--teach-pad", "/dev/null"), 3, "/dev/null: not the event node of a game pad"),
        (("--pad", "pipe", "--robot", "bodiless.yaml"), 2, "bodiless has no base"),
    ],
)
def test_invalid_teleop_arguments_are_refused_with_a_reason(
    arguments: tuple[str, ...],
    code: int,
    words: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bodiless.yaml").write_text("robot: bodiless\n", encoding="utf-8")
    os.mkfifo("pipe")
    outcome = command(capsys, "teleop", *arguments)
    assert outcome.code == code
    assert words in outcome.err
