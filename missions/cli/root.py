"""The ``mission`` command itself: finds its subcommand, and turns what goes wrong into words and an exit code."""

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

# Commands that run out of memory: said so, with what to do, whichever error it came as.

MIN_MEMORY_BYTES = 1_000_000_000
"""Bytes of address space with which every command works: simulation and cameras take 0.6 GB."""

MEMORY_ERROR_TEXTS = (
    "failed to map segment",
    "cannot allocate memory",
    "insufficient memory",
    "can't start new thread",
    "unable to allocate",
    "failed to allocate",
)
"""Parts of the messages of libraries that have run out of memory, in small letters."""


class OutOfMemoryError(Exception):
    """A command has run out of memory; the message says what failed."""


def memory_error(error: BaseException) -> str:
    """Return what failed for lack of memory: this error, or one that has led to it; nothing where none did."""
    seen: list[BaseException] = []
    at: BaseException | None = error
    while at is not None and at not in seen:
        seen.append(at)
        if isinstance(at, MemoryError) or (isinstance(at, OSError) and at.errno == errno.ENOMEM):
            return str(at) or "no memory is left"
        for line in _message_of(at).splitlines():
            if any(sign in line.lower() for sign in MEMORY_ERROR_TEXTS):
                return line.strip()[-200:]
        at = at.__cause__ or at.__context__
    return ""


def _message_of(error: BaseException) -> str:
    """Return the message of an error; nothing where it cannot be read, or may be for lack of processes."""
    try:
        words = str(error)
    except Exception:  # of somebody else's
        return ""
    return "" if "start new thread" in words and memory_limit() is None else words


def memory_limit() -> int | None:
    """Return the bytes of memory that this process may take, as ``ulimit -v`` and ``-d`` say; None for any number."""
    try:
        import resource  # noqa: PLC0415 - Python in a browser does not have it
    except ImportError:
        return None
    found = [resource.getrlimit(each)[0] for each in (resource.RLIMIT_AS, resource.RLIMIT_DATA)]
    return min((each for each in found if each != resource.RLIM_INFINITY), default=None)


def warn_of_memory_limit() -> None:
    """Warn of a limit that is low: libraries in C may end the process without a word when they run into it."""
    allowed = memory_limit()
    if allowed is not None and allowed < MIN_MEMORY_BYTES:
        said = f"mission: memory is limited to {allowed / 1e6:.0f} MB, so this may run out of memory"
        click.echo(f"{said}\n  try: {memory_advice(allowed)}", err=True)


def memory_advice(limit: int | None) -> str:
    """Return what to do about a lack of memory, where so many bytes are ``allowed``."""
    if limit is not None:
        return f"ulimit -v unlimited; ulimit -d unlimited  (in this shell; now {limit // 1024} kB)"
    return "free -m  (what is left), and end what takes it"


SUCCESS, FAILURE, USAGE, DEVICE, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 70, 130
"""The exit codes: a mission's success and failure, bad usage or a bad file, a device,
a fault of our own, Ctrl-C or SIGTERM."""

COMPLETION_VARIABLE = "_MISSION_COMPLETE"
"""What a shell sets in the environment where it asks what a word may become."""


@click.group(
    cls=MissionGroup, context_settings={"help_option_names": ["-h", "--help"]}, epilog="Example: mission run greet"
)
@click.version_option(package_name="missiontree", prog_name="mission")
def mission() -> None:
    """Missions for robots, as readable behaviour trees."""


def main() -> None:
    """Run ``mission`` with the arguments of the process, and exit."""
    # Without a standard stream (`>&-`), libraries that look at it would fail, here and in processes that we start.
    for number in (1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
            os.set_inheritable(number, True)
    sys.stdout = sys.stdout or Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - for the whole process
    sys.stderr = sys.stderr or sys.stdout
    if COMPLETION_VARIABLE in os.environ:
        import_module("missions.cli.completion")  # which knows how shells ask
    warn_of_memory_limit()
    with use_printable_streams():
        try:
            code = run_guarded(lambda: mission.main(standalone_mode=False, obj=OWN_PROCESS))
        except (ImportError, OSError, MemoryError) as error:  # before anything of ours could be imported
            if not (why := memory_error(error)):
                raise
            code = _print_memory_error(why)
    sys.exit(code)


def run_guarded(work: Callable[[], object]) -> int:
    """Do ``work`` and return the exit code: its own where it gives one, else what its errors mean."""
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
    except BrokenPipeError:  # the reader of our output has gone, as `mission list | head -1` does
        sys.stdout = None  # so that Python does not flush into the pipe at exit
        return SUCCESS
    except OSError as error:  # a name that is too long; without one, a full disk behind stdout
        what = "cannot write" if error.filename is None else quoted_value(str(error.filename))
        with suppress(OSError):
            click.echo(f"mission: {what}: {error.strerror or error}", err=True)
        sys.stdout = None
        return USAGE
    except Exception as error:
        return _print_internal_error(error)
    return code if isinstance(code, int) else SUCCESS


def _convert_memory_errors(work: Callable[[], object]) -> object:
    """Return what ``work`` does. Raises OutOfMemoryError for any error that comes of a lack of memory."""
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
    """Print where the robot came from if ``text``, an error, is about a robot that the user did not name."""
    from missions.cli.origin import origin_note  # noqa: PLC0415 - few commands end so

    if note := origin_note(text):
        click.echo(f"  {note}", err=True)


def _print_internal_error(error: Exception) -> int:
    """Tell of an error that no user has made, in two lines; all of it where MISSION_DEBUG is set."""
    if "MISSION_DEBUG" in os.environ:
        raise error
    click.echo(f"mission: {type(error).__name__}: {error}", err=True)
    click.echo("  this is a fault of MissionTree itself; MISSION_DEBUG=1 shows where, for a report", err=True)
    return INTERNAL
