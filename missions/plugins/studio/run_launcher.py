"""The queue of tasks over the studio: read as it is, and changed by the same words as in a terminal."""

import asyncio
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, replace
from re import search
from typing import IO

from config.notices import public_text
from missions.control.commands import BadMessage, ClientCommand
from missions.control.run_search import has_control_socket
from missions.library.folders import state_folder
from missions.plugins.records.options import RECORD_ENVIRONMENT_VARIABLE
from missions.plugins.studio.library import check_name
from missions.plugins.studio.studio_commands import AddTask, ApproveTask, CancelTask, MoveTask, StartRun, TasksQuery
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.file_lock import is_locked, server_lock
from missions.plugins.tasks.queue import TaskQueue, local_zone, wall_clock
from missions.plugins.tasks.queue_database import open_db, queue_errors, queue_file

# Starting a run: `mission run` in a process of its own, which goes on whatever becomes of the studio.

START_TIMEOUT = 60.0
"""Seconds that a run has to open its control socket."""

POLL_INTERVAL = 0.05
"""Seconds from one look whether it has to the next."""

RUN_EXIT_CODES = (0, 1)
"""Exit codes of a run that has been made, and that was so short that nobody has seen its control socket."""

LAST_OUTPUT_TIMEOUT = 3.0
"""Seconds for which the last words are waited for of a run that is not to be reached any more."""

MAX_KEPT_RUNS = 32
"""Runs that have ended whose last words are kept."""

RUN_COMMAND = (sys.executable, "-m", "missions", "run")


def command_arguments(command: StartRun | AddTask) -> Iterator[str]:
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


class RunLauncher:
    """Starts runs, which are recorded where that is wished and ``record``."""

    def __init__(self, *, record: bool, command: Sequence[str] = RUN_COMMAND) -> None:
        self._record, self._command = record, command
        self._children: dict[subprocess.Popen[bytes], IO[bytes]] = {}  # and what each says
        self._ended: dict[str, str] = {}
        self.stops = 0
        """How often all was stopped: what was asked for before does not begin after it."""

    def stop(self) -> None:
        """Begin none of the runs that were asked for until now, and end those that cannot be stopped otherwise yet."""
        self.stops += 1

    async def start(self, request: StartRun, stops: int | None = None) -> Mapping[str, object]:
        """Start a run and answer `start` once its control socket is there. Raises BadMessage with its own words.

        ``stops`` is how often all had been stopped when it was asked for.
        """
        stops = self.stops if stops is None else stops
        words = [*command_arguments(request), f"--seed={request.seed}"]
        if request.speed is not None:
            words.append(f"--speed={request.speed:g}")
        recorded = "all" if request.record and self._record else "no"
        self._check_not_stopped(stops)
        self._reap()
        try:
            process, said = await asyncio.to_thread(self._popen, [*words, "--", request.mission], recorded)
        except OSError as error:  # of processes, or of room for what it says
            raise BadMessage("cannot_start", f"the run has not begun: {error}", "df -h /tmp; ulimit -u") from error
        run = str(process.pid)
        for _ in range(int(START_TIMEOUT / POLL_INTERVAL)):
            self._check_not_stopped(stops, process)
            code = process.poll()  # once: a short run may end between two looks
            if code in RUN_EXIT_CODES or has_control_socket(run):
                told = (self._ended.get(run) or _last_output(said)).splitlines()
                return {"run": run, "message": "\n".join(line for line in told if line.startswith("mission: "))}
            if code is not None:
                raise BadMessage("cannot_start", await self.last_output(run))
            await asyncio.sleep(POLL_INTERVAL)
        process.terminate()
        raise BadMessage("cannot_start", f"the run has not begun within {START_TIMEOUT:g} s: {_last_output(said)}")

    def _check_not_stopped(self, stops: int, process: "subprocess.Popen[bytes] | None" = None) -> None:
        if self.stops != stops:
            if process is not None:
                process.terminate()
            raise BadMessage("cannot_start", "everything was stopped before it had begun", "start it again")

    async def last_output(self, run: str) -> str:
        """Return the last that a run said which was started here and has ended, or ends; nothing of another one."""
        for _ in range(int(LAST_OUTPUT_TIMEOUT / POLL_INTERVAL)):
            self._reap()
            if run not in {str(child.pid) for child in [*self._children]}:
                break
            await asyncio.sleep(POLL_INTERVAL)
        return self._ended.get(run, "")

    def _reap(self) -> None:
        for child, said in [*self._children.items()]:
            if child.poll() is not None:
                del self._children[child]
                self._ended[str(child.pid)] = _last_output(said) or "the run has ended, and said nothing"
                said.close()
        while len(self._ended) > MAX_KEPT_RUNS:
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
            env={**os.environ, RECORD_ENVIRONMENT_VARIABLE: recorded},
        )  # fmt: skip
        self._children[process] = said
        return process, said


