"""Folders for control sockets and notes of this user's runs; some do not depend on the environment.

`mission stop` may have another environment than the run: cron, a system unit, `su`, `docker exec`. So it searches the
folders that the environment names, and those of the user's session and home.
"""

import os
import pwd
import stat
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from threading import Lock, Thread
from typing import Generic, TypeVar

from drivers.api.fast_dataclass import dataclass
from drivers.clock import SystemClock
from missions.library.folders import runtime_folder, state_folder

# Calls on folders that may block, such as a home on a network disk: abandoned after a timeout.
#
# A blocked call cannot be ended. So each call has its own thread, which is abandoned, and there are no other calls
# on its folder until it returns.

FOLDER_TIMEOUT = 1.0
"""Seconds within which a folder must respond to a command of a person, such as `mission stop`."""

CHECK_TIMEOUT = 0.1
"""Seconds within which a folder must respond to the thread of the control socket, which must be free to receive stops.
"""

Result = TypeVar("Result")


class FolderTimeoutError(TimeoutError):
    """A folder does not respond, so its contents are unknown."""

    def __init__(self, folder: Path) -> None:
        super().__init__(f"{folder} does not respond (network disk disconnected?)")


class _FolderCall(Generic[Result]):
    """A function call that reads or writes a folder, in a thread of its own, since the folder may not respond."""

    def __init__(self, work: Callable[[], Result]) -> None:
        self.results: list[Result] = []
        self.error: BaseException | None = None
        self._work = work
        self.thread = Thread(target=self._do, name="folder", daemon=True)

    def begin(self) -> None:
        """Start the thread; if the system allows no more threads, make the call here."""
        try:
            self.thread.start()
        except RuntimeError:
            self._do()

    def _do(self) -> None:
        try:
            self.results.append(self._work())
        except BaseException as error:
            self.error = error


_hung_threads: dict[Path, Thread] = {}
_lock = Lock()


def call_with_timeout(folder: Path, work: Callable[[], Result], seconds: float = FOLDER_TIMEOUT) -> Result:
    """Return the result of ``work``, a function that reads or writes ``folder``. Raises the exceptions of ``work``.

    Raises FolderTimeoutError after ``seconds``.
    """
    found = call_all_with_timeout({folder: work}, seconds)[folder]
    if isinstance(found, OSError):
        raise found
    return found


def call_all_with_timeout(
    works: Mapping[Path, Callable[[], Result]], seconds: float = FOLDER_TIMEOUT
) -> dict[Path, Result | OSError]:
    """Call each function on its folder, in parallel; return the results, or the OSErrors."""
    calls: dict[Path, _FolderCall[Result]] = {}
    for folder, work in works.items():
        with _lock:
            hangs = _hung_threads.get(folder)
            if hangs is not None and not hangs.is_alive():
                del _hung_threads[folder]
                hangs = None
        if hangs is None:
            calls[folder] = _FolderCall(work)
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
                    _hung_threads[folder] = call.thread
            found[folder] = FolderTimeoutError(folder)
        elif call.error is None:
            found[folder] = call.results[0]
        elif isinstance(call.error, OSError):
            found[folder] = call.error
        else:
            raise call.error
    return found


SYSTEM_ROOT = "MISSION_SYSTEM_ROOT"
"""Environment variable with a folder in which `/run/user` and home folders are searched instead of "/"; for tests."""

SESSION_SUBFOLDER = "missiontree/runs"
"""Path of the folder of runs within a session folder such as `/run/user/1000`."""

HOME_SUBFOLDER = ".local/state/missiontree/run/runs"
"""Path of the folder of runs within a home folder."""


@dataclass(frozen=True, slots=True)
class RunFolder:
    """A ``folder`` for runs; ``is_own`` means that it belongs to this user, who may create it."""

    folder: Path
    is_own: bool = True

    def prepare(self) -> Path:
        """Return the folder; create it with access for its owner only.

        Raises OSError, also if the folder belongs to another user.
        """
        if not self.is_own:
            raise PermissionError(f"{self.folder} belongs to another user")
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = self.folder.stat()
        if status.st_uid != os.geteuid():
            raise PermissionError(f"{self.folder} belongs to another user")
        if status.st_mode & 0o077:
            self.folder.chmod(0o700)
        return self.folder

    def file_names(self) -> list[str]:
        """Return the names of the files in the folder; empty if it does not exist or belongs to another user.

        Raises OSError if the folder cannot be read.
        """
        try:
            if os.geteuid() not in (0, self.folder.stat().st_uid):
                return []
            return os.listdir(self.folder)  # noqa: PTH208 - its errors are those of one call
        except (FileNotFoundError, NotADirectoryError):
            return []
        except PermissionError:
            if _nearest_owner(self.folder) in (None, os.geteuid()):
                raise
            return []


