"""The twin of a screen: what it shows can be asked, and it has a plug."""

from drivers.api import Health, Mood, Report, ignore
from drivers.clock import Clock
from drivers.screen.kept import KeptScreen
from drivers.sim.plug import Plug


class ScreenTwin(KeptScreen):
    """A ``drivers.api.Screen`` that nobody needs to look at. Unplugged it keeps what it is told, as the real one."""

    def __init__(
        self,
        clock: Clock,
        *,
        rest: Mood = Mood.ASLEEP,
        awake: Mood = Mood.NEUTRAL,
        report: Report = ignore,
    ) -> None:
        super().__init__(clock, rest=rest, awake=awake)
        self.plug = Plug(self.name, report)

    def open(self) -> None:
        """Wake up, and be there at once unless it is unplugged."""
        super().open()
        self.plug.open()

    def close(self) -> None:
        """Rest, and go."""
        self.rest()
        self.plug.close()

    def health(self) -> Health:
        """Say whether it is there."""
        return self.plug.health({})
