"""Trial import of foreign Python code in a separate process, so that crashes, hangs and side effects are detected.

An import can raise any exception, sleep for ever, end the process, change the folder or start threads. None of that can
be caught in the importing process.
"""

import json
import os
import subprocess
import sys
import threading
import traceback
from collections.abc import Sequence
from contextlib import redirect_stdout, suppress
from functools import lru_cache
from pathlib import Path
from signal import SIGKILL, Signals
from typing import TYPE_CHECKING, Any

from drivers.api.fast_dataclass import dataclass

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


IMPORT_TIMEOUT = 20.0
"""Seconds that a trial import in a separate process may take."""

MAX_REPORT = 1 << 16
"""Maximum bytes that are read of the trial process's report."""


@dataclass(frozen=True, slots=True)
class ImportProblem:
    """Reason why Python code cannot be imported; ``line`` is the line of the error in its file, 0 if unknown."""

    message: str
    line: int = 0
    column: int = 1


def find_file_problem(path: Path) -> ImportProblem | None:
    """Return why a Python file cannot be imported; None if it can."""
    status = path.stat()
    return _try_import("file", str(path.resolve()), tuple(sys.path), (status.st_mtime_ns, status.st_size))


def find_entry_point_problem(point: "EntryPoint") -> ImportProblem | None:
    """Return why an entry point cannot be imported; None if it can."""
    if _is_imported(point.value):
        return None
    return _try_import("name", point.value, tuple(sys.path), None if point.dist is None else point.dist.version)


def find_name_problem(name: str) -> ImportProblem | None:
    """Return why a dotted name, ``package.module:attribute``, cannot be imported; None if it can."""
    return None if _is_imported(name) else _try_import("name", name, tuple(sys.path), None)


def _is_imported(name: str) -> bool:
    """Return whether the module of a dotted name is imported already."""
    return name.partition(":")[0].strip() in sys.modules


@lru_cache(maxsize=256)
def _try_import(kind: str, value: str, path: tuple[str, ...], version: object) -> ImportProblem | None:
    """Import ``value`` in another process with the module search path ``path``; return the problem, or None.

    ``kind`` is the kind of ``value``: a file, an entry point or a dotted name. Results are cached by ``version``.
    """
    del version
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as report:
        try:
            process = subprocess.Popen(  # noqa: S603 - of ours
                [sys.executable, "-P", "-c", f"from {__name__} import main; main()", kind, value, str(writing)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[writing],
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(path), "PYTHONDONTWRITEBYTECODE": "1"},
            )
        except OSError:  # no process can be started: the import is tried without a trial
            return None
        finally:
            os.close(writing)
        try:
            code = process.wait(IMPORT_TIMEOUT)
        except subprocess.TimeoutExpired:
            return ImportProblem(f"its import takes more than {IMPORT_TIMEOUT:g} s")
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, SIGKILL)  # its child processes too
            process.wait()
        os.set_blocking(report.fileno(), False)
        return _parse_report(report.read(MAX_REPORT) or b"", code)


def _parse_report(report: bytes, code: int) -> ImportProblem | None:
    """Return the problem in the report of a trial process that ended with ``code``; None if the import succeeded."""
    try:
        found = json.loads(report)
        return None if found is None else ImportProblem(str(found[0]), int(found[1]), int(found[2]))
    except (ValueError, TypeError, IndexError):
        with suppress(ValueError):
            return ImportProblem(f"its import ends the process by {Signals(-code).name}")
        return ImportProblem(f"its import ends the process with exit code {code}")


def error_text(error: BaseException) -> str:
    """Return the type and message of an exception."""
    try:
        words = str(error.msg if isinstance(error, SyntaxError) else error)
    except Exception:  # its __str__ raises
        words = ""
    return f"{type(error).__name__}: {words[:500]}" if words else type(error).__name__


def short_repr(value: object) -> str:
    """Return the start of the repr of a value; its type if the repr fails."""
    try:
        return f"{value!r:.60}"
    except Exception:  # its __repr__ raises
        return f"a {type(value).__name__}"


