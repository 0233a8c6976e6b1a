"""Option of `mission run` for the live view."""

from dataclasses import replace
from math import inf

from drivers.api.fast_dataclass import dataclass
from missions.options import option
from missions.request import RunOptions, RunRequest


@dataclass(frozen=True, kw_only=True)
class ViewOptions(RunOptions):
    """Option ``--view``, which shows the run on the whole terminal."""

    view: bool = option(
        "Show the tree, the variables, the robot and the log on the whole terminal; keys pause, step and stop.",
        default=False,
        newcomer=True,
    )

    def adapt(self, request: RunRequest) -> RunRequest:
        """Return the request in real time, unless it sets a speed."""
        watched = self.view and request.simulate == "fast" and request.speed == inf
        return replace(request, speed=1.0) if watched else request
