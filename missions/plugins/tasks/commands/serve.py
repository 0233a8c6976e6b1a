"""``mission task serve``: the server that does the tasks of ``mission task``, without a screen of its own."""

import sqlite3
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext, suppress
from functools import partial
from pathlib import Path
from threading import Event

import click

from missions.cli.declared import declared_options
from missions.cli.root import SUCCESS
from missions.executive.signals import Signals
from missions.library.folders import state_folder
from missions.library.plugins import service
from missions.options import filled
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.courier import Courier
from missions.plugins.tasks.fleet_latch import FleetLatch
from missions.plugins.tasks.lock import Taken, locked, run_lock, server_lock
from missions.plugins.tasks.notices import channel_of
from missions.plugins.tasks.outbox import Outbox
from missions.plugins.tasks.queue import Queue, local_zone, wall_clock
from missions.plugins.tasks.schema import DiskFull, in_a_line, in_words, open_db, queue_file, trouble
from missions.plugins.tasks.serve import Server
from missions.plugins.tasks.task import TaskError
from missions.plugins.tasks.work import Child

LEAVE = 60.0
"""Seconds that a run without a server has to come to rest; it needs a few."""

FULL_PERIOD = 2.0
"""Seconds from one look to the next whether a full disk has room again."""

FLUSH = 60.0
"""Seconds for which ``--once`` waits until every notice was tried."""


OPTIONS = {name: cls for name in ("studio_options", "fleet_options") if (cls := service(name)) is not None}
"""Options that other plug-ins add."""


@click.command("serve", epilog="Example: mission task serve --once")
@click.option("--once", is_flag=True, help="End when nothing is due any more.")
@declared_options(*OPTIONS.values())
def serve_tasks(once: bool, **values: object) -> int:
    """Do the tasks of the queue, one after another, as they are due. Ctrl-C stops what runs, safely, and ends it.

    `mission task add` fills the queue. What was interrupted, by a power cut or else, is told, and given up, or tried
    again where its task says so. With --fleet, others see this robot, stop it, and give it tasks.
    """
    try:
        member = None
        if (fleet := OPTIONS.get("fleet_options")) is not None:
            member = service("fleet_membership")(filled(fleet, values))
        with service("serving_studio")() if values.get("studio") else nullcontext():
            serve(state_folder(), once=once, member=member)
    except TaskError as error:
        hint = f"\n  try: {error.hint}" if error.hint else ""
        raise click.ClickException(f"{error}{hint}") from error
    return SUCCESS


Membership = Callable[[Path, FleetLatch], AbstractContextManager[object]]
"""The context in which a server is in a fleet, with its state folder and the stop of the fleet."""


def serve(where: Path, *, once: bool, member: Membership | None = None) -> None:
    """Serve the queue in the folder ``where``, as a ``member`` of a fleet, if any.

    Raises TaskError where another server does, or it cannot be used.
    """
    path = queue_file(where)
    with in_words(path), ExitStack() as closed:
        try:
            closed.enter_context(locked(server_lock(where)))
            held = _after_orphan(run_lock(where), closed)
        except Taken as error:
            raise TaskError(f"another `mission task serve` does the tasks: {error}") from error
        except OSError as error:
            raise trouble(path, error) from error
        connection = closed.enter_context(closing(_begun(path, patient=not once)))
        queue = Queue(connection, channels_of, local_zone())
        latch = FleetLatch(where)
        explain = partial(in_a_line, path)
        server = Server(queue, Child([held], _tell), wall_clock, _tell, held=lambda: latch.stopped, explain=explain)
        closed.enter_context(Signals(server.stop))
        courier = closed.enter_context(Courier(path, partial(channel_of, print_line=click.echo), wall_clock, _tell))
        if member is not None:
            closed.enter_context(member(where, latch))
        _tell(f"serving {path}")
        server.run(once=once)
        if once:
            courier.flush(FLUSH)
            if waiting := Outbox(connection).waiting():
                _tell(f"{waiting} notices are not delivered yet: the next `mission task serve` goes on with them")


def _begun(path: Path, *, patient: bool) -> sqlite3.Connection:
    """Open the queue, and end the attempts of the server before: a fleet shall not hear that they run.

    Who is ``patient`` waits until the disk has room. Raises TaskError, and errors of sqlite3.
    """
    told = False
    while True:
        try:
            with in_words(path), ExitStack() as undone:
                connection = open_db(path)
                undone.callback(connection.close)
                Queue(connection, channels_of, local_zone()).recover(wall_clock())
                undone.pop_all()
                return connection
        except DiskFull as error:
            if not patient:
                raise
            if not told:
                _tell(f"{error}; waiting for room\n  try: {error.hint}")
            told = True
        Event().wait(FULL_PERIOD)


def _after_orphan(path: Path, closed: ExitStack) -> int:
    """Hold what each run holds as well: where a run has lost its server, wait until it has come to rest."""
    try:
        return closed.enter_context(locked(path))
    except Taken:
        _tell("waiting: a run that has lost its server comes to rest")
    try:
        return closed.enter_context(locked(path, patience=LEAVE))
    except Taken as error:
        raise TaskError(f"a run of another server does not end: {error}", hint=f"fuser {path}") from error


def _tell(text: str) -> None:
    """Say something to who watches the server, if anybody does."""
    with suppress(OSError):
        click.echo(text, err=True)
