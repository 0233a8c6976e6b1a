"""Programs that speak by themselves, such as an installed espeak-ng: each text is one run of the program."""

from drivers.api import Manner
from drivers.voice.cut import Cut
from drivers.voice.program import run
from drivers.voice.protocol import Speech
from drivers.voice.synthesiser import Synthesiser


class Speaker:
    """A ``drivers.voice.engines.Engine`` that has a program speak."""

    speaks_itself = True
    broken = ""

    def __init__(self, synthesiser: Synthesiser, *, name: str = "voice") -> None:
        self._synthesiser = synthesiser
        self._name = name

    def open(self) -> None:
        """Do nothing: the program is run for each text."""

    def close(self) -> None:
        """Do nothing: what runs is broken off with the words that it says."""

    def speak(self, text: str, manner: Manner, cut: Cut) -> Speech | None:
        """See Engine. Raises DeviceFault."""
        run(self._name, self._synthesiser.command(manner), text, cut)
        return None
