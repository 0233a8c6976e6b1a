"""Simulated screen, which can be unplugged."""

from drivers.api import Health, Mood, StatusCallback, ignore
from drivers.clock import Clock
from drivers.screen.base_screen import BaseScreen
from drivers.sim.plug import SimulatedPlug


class ScreenTwin(BaseScreen):
    """Simulated ``drivers.api.Screen``. While unplugged it still stores its content, as the real one does.

    ``rest`` and ``awake`` are the moods after ``rest`` and after ``open``.
    """

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
        """Wake up, and connect at once unless it is unplugged."""
        super().open()
        self.plug.open()

    def close(self) -> None:
        """Rest, and disconnect."""
        self.rest()
        self.plug.close()

    def health(self) -> Health:
        """Return whether the screen is connected."""
        return self.plug.health({})
