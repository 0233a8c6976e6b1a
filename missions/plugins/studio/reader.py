"""What the studio reads of files, in processes of its own: a large record keeps no stop from its run."""

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

from config.editing import NotEditableError
from config.faults import InvalidFileError
from config.library import UnknownNameError
from missions.control.commands import BadMessage, Command
from missions.library.tuning import keep
from missions.plugins.records.recording.faults import InvalidRecordError
from missions.plugins.studio import failsafe, library, looking_back, moments, queueing
from missions.plugins.studio.wishes import Start
from missions.plugins.tasks.task import TaskError

WORKERS = 2
"""Processes: while one reads a long record, another answers."""

PATIENCE = 60.0
"""Seconds that a piece of work may take."""

NICE = 5
"""How far a reader stands back behind the runs."""

DOES: Mapping[str, Callable[[Command], dict[str, object]]] = {
    **library.DOES,
    **looking_back.DOES,
    **moments.DOES,
    **queueing.DOES,
    **failsafe.DOES,
}
"""What does each command that no run answers."""

ERRORS: Mapping[type[Exception], str] = {
    InvalidFileError: "bad_file",
    NotEditableError: "bad_file",
    UnknownNameError: "bad_file",
    InvalidRecordError: "bad_record",
    TaskError: "bad_task",
    OSError: "bad_file",
}
"""What the errors of others are called in answers."""

Given = TypeVar("Given")
Found = TypeVar("Found")


class Reader:
    """Does what commands ask for that only read files, or that change the queue of tasks."""

    def __init__(self) -> None:
        self._pool = _pool()

    async def do(self, command: Command) -> Mapping[str, object]:
        """Return what is answered. Raises BadMessage with the name of what went wrong."""
        return await self._work(read, command)

    async def check(self, command: Start) -> None:
        """Raise BadMessage for a mission, robot or world that is none of those that there are."""
        await self._work(checked, command)

    async def keep(self, tuning: Mapping[str, Any]) -> Mapping[str, object]:
        """Write what was tuned in a run into its robot file; return what is answered. Raises BadMessage."""
        return await self._work(kept, tuning)

    async def report(self, name: str) -> str:
        """Return the report of a record, as a page. Raises BadMessage."""
        return await self._work(reported, name)

    async def _work(self, work: Callable[[Given], Found], given: Given) -> Found:
        pool = self._pool
        try:
            async with asyncio.timeout(PATIENCE):
                return await asyncio.get_running_loop().run_in_executor(pool, work, given)
        except BrokenProcessPool as error:
            if self._pool is pool:
                self._pool = _pool()
            raise BadMessage("fault", "what reads files has died; ask again") from error
        except TimeoutError as error:
            if self._pool is pool:  # what hangs on would take the place of all that comes
                self._pool = _pool()
                await asyncio.to_thread(_end, pool)
            raise BadMessage("fault", f"it took more than {PATIENCE:g} s") from error

    def close(self) -> None:
        """End the processes, whatever they do."""
        _end(self._pool)


def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn"), initializer=_begin)


def _end(pool: ProcessPoolExecutor) -> None:
    processes = list(getattr(pool, "_processes", None) or {})
    pool.shutdown(wait=False, cancel_futures=True)
    for number in processes:
        with suppress(ProcessLookupError):
            os.kill(number, 15)
    pool.shutdown(wait=True)


def _begin() -> None:
    """Stand back behind the runs, and end with the studio, however that ends."""
    os.nice(NICE)

    def end() -> None:
        studio = parent_process()
        if studio is not None:
            studio.join()
        os._exit(0)

    Thread(target=end, name="end with the studio", daemon=True).start()


def read(command: Command) -> dict[str, object]:
    """Do a command, in a reader's process. Raises BadMessage."""
    with _by_name():
        return DOES[command.word](command)


def reported(name: str) -> str:
    """Return the report of a record, in a reader's process. Raises BadMessage."""
    with _by_name():
        return looking_back.report(name)


def kept(tuning: Mapping[str, Any]) -> dict[str, object]:
    """Write what was tuned into the robot file, in a reader's process. Raises BadMessage."""
    values = {each["name"]: each["value"] for each in tuning["knobs"] if each["tuned"]}
    with _by_name():
        changes = keep(Path(tuning["file"]), values, "mission run MISSION --robot FILE")
    return {"file": tuning["file"], "changes": changes}


@contextmanager
def _by_name() -> Iterator[None]:
    """Name the errors of others as answers do."""
    try:
        yield
    except tuple(ERRORS) as error:
        name = next(name for kind, name in ERRORS.items() if isinstance(error, kind))
        hint = getattr(error, "hint", "")
        raise BadMessage(name, str(error)[:4000], hint if isinstance(hint, str) else "") from None


def checked(command: Start) -> None:
    """Check what a run is to be started with. Raises BadMessage."""
    queueing.check_wanted(command)
