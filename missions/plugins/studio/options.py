"""Option ``--studio`` of `mission run` and `mission task serve`."""

from typing import ClassVar

from drivers.api.fast_dataclass import dataclass
from missions.options import option
from missions.request import RunOptions


@dataclass(frozen=True, kw_only=True)
class StudioOptions(RunOptions):
    """Option that serves a studio in a process of its own during a run."""

    needs_control: ClassVar[bool] = True

    studio: bool = option("Serve the page of `mission studio` during the run.", default=False, newcomer=True)
