"""Python of other people, imported in a process of its own first: what would end, hang or upset ours is found there.

An import can raise whatever it likes, sleep for ever, end the process, change its folder or start threads. None of that
can be caught where it happens.
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
"""Seconds that an import may take."""

MAX_REPORT = 1 << 16
"""Bytes of the report that are read."""


@dataclass(frozen=True, slots=True)
class ImportProblem:
    """Why something cannot be imported; ``line`` is that of its file, 0 where it is not known."""

    message: str
    line: int = 0
    column: int = 1


def find_file_problem(path: Path) -> ImportProblem | None:
    """Return why a file of Python cannot be imported; None for one that can."""
    status = path.stat()
    return _try_import("file", str(path.resolve()), tuple(sys.path), (status.st_mtime_ns, status.st_size))


def find_entry_point_problem(point: "EntryPoint") -> ImportProblem | None:
    """Return why an entry point cannot be imported; None for one that can."""
    if _is_imported(point.value):
        return None
    return _try_import("name", point.value, tuple(sys.path), None if point.dist is None else point.dist.version)


def find_name_problem(name: str) -> ImportProblem | None:
    """Return why a dotted name, ``package.module:attribute``, cannot be imported; None for one that can."""
    return None if _is_imported(name) else _try_import("name", name, tuple(sys.path), None)


def _is_imported(name: str) -> bool:
    """Return whether the module of a dotted name was imported already: that does not happen again."""
    return name.partition(":")[0].strip() in sys.modules


@lru_cache(maxsize=256)
def _try_import(kind: str, value: str, path: tuple[str, ...], version: object) -> ImportProblem | None:
    """Try an import in another process, which has the same ``path``; once for each ``version``."""
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
        except OSError:  # no room for another process: it is tried where it is used
            return None
        finally:
            os.close(writing)
        try:
            code = process.wait(IMPORT_TIMEOUT)
        except subprocess.TimeoutExpired:
            return ImportProblem(f"its import takes more than {IMPORT_TIMEOUT:g} s")
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, SIGKILL)  # what it has started, too
            process.wait()
        os.set_blocking(report.fileno(), False)
        return _parse_report(report.read(MAX_REPORT) or b"", code)


def _parse_report(report: bytes, code: int) -> ImportProblem | None:
    """Return what a process has reported that has ended with ``code``."""
    try:
        found = json.loads(report)
        return None if found is None else ImportProblem(str(found[0]), int(found[1]), int(found[2]))
    except (ValueError, TypeError, IndexError):
        with suppress(ValueError):
            return ImportProblem(f"its import ends the process by {Signals(-code).name}")
        return ImportProblem(f"its import ends the process with exit code {code}")


def error_text(error: BaseException) -> str:
    """Return an error in words: its type, and its message where it has one that can be read."""
    try:
        words = str(error.msg if isinstance(error, SyntaxError) else error)
    except Exception:  # its own __str__ raises
        words = ""
    return f"{type(error).__name__}: {words[:500]}" if words else type(error).__name__


def short_repr(value: object) -> str:
    """Return the beginning of what a value says it is; its type where it does not."""
    try:
        return f"{value!r:.60}"
    except Exception:  # its own __repr__ raises
        return f"a {type(value).__name__}"


def error_position(error: BaseException, path: str) -> tuple[int, int]:
    """Return the line and column of a file at which an error came up; line 0 where it did not."""
    if isinstance(error, SyntaxError) and error.filename == path:
        return error.lineno or 1, error.offset or 1
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == path]
    return (lines[-1] or 1, 1) if lines else (0, 1)


def main() -> None:
    """Import what the arguments name, and report what is wrong with that; ends the process."""
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
    os._exit(0)  # whatever it has started, or has set up for the end


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


# Entry points of other distributions: found quickly, as each command looks at them, and loaded safely.


def entry_points_of(group: str) -> Sequence["EntryPoint"]:
    """Return the entry points of a ``group``, by name.

    Mostly there are none, which the files that declare them say in a few milliseconds; ``importlib.metadata`` takes a
    tenth of what a check does. What is on the path and no folder, such as an archive, only that can read.
    """
    folders = [Path(name) for name in dict.fromkeys(sys.path)]
    read = all(folder.is_dir() or not folder.exists() for folder in folders)
    if read and not _is_declared(group, tuple((folder, _modified_at(folder)) for folder in folders)):
        return []
    from importlib.metadata import entry_points  # noqa: PLC0415 - where there are some

    return sorted(entry_points(group=group), key=lambda point: (point.name, point.value))


def _modified_at(folder: Path) -> int:
    """Return when a folder was changed last, in nanoseconds: something was installed, or went; 0 if it is not there."""
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=64)
def _is_declared(group: str, folders: tuple[tuple[Path, int], ...]) -> bool:
    """Whether any distribution in ``folders``, as they were when they were changed last, declares a group."""
    files = (file for folder, _ in folders for file in folder.glob("*-info/entry_points.txt"))
    return any(group in file.read_text(encoding="utf-8", errors="replace") for file in files)


class BrokenEntryPointError(ValueError):
    """An entry point that cannot be loaded; the message says why."""


def load_entry_point(point: "EntryPoint") -> Any:
    """Import the object of an entry point, after a trial in a process of its own. Raises BrokenOfferError."""
    if problem := find_entry_point_problem(point):
        raise BrokenEntryPointError(problem.message)
    try:
        with redirect_stdout(sys.stderr):  # its output must not mix with the answer of the command
            return point.load()
    except Exception as error:
        raise BrokenEntryPointError(f"cannot be imported: {error_text(error)}") from error


def owner_of(point: "EntryPoint") -> str:
    """Return the name of the distribution that declares an entry point; empty where that is unknown."""
    return point.dist.name if point.dist is not None else ""


def describe_entry_point(point: "EntryPoint") -> str:
    """Return an entry point as it is declared, with its distribution."""
    owner = owner_of(point)
    return f"{point.name} = {point.value}" + (f" of {owner}" if owner else "")
