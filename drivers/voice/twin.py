"""The twin of a voice: printed words with a plug."""

from collections.abc import Callable
from pathlib import Path

from drivers.api import AS_USUAL, Health, Manner, Priority, Report, Utterance, ignore
from drivers.clock import Clock
from drivers.sim.plug import Plug
from drivers.sound.printed import PrintedVoice


class VoiceTwin(PrintedVoice):
    """A printed voice that can be unplugged, which silences it. ``step``, every ``PERIOD``, tells what has ended."""

    PERIOD = 0.05

    def __init__(
        self,
        clock: Clock,
        out: Callable[[str], None],
        *,
        usual: Manner = AS_USUAL,
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        super().__init__(clock, out, usual=usual, changed=changed)
        self.plug = Plug(self.name, report, gone=self.rest)
        self.hanging = False
        """Whether what it says comes to no end, as with a program that hangs."""

    def open(self) -> None:
        """Be there at once, unless it is unplugged."""
        super().open()
        self.plug.open()

    def close(self) -> None:
        """Fall silent for good."""
        super().close()
        self.plug.close()

    def health(self) -> Health:
        """Say whether it is there."""
        return self.plug.health(super().health().counters)

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print ``text`` in its turn; it lasts as its speed says. Raises NotConnected if unplugged."""
        self.plug.require()
        return super().say(text, manner, priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print the name of a file in its turn. Raises BadRequest; NotConnected if unplugged."""
        self.plug.require()
        return super().play(path, priority)

    def settle(self) -> None:
        """Take out of the queue what has ended by now; nothing while it hangs."""
        if not self.hanging:
            super().settle()

    def step(self) -> None:
        """Take note of what has been said to its end."""
        self.settle()
