"""The option of `mission run` for a game pad beside the mission."""

from dataclasses import replace

from drivers.api.quick import dataclass
from missions.options import option
from missions.plugins.teleop import FIRST_PAD
from missions.request import WHERE, RunOptions, RunRequest


@dataclass(frozen=True, kw_only=True)
class PadOptions(RunOptions):
    """The game pad that may drive the base meanwhile."""

    pad: str | None = option(
        "Let a game pad drive the base while you hold its left shoulder button: the first one, or this device.",
        alone=FIRST_PAD,
        metavar="[DEVICE]",
        group=WHERE,
    )

    def adapt(self, request: RunRequest) -> RunRequest:
        """Return the request with the pad."""
        return request if self.pad is None else replace(request, pad=self.pad)
