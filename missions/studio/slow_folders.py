"""Calls on folders that may hang, such as a home on a network disk that is gone: given up after a moment.

A call that hangs cannot be ended. So it is made in a thread of its own, which is left behind, and while it hangs no
other call is made on its folder.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock, Thread
from typing import Generic, TypeVar

from drivers.clock import SystemClock

FOLDER_TIMEOUT = 1.0
"""Seconds that a folder has to answer, where a person waits for it."""

CHECK_TIMEOUT = 0.1
"""Seconds that a folder has to answer to the thread of a run that also hears stops."""

Result = TypeVar("Result")


class FolderTimeoutError(TimeoutError):
    """A folder has not answered: nothing is known of what is in it."""

    def __init__(self, folder: Path) -> None:
        super().__init__(f"{folder} does not answer (a network disk that is gone?)")


class _Call(Generic[Result]):
    """One call, in a thread of its own."""

    def __init__(self, work: Callable[[], Result]) -> None:
        self.results: list[Result] = []
        self.error: BaseException | None = None
        self._work = work
        self.thread = Thread(target=self._do, name="folder", daemon=True)

    def begin(self) -> None:
        """Start the thread; where the system allows no more threads, do the work here."""
        try:
            self.thread.start()
        except RuntimeError:
            self._do()

    def _do(self) -> None:
        try:
            self.results.append(self._work())
        except BaseException as error:
            self.error = error


_hanging: dict[Path, Thread] = {}
_lock = Lock()


def within(folder: Path, work: Callable[[], Result], seconds: float = FOLDER_TIMEOUT) -> Result:
    """Return the result of work on a folder. Raises what it raises, and FolderTimeoutError after so many seconds."""
    found = all_within({folder: work}, seconds)[folder]
    if isinstance(found, OSError):
        raise found
    return found


def all_within(
    works: Mapping[Path, Callable[[], Result]], seconds: float = FOLDER_TIMEOUT
) -> dict[Path, Result | OSError]:
    """Return the result of work on each of several folders at the same time, or its OSError."""
    calls: dict[Path, _Call[Result]] = {}
    for folder, work in works.items():
        with _lock:
            hangs = _hanging.get(folder)
            if hangs is not None and not hangs.is_alive():
                del _hanging[folder]
                hangs = None
        if hangs is None:
            calls[folder] = _Call(work)
            calls[folder].begin()
    clock = SystemClock()
    until = clock.now() + seconds
    found: dict[Path, Result | OSError] = {}
    for folder in works:
        call = calls.get(folder)
        if call is not None and call.thread.ident is not None:
            call.thread.join(max(0.0, until - clock.now()))
        if call is None or not (call.results or call.error):
            if call is not None:
                with _lock:
                    _hanging[folder] = call.thread
            found[folder] = FolderTimeoutError(folder)
        elif call.error is None:
            found[folder] = call.results[0]
        elif isinstance(call.error, OSError):
            found[folder] = call.error
        else:
            raise call.error
    return found
