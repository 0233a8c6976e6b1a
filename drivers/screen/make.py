"""Factories of screens, and the screen that prints to the terminal."""

from collections.abc import Callable

from drivers.api import Health, Mood, Screen
from drivers.api.driver import DriverContext
from drivers.api.sections import ScreenKeys
from drivers.clock import Clock
from drivers.screen.base_screen import BaseScreen
from drivers.screen.declared import PageKeys
from drivers.screen.pages import PageScreen
from drivers.transport.loop import guard_callback

# The screen of a machine without one: it prints the text of the face.


class PrintedScreen(BaseScreen):
    """Screen that prints each new mood and text by ``out``: a ``drivers.api.Screen``.

    ``rest`` and ``awake`` are the moods after ``rest`` and after ``open``.
    """

    def __init__(
        self,
        clock: Clock,
        out: Callable[[str], None],
        *,
        rest: Mood = Mood.ASLEEP,
        awake: Mood = Mood.NEUTRAL,
    ) -> None:
        super().__init__(clock, rest=rest, awake=awake)
        self._out = guard_callback(out)
        self._open = False

    def open(self) -> None:
        """Wake up, and start printing."""
        super().open()
        self._open = True

    def close(self) -> None:
        """Rest, and stop printing."""
        self.rest()
        self._open = False

    def health(self) -> Health:
        """Return whether the screen is open."""
        return Health(self._open, "" if self._open else f"{self.name}: not opened yet")

    def mood(self, mood: Mood) -> None:
        """Print a new mood."""
        new = mood is not self.content().mood
        super().mood(mood)
        if new and self._open:
            self._out(f"face: {mood}")

    def show(self, text: str) -> None:
        """Print ``text`` if it is new and not empty."""
        new = text != self.content().text
        super().show(text)
        if new and text and self._open:
            self._out(f"show: {text}")


def page(keys: PageKeys, site: DriverContext) -> PageScreen:
    """Return a face on a page for a browser."""
    return PageScreen(site.clock, port=keys.port or 0, awake=Mood(keys.mood), report=site.report)


def printed(keys: ScreenKeys, site: DriverContext) -> Screen:
    """Return a face that is printed on the terminal."""
    return PrintedScreen(site.clock, site.print_line, awake=Mood(keys.mood))
