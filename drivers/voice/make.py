"""From the keys of a robot file to a voice; one that cannot speak here prints its words."""

from pathlib import Path

from drivers.api import Voice
from drivers.api.driver import Site
from drivers.api.sections import VoiceKeys
from drivers.voice.choose import Wish, make_voice
from drivers.voice.declared import SpeechKeys


def auto(keys: SpeechKeys, site: Site) -> Voice:
    """Return the first of a synthesiser's wheel, an installed synthesiser and printing that there is."""
    return _voice("auto", keys, site)


def espeak(keys: SpeechKeys, site: Site) -> Voice:
    """Return the voice of the synthesiser's wheel."""
    return _voice("espeak", keys, site)


def program(keys: SpeechKeys, site: Site) -> Voice:
    """Return the voice of an installed synthesiser."""
    return _voice("program", keys, site)


def piper(keys: SpeechKeys, site: Site) -> Voice:
    """Return a voice of Piper."""
    return _voice("piper", keys, site)


def command(keys: SpeechKeys, site: Site) -> Voice:
    """Return the voice of a command line."""
    return _voice("command", keys, site)


def printed(keys: VoiceKeys, site: Site) -> Voice:
    """Return a voice that prints its words."""
    return make_voice(Wish("print", keys.manner), site.clock, site.out, report=site.report, changed=site.changed)


def _voice(driver: str, keys: SpeechKeys, site: Site) -> Voice:
    model = str(Path(keys.model).expanduser().absolute()) if keys.model else ""
    wish = Wish(driver, keys.manner, keys.volume, keys.device, model, keys.command)
    return make_voice(wish, site.clock, site.out, report=site.report, changed=site.changed)
