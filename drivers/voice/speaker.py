"""Programs that speak by themselves, such as an installed espeak-ng: each text is one run of the program."""

from drivers.api import Manner
from drivers.clock import Clock
from drivers.errors import DeviceFault
from drivers.voice.cut import Cut
from drivers.voice.manner import WORDS_PER_MINUTE, longest, seconds_of
from drivers.voice.program import run
from drivers.voice.protocol import Speech
from drivers.voice.synthesiser import Synthesiser

TOO_SOON = 1 / 3
"""Part of the time that words take: a program that complains and has ended by then has not spoken them."""


class Speaker:
    """A ``drivers.voice.engines.Engine`` that has a program speak."""

    speaks_itself = True
    broken = ""

    def __init__(self, synthesiser: Synthesiser, clock: Clock) -> None:
        self._synthesiser = synthesiser
        self._clock = clock
        self._name = "voice"

    def open(self) -> None:
        """Do nothing: the program is run for each text."""

    def close(self) -> None:
        """Do nothing: what runs is broken off with the words that it says."""

    def speak(self, text: str, manner: Manner, cut: Cut) -> Speech | None:
        """See Engine. Raises DeviceFault, also where it says that it has spoken and cannot have; and NoReply.

        Without a sound card espeak-ng complains, ends at once, and with 0.
        """
        command, began = self._synthesiser.command(manner), self._clock.now()
        ran = run(self._name, command, text, cut, self._clock, limit=longest(text, manner))
        seconds = TOO_SOON * seconds_of(text, manner.speed or WORDS_PER_MINUTE)
        if ran is not None and ran.complaint and self._clock.now() - began < seconds:
            program = self._synthesiser.program
            hint = "`aplay -l` lists sound cards; `driver: print` speaks without"
            raise DeviceFault(f"{self._name}: {program}: ended before it had spoken: {ran.complaint}", hint=hint)
        return None
