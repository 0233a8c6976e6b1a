"""Checkup of a voice: whether a synthesiser is installed. Nothing is spoken."""

from collections.abc import Iterator

from drivers.api.driver import DriverContext, Finding, warning
from drivers.extras import extra_hint
from drivers.sound.printed_voice import PrintedVoice
from drivers.voice.declared import SpeechKeys
from drivers.voice.speech import auto


def checkup(keys: SpeechKeys, context: DriverContext) -> Iterator[Finding]:
    """Search for a synthesiser, and yield the finding."""
    if isinstance(auto(keys, context), PrintedVoice):
        fix = extra_hint("speak", "sudo apt install espeak-ng")
        yield warning("synthesiser", "not installed: speech is printed", fix)
    else:
        yield Finding("synthesiser", "installed")
