"""``mission run --record``: recording of a run, from before its start to its end."""

import sys
from contextlib import AbstractContextManager, nullcontext, suppress
from datetime import timedelta
from pathlib import Path
from types import TracebackType
from typing import Self

import click

from drivers.api import DeviceStatus
from drivers.api.fast_dataclass import dataclass
from drivers.clock import time_of_day
from missions.cli.session import RunSession
from missions.executive.events import FaultRaised
from missions.plugins.records import retention
from missions.plugins.records.options import RecordOptions, is_recorded_by_default
from missions.plugins.records.recording.budget import DEFAULT_FRAME_RATE, DEFAULT_MAX_BYTES
from missions.request import RunRequest

RECORD_SUFFIX = ".mcap"
"""File name ending of a record."""


@dataclass(frozen=True, slots=True)
class RecordSettings:
    """Settings of a record: path (a file or a folder), maximum size (bytes), pictures per second."""

    path: Path
    limit: float = DEFAULT_MAX_BYTES
    frames: float = DEFAULT_FRAME_RATE
    overwrite: bool = False
    requested: bool = True
    """Whether the user requested the record; if a record made by default fails, the run goes on without it."""


def record_settings(options: RecordOptions, request: RunRequest) -> RecordSettings | None:
    """Return the settings of the record that the options request; None if the run is not recorded.

    Without options, a run on a robot is recorded in the user's folder of records. Raises click.UsageError for options
    that have no effect.
    """
    record, requested = options.record, options.record is not None
    if record is None and not options.no_record and is_recorded_by_default(simulated=request.simulation is not None):
        record = _default_folder()
    if record is None:
        if options.record_limit is not None or options.record_frames is not None or options.overwrite:
            raise click.UsageError(f"--record-limit, --record-frames and --overwrite need --record FILE{RECORD_SUFFIX}")
        return None
    if record.is_dir():
        record = _new_path(record, f"{Path(request.mission).stem}-{time_of_day().astimezone():%Y-%m-%dT%H-%M-%S}")
    elif record.suffix != RECORD_SUFFIX:
        raise click.BadParameter(f"{record}: the name of a record must end in {RECORD_SUFFIX}", param_hint="--record")
    frames = DEFAULT_FRAME_RATE if options.record_frames is None else options.record_frames
    return RecordSettings(record, options.record_limit or DEFAULT_MAX_BYTES, frames, options.overwrite, requested)


def _default_folder() -> Path | None:
    """Return the folder of records made by default, after removing old records; None if it cannot be created."""
    folder = retention.records_folder()
    try:
        removed = retention.remove_old_records(folder, time_of_day().timestamp())
    except OSError as error:  # a full disk must not keep the robot from running
        click.echo(f"mission: not recorded: {folder}: {error.strerror or error}", err=True)
        return None
    if removed:
        click.echo(f"mission: removed old records from {folder}: {', '.join(removed)}", err=True)
    return folder


def _new_path(folder: Path, name: str) -> Path:
    """Return an unused file name in ``folder``: two runs may start in the same second."""
    numbered = (folder / f"{name}{more}{RECORD_SUFFIX}" for more in ("", *(f"-{number}" for number in range(2, 100))))
    return next((path for path in numbered if not path.exists()), folder / f"{name}{RECORD_SUFFIX}")


class RunRecording:
    """Context manager that records the run of a ``session``.

    ``__enter__`` starts the record before anything moves. It raises click.BadParameter if a requested record cannot be
    started. Messages missing from the record are printed to stderr at the end.
    """

    def __init__(self, settings: RecordSettings, session: RunSession) -> None:
        from missions.plugins.records.recording.recorder import Recorder  # noqa: PLC0415 - a run without a record needs none

        self._settings, self._session = settings, session
        self._recorder = recorder = Recorder(
            settings.path,
            limit=settings.limit,
            frame_rate=settings.frames,
            lossless=session.request.simulation == "fast",
            overwrite=settings.overwrite,
        )
        session.listen(recorder)
        session.runner.observe(recorder.on_tick, recorder.on_view, recorder.on_frame)
        session.outputs.append(lambda: self.path if self.started else None)
        recorder.watch_tree(session.runner.root)
        self.started = True

    def __enter__(self) -> Self:
        from missions.plugins.records.recording.record_contents import contents_of  # noqa: PLC0415 - a run without a record needs none of it
        from missions.plugins.records.recording.writer_client import CannotRecordError  # noqa: PLC0415

        wish, session, runner = self._settings, self._session, self._session.runner
        if wish.path.resolve() in session.files:
            raise click.BadParameter(f"{wish.path} is an input file of this run", param_hint="--record")
        started = time_of_day() - timedelta(seconds=runner.clock.now())
        lag = runner.assembled_robot.robot.lag
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
            self._recorder.open(contents, runner.clock, report=self._report, health_check=runner.assembled_robot.health)
        except CannotRecordError as error:
            if not wish.requested:
                click.echo(f"mission: not recorded: {error}", err=True)
                self.started = False
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
        """Path of the record.

        It is another one than requested if the new record is incomplete, so that an earlier record keeps the requested
        path.
        """
        return self._recorder.path

    def _report(self, notice: DeviceStatus) -> None:
        runner = self._session.runner
        runner.stream.emit(FaultRaised(runner.clock.now(), notice.device, notice.kind, notice.message, notice.hint))


def record_run(options: RecordOptions, session: RunSession) -> AbstractContextManager[object]:
    """Return a context that records the run of ``session``; it does nothing if the ``options`` request no record.

    Raises click.UsageError for options that have no effect.
    """
    wish = record_settings(options, session.request)
    return nullcontext() if wish is None else RunRecording(wish, session)
