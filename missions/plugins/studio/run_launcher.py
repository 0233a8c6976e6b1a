"""Starts runs and changes the task queue for the studio, with the commands `mission run` and `mission task`."""

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

# Starting a run: `mission run` in a process of its own, which outlives the studio.

START_TIMEOUT = 60.0
"""Seconds within which a run must open its control socket."""

POLL_INTERVAL = 0.05
"""Seconds between two checks for the control socket of a started run."""

RUN_EXIT_CODES = (0, 1)
"""Exit codes that count as a normal end if a run ends before its control socket was seen: success and failure."""

LAST_OUTPUT_TIMEOUT = 3.0
"""Seconds to wait for the last output of a run that has no control socket any more."""

MAX_KEPT_RUNS = 32
"""Maximum number of ended runs whose last output is kept."""

RUN_COMMAND = (sys.executable, "-m", "missions", "run")


def command_arguments(command: StartRun | AddTask) -> Iterator[str]:
    """Yield the arguments that `mission run` and `mission task add` share.

    Each value is joined to its option, so that no value is read as an option; the mission follows ``--``. Raises
    BadMessage for a real robot unless ``command.sure`` confirms that there is room to move.
    """
    if command.robot and not command.simulate and not command.sure:
        raise BadMessage("not_sure", f"{command.robot} will move: make sure that there is room", "send `sure`")
    if command.robot:
        yield f"--robot={command.robot}"
    if command.simulate:
        yield f"--simulate={command.simulate}"
    if command.world:
        yield f"--world={command.world}"
    for name, value in command.params.items():
        yield f"--param={name}={value}"


class RunLauncher:
    """Starts runs in processes of their own. A run is recorded if its request asks for it and ``record`` is true."""

    def __init__(self, *, record: bool, command: Sequence[str] = RUN_COMMAND) -> None:
        self._record, self._command = record, command
        self._children: dict[subprocess.Popen[bytes], IO[bytes]] = {}  # with their output files
        self._ended: dict[str, str] = {}
        self.stops = 0
        """Number of stops of all runs so far; a run requested before a stop does not begin after it."""

    def stop(self) -> None:
        """Cancel the runs requested until now, and end started runs that have no control socket yet."""
        self.stops += 1

    async def start(self, request: StartRun, stops: int | None = None) -> Mapping[str, object]:
        """Start a run; return the answer to the command `start` when the run's control socket exists.

        ``stops`` is the value of the attribute ``stops`` when the run was requested: if it has grown since, the run
        does not begin. Raises BadMessage with the run's own output.
        """
        stops = self.stops if stops is None else stops
        words = [*command_arguments(request), f"--seed={request.seed}"]
        if request.speed is not None:
            words.append(f"--speed={request.speed:g}")
        recorded = "all" if request.record and self._record else "no"
        self._check_not_stopped(stops)
        self._reap()
        try:
            process, output = await asyncio.to_thread(self._popen, [*words, "--", request.mission], recorded)
        except OSError as error:  # too many processes, or no space for the output
            raise BadMessage("cannot_start", f"the run has not begun: {error}", "df -h /tmp; ulimit -u") from error
        run = str(process.pid)
        for _ in range(int(START_TIMEOUT / POLL_INTERVAL)):
            self._check_not_stopped(stops, process)
            code = process.poll()  # polled once: a short run may end between two checks
            if code in RUN_EXIT_CODES or has_control_socket(run):
                lines = (self._ended.get(run) or _last_output(output)).splitlines()
                return {"run": run, "message": "\n".join(line for line in lines if line.startswith("mission: "))}
            if code is not None:
                raise BadMessage("cannot_start", await self.last_output(run))
            await asyncio.sleep(POLL_INTERVAL)
        process.terminate()
        raise BadMessage("cannot_start", f"the run has not begun within {START_TIMEOUT:g} s: {_last_output(output)}")

    def _check_not_stopped(self, stops: int, process: "subprocess.Popen[bytes] | None" = None) -> None:
        if self.stops != stops:
            if process is not None:
                process.terminate()
            raise BadMessage("cannot_start", "all runs were stopped before it began", "start it again")

    async def last_output(self, run: str) -> str:
        """Return the last output of a run that was started here and has ended or is ending; else an empty text."""
        for _ in range(int(LAST_OUTPUT_TIMEOUT / POLL_INTERVAL)):
            self._reap()
            if run not in {str(child.pid) for child in [*self._children]}:
                break
            await asyncio.sleep(POLL_INTERVAL)
        return self._ended.get(run, "")

    def _reap(self) -> None:
        for child, output in [*self._children.items()]:
            if child.poll() is not None:
                del self._children[child]
                self._ended[str(child.pid)] = _last_output(output) or "the run has ended without output"
                output.close()
        while len(self._ended) > MAX_KEPT_RUNS:
            del self._ended[next(iter(self._ended))]

    @property
    def running(self) -> list[int]:
        """Process ids of the started runs that have not ended."""
        self._reap()
        return sorted(child.pid for child in [*self._children])

    def _popen(self, words: Sequence[str], recorded: str) -> "tuple[subprocess.Popen[bytes], IO[bytes]]":
        # A file, not a pipe: a run must not end with the studio by a broken pipe.
        output = tempfile.TemporaryFile()  # noqa: SIM115 - closed once the run has ended
        process = subprocess.Popen(  # noqa: S603 - ourselves
            [*self._command, *words], stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True,
            env={**os.environ, RECORD_ENVIRONMENT_VARIABLE: recorded},
        )  # fmt: skip
        self._children[process] = output
        return process, output


