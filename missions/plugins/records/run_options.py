"""``mission run --record``: a run kept in a file, from before its beginning to its end."""

import sys
from contextlib import AbstractContextManager, nullcontext, suppress
from datetime import timedelta
from pathlib import Path
from types import TracebackType
from typing import Self

import click

from drivers.api import DeviceStatus
from drivers.api.quick import dataclass
from drivers.clock import time_of_day
from missions.cli.session import RunSession
from missions.executive.events import FaultRaised
from missions.plugins.records import ring
from missions.plugins.records.options import RecordOptions, recorded_by_default
from missions.plugins.records.recording.budget import FRAMES, LIMIT
from missions.request import RunRequest

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


def record_wish(options: RecordOptions, request: RunRequest) -> RecordWish | None:
    """Return what the options ask for; by default a record in the user's own folder, of a run on a robot.

    Raises click.UsageError for options that could only be ignored.
    """
    record, asked = options.record, options.record is not None
    if record is None and not options.no_record and recorded_by_default(simulated=request.simulation is not None):
        record = _default_folder()
    if record is None:
        if options.record_limit is not None or options.record_frames is not None or options.overwrite:
            raise click.UsageError(f"--record-limit, --record-frames and --overwrite go with --record FILE{ENDING}")
        return None
    if record.is_dir():
        record = _new(record, f"{Path(request.mission).stem}-{time_of_day().astimezone():%Y-%m-%dT%H-%M-%S}")
    elif record.suffix != ENDING:
        raise click.BadParameter(f"{record}: a record's name ends in {ENDING}", param_hint="--record")
    frames = FRAMES if options.record_frames is None else options.record_frames
    return RecordWish(record, options.record_limit or LIMIT, frames, options.overwrite, asked)


def _default_folder() -> Path | None:
    """Return the folder of records that are kept by default, with room for one more; None if it cannot be made."""
    folder = ring.records_folder()
    try:
        removed = ring.make_room(folder, time_of_day().timestamp())
    except OSError as error:  # such as a full disk: a robot does not refuse to move for that
        click.echo(f"mission: not recorded: {folder}: {error.strerror or error}", err=True)
        return None
    if removed:
        click.echo(f"mission: removed old records from {folder}: {', '.join(removed)}", err=True)
    return folder


def _new(folder: Path, name: str) -> Path:
    """Return a file in ``folder`` that is not there yet: two runs may begin in one second."""
    numbered = (folder / f"{name}{more}{ENDING}" for more in ("", *(f"-{number}" for number in range(2, 100))))
    return next((path for path in numbered if not path.exists()), folder / f"{name}{ENDING}")


class Recording:
    """Records the run of a ``session``: a context around the run.

    What is missing from the record in the end is said on stderr. ``__enter__``, which begins the record before anything
    has moved, raises click.BadParameter where that cannot be.
    """

    def __init__(self, wish: RecordWish, session: RunSession) -> None:
        from missions.plugins.records.recording.recorder import Recorder  # noqa: PLC0415 - a run without a record needs none

        self._wish, self._session = wish, session
        self._recorder = recorder = Recorder(
            wish.path,
            limit=wish.limit,
            frames=wish.frames,
            patient=session.request.simulation == "fast",
            overwrite=wish.overwrite,
        )
        session.listen(recorder)
        session.runner.observe(recorder.moment, recorder.view, recorder.frame)
        session.outputs.append(lambda: self.path if self.begun else None)
        recorder.watch(session.runner.root)
        self.begun = True

    def __enter__(self) -> Self:
        from missions.plugins.records.recording.gather import contents_of  # noqa: PLC0415 - a run without a record needs none of it
        from missions.plugins.records.recording.outlet import CannotRecordError  # noqa: PLC0415

        wish, session, runner = self._wish, self._session, self._session.runner
        if wish.path.resolve() in session.files:
            raise click.BadParameter(f"{wish.path} is a file of this very run", param_hint="--record")
        started = time_of_day() - timedelta(seconds=runner.clock.now())
        lag = runner.assembled.robot.lag
        contents = contents_of(
            session.request,
            runner.plan,
            runner.config,
            session.files,
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
        runner = self._session.runner
        runner.stream.emit(FaultRaised(runner.clock.now(), notice.device, notice.kind, notice.what, notice.hint))


def record_run(options: RecordOptions, session: RunSession) -> AbstractContextManager[object]:
    """Record a run, as the options ask. Raises click.UsageError."""
    wish = record_wish(options, session.request)
    return nullcontext() if wish is None else Recording(wish, session)
