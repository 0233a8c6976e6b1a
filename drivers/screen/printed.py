"""The screen of a machine without one: it prints what the face would show."""

from collections.abc import Callable

from drivers.api import Health, Mood
from drivers.clock import Clock
from drivers.guard import guarded
from drivers.screen.kept import KeptScreen


class PrintedScreen(KeptScreen):
    """A ``drivers.api.Screen`` that hands each new mood and each new text to ``out``, as a mission writes them."""

    def __init__(
        self,
        clock: Clock,
        out: Callable[[str], None],
        *,
        rest: Mood = Mood.ASLEEP,
        awake: Mood = Mood.NEUTRAL,
    ) -> None:
        super().__init__(clock, rest=rest, awake=awake)
        self._out = guarded(out)
        self._open = False

    def open(self) -> None:
        """Wake up, and be ready to print."""
        super().open()
        self._open = True

    def close(self) -> None:
        """Rest, and print no more."""
        self.rest()
        self._open = False

    def health(self) -> Health:
        """Say whether it is open."""
        return Health(self._open, "" if self._open else f"{self.name}: not opened yet")

    def mood(self, mood: Mood) -> None:
        """Print the mood, if it is a new one."""
        new = mood is not self.shown().mood
        super().mood(mood)
        if new and self._open:
            self._out(f"face: {mood}")

    def show(self, text: str) -> None:
        """Print the text, if it is a new one and not empty."""
        new = text != self.shown().text
        super().show(text)
        if new and text and self._open:
            self._out(f"show: {text}")
