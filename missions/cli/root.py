"""The ``mission`` command: runs a subcommand, and converts exceptions into messages and exit codes."""

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import click

from missions.cli.commands import OWN_PROCESS, MissionGroup
from missions.cli.printable import use_printable_streams

# Commands that run out of memory: one message with a hint, whatever the type of the error.

MIN_MEMORY_BYTES = 1_000_000_000
"""Memory limit in bytes of address space below which a warning is printed; simulation and cameras take 600 MB."""

MEMORY_ERROR_TEXTS = (
    "failed to map segment",
    "cannot allocate memory",
    "insufficient memory",
    "can't start new thread",
    "unable to allocate",
    "failed to allocate",
)
"""Lower-case parts of library messages that mean a lack of memory."""


class OutOfMemoryError(Exception):
    """A command ran out of memory; the message is that of the original error."""


def memory_error(error: BaseException) -> str:
    """Return the message of an out-of-memory error among ``error`` and its causes; empty if there is none."""
    visited: list[BaseException] = []
    at: BaseException | None = error
    while at is not None and at not in visited:
        visited.append(at)
        if isinstance(at, MemoryError) or (isinstance(at, OSError) and at.errno == errno.ENOMEM):
            return str(at) or "no memory is left"
        for line in _message_of(at).splitlines():
            if any(sign in line.lower() for sign in MEMORY_ERROR_TEXTS):
                return line.strip()[-200:]
        at = at.__cause__ or at.__context__
    return ""


def _message_of(error: BaseException) -> str:
    """Return the message of an error; empty if it cannot be read.

    Also empty if a thread could not be started although memory is not limited: the limit of processes may be the cause.
    """
    try:
        words = str(error)
    except Exception:  # an error of another library
        return ""
    return "" if "start new thread" in words and memory_limit() is None else words


def memory_limit() -> int | None:
    """Return the memory limit of this process in bytes (``ulimit -v`` and ``-d``); None if unlimited."""
    try:
        import resource  # noqa: PLC0415 - Python in a browser does not have it
    except ImportError:
        return None
    found = [resource.getrlimit(each)[0] for each in (resource.RLIMIT_AS, resource.RLIMIT_DATA)]
    return min((each for each in found if each != resource.RLIM_INFINITY), default=None)


def warn_of_memory_limit() -> None:
    """Warn of a low memory limit; C libraries may end the process without a message when they reach it."""
    allowed = memory_limit()
    if allowed is not None and allowed < MIN_MEMORY_BYTES:
        message = f"mission: memory is limited to {allowed / 1e6:.0f} MB, so this may run out of memory"
        click.echo(f"{message}\n  try: {memory_advice(allowed)}", err=True)


def memory_advice(limit: int | None) -> str:
    """Return a command for the user to type when memory is short.

    ``limit`` is the memory limit of this process in bytes, None if unlimited.
    """
    if limit is not None:
        return f"ulimit -v unlimited; ulimit -d unlimited  (in this shell; now {limit // 1024} kB)"
    return "free -m  (shows free memory), and end other programs"


SUCCESS, FAILURE, USAGE, DEVICE, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 70, 130
"""Exit codes: mission success and failure, usage or file error, device error, internal error, interrupted."""

COMPLETION_VARIABLE = "_MISSION_COMPLETE"
"""Environment variable that a shell sets to request completions."""


@click.group(
    cls=MissionGroup, context_settings={"help_option_names": ["-h", "--help"]}, epilog="Example: mission run greet"
)
@click.version_option(package_name="missiontree", prog_name="mission")
def mission() -> None:
    """Run missions for robots, written as readable behaviour trees."""


def main() -> None:
    """Run ``mission`` with the arguments of the process, and exit."""
    # Without a standard stream (`>&-`), libraries that use it would fail, here and in child processes.
    for number in (1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
            os.set_inheritable(number, True)
    sys.stdout = sys.stdout or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - for the whole process
    sys.stderr = sys.stderr or sys.stdout
    if COMPLETION_VARIABLE in os.environ:
        import_module("missions.cli.completion")  # it reads the requests of shells
    warn_of_memory_limit()
    with use_printable_streams():
        try:
            code = run_guarded(lambda: mission.main(standalone_mode=False, obj=OWN_PROCESS))
        except (ImportError, OSError, MemoryError) as error:  # raised while our modules are imported
            if not (why := memory_error(error)):
                raise
            code = _print_memory_error(why)
    sys.exit(code)


def run_guarded(work: Callable[[], object]) -> int:
    """Call ``work`` and return the exit code of the process; print an exception as a message."""
    from config.diagnostics import InvalidFileError, InvalidInputError  # noqa: PLC0415 - `mission --help` needs none of this
    from config.library import UnknownNameError  # noqa: PLC0415
    from config.units import quoted_value  # noqa: PLC0415
    from drivers.errors import DriverError  # noqa: PLC0415
    from missions.cli.origin import forget_origin  # noqa: PLC0415
    from perception.model_files import ModelFileError  # noqa: PLC0415

    forget_origin()
    try:
        code = _convert_memory_errors(work)
    except OutOfMemoryError as error:
        return _print_memory_error(str(error))
    except click.exceptions.Exit as done:
        return done.exit_code
    except click.ClickException as error:
        error.show()
        _print_robot_origin(error.format_message())
        return USAGE
    except (click.Abort, KeyboardInterrupt):
        click.echo("mission: interrupted", err=True)
        return INTERRUPTED
    except (InvalidInputError, UnknownNameError, ModelFileError) as error:
        click.echo(str(error) if isinstance(error, InvalidFileError) else f"mission: {error}", err=True)
        _print_robot_origin(str(error))
        return USAGE
    except DriverError as error:
        click.echo(f"mission: {error}" + (f"\n  try: {error.hint}" if error.hint else ""), err=True)
        _print_robot_origin(f"robot: {error}")
        return DEVICE
    except BrokenPipeError:  # stdout was closed by its reader, as in `mission list | head -1`
        sys.stdout = None  # so that Python does not flush into the closed pipe at exit
        return SUCCESS
    except OSError as error:  # a file name that is too long, or a full disk behind stdout
        what = "cannot write" if error.filename is None else quoted_value(str(error.filename))
        with suppress(OSError):
            click.echo(f"mission: {what}: {error.strerror or error}", err=True)
        sys.stdout = None
        return USAGE
    except Exception as error:
        return _print_internal_error(error)
    return code if isinstance(code, int) else SUCCESS


def _convert_memory_errors(work: Callable[[], object]) -> object:
    """Call ``work``. Raises OutOfMemoryError for each error that a lack of memory caused."""
    try:
        return work()
    except Exception as error:
        if why := memory_error(error):
            raise OutOfMemoryError(why) from error
        raise


def _print_memory_error(message: str) -> int:
    click.echo(f"mission: out of memory: {message}\n  try: {memory_advice(memory_limit())}", err=True)
    return USAGE


def _print_robot_origin(text: str) -> None:
    """Print the origin of the robot if ``text`` is an error about a robot that the user did not name."""
    from missions.cli.origin import origin_note  # noqa: PLC0415 - few commands end so

    if note := origin_note(text):
        click.echo(f"  {note}", err=True)


def _print_internal_error(error: Exception) -> int:
    """Print an internal error in two lines; with MISSION_DEBUG set, raise it."""
    if "MISSION_DEBUG" in os.environ:
        raise error
    click.echo(f"mission: {type(error).__name__}: {error}", err=True)
    click.echo("  this is an error in MissionTree; MISSION_DEBUG=1 shows the traceback, for a report", err=True)
    return INTERNAL
