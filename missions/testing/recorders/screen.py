"""A screen that keeps what it was told."""

from drivers.api import Mood, Screen, Shown
from drivers.clock import ManualClock
from missions.testing.recorders.spy import Spy


class RecordedScreen(Spy):
    """A ``drivers.api.Screen``: keeps moods, texts, and openings of the mouth as numbers, in one row.

    Like the real one it raises nothing in trouble. ``now`` is what it shows.
    """

    protocol = Screen

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("screen", clock)
        self.now = Shown()

    def mood(self, mood: Mood) -> None:
        """Keep the mood."""
        self.keep_anyway(mood)
        self.now = Shown(mood, self.now.text, self.now.mouth)

    def show(self, text: str) -> None:
        """Keep the text."""
        self.keep_anyway(text)
        self.now = Shown(self.now.mood, text, self.now.mouth)

    def mouth(self, opening: float) -> None:
        """Keep how far the mouth is to open."""
        self.keep_anyway(opening)
        self.now = Shown(self.now.mood, self.now.text, opening)

    def shown(self) -> Shown:
        """Return what it was told."""
        return self.now
