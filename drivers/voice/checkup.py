"""How a voice is: what speaks, and whether it is there. Nothing is said."""

from collections.abc import Iterator

from drivers.api.driver import DriverContext, Finding, warning
from drivers.extras import extra_hint
from drivers.sound.printed_voice import PrintedVoice
from drivers.voice.declared import SpeechKeys
from drivers.voice.speech import auto


def checkup(keys: SpeechKeys, site: DriverContext) -> Iterator[Finding]:
    """Look for what speaks."""
    if isinstance(auto(keys, site), PrintedVoice):
        cure = extra_hint("speak", "sudo apt install espeak-ng")
        yield warning("synthesiser", "there is none: what the robot says is printed", cure)
    else:
        yield Finding("synthesiser", "there is one")
