"""The option of `mission run` and `mission task serve` for a studio beside them."""

from typing import ClassVar

from drivers.api.fast_dataclass import dataclass
from missions.options import option
from missions.request import RunOptions


@dataclass(frozen=True, kw_only=True)
class StudioOptions(RunOptions):
    """Whether a studio is served meanwhile."""

    needs_control: ClassVar[bool] = True

    studio: bool = option("Serve the page of `mission studio` meanwhile.", default=False, newcomer=True)
