"""From the keys of a robot file to a voice; one that cannot speak here prints its words."""

import shlex
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from drivers.api import AS_USUAL, Manner, Report, Voice, ignore
from drivers.api.driver import Site
from drivers.api.quick import dataclass
from drivers.api.sections import VoiceKeys
from drivers.clock import Clock
from drivers.sound.engines import Engine, Espeak, Piper
from drivers.sound.player import Player
from drivers.sound.program import KNOWN, Speaker, Synthesiser, find_synthesiser
from drivers.voice.declared import SpeechKeys
from drivers.voice.speech import SpeechVoice

WHEELS = ("espeakng_loader", "miniaudio")
"""What the extra ``speak`` installs."""


@dataclass(frozen=True, slots=True)
class Wish:
    """The voice that is wanted, in the words of a robot file; ``backend`` is one of miniaudio's, for tests."""

    driver: str = "auto"
    usual: Manner = AS_USUAL
    volume: float = 1.0
    device: str = ""
    model: str = ""
    command: str = ""
    backend: str = ""


def make_voice(
    wish: Wish,
    clock: Clock,
    out: Callable[[str], None],
    *,
    report: Report = ignore,
    changed: Callable[[], None] = ignore,
) -> Voice:
    """Return a voice; ``out`` prints what cannot be heard."""
    engine = _engine(wish, clock, report)
    if engine is None:
        from drivers.sound.printed import PrintedVoice  # noqa: PLC0415 - a voice that is heard prints by itself

        return PrintedVoice(clock, out, usual=wish.usual, changed=changed)
    player = Player(clock, device=wish.device, volume=wish.volume, backend=wish.backend, report=report)
    return SpeechVoice(clock, engine, player, out, usual=wish.usual, report=report, changed=changed)


def _engine(wish: Wish, clock: Clock, report: Report) -> Engine | None:
    installed = find_synthesiser(volume=wish.volume) if wish.driver in ("auto", "program") else None
    match wish.driver:
        case "espeak":
            return Espeak(clock, usual=wish.usual, report=report)
        case "auto" if all(find_spec(wheel) for wheel in WHEELS):
            return Espeak(clock, usual=wish.usual, report=report)
        case "piper":
            return Piper(Path(wish.model).expanduser(), clock)
        case "command":
            program, *arguments = shlex.split(wish.command)
            return Speaker(Synthesiser(program, tuple(arguments), wish.volume), clock)
        case "auto" | "program" if installed is not None:
            return Speaker(installed, clock)
        case "program":  # which will say that it is missing
            return Speaker(Synthesiser("espeak-ng", KNOWN["espeak-ng"]), clock)
    return None


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
