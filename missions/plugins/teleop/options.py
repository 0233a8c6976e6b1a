"""Option of `mission run` for a game pad during the mission."""

from drivers.api.fast_dataclass import dataclass
from missions.options import option
from missions.plugins.teleop import FIRST_PAD
from missions.request import WHERE, RunOptions, RunRequest


@dataclass(frozen=True, kw_only=True)
class PadOptions(RunOptions):
    """Option ``--pad``, which lets a game pad drive the base during a mission."""

    pad: str | None = option(
        "Let a game pad drive the base while you hold its left shoulder button: the first one, or this device.",
        alone=FIRST_PAD,
        metavar="[DEVICE]",
        group=WHERE,
    )

    def check(self, request: RunRequest) -> None:
        if self.pad is not None and request.simulation == "fast":
            raise ValueError("--pad needs real time: use --simulate wire, not fast")
