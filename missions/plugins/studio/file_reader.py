"""Worker processes that read files for the studio, so that a large record delays no stop."""

import asyncio
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any, TypeVar

from config.diagnostics import InvalidFileError
from config.library import UnknownNameError
from config.yaml_edit import NotEditableError
from missions.control.commands import BadMessage, ClientCommand
from missions.library.tuning import save_values
from missions.plugins.records.recording.validation import InvalidRecordError
from missions.plugins.studio import failsafe, library, moment_query, record_queries, run_launcher
from missions.plugins.studio.studio_commands import StartRun
from missions.plugins.tasks.task import TaskError

MAX_WORKERS = 2
"""Number of worker processes: one answers while another reads a long record."""

WORK_TIMEOUT = 60.0
"""Seconds that a worker process may take for one command or report."""

NICENESS = 5
"""Niceness of the worker processes (0 is normal, 19 the lowest priority), so that runs come first."""

HANDLERS: Mapping[str, Callable[[ClientCommand], dict[str, object]]] = {
    **library.HANDLERS,
    **record_queries.HANDLERS,
    **moment_query.HANDLERS,
    **run_launcher.HANDLERS,
    **failsafe.HANDLERS,
}
"""Handlers, by command word, of the commands that no run answers."""

ERROR_NAMES: Mapping[type[Exception], str] = {
    InvalidFileError: "bad_file",
    NotEditableError: "bad_file",
    UnknownNameError: "bad_file",
    InvalidRecordError: "bad_record",
    TaskError: "bad_task",
    OSError: "bad_file",
}
"""Names of errors in the answers to clients, such as "bad_file", by exception class."""

Given = TypeVar("Given")
Found = TypeVar("Found")


class FileReader:
    """Runs commands that read files or change the task queue, in worker processes."""

    def __init__(self) -> None:
        self._pool = _make_pool()

    async def do(self, command: ClientCommand) -> Mapping[str, object]:
        """Return the answer of a command. Raises BadMessage with the name of the error."""
        return await self._work(run_command, command)

    async def check(self, command: StartRun) -> None:
        """Raise BadMessage if the library does not have the mission, robot or world."""
        await self._work(check_start, command)

    async def keep(self, tuning: Mapping[str, Any]) -> Mapping[str, object]:
        """Write the tuned values of a run to its robot file; return the answer. Raises BadMessage."""
        return await self._work(keep_tuning, tuning)

    async def report(self, name: str) -> str:
        """Return the report of a record as an HTML page. Raises BadMessage."""
        return await self._work(make_report, name)

    async def _work(self, work: Callable[[Given], Found], argument: Given) -> Found:
        pool = self._pool
        try:
            async with asyncio.timeout(WORK_TIMEOUT):
                return await asyncio.get_running_loop().run_in_executor(pool, work, argument)
        except BrokenProcessPool as error:
            if self._pool is pool:
                self._pool = _make_pool()
            raise BadMessage("fault", "the process that reads files died; try again") from error
        except TimeoutError as error:
            if self._pool is pool:  # a hanging worker would block later work
                self._pool = _make_pool()
                await asyncio.to_thread(_end_pool, pool)
            raise BadMessage("fault", f"it took more than {WORK_TIMEOUT:g} s") from error

    def close(self) -> None:
        """End the worker processes at once, even while they work."""
        _end_pool(self._pool)


def _make_pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(MAX_WORKERS, mp_context=get_context("spawn"), initializer=_prepare_worker)


def _end_pool(pool: ProcessPoolExecutor) -> None:
    processes = list(getattr(pool, "_processes", None) or {})
    pool.shutdown(wait=False, cancel_futures=True)
    for number in processes:
        with suppress(ProcessLookupError):
            os.kill(number, 15)
    pool.shutdown(wait=True)


def _prepare_worker() -> None:
    """Lower the priority of a worker, and have it end with the studio, even after a crash."""
    os.nice(NICENESS)

    def end() -> None:
        studio = parent_process()
        if studio is not None:
            studio.join()
        os._exit(0)

    Thread(target=end, name="end with the studio", daemon=True).start()


def run_command(command: ClientCommand) -> dict[str, object]:
    """Run a command of a client in a worker process. Raises BadMessage."""
    with _named_errors():
        return HANDLERS[command.word](command)


def make_report(name: str) -> str:
    """Return the report of a record; runs in a worker. Raises BadMessage."""
    with _named_errors():
        return record_queries.render_report(name)


def keep_tuning(tuning: Mapping[str, Any]) -> dict[str, object]:
    """Write tuned values to a robot file; runs in a worker. Raises BadMessage."""
    values = {each["name"]: each["value"] for each in tuning["knobs"] if each["tuned"]}
    with _named_errors():
        changes = save_values(Path(tuning["file"]), values, "mission run MISSION --robot FILE")
    return {"file": tuning["file"], "changes": changes}


@contextmanager
def _named_errors() -> Iterator[None]:
    """Convert exceptions of the classes in ``ERROR_NAMES`` to BadMessage, with the error's name and hint."""
    try:
        yield
    except tuple(ERROR_NAMES) as error:
        name = next(name for kind, name in ERROR_NAMES.items() if isinstance(error, kind))
        hint = getattr(error, "hint", "")
        raise BadMessage(name, str(error)[:4000], hint if isinstance(hint, str) else "") from None


def check_start(command: StartRun) -> None:
    """Check the names in a request to start a run; runs in a worker. Raises BadMessage."""
    run_launcher.check_names(command)
