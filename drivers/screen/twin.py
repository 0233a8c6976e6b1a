"""The twin of a screen: what it shows can be asked, and it has a plug."""

from drivers.api import Health, Mood, StatusCallback, ignore
from drivers.clock import Clock
from drivers.screen.base_screen import BaseScreen
from drivers.sim.plug import SimulatedPlug


class ScreenTwin(BaseScreen):
    """A ``drivers.api.Screen`` that nobody needs to look at. Unplugged it keeps what it is told, as the real one."""

    def __init__(
        self,
        clock: Clock,
        *,
        rest: Mood = Mood.ASLEEP,
        awake: Mood = Mood.NEUTRAL,
        report: StatusCallback = ignore,
    ) -> None:
        super().__init__(clock, rest=rest, awake=awake)
        self.plug = SimulatedPlug(self.name, report)

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