def error_position(error: BaseException, path: str) -> tuple[int, int]:
    """Return line and column of a file at which an error occurred; line 0 if it occurred elsewhere."""
    if isinstance(error, SyntaxError) and error.filename == path:
        return error.lineno or 1, error.offset or 1
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == path]
    return (lines[-1] or 1, 1) if lines else (0, 1)


def main() -> None:
    """Import the object that the arguments name, write the problem found (or null) to a pipe, and end the process."""
    kind, value, number = sys.argv[1:]
    folder = Path.cwd()
    report: object = None
    try:
        _import(kind, value)
    except BaseException as error:
        report = (f"cannot be imported: {error_text(error)}", *error_position(error, value))
    else:
        if Path.cwd() != folder:
            report = ("its import changes the current folder", 0, 1)
        elif others := [each.name for each in threading.enumerate() if each is not threading.main_thread()]:
            report = (f"its import starts a thread ({others[0][:60]})", 0, 1)
    os.write(int(number), json.dumps(report).encode())
    os._exit(0)  # skips threads and exit handlers of the imported module


def _import(kind: str, value: str) -> None:
    if kind == "file":
        name = f"missiontree_behaviours.{Path(value).stem}"
        module = type(sys)(name)
        module.__file__ = value
        sys.modules[name] = module
        text = Path(value).read_text(encoding="utf-8")
        exec(compile(text, value, "exec"), vars(module))  # noqa: S102 - running it is what was asked for
    else:
        from importlib.metadata import EntryPoint  # noqa: PLC0415 - only here

        EntryPoint("tried", value, "").load()


# Entry points of other distributions: found quickly, since each command needs them, and loaded safely.


def entry_points_of(group: str) -> Sequence["EntryPoint"]:
    """Return the entry points of a ``group``, by name.

    Usually there are none. To find this out, the files that declare entry points are searched for the group's name in a
    few milliseconds; ``importlib.metadata`` would take a tenth of the time of `mission check`. If the path contains
    archives, ``importlib.metadata`` is always used.
    """
    folders = [Path(name) for name in dict.fromkeys(sys.path)]
    read = all(folder.is_dir() or not folder.exists() for folder in folders)
    if read and not _is_declared(group, tuple((folder, _modified_at(folder)) for folder in folders)):
        return []
    from importlib.metadata import entry_points  # noqa: PLC0415 - where there are some

    return sorted(entry_points(group=group), key=lambda point: (point.name, point.value))


def _modified_at(folder: Path) -> int:
    """Return the modification time (ns) of a folder, which installations change; 0 if it does not exist."""
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=64)
def _is_declared(group: str, folders: tuple[tuple[Path, int], ...]) -> bool:
    """Return True if a distribution in ``folders`` declares entry points of the group.

    Results are cached by the modification times of the folders.
    """
    files = (file for folder, _ in folders for file in folder.glob("*-info/entry_points.txt"))
    return any(group in file.read_text(encoding="utf-8", errors="replace") for file in files)


class BrokenEntryPointError(ValueError):
    """An entry point that cannot be loaded; the message is the reason."""


def load_entry_point(point: "EntryPoint") -> Any:
    """Return the object of an entry point, imported after a trial import in a separate process.

    Raises BrokenEntryPointError.
    """
    if problem := find_entry_point_problem(point):
        raise BrokenEntryPointError(problem.message)
    try:
        with redirect_stdout(sys.stderr):  # its output must not mix with the command's
            return point.load()
    except Exception as error:
        raise BrokenEntryPointError(f"cannot be imported: {error_text(error)}") from error


def owner_of(point: "EntryPoint") -> str:
    """Return the distribution of an entry point; empty if unknown."""
    return point.dist.name if point.dist is not None else ""


def describe_entry_point(point: "EntryPoint") -> str:
    """Return an entry point as declared, with its distribution."""
    owner = owner_of(point)
    return f"{point.name} = {point.value}" + (f" of {owner}" if owner else "")
