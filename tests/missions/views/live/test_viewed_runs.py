"""Whole runs with a view on a terminal of their own: keys, and every way in which a view or its terminal goes away."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import termios
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.forked import Forked
from tests.waiting import wait_until

LONG = 90.0
"""Seconds that anything may take: machines are shared."""

SIZES = ("COLUMNS", "LINES")
"""Variables that would take the place of the terminal's own size."""


class Screen:
    """A terminal with a run on it. ``text`` is all that was written there."""

    def __init__(self, result: Path, *, speed: float, patience: str) -> None:
        self.text = ""
        self.result = result
        self.master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.slave = slave
        self.before = termios.tcgetattr(slave)
        with pytest.MonkeyPatch.context() as patch:
            for name in SIZES:
                patch.delenv(name, raising=False)
            patch.setenv("TERM", "xterm-256color")
            self.process = Forked(
                "tests.missions.views.live.viewed_run",
                *(str(result), str(speed), *patience.split()),
                stdin=slave,
                stdout=slave,
                stderr=slave,
            )

    def read(self) -> str:
        """Return all that was written there, up to now."""
        while self.master >= 0 and select.select([self.master], [], [], 0.0)[0]:
            try:
                self.text += os.read(self.master, 1 << 16).decode("utf-8", "replace")
            except OSError:  # everybody has gone
                break
        return self.text

    def wait_for(self, words: str) -> None:
        """Wait until these words are written there."""
        with suppress(AssertionError):
            wait_until(lambda: words in self.read() or self.process.poll() is not None, LONG)
        assert words in self.read()

    def tick(self) -> int:
        """Return how many ticks there were, by what was written last."""
        return int(re.findall(r"tick (\d+)", self.read())[-1])

    def press(self, keys: str) -> None:
        os.write(self.master, keys.encode())

    def end(self) -> int:
        """Wait until the run has ended; return its exit code."""
        wait_until(lambda: (self.read(), self.process.poll() is not None)[1], LONG)
        self.read()
        return self.process.wait()

    def viewer(self) -> int:
        """Return the process that draws."""
        pid = self.process.pid
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        (child,) = (int(child) for child in children)
        return child

    def hang_up(self) -> None:
        """Close the terminal, as a dropped SSH does."""
        os.close(self.slave)
        os.close(self.master)
        self.master = self.slave = -1

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        if self.master >= 0:
            self.hang_up()


Begin = Callable[..., Screen]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    screens: list[Screen] = []

    def begin(speed: float = 1.0, patience: str = str(LONG)) -> Screen:
        screens.append(Screen(tmp_path / "result", speed=speed, patience=patience))
        return screens[-1]

    yield begin
    for screen in screens:
        screen.close()


@pytest.mark.timeout(400)
def test_keys_pause_step_and_stop_and_the_terminal_is_restored(begin: Begin) -> None:
    screen = begin()
    screen.wait_for("find_face")
    screen.press(" ")
    screen.wait_for("paused")
    ticks = screen.tick()
    screen.press("n")
    wait_until(lambda: screen.tick() > ticks, LONG)
    screen.press("s")
    assert screen.end() == 130
    assert screen.result.read_text() == "interrupted: stopped from the view"
    assert termios.tcgetattr(screen.slave) == screen.before
    after = screen.text.rpartition("\x1b[?1049l")[2]
    assert "mission" in after
    assert "greet: interrupted" in after


@pytest.mark.timeout(400)
def test_killed_view_leaves_run_and_terminal_intact(begin: Begin) -> None:
    screen = begin(speed=2.0)
    screen.wait_for("find_face")
    os.kill(screen.viewer(), signal.SIGKILL)
    screen.wait_for("the view ended (killed by SIGKILL); the mission continues")
    assert termios.tcgetattr(screen.slave) == screen.before
    assert screen.end() == 0
    assert screen.result.read_text() == "success: "
    after = screen.text.rpartition("\x1b[?1049l")[2]
    assert "\x1b[?25h" in after
    assert "greet: success" in after


@pytest.mark.timeout(400)
def test_paused_run_is_stopped_when_its_view_is_killed(begin: Begin) -> None:
    screen = begin()
    screen.wait_for("find_face")
    screen.press(" ")
    screen.wait_for("paused")
    os.kill(screen.viewer(), signal.SIGKILL)
    assert screen.end() == 130
    assert screen.result.read_text() == "interrupted: the view ended while the mission was paused"


@pytest.mark.timeout(400)
def test_closed_terminal_ends_the_run_safely(begin: Begin) -> None:
    screen = begin(speed=0.2)
    screen.wait_for("find_face")
    screen.hang_up()
    wait_until(lambda: screen.process.poll() is not None, LONG)
    assert screen.result.read_text() == "interrupted: the terminal was closed"


@pytest.mark.timeout(400)
def test_ctrl_c_ends_the_run_as_ever_and_once_more_does_no_harm(begin: Begin) -> None:
    screen = begin(speed=0.2)
    screen.wait_for("find_face")
    screen.press("\x03")
    screen.press("\x03")
    assert screen.end() == 130
    assert screen.result.read_text() == "interrupted: Ctrl-C"
    assert termios.tcgetattr(screen.slave) == screen.before


@pytest.mark.timeout(400)
def test_blocked_terminal_does_not_delay_ticks(begin: Begin) -> None:
    screen = begin(speed=3.0, patience="")
    wait_until(screen.result.exists, LONG)
    assert screen.result.read_text() == "success: "
    assert screen.end() == 0
    assert termios.tcgetattr(screen.slave) == screen.before