def _last_output(said: IO[bytes]) -> str:
    """Return the last that a run has written."""
    size = os.fstat(said.fileno()).st_size
    return os.pread(said.fileno(), 4000, max(0, size - 4000)).decode(errors="replace").strip()


Json = dict[str, object]

TASK_TIMEOUT = 30.0
"""Seconds that `mission task` may take."""


def answer_tasks(command: ClientCommand) -> Json:
    """Answer `answer_tasks`."""
    ended = isinstance(command, TasksQuery) and command.ended
    path, now = queue_file(state_folder()), wall_clock()
    if not path.exists():
        return {"tasks": [], "served": False}
    with queue_errors(path), closing(open_db(path)) as connection:
        queue = TaskQueue(connection, channels_of, local_zone())
        found = [replace(task, due=queue.expected_time(task, now)) for task in queue.tasks(ended=ended)]
    told = [asdict(task) | {"channels": [public_text(each) for each in task.channels]} for task in found]
    return {"tasks": told, "served": is_locked(server_lock(state_folder()))}


def answer_add_task(command: ClientCommand) -> Json:
    """Answer `answer_add_task`: by `mission task add`, which checks the mission for its robot as every other time."""
    if not isinstance(command, AddTask):
        raise TypeError(command.word)
    check_names(command)
    words = list(command_arguments(command))
    words += [f"--{name}={value}" for name, value in (("at", command.at), ("every", command.every)) if value]
    words += [f"--priority={command.priority}", f"--retry={command.retry}"]
    words += ["--needs-approval"] * command.needs_approval
    said = _run_task_command("add", *words, "--", command.mission)
    found = search(r"task (\d+)", said)
    return {"task": int(found[1]) if found else None, "message": said}


def answer_cancel_task(command: ClientCommand) -> Json:
    """Answer `answer_cancel_task`."""
    return {"message": _run_task_command("remove", str(command.task if isinstance(command, CancelTask) else 0))}


def answer_approve_task(command: ClientCommand) -> Json:
    """Answer `answer_approve_task`."""
    return {
        "message": _run_task_command("approve", f"--by={command.by}", str(command.task))
        if isinstance(command, ApproveTask)
        else {}
    }


def answer_move_task(command: ClientCommand) -> Json:
    """Answer `answer_move_task`."""
    if not isinstance(command, MoveTask):
        raise TypeError(command.word)
    return {"message": _run_task_command("move", f"--priority={command.priority}", "--", str(command.task))}


HANDLERS: Mapping[str, Callable[[ClientCommand], Json]] = {
    "tasks": answer_tasks,
    "add_task": answer_add_task,
    "approve_task": answer_approve_task,
    "cancel_task": answer_cancel_task,
    "move_task": answer_move_task,
}
"""What does each command."""


def check_names(command: AddTask | StartRun) -> None:
    """Raise BadMessage for a mission, robot or world that is none of those that there are."""
    check_name("missions", command.mission)
    if command.robot:
        check_name("robots", command.robot)
    if command.world:
        check_name("worlds", command.world)


def _run_task_command(*words: str) -> str:
    """Run `mission task`, and return what it says. Raises BadMessage with its own words where it refuses."""
    done = subprocess.run(  # noqa: S603 - ourselves
        [sys.executable, "-m", "missions", "task", *words],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=TASK_TIMEOUT, check=False,
    )  # fmt: skip
    if done.returncode:
        raise BadMessage("bad_task", done.stderr.strip()[-4000:] or f"it ended with exit code {done.returncode}")
    return done.stdout.strip()
