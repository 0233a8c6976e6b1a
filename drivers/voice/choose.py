"""From a robot file's words to a voice: the one that is asked for, or the best that there is."""

import shlex
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from drivers.api import AS_USUAL, Manner, Report, Voice, ignore
from drivers.api.quick import dataclass
from drivers.clock import Clock
from drivers.voice.engines import Engine, Espeak, Piper
from drivers.voice.player import Player
from drivers.voice.printed import PrintedVoice
from drivers.voice.speaker import Speaker
from drivers.voice.speech import SpeechVoice
from drivers.voice.synthesiser import KNOWN, Synthesiser, find_synthesiser

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
