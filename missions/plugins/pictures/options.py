"""Option of `mission run` for films of simulated runs."""

from dataclasses import replace
from pathlib import Path

from drivers.api.fast_dataclass import dataclass
from missions.options import option
from missions.request import CLOCK, RunOptions, RunRequest


@dataclass(frozen=True, kw_only=True)
class FilmOptions(RunOptions):
    """Options of a run's film."""

    film: Path | None = option(
        "Film the camera's view and the room from above, to a .webm file or a folder of pictures.",
        "path",
        metavar="FILE",
        group=CLOCK,
    )

    def adapt(self, request: RunRequest) -> RunRequest:
        """Return the request in simulated time, unless it names a robot or a simulation."""
        unnamed = self.film is not None and request.simulate is None and request.robot is None
        return replace(request, simulate="fast") if unnamed else request

    def check(self, request: RunRequest) -> None:
        """Raise ValueError if a film is requested of a run in real time."""
        if self.film is not None and request.simulation != "fast":
            raise ValueError("--film needs simulated time: add --simulate fast")
