"""Simulated voice, which prints its texts and can be unplugged."""

from collections.abc import Callable
from pathlib import Path

from drivers.api import DEFAULT_STYLE, Health, Priority, SpeechStyle, StatusCallback, Utterance, ignore
from drivers.clock import Clock
from drivers.sim.plug import SimulatedPlug
from drivers.sound.printed_voice import PrintedVoice


class VoiceTwin(PrintedVoice):
    """Simulated voice that prints its texts; while it is unplugged, it says nothing.

    Call ``step`` every ``STEP_INTERVAL`` to end utterances.
    """

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
        """Whether utterances never end, as with a program that hangs."""

    def open(self) -> None:
        """Connect at once, unless unplugged."""
        super().open()
        self.plug.open()

    def close(self) -> None:
        """Cancel all utterances."""
        super().close()
        self.plug.close()

    def health(self) -> Health:
        """Return whether the voice is plugged in."""
        return self.plug.health(super().health().counters)

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Queue ``text`` for printing; its duration follows from its speed. Raises NotConnected if unplugged."""
        self.plug.check_online()
        return super().say(text, manner, priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Queue a sound file, whose name is printed. Raises BadRequest; NotConnected if unplugged."""
        self.plug.check_online()
        return super().play(path, priority)

    def update(self) -> None:
        """Remove finished utterances from the queue. Does nothing while ``is_hanging`` is True."""
        if not self.is_hanging:
            super().update()

    def step(self) -> None:
        """Remove finished utterances from the queue."""
        self.update()
