"""Starting a run: `mission run` in a process of its own, which goes on whatever becomes of the studio."""

import asyncio
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from typing import IO

from missions.control.commands import BadMessage
from missions.control.searching import is_listed
from missions.plugins.records.options import SWITCH
from missions.plugins.studio.wishes import AddTask, Start

BEGIN_TIME = 60.0
"""Seconds that a run has to open its control socket."""

PERIOD = 0.05
"""Seconds from one look whether it has to the next."""

RAN = (0, 1)
"""Exit codes of a run that has been made, and that was so short that nobody has seen its control socket."""

END_TIME = 3.0
"""Seconds for which the last words are waited for of a run that is not to be reached any more."""

KEPT = 32
"""Runs that have ended whose last words are kept."""

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
    """Starts runs, which are recorded where that is wished and ``record``."""

    def __init__(self, *, record: bool, command: Sequence[str] = RUN) -> None:
        self._record, self._command = record, command
        self._children: dict[subprocess.Popen[bytes], IO[bytes]] = {}  # and what each says
        self._ended: dict[str, str] = {}
        self.stops = 0
        """How often all was stopped: what was asked for before does not begin after it."""

    def stop(self) -> None:
        """Begin none of the runs that were asked for until now, and end those that cannot be stopped otherwise yet."""
        self.stops += 1

    async def start(self, wanted: Start, stops: int | None = None) -> Mapping[str, object]:
        """Start a run and answer `start` once its control socket is there. Raises BadMessage with its own words.

        ``stops`` is how often all had been stopped when it was asked for.
        """
        stops = self.stops if stops is None else stops
        words = [*words_of(wanted), f"--seed={wanted.seed}"]
        if wanted.speed is not None:
            words.append(f"--speed={wanted.speed:g}")
        recorded = "all" if wanted.record and self._record else "no"
        self._check_unstopped(stops)
        self._reap()
        try:
            process, said = await asyncio.to_thread(self._popen, [*words, "--", wanted.mission], recorded)
        except OSError as error:  # of processes, or of room for what it says
            raise BadMessage("cannot_start", f"the run has not begun: {error}", "df -h /tmp; ulimit -u") from error
        run = str(process.pid)
        for _ in range(int(BEGIN_TIME / PERIOD)):
            self._check_unstopped(stops, process)
            if process.poll() in RAN or is_listed(run):
                told = (self._ended.get(run) or _last(said)).splitlines()
                return {"run": run, "message": "\n".join(line for line in told if line.startswith("mission: "))}
            if process.poll() is not None:
                raise BadMessage("cannot_start", await self.last_words(run))
            await asyncio.sleep(PERIOD)
        process.terminate()
        raise BadMessage("cannot_start", f"the run has not begun within {BEGIN_TIME:g} s: {_last(said)}")

    def _check_unstopped(self, stops: int, process: "subprocess.Popen[bytes] | None" = None) -> None:
        if self.stops != stops:
            if process is not None:
                process.terminate()
            raise BadMessage("cannot_start", "everything was stopped before it had begun", "start it again")

    async def last_words(self, run: str) -> str:
        """Return the last that a run said which was started here and has ended, or ends; nothing of another one."""
        for _ in range(int(END_TIME / PERIOD)):
            self._reap()
            if run not in {str(child.pid) for child in [*self._children]}:
                break
            await asyncio.sleep(PERIOD)
        return self._ended.get(run, "")

    def _reap(self) -> None:
        for child, said in [*self._children.items()]:
            if child.poll() is not None:
                del self._children[child]
                self._ended[str(child.pid)] = _last(said) or "the run has ended, and said nothing"
                said.close()
        while len(self._ended) > KEPT:
            del self._ended[next(iter(self._ended))]

    @property
    def running(self) -> list[int]:
        """The processes that it has started and that go on."""
        self._reap()
        return sorted(child.pid for child in [*self._children])

    def _popen(self, words: Sequence[str], recorded: str) -> "tuple[subprocess.Popen[bytes], IO[bytes]]":
        # Not a pipe: a run ends when nobody reads what it writes, and is not to end with the studio.
        said = tempfile.TemporaryFile()  # noqa: SIM115 - closed once the run has ended
        process = subprocess.Popen(  # noqa: S603 - ourselves
            [*self._command, *words], stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True,
            env={**os.environ, SWITCH: recorded},
        )  # fmt: skip
        self._children[process] = said
        return process, said


def _last(said: IO[bytes]) -> str:
    """Return the last that a run has written."""
    size = os.fstat(said.fileno()).st_size
    return os.pread(said.fileno(), 4000, max(0, size - 4000)).decode(errors="replace").strip()
