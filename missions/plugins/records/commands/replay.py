"""``mission record replay`` and ``rerun``: play a record, export it as a film, or repeat its decisions."""

import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click
from rich.live import Live

from drivers.clock import SystemClock
from missions.cli.console import console
from missions.cli.keys import KeyReader, interruptible
from missions.cli.names import MISSION
from missions.cli.numbers import RealNumber
from missions.cli.option_declarations import behaviours_option
from missions.cli.options import SECONDS
from missions.cli.root import FAILURE, SUCCESS, USAGE
from missions.plugins.pictures.movie import Movie, check_output
from missions.plugins.records.recording.run_record import RunRecord, open_record

if TYPE_CHECKING:
    from missions.plugins.records.replay.rerun_files import RerunFiles

FILM_RATE = 12.5
"""Frames per second of a film of a record."""

REFRESH_INTERVAL = 0.1
"""Seconds between two updates of the player's screen."""


RECORD = click.argument("file", metavar="RECORD", type=click.Path(exists=True, dir_okay=False, path_type=Path))


@click.command(epilog="Example: mission record replay monday.mcap --at 12.5s")
@RECORD
@click.option("--at", type=SECONDS, default=0.0, metavar="TIME", help="Start time, such as 12.5s.")
@click.option(
    "--speed",
    type=RealNumber(min=0, min_open=True, max=1000),
    default=1.0,
    metavar="FACTOR",
    help="Speed relative to real time.",
)
@click.option(
    "--frames",
    type=click.Path(path_type=Path),
    metavar="OUT",
    help="Write the annotated pictures to a .webm file or a folder.",
)
def replay(file: Path, at: float, speed: float, frames: Path | None) -> int:
    """Play a record in the terminal, or export it as a film.

    Keys: space plays or pauses, left and right jump 5 s, up and down change the speed, period and comma go to the next
    and previous tick, f and F to the next and previous failure, / searches, n and N go to the next and previous match,
    0 to 9 go to that tenth of the record, q quits. Without a terminal, the events are printed line by line.
    """
    if frames is None:
        return _play(open_record(file), at, speed)
    check_output(frames, "--frames")
    return _write_film(open_record(file), frames)


@click.command(epilog="Example: mission record rerun monday.mcap")
@RECORD
@click.option("--recorded", is_flag=True, help="Use the files in the record, not today's.")
@click.option(
    "--mission", type=MISSION, metavar="MISSION", help="Another mission (a name or a file) for the recorded inputs."
)
@behaviours_option
@click.option(
    "--trust-code", is_flag=True, help="Run the Python code in the record: it can do anything on this computer."
)
@click.option(
    "--see", "look", is_flag=True, help="Search the pictures with today's perception, instead of repeating decisions."
)
def rerun(
    file: Path,
    recorded: bool,
    mission: str | None,
    files: tuple[Path, ...],
    trust_code: bool,
    look: bool,
) -> int:
    """Repeat the decisions of a record with today's files, or search its pictures again, and compare. Nothing moves.

    Exit codes: 0 no difference, 1 a difference, 2 no comparison possible.
    """
    again = _RerunOptions(code=files, recorded=recorded, trusted=trust_code)
    return (_rerun_perception if look else _rerun_decisions)(open_record(file), mission, again)


def _play(record: RunRecord, at: float, speed: float) -> int:
    """Play a record with keys, or print its events from ``at`` (s) on if there is no terminal."""
    from missions.plugins.records.replay.player_screen import PlayerScreen, event_lines  # noqa: PLC0415
    from missions.plugins.records.replay.record_player import RecordPlayer  # noqa: PLC0415 - as below, what one option needs is not loaded for all

    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        for line in event_lines(record, at):
            click.echo(line)
        return SUCCESS
    player, screen, shown_on, clock = (
        RecordPlayer(record, at=at, speed=speed),
        PlayerScreen(record),
        console(),
        SystemClock(),
    )
    with (
        interruptible(),
        KeyReader(sys.stdin.fileno()) as keys,
        Live(console=shown_on, screen=True, auto_refresh=False) as live,
    ):
        shown = clock.now()
        going_on = True
        while going_on:
            live.update(screen.draw(player, shown_on.size.height), refresh=True)
            key = keys.read(REFRESH_INTERVAL)
            before, shown = shown, clock.now()
            player.advance(shown - before)
            going_on = not key or player.press(key)
    return SUCCESS


def _write_film(record: RunRecord, path: Path) -> int:
    from missions.plugins.records.replay.frames import annotate_frames, resample_frames  # noqa: PLC0415

    with Movie(path, rate=FILM_RATE, option="--frames") as movie:
        pictures = annotate_frames(record)
        for picture in resample_frames(pictures, FILM_RATE) if movie.is_film else (picture for _, picture in pictures):
            movie.write(picture)
    if not movie.pictures:
        raise click.UsageError(_no_pictures_message(record))
    if movie.error:
        raise click.ClickException(movie.error)
    click.echo(f"wrote {movie.pictures} pictures to {path}")
    return SUCCESS