def _nearest_owner(folder: Path) -> int | None:
    """Return the user id that owns the folder, or its nearest parent that can be read; None if unknown.

    If the owner is another user, the folder cannot contain a run of this user.
    """
    for parent in (folder, *folder.parents):
        try:
            return parent.stat().st_uid
        except PermissionError:
            continue
        except OSError:
            return None
    return None


def run_folders(environment: Mapping[str, str] = os.environ, seconds: float = FOLDER_TIMEOUT) -> list[RunFolder]:
    """Return the folders of this user's runs, the one for new runs first; for root also those of other users.

    A home folder that does not respond within ``seconds`` is included.
    """
    uid = os.geteuid()
    found = [RunFolder(folder) for folder in _iter_own_folders(environment, uid, seconds)]
    if uid == 0:
        found += _other_users_folders(environment, seconds)
    first = dict[Path, RunFolder]()
    for each in found:
        first.setdefault(each.folder, each)
    return list(first.values())


def _iter_own_folders(environment: Mapping[str, str], uid: int, seconds: float) -> Iterator[Path]:
    if Path(environment.get("XDG_RUNTIME_DIR", "")).is_absolute():
        yield runtime_folder(environment) / "runs"
    session = _system_root(environment) / "run/user" / str(uid)
    if _may_exist(session, seconds):  # only the system may create it
        yield session / SESSION_SUBFOLDER
    if any(Path(environment.get(name, "")).is_absolute() for name in ("HOME", "XDG_STATE_HOME")):
        yield state_folder(environment) / "run" / "runs"  # without both variables, the home below is used
    home = _home(environment, uid, seconds)
    if home is not None:
        yield home / HOME_SUBFOLDER


def _other_users_folders(environment: Mapping[str, str], seconds: float) -> Iterator[RunFolder]:
    """Yield the folders of runs of all users who are logged in, and of the user who typed `sudo`."""
    sessions = _system_root(environment) / "run/user"
    try:
        names = call_with_timeout(sessions, lambda: os.listdir(sessions), seconds)  # noqa: PTH208 - as above
    except (FileNotFoundError, NotADirectoryError):
        names = []
    except OSError:
        names = []
        yield RunFolder(sessions, is_own=False)  # the search of this folder reports the error
    for uid in {int(name) for name in [*names, environment.get("SUDO_UID", "")] if name.isdecimal()} - {0}:
        yield RunFolder(sessions / str(uid) / SESSION_SUBFOLDER, is_own=False)
        home = _home(environment, uid, seconds)
        if home is not None:
            yield RunFolder(home / HOME_SUBFOLDER, is_own=False)


def _system_root(environment: Mapping[str, str]) -> Path:
    return Path(environment.get(SYSTEM_ROOT) or "/")


def _home(environment: Mapping[str, str], uid: int, seconds: float) -> Path | None:
    """Return the home folder from the password database, independent of HOME; None if there is none."""
    if root := environment.get(SYSTEM_ROOT):
        return Path(root) / "home" / str(uid)
    try:
        if uid not in _home_cache:
            _home_cache[uid] = Path(pwd.getpwuid(uid).pw_dir)
    except KeyError:
        return None
    home = _home_cache[uid]
    return home if home.is_absolute() and _may_exist(home, seconds) else None


_home_cache: dict[int, Path] = {}
"""Home folders by user id. They are kept since a lookup fails when no file descriptor is free."""


def _may_exist(folder: Path, seconds: float) -> bool:
    """Return False only if the folder certainly does not exist, True also if it does not respond."""
    try:
        return stat.S_ISDIR(call_with_timeout(folder, folder.stat, seconds).st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True
