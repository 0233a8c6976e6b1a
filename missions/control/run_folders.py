"""The folders in which a run of this user can have its control socket and its note, whatever the environment says.

`mission stop` may be typed where other variables are set than where the run began: by cron, a system unit, `su`,
`docker exec`. So the folders that depend on the environment are looked at, and those that depend on the user alone.
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

# Calls on folders that may hang, such as a home on a network disk that is gone: given up after a moment.
#
# A call that hangs cannot be ended. So it is made in a thread of its own, which is left behind, and while it hangs no
# other call is made on its folder.

FOLDER_TIMEOUT = 1.0
"""Seconds that a folder has to answer, where a person waits for it."""

CHECK_TIMEOUT = 0.1
"""Seconds that a folder has to answer to the thread of a run that also hears stops."""

Result = TypeVar("Result")


class FolderTimeoutError(TimeoutError):
    """A folder has not answered: nothing is known of what is in it."""

    def __init__(self, folder: Path) -> None:
        super().__init__(f"{folder} does not answer (a network disk that is gone?)")


class _FolderCall(Generic[Result]):
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


_hung_threads: dict[Path, Thread] = {}
_lock = Lock()


def call_with_timeout(folder: Path, work: Callable[[], Result], seconds: float = FOLDER_TIMEOUT) -> Result:
    """Return the result of work on a folder. Raises what it raises, and FolderTimeoutError after so many seconds."""
    found = call_all_with_timeout({folder: work}, seconds)[folder]
    if isinstance(found, OSError):
        raise found
    return found


def call_all_with_timeout(
    works: Mapping[Path, Callable[[], Result]], seconds: float = FOLDER_TIMEOUT
) -> dict[Path, Result | OSError]:
    """Return the result of work on each of several folders at the same time, or its OSError."""
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
"""The variable with the folder below which `/run/user` and the homes of users are looked for: tests set it."""

SESSION_SUBFOLDER = "missiontree/runs"
"""The folder of runs below that of a session, such as `/run/user/1000`."""

HOME_SUBFOLDER = ".local/state/missiontree/run/runs"
"""The folder of runs below the home of a user."""


@dataclass(frozen=True, slots=True)
class RunFolder:
    """A ``folder`` of runs. ``is_own`` says that it is one of this user, who may create it."""

    folder: Path
    is_own: bool = True

    def prepare(self) -> Path:
        """Return the folder, created where it is missing, for its owner alone.

        Raises OSError: also for the folder of another user, into which no run of this user is put.
        """
        if not self.is_own:
            raise PermissionError(f"{self.folder} is not this user's")
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = self.folder.stat()
        if status.st_uid != os.geteuid():
            raise PermissionError(f"{self.folder} belongs to another user")
        if status.st_mode & 0o077:
            self.folder.chmod(0o700)
        return self.folder

    def file_names(self) -> list[str]:
        """Return the names of the files; none if the folder does not exist.

        None either where the folder belongs to another user: none of this user's runs is in it.

        Raises OSError where the folder cannot be read.
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
    """Return the owner of the innermost folder on the way that can be seen; None for nobody known.

    Where that is another user, this user could not have put a run into the folder either.
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
    """Return where runs of this user can be, the place for a new one first; for root those of all sessions besides.

    A home that does not answer within so many ``seconds`` counts as there.
    """
    uid = os.geteuid()
    found = [RunFolder(folder) for folder in _own_folders(environment, uid, seconds)]
    if uid == 0:
        found += _other_users_folders(environment, seconds)
    first = dict[Path, RunFolder]()
    for each in found:
        first.setdefault(each.folder, each)
    return list(first.values())


def _own_folders(environment: Mapping[str, str], uid: int, seconds: float) -> Iterator[Path]:
    if Path(environment.get("XDG_RUNTIME_DIR", "")).is_absolute():
        yield runtime_folder(environment) / "runs"
    session = _system_root(environment) / "run/user" / str(uid)
    if _may_exist(session, seconds):  # it is the system's to create
        yield session / SESSION_SUBFOLDER
    if any(Path(environment.get(name, "")).is_absolute() for name in ("HOME", "XDG_STATE_HOME")):
        yield state_folder(environment) / "run" / "runs"  # without either, it is in the home that follows
    home = _home(environment, uid, seconds)
    if home is not None:
        yield home / HOME_SUBFOLDER


def _other_users_folders(environment: Mapping[str, str], seconds: float) -> Iterator[RunFolder]:
    """Yield the places of all who have a session, and of the user for whom `sudo` was typed."""
    sessions = _system_root(environment) / "run/user"
    try:
        names = call_with_timeout(sessions, lambda: os.listdir(sessions), seconds)  # noqa: PTH208 - as above
    except (FileNotFoundError, NotADirectoryError):
        names = []
    except OSError:
        names = []
        yield RunFolder(sessions, is_own=False)  # who looks there meets the error
    for uid in {int(name) for name in [*names, environment.get("SUDO_UID", "")] if name.isdecimal()} - {0}:
        yield RunFolder(sessions / str(uid) / SESSION_SUBFOLDER, is_own=False)
        home = _home(environment, uid, seconds)
        if home is not None:
            yield RunFolder(home / HOME_SUBFOLDER, is_own=False)


def _system_root(environment: Mapping[str, str]) -> Path:
    return Path(environment.get(SYSTEM_ROOT) or "/")


def _home(environment: Mapping[str, str], uid: int, seconds: float) -> Path | None:
    """Return the home that the system knows of a user, whatever HOME says; None for a user without one."""
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
"""By user: without a descriptor left, the password file looks as if it were empty."""


def _may_exist(folder: Path, seconds: float) -> bool:
    """Return whether there is such a folder, or that is not known."""
    try:
        return stat.S_ISDIR(call_with_timeout(folder, folder.stat, seconds).st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True
