"""The twin of a voice: printed words with a plug."""

from collections.abc import Callable
from pathlib import Path

from drivers.api import DEFAULT_STYLE, Health, Priority, SpeechStyle, StatusCallback, Utterance, ignore
from drivers.clock import Clock
from drivers.sim.plug import SimulatedPlug
from drivers.sound.printed_voice import PrintedVoice


class VoiceTwin(PrintedVoice):
    """A printed voice that can be unplugged, which silences it. ``step``, every ``STEP_INTERVAL``, tells what has ended."""

    STEP_INTERVAL = 0.05

    def __init__(
        self,
        clock: Clock,
        out: Callable[[str], None],
        *,
        default_style: SpeechStyle = DEFAULT_STYLE,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        super().__init__(clock, out, default_manner=default_style, changed=changed)
        self.plug = SimulatedPlug(self.name, report, on_offline=self.rest)
        self.is_hanging = False
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

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print ``text`` in its turn; it lasts as its speed says. Raises NotConnected if unplugged."""
        self.plug.check_online()
        return super().say(text, manner, priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print the name of a file in its turn. Raises BadRequest; NotConnected if unplugged."""
        self.plug.check_online()
        return super().play(path, priority)

    def update(self) -> None:
        """Take out of the queue what has ended by now; nothing while it hangs."""
        if not self.is_hanging:
            super().update()

    def step(self) -> None:
        """Take note of what has been said to its end."""
        self.update()
