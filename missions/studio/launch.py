"""Starting a run: `mission run` in a process of its own, which goes on whatever becomes of the studio."""

import asyncio
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from drivers.clock import time_of_day
from missions.studio import sockets
from missions.studio.form import BadMessage
from missions.studio.ring import make_room
from missions.studio.wishes import AddTask, Start

BEGIN_TIME = 60.0
"""Seconds that a run has to open its control socket."""

PERIOD = 0.05
"""Seconds from one look whether it has to the next."""

RUN = (sys.executable, "-m", "missions", "run")


def words_of(command: Start | AddTask) -> Iterator[str]:
    """Yield what of a command both `mission run` and `mission task add` understand. Raises BadMessage where not sure.

    Each value is joined to its option, so that none is taken for an option itself; the mission comes behind ``--``.
    """
    if command.robot and not command.simulate and not command.sure:
        raise BadMessage("not_sure", f"{command.robot} moves: has somebody looked that there is room?", "say `sure`")
    if command.robot:
        yield f"--robot={command.robot}"
    if command.simulate:
        yield f"--simulate={command.simulate}"
    if command.world:
        yield f"--world={command.world}"
    for name, value in command.params.items():
        yield f"--param={name}={value}"


class Launcher:
    """Starts runs, and records them in the folder ``records`` as far as that is wished."""

    def __init__(self, records: Path | None, *, command: Sequence[str] = RUN) -> None:
        self._records, self._command = records, command
        self._children: set[subprocess.Popen[bytes]] = set()
        self.stops = 0
        """How often all was stopped: what was asked for before does not begin after it."""

    def stop(self) -> None:
        """Begin none of the runs that were asked for until now, and end those that cannot be stopped otherwise yet."""
        self.stops += 1

    async def start(self, wanted: Start, stops: int | None = None) -> str:
        """Start a run and return its name once its control socket is there. Raises BadMessage with its own words.

        ``stops`` is how often all had been stopped when it was asked for.
        """
        stops = self.stops if stops is None else stops
        words = [*words_of(wanted), f"--seed={wanted.seed}"]
        if wanted.speed is not None:
            words.append(f"--speed={wanted.speed:g}")
        if wanted.record and self._records is not None:
            await asyncio.to_thread(make_room, self._records, time_of_day().timestamp())
            words.append(f"--record={self._records}")
        # Not a pipe: a run ends when nobody reads what it writes, and is not to end with the studio.
        with tempfile.TemporaryFile() as said:
            self._check_unstopped(stops)
            process = await asyncio.to_thread(self._popen, [*words, "--", wanted.mission], said.fileno())
            for _ in range(int(BEGIN_TIME / PERIOD)):
                if process.poll() is not None:
                    raise BadMessage("cannot_start", _said(said.fileno()) or "the run has ended, and said nothing")
                self._check_unstopped(stops, process)
                if sockets.path_of(str(process.pid)).exists():
                    return str(process.pid)
                await asyncio.sleep(PERIOD)
            process.terminate()
            raise BadMessage("cannot_start", f"the run has not begun within {BEGIN_TIME:g} s: {_said(said.fileno())}")

    def _check_unstopped(self, stops: int, process: "subprocess.Popen[bytes] | None" = None) -> None:
        if self.stops != stops:
            if process is not None:
                process.terminate()
            raise BadMessage("cannot_start", "everything was stopped before it had begun", "start it again")

    def reap(self) -> None:
        """Take note of the runs that have ended; the others go on."""
        self._children = {child for child in self._children if child.poll() is None}

    @property
    def running(self) -> list[int]:
        """The processes that it has started and that go on."""
        self.reap()
        return sorted(child.pid for child in self._children)

    def _popen(self, words: Sequence[str], said: int) -> "subprocess.Popen[bytes]":
        self.reap()
        process = subprocess.Popen(  # noqa: S603 - ourselves
            [*self._command, *words], stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True
        )
        self._children.add(process)
        return process


def _said(number: int) -> str:
    """Return the last that a run has written."""
    size = os.fstat(number).st_size
    return os.pread(number, 4000, max(0, size - 4000)).decode(errors="replace").strip()