@dataclass(frozen=True, slots=True, kw_only=True)
class _RerunOptions:
    """Options for choosing the files of a rerun.

    ``code`` are Python files to use instead of recorded ones, ``recorded`` means to use only recorded files, and
    ``trusted`` to run recorded Python code.
    """

    code: Sequence[Path]
    recorded: bool
    trusted: bool


def _rerun_decisions(record: RunRecord, mission: str | None, options: _RerunOptions) -> int:
    """Repeat the decisions of a record, print the comparison, and return the exit code."""
    from missions.plugins.records.replay.rerun import rerun as decide  # noqa: PLC0415
    from missions.plugins.records.replay.result_text import rerun_lines  # noqa: PLC0415

    if problem := _rerun_obstacle(record):
        raise click.UsageError(problem)
    with _unpack_sources(record, options) as sources:
        config = sources.robot()
        result = decide(record, sources.plan(config, mission), config, seed=record.header.seed, lag=record.header.lag)
        for line in rerun_lines(result, sources):
            click.echo(line)
    if not result.nodes or result.unanswered:
        return USAGE
    return SUCCESS if result.is_identical else FAILURE


def _rerun_perception(record: RunRecord, mission: str | None, options: _RerunOptions) -> int:
    """Search the pictures of a record again, print the comparison, and return the exit code."""
    from missions.library.interests import interests_of  # noqa: PLC0415
    from missions.plugins.records.replay.perception_rerun import rerun_perception  # noqa: PLC0415
    from missions.plugins.records.replay.result_text import perception_lines  # noqa: PLC0415

    with _unpack_sources(record, options) as sources:
        config = sources.robot()
        if config.camera is None:
            raise click.UsageError(f"{config.name} has no camera")
        try:
            comparison = rerun_perception(
                record, config.camera, interests_of(sources.plan(config, mission).tree, config.camera)
            )
        except FileNotFoundError as error:  # the model file of a detector
            raise click.UsageError(str(error)) from error
        if not comparison.picture_count:
            raise click.UsageError(_no_pictures_message(record))
        for line in perception_lines(comparison):
            click.echo(line)
    return FAILURE if comparison.lost_tracks else SUCCESS


@contextmanager
def _unpack_sources(record: RunRecord, options: _RerunOptions) -> Iterator["RerunFiles"]:
    """Unpack the files of a record into a temporary folder, and print those that have changed since.

    Raises click.UsageError, with a list, for a record that holds Python code without ``--trust-code``.
    """
    from missions.plugins.records.replay.rerun_files import RerunFiles  # noqa: PLC0415

    with TemporaryDirectory(prefix="mission-replay-") as folder:
        sources = RerunFiles(
            record.header,
            record.files,
            Path(folder),
            recorded=options.recorded,
            code=options.code,
            trusted=options.trusted,
        )
        if code := sources.foreign_code():
            listing = "".join(f"\n  {line}" for line in code)
            if not options.trusted:
                raise click.UsageError(
                    f"{record.path} holds Python code that would be run:{listing}\n{_inspection_hint(record)}"
                )
            click.echo(f"running the Python code of {record.path}:{listing}")
        sources.unpack()
        for line in () if options.recorded else sources.changed_files():
            click.echo(line)
        yield sources


def _inspection_hint(record: RunRecord) -> str:
    path = shlex.quote(str(record.path))
    return (
        f"  try: mission record export {path} --folder FOLDER, and read it;\n"
        "       then --trust-code, or --behaviours FILE.py to run a file of yours instead"
    )


def _rerun_obstacle(record: RunRecord) -> str:
    """Return the reason why a record cannot be rerun; empty if it can."""
    if record.cut_start is not None:
        return f"{record.path} is a piece from {record.cut_start:g} s on: a rerun needs the record from its beginning"
    if record.header.mocks:
        return f"{record.path} is of a test with mocks ({', '.join(record.header.mocks)}): the mission file has none"
    lost = {topic: count for topic, count in record.lost_counts().items() if topic in ("/moments", "/nodes") and count}
    if lost:
        counts = ", ".join(f"{count} of {topic}" for topic, count in lost.items())
        return f"{record.path} lost messages while it was written: {counts}"
    return ""


def _no_pictures_message(record: RunRecord) -> str:
    eyes = " with --eyes truth, which needs none" if record.header.eyes == "truth" else ""
    return f"{record.path} has no pictures: it was recorded{eyes or ' without a camera, or with --record-frames 0'}"
