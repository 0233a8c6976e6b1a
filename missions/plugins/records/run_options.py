"""``mission run --record``: a run kept in a file, from before its beginning to its end."""

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from types import TracebackType
from typing import Any, ParamSpec, Self

import click

from config.reading import files_read
from drivers.api import DeviceStatus
from drivers.api.quick import dataclass
from drivers.clock import time_of_day
from missions.cli.numbers import InUnit
from missions.cli.options import SIZE
from missions.cli.orders import pad_of
from missions.control.pictures import Pictures
from missions.executive.events import FaultRaised
from missions.executive.executive import Result
from missions.executive.stream import Listener
from missions.plugins.records import ring
from missions.plugins.records.recording.budget import FRAMES, LIMIT
from missions.request import RunRequest
from missions.runner import Runner

ENDING = ".mcap"
"""What the name of a record ends in."""


@dataclass(frozen=True, slots=True)
class RecordWish:
    """What a user asks of a record: where (a file or a folder), how large at most (bytes), and pictures a second."""

    path: Path
    limit: float = LIMIT
    frames: float = FRAMES
    overwrite: bool = False
    asked: bool = True
    """False for a record that is kept by default: where it cannot be, the run goes on without."""


def record_options(command: Any) -> Any:
    """Add ``--record`` and what belongs to it to a command."""
    for option in (
        click.option("--overwrite", is_flag=True, help="Let the record take the place of the file that is there."),
        click.option(
            "--record-frames",
            type=InUnit("Hz", 0, 100),
            metavar="RATE",
            help=f"Keep so many of the camera's pictures a second: {FRAMES:g} unless you say otherwise, 0 for none.",
        ),
        click.option(
            "--record-limit",
            type=SIZE,
            metavar="SIZE",
            help=f"How large the record may grow: {LIMIT / 1e9:g} GB unless you say otherwise. Before that, pictures "
            "become rarer.",
        ),
        click.option(
            "--no-record",
            is_flag=True,
            help="Keep nothing of a run on a robot, which is recorded unless your defaults.yaml says `record: false`.",
        ),
        click.option(
            "--record",
            type=click.Path(path_type=Path),
            metavar="FILE",
            help=f"Keep all that happens in FILE{ENDING}, for `mission replay`, `report` and `stats`; in a folder, "
            "under the mission's name and the time of day.",
        ),
    ):
        command = option(command)
    return command


def record_wish(
    record: Path | None,
    limit: float | None,
    frames: float | None,
    *,
    overwrite: bool,
    mission: str,
    otherwise: bool = False,
) -> RecordWish | None:
    """Return what the options ask for; a record in the user's own folder where nothing is asked, and ``otherwise``.

    Raises click.UsageError for options that could only be ignored.
    """
    asked = record is not None
    if record is None and otherwise:
        record = ring.records_folder()
        try:
            removed = ring.make_room(record, time_of_day().timestamp())
            if removed:
                click.echo(f"mission: removed old records from {record}: {', '.join(removed)}", err=True)
        except OSError as error:  # such as a full disk: a robot does not refuse to move for that
            click.echo(f"mission: not recorded: {record}: {error.strerror or error}", err=True)
            record = None
    if record is None:
        if limit is not None or frames is not None or overwrite:
            raise click.UsageError(f"--record-limit, --record-frames and --overwrite go with --record FILE{ENDING}")
        return None
    if record.is_dir():
        record = _new(record, f"{Path(mission).stem}-{time_of_day().astimezone():%Y-%m-%dT%H-%M-%S}")
    elif record.suffix != ENDING:
        raise click.BadParameter(f"{record}: a record's name ends in {ENDING}", param_hint="--record")
    wish = RecordWish(record, overwrite=overwrite)
    return RecordWish(record, limit or wish.limit, wish.frames if frames is None else frames, overwrite, asked)


def _new(folder: Path, name: str) -> Path:
    """Return a file in ``folder`` that is not there yet: two runs may begin in one second."""
    numbered = (folder / f"{name}{more}{ENDING}" for more in ("", *(f"-{number}" for number in range(2, 100))))
    return next((path for path in numbered if not path.exists()), folder / f"{name}{ENDING}")


P = ParamSpec("P")


def both(one: Callable[P, object], other: Callable[P, object]) -> Callable[P, None]:
    """Return what calls both."""

    def call(*args: P.args, **kwargs: P.kwargs) -> None:
        one(*args, **kwargs)
        other(*args, **kwargs)

    return call


class Recording:
    """Records the run of an order: it makes the ``runner``, and is a context around the run.

    What is missing from the record in the end is said on stderr. ``__enter__``, which begins the record before anything
    has moved, raises click.BadParameter where that cannot be.
    """

    def __init__(
        self,
        wish: RecordWish,
        order: RunRequest,
        *,
        listeners: Sequence[Listener],
        give_up: Callable[[Result], None],
        pictures: Pictures,
    ) -> None:
        from missions.plugins.records.recording.recorder import Recorder  # noqa: PLC0415 - a run without a record needs none

        self._wish = wish
        self._order = order
        self._recorder = recorder = Recorder(
            wish.path,
            limit=wish.limit,
            frames=wish.frames,
            patient=order.simulation == "fast",
            overwrite=wish.overwrite,
        )
        with files_read() as self._files:
            self.runner = Runner(
                order,
                listeners=[*listeners, recorder],
                give_up=give_up,
                on_moment=recorder.moment,
                on_view=both(recorder.view, pictures.view),
                on_frame=both(recorder.frame, pictures.frame),
                pad=pad_of(order),
            )
        recorder.watch(self.runner.root)
        self.begun = True

    def __enter__(self) -> Self:
        from missions.plugins.records.recording.gather import contents_of  # noqa: PLC0415 - a run without a record needs none of it
        from missions.plugins.records.recording.outlet import CannotRecordError  # noqa: PLC0415

        wish, runner = self._wish, self.runner
        if wish.path.resolve() in self._files:
            raise click.BadParameter(f"{wish.path} is a file of this very run", param_hint="--record")
        started = time_of_day() - timedelta(seconds=runner.clock.now())
        lag = runner.assembled.robot.lag
        contents = contents_of(
            self._order,
            runner.plan,
            runner.config,
            self._files,
            started=started,
            command=("mission", *sys.argv[1:]),
            lag=lag.seconds if lag.learnt else None,
        )
        try:
            self._recorder.open(contents, runner.clock, report=self._report, check=runner.assembled.health)
        except CannotRecordError as error:
            if not wish.asked:
                click.echo(f"mission: not recorded: {error}", err=True)
                self.begun = False
                return self
            hint = f"\n  try: {error.hint}" if error.hint else ""
            raise click.BadParameter(f"{error}{hint}", param_hint="--record") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        loss = self._recorder.close()
        if loss:
            with suppress(OSError):
                click.echo(f"mission: {self.path}: {loss}", err=True)

    @property
    def path(self) -> Path:
        """Where the record is; renamed where it is incomplete and an earlier one has its name."""
        return self._recorder.path

    def _report(self, notice: DeviceStatus) -> None:
        stream, now = self.runner.stream, self.runner.clock.now()
        stream.emit(FaultRaised(now, notice.device, notice.kind, notice.what, notice.hint))
