"""The option of `mission run` and `mission task serve` for a studio beside them."""

from drivers.api.quick import dataclass
from missions.options import option
from missions.request import RunOptions


@dataclass(frozen=True, kw_only=True)
class StudioOptions(RunOptions):
    """Whether a studio is served meanwhile."""

    studio: bool = option("Serve the page of `mission studio` meanwhile.", default=False, newcomer=True)
