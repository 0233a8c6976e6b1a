"""The twin of a voice: printed words with a plug."""

from collections.abc import Callable

from drivers.api import Health, Report, Utterance, unheard, unreported
from drivers.clock import Clock
from drivers.sim.twins.plug import Plug
from drivers.voice.printed import PrintedVoice


class VoiceTwin(PrintedVoice):
    """A printed voice that can be unplugged, which silences it. ``step``, every ``PERIOD``, tells what has ended."""

    PERIOD = 0.05

    def __init__(
        self,
        clock: Clock,
        out: Callable[[str], None],
        *,
        report: Report = unreported,
        changed: Callable[[], None] = unheard,
        name: str = "voice",
    ) -> None:
        super().__init__(clock, out, changed=changed, name=name)
        self.plug = Plug(name, report, gone=self.rest)

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

    def say(self, text: str) -> Utterance:
        """Print ``text`` now; its time runs after that of whatever is being said. Raises NotConnected if unplugged."""
        self.plug.require()
        return super().say(text)

    def step(self) -> None:
        """Take note of what has been said to its end."""
        self.settle()
