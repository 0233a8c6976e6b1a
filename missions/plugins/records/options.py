"""Record options of `mission run`."""

import os
from importlib.util import find_spec
from pathlib import Path

from config.defaults import load_defaults
from drivers.api.fast_dataclass import dataclass
from missions.options import option
from missions.request import RunOptions, RunRequest

GROUP = "The record"

RECORD_ENVIRONMENT_VARIABLE = "MISSION_RECORD"
"""Environment variable that overrides the user's default: ``no``, ``yes``, or ``all`` to include simulated runs."""


@dataclass(frozen=True, kw_only=True)
class RecordOptions(RunOptions):
    """Whether and where a run is recorded, and the maximum size of its record."""

    record: Path | None = option(
        "Record the run into FILE.mcap, for `mission record`; in a folder, under the mission's name and the time. "
        "Runs on a robot are recorded by default.",
        "path",
        metavar="FILE",
        group=GROUP,
        newcomer=True,
    )
    no_record: bool = option("Do not record a run on a robot.", default=False, group=GROUP)
    record_limit: float | None = option(
        "The maximum size of the record, by default 2 GB. Before that, pictures become rarer.",
        "size",
        metavar="SIZE",
        group=GROUP,
    )
    record_frames: float | None = option(
        "Pictures of the camera per second, by default 5; 0 for none.",
        "frequency",
        low=0,
        high=100,
        metavar="RATE",
        group=GROUP,
    )
    overwrite: bool = option("Replace the record that is there.", default=False, group=GROUP)

    def is_wanted(self, request: RunRequest) -> bool:
        """Whether the run is recorded: by an option, or by default."""
        if self == RecordOptions(no_record=True):
            return False
        return super().is_wanted(request) or is_recorded_by_default(simulated=request.simulation is not None)

    def check(self, request: RunRequest) -> None:
        """Raise ValueError for contradictory options."""
        del request
        if self.no_record and self.record is not None:
            raise ValueError("--record and --no-record cannot be used together")


def is_recorded_by_default(*, simulated: bool = False) -> bool:
    """Return whether runs are recorded by default: not if the user declines, or the extra `records` is missing.

    Raises InvalidFileError for the user's defaults.
    """
    said = os.environ.get(RECORD_ENVIRONMENT_VARIABLE, "").lower()
    wished = said not in ("no", "0", "off") if said else load_defaults().record
    return wished and (said == "all" or not simulated) and find_spec("mcap") is not None
