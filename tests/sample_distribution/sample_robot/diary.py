"""The diary of a run: a line of text for each behaviour that ended."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import click

from config.diagnostics import InvalidInputError
from missions.cli.session import RunSession
from missions.executive.events import Event, NodeChanged
from sample_robot.diary_options import DiaryOptions


@contextmanager
def keep_diary(options: DiaryOptions, session: RunSession) -> Iterator[None]:
    """Write the diary of a run."""
    if options.diary is None:
        raise click.UsageError("--diary needs a file")
    with options.diary.open("w", encoding="utf-8") as file:

        def write(event: Event) -> None:
            if isinstance(event, NodeChanged) and event.status in ("success", "failure"):
                file.write(f"{event.t:.1f} {event.name} {event.status}\n")

        session.listen(write)
        session.outputs.append(lambda: options.diary)
        yield


@click.command()
@click.argument("path", type=click.Path(path_type=Path, exists=True))
def command(path: Path) -> None:
    """Print the diary of a run."""
    for line in path.read_text(encoding="utf-8").splitlines():
        time, _, rest = line.partition(" ")
        click.echo(f"{time:>8} s  {rest}")


def check_diary(path: Path, behaviours: Sequence[Path]) -> str:
    """Return how long a diary is. Raises InvalidInputError."""
    lines = path.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, 1):
        if not line.partition(" ")[0].replace(".", "").isdigit():
            raise InvalidInputError(f"{path}:{number}: a line must begin with a time\n  try: rm {path}")
    return f"{len(lines)} lines"
