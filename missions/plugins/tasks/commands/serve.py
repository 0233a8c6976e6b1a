"""``mission task serve``: the server that runs queued tasks."""

import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext, suppress
from functools import partial
from pathlib import Path
from threading import Event

import click

from missions.cli.option_declarations import add_options
from missions.cli.root import SUCCESS
from missions.executive.signals import SignalHandler
from missions.library.folders import state_folder
from missions.library.plugins import service
from missions.options import make_options
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.file_lock import LockHeldError, hold_lock, run_lock, server_lock
from missions.plugins.tasks.fleet_latch import FleetLatch
from missions.plugins.tasks.notice_delivery import NoticeSender
from missions.plugins.tasks.notices import channel_of
from missions.plugins.tasks.outbox import Outbox
from missions.plugins.tasks.queue import TaskQueue, local_zone, wall_clock
from missions.plugins.tasks.queue_database import (
    DiskFullError,
    describe_retry,
    open_db,
    queue_error,
    queue_errors,
    queue_file,
)
from missions.plugins.tasks.run_process import RunProcess
from missions.plugins.tasks.task import TaskError
from missions.plugins.tasks.task_server import TaskServer

ORPHAN_TIMEOUT = 60.0
"""Seconds to wait for the run of an ended task server to come to rest; normally a few are enough."""

DISK_CHECK_INTERVAL = 2.0
"""Seconds between two checks whether a full disk has space again."""

FLUSH_TIMEOUT = 60.0
"""Seconds for which ``--once`` waits until every notice was tried."""


OPTIONS = {name: cls for name in ("studio_options", "fleet_options") if (cls := service(name)) is not None}
"""Options of `mission task serve` that other plug-ins add."""


@click.command("serve", epilog="Example: mission task serve --once")
@click.option("--once", is_flag=True, help="End when no task is due.")
@add_options(*OPTIONS.values())
def serve_tasks(once: bool, **values: object) -> int:
    """Run the tasks of the queue as they are due. Ctrl-C stops the running task safely and ends the server.

    `mission task add` fills the queue. An interrupted task, for example after a power cut, is reported, and retried or
    given up as its task says. With --fleet, other computers see this robot, stop it, and give it tasks.
    """
    try:
        member = None
        if (fleet := OPTIONS.get("fleet_options")) is not None:
            member = service("fleet_membership")(make_options(fleet, values))
        with service("serving_studio")() if values.get("studio") else nullcontext():
            serve(state_folder(), once=once, member=member)
    except TaskError as error:
        hint = f"\n  try: {error.hint}" if error.hint else ""
        raise click.ClickException(f"{error}{hint}") from error
    return SUCCESS


Membership = Callable[[Path, FleetLatch], AbstractContextManager[object]]
"""Function that makes a task server a member of a fleet while the returned context is entered.

It is given the server's state folder and the stop latch of the fleet.
"""


def serve(where: Path, *, once: bool, member: Membership | None = None) -> None:
    """Serve the queue in the folder ``where``, in the fleet context of ``member``, if any.

    Raises TaskError if another server runs, or the queue cannot be used.
    """
    path = queue_file(where)
    with queue_errors(path), ExitStack() as closed:
        try:
            closed.enter_context(hold_lock(server_lock(where)))
            held = _wait_for_orphan(run_lock(where), closed)
        except LockHeldError as error:
            raise TaskError(f"another `mission task serve` runs the tasks: {error}") from error
        except OSError as error:
            raise queue_error(path, error) from error
        connection = closed.enter_context(closing(_open_recovered(path, wait_for_space=not once)))
        queue = TaskQueue(connection, channels_of, local_zone())
        latch = FleetLatch(where)
        explain = partial(describe_retry, path)
        server = TaskServer(
            queue, RunProcess([held], _report), wall_clock, _report, is_held=lambda: latch.is_latched, explain=explain
        )
        closed.enter_context(SignalHandler(server.stop))
        courier = closed.enter_context(
            NoticeSender(path, partial(channel_of, print_line=click.echo), wall_clock, _report)
        )
        if member is not None:
            closed.enter_context(member(where, latch))
        _report(f"serving {path}")
        server.run(once=once)
        if once:
            courier.flush(FLUSH_TIMEOUT)
            if waiting := Outbox(connection).pending_count():
                _report(f"{waiting} notices are not delivered yet; the next `mission task serve` will try again")


def _open_recovered(path: Path, *, wait_for_space: bool) -> sqlite3.Connection:
    """Open the queue, and end the attempts of a previous server, so that a fleet does not see them as running.

    With ``wait_for_space``, wait while the disk is full. Raises TaskError, sqlite3.Error.
    """
    is_reported = False
    while True:
        try:
            with queue_errors(path), ExitStack() as undone:
                connection = open_db(path)
                undone.callback(connection.close)
                TaskQueue(connection, channels_of, local_zone()).recover(wall_clock())
                undone.pop_all()
                return connection
        except DiskFullError as error:
            if not wait_for_space:
                raise
            if not is_reported:
                _report(f"{error}; waiting for free space\n  try: {error.hint}")
            is_reported = True
        Event().wait(DISK_CHECK_INTERVAL)


def _wait_for_orphan(path: Path, closed: ExitStack) -> int:
    """Take the lock that each run of this server inherits; return its file descriptor.

    If a run of an ended server holds the lock, wait until that run is at rest. Leaving ``closed`` releases the lock.
    Raises TaskError after ``ORPHAN_TIMEOUT``.
    """
    try:
        return closed.enter_context(hold_lock(path))
    except LockHeldError:
        _report("waiting for a run without a server to end")
    try:
        return closed.enter_context(hold_lock(path, timeout=ORPHAN_TIMEOUT))
    except LockHeldError as error:
        raise TaskError(f"the run of an earlier server does not end: {error}", hint=f"fuser {path}") from error


def _report(text: str) -> None:
    """Print a text on stderr; errors of a closed terminal are ignored."""
    with suppress(OSError):
        click.echo(text, err=True)
