"""Who holds a robot: a note of each run, and of each command that moves one, beside the sockets of the runs.

A note tells what its process is without that being asked, so that one that hangs has a name too. It is locked while its
process lives: the kernel takes the lock away with it, so that no other that gets its number is taken for it.
"""

import fcntl
import json
import os
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from threading import Event
from typing import Any

import click

from drivers.api.quick import dataclass
from drivers.clock import SystemClock
from missions.studio import sockets

ENDING = ".note"

END_TIME = 5.0
"""Seconds that a command has to bring to rest what it moves, and to let go of it."""

GLANCE = 0.02
"""Seconds from one look whether it has, to the next."""


@dataclass(frozen=True, slots=True)
class Holder:
    """A process that holds a robot: ``name`` is its mission or its command."""

    process: int
    name: str
    robot: str
    simulated: str

    @property
    def words(self) -> str:
        """What it is, as people are told."""
        return f"{self.process}: {self.name} on {self.robot}" + (
            f" (simulated, {self.simulated})" * bool(self.simulated)
        )

    @property
    def is_run(self) -> bool:
        """Whether it has a control socket, as runs of missions have: that stops it."""
        return sockets.path_of(str(self.process)).exists()

    def end(self, by: str) -> bool:
        """Have a command end, for ``by``, with its actuators at rest; say whether it has, within ``END_TIME``."""
        if holder_of(self.process) != self:  # it has ended, and another one may have its number by now
            return True
        with suppress(OSError), _note_of(self.process).open("r+", encoding="utf-8") as note:
            note.seek(0, os.SEEK_END)
            note.write(f"{by}\n")
        with suppress(ProcessLookupError):
            os.kill(self.process, signal.SIGTERM)
        clock, pause = SystemClock(), Event()
        while holder_of(self.process) == self:
            if clock.now() > END_TIME:
                return False
            pause.wait(GLANCE)
        return True


@contextmanager
def noted(name: str, robot: str, simulated: str = "") -> Iterator[Path]:
    """Have a note of this process while this is entered. Raises OSError.

    It is locked before it is there: one that is not locked is of a process that was killed.
    """
    path = _note_of(os.getpid())
    begun = path.with_suffix(".noting")
    with closing(os.fdopen(os.open(begun, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8")) as note:
        fcntl.flock(note, fcntl.LOCK_EX)
        note.write(json.dumps({"name": name, "robot": robot, "simulated": simulated}) + "\n")
        note.flush()
        begun.replace(path)
        try:
            yield path
        finally:
            path.unlink(missing_ok=True)


@contextmanager
def holding(robot: str, *, simulated: bool) -> Iterator[None]:
    """Let ``mission stop`` end the command that is being done, by a SIGTERM, while it holds a robot.

    Enter it where that signal ends the command, and open the robot within: it is closed before the stop is told.
    """
    name = _command()
    by: list[str] = []
    with ExitStack() as keeping:
        keeping.callback(_tell_stop, name, robot, by)
        try:
            path = keeping.enter_context(noted(name, robot, "wire" if simulated else ""))
        except OSError as error:  # such as a full disk: its terminal, and signals, stop it
            click.echo(f"mission: {error}: `mission stop` cannot reach this command", err=True)
            yield
            return
        try:
            yield
        finally:
            with suppress(OSError):
                by += path.read_text(encoding="utf-8").splitlines()[1:]


def _tell_stop(name: str, robot: str, by: Sequence[str]) -> None:
    """Say who stopped a command, if somebody did, once its robot is closed and its note is gone."""
    if by:
        click.echo(f"mission {name}: stopped by {by[0]}; {robot} was brought to rest", err=True)


def _command() -> str:
    """Return the command that is being done, such as "head look"."""
    context, words = click.get_current_context(), list[str]()
    while context.parent is not None:
        words.insert(0, context.info_name or "")
        context = context.parent
    return " ".join(words)


def holder_of(process: int) -> Holder | None:
    """Return what a process holds, as its note says; None where it has none. A note that was left is taken away."""
    path = _note_of(process)
    with suppress(OSError, ValueError, KeyError), path.open(encoding="utf-8") as note:
        try:
            fcntl.flock(note, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            told: Mapping[str, Any] = json.loads(note.readline())
            return Holder(process, told["name"], told["robot"], told["simulated"])
        path.unlink()
    return None


def holders() -> list[Holder]:
    """Return all that there are, in no order."""
    found: list[Holder | None] = []
    with suppress(OSError):
        names = [each.name.removesuffix(ENDING) for each in sockets.socket_folder().glob(f"*{ENDING}")]
        found = [holder_of(int(name)) for name in names if name.isdecimal()]
    return [each for each in found if each is not None]


def commands() -> list[Holder]:
    """Return those that are no runs, but for this process: who stops all others does not end itself."""
    return [each for each in holders() if not each.is_run and each.process != os.getpid()]


def _note_of(process: int) -> Path:
    return sockets.socket_folder() / f"{process}{ENDING}"
