"""The output file of `mission run --events`."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import click

from missions.cli.outputs import report_write_errors
from missions.cli.session import RunSession
from missions.executive.events import JsonLinesWriter
from missions.library.private_files import EarlierFile, open_private


class EventsFile:
    """Writer of the events of a run to ``path``, readable by its owner only.

    Add its attribute ``lines`` to the listeners of the run. If the new file cannot be written completely, an earlier
    file with the name ``path`` is kept. The incomplete file then has another name, which is stored in ``path``. Raises
    click.BadParameter.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with report_write_errors(path, "--events"):
            self._earlier = EarlierFile(path)
            try:
                self.file = open_private(path)
            except OSError:
                self._earlier.restore()
                raise
        self.lines = JsonLinesWriter(self.file)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        whole = self.lines.is_complete
        try:
            self.file.close()
        except OSError:  # the stream reports that an event could not be written
            whole = False
        if whole:
            self._earlier.remove()
            return
        with suppress(OSError):
            renamed = self._earlier.restore()
            if renamed is not None:
                click.echo(f"mission: {self.path} is the earlier file, {renamed} the new one", err=True)
                self.path = renamed


@contextmanager
def write_events(path: Path, session: RunSession) -> Iterator[None]:
    """Write the events of a run to ``path``. Raises click.UsageError if the run reads that file."""
    for step in session.runner.plan.tree.walk():
        if Path(step.source.name).exists() and path.exists() and path.samefile(step.source.name):
            raise click.UsageError(f"--events would overwrite the mission {path}")
    with EventsFile(path) as events:
        session.listen(events.lines)
        session.watched_outputs.append(events.file)
        session.outputs.append(lambda: events.path)
        yield