def _last_output(output: IO[bytes]) -> str:
    """Return the last lines of output of a run."""
    size = os.fstat(output.fileno()).st_size
    return os.pread(output.fileno(), 4000, max(0, size - 4000)).decode(errors="replace").strip()


Json = dict[str, object]

TASK_TIMEOUT = 30.0
"""Seconds that a `mission task` command may take."""


def answer_tasks(command: ClientCommand) -> Json:
    """Return the answer to the command `tasks`: the tasks of the queue, and whether a task server runs."""
    ended = isinstance(command, TasksQuery) and command.ended
    path, now = queue_file(state_folder()), wall_clock()
    if not path.exists():
        return {"tasks": [], "served": False}
    with queue_errors(path), closing(open_db(path)) as connection:
        queue = TaskQueue(connection, channels_of, local_zone())
        found = [replace(task, due=queue.expected_time(task, now)) for task in queue.tasks(ended=ended)]
    tasks = [asdict(task) | {"channels": [public_text(each) for each in task.channels]} for task in found]
    return {"tasks": tasks, "served": is_locked(server_lock(state_folder()))}


def answer_add_task(command: ClientCommand) -> Json:
    """Return the answer to `add_task`: runs `mission task add`, which checks the mission for its robot."""
    if not isinstance(command, AddTask):
        raise TypeError(command.word)
    check_names(command)
    words = list(command_arguments(command))
    words += [f"--{name}={value}" for name, value in (("at", command.at), ("every", command.every)) if value]
    words += [f"--priority={command.priority}", f"--retry={command.retry}"]
    words += ["--needs-approval"] * command.needs_approval
    output = _run_task_command("add", *words, "--", command.mission)
    found = search(r"task (\d+)", output)
    return {"task": int(found[1]) if found else None, "message": output}


def answer_cancel_task(command: ClientCommand) -> Json:
    """Return the answer to the command `cancel_task`: the output of `mission task remove`."""
    return {"message": _run_task_command("remove", str(command.task if isinstance(command, CancelTask) else 0))}


def answer_approve_task(command: ClientCommand) -> Json:
    """Return the answer to the command `approve_task`: the output of `mission task approve`."""
    return {
        "message": _run_task_command("approve", f"--by={command.by}", str(command.task))
        if isinstance(command, ApproveTask)
        else {}
    }


def answer_move_task(command: ClientCommand) -> Json:
    """Return the answer to the command `move_task` (a new priority): the output of `mission task move`."""
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
"""Handlers of the commands about tasks, by command word."""


def check_names(command: AddTask | StartRun) -> None:
    """Raise BadMessage if the library does not have the mission, robot or world."""
    check_name("missions", command.mission)
    if command.robot:
        check_name("robots", command.robot)
    if command.world:
        check_name("worlds", command.world)


def _run_task_command(*words: str) -> str:
    """Run `mission task` with the arguments ``words``; return its output. Raises BadMessage with its error message."""
    done = subprocess.run(  # noqa: S603 - ourselves
        [sys.executable, "-m", "missions", "task", *words],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=TASK_TIMEOUT, check=False,
    )  # fmt: skip
    if done.returncode:
        raise BadMessage("bad_task", done.stderr.strip()[-4000:] or f"it ended with exit code {done.returncode}")
    return done.stdout.strip()
