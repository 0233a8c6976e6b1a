"""Which programs that speak there are, and how each is told what to say."""

import shutil
from collections.abc import Mapping

from drivers.api import Manner
from drivers.api.quick import dataclass
from drivers.voice.manner import espeak_name

_ESPEAK = ("--stdin", "-v{name}", "-s{speed}", "-a{volume}")

KNOWN: Mapping[str, tuple[str, ...]] = {
    "espeak-ng": _ESPEAK,
    "espeak": _ESPEAK,
    "say": ("-v{voice}", "-r{speed}", "-f", "-"),  # of macOS
}
"""Programs that speak their standard input, best first, and their arguments."""


@dataclass(frozen=True, slots=True)
class Synthesiser:
    """A program that speaks what it reads from its standard input (UTF-8), and ends when it has.

    In ``arguments``, ``{voice}``, ``{language}`` and ``{speed}`` (words a minute) stand for the manner of speaking,
    ``{volume}`` for how loud (percent), ``{name}`` for the voice as espeak calls it: "en-us+f2". An argument is left
    out while what stands in it is not known.
    """

    program: str
    arguments: tuple[str, ...] = ()
    volume: float = 1.0

    def command(self, manner: Manner) -> list[str]:
        """Return what to run; never through a shell, and the text is no part of it."""
        values = {
            "{voice}": manner.voice,
            "{language}": manner.language,
            "{name}": espeak_name(manner),
            "{speed}": f"{manner.speed:.0f}" if manner.speed else "",
            "{volume}": f"{self.volume:.0%}".rstrip("%"),
        }
        return [self.program, *(_filled(each, values) for each in self.arguments if not _lacks(each, values))]


def _lacks(argument: str, values: Mapping[str, str]) -> bool:
    return any(word in argument and not value for word, value in values.items())


def _filled(argument: str, values: Mapping[str, str]) -> str:
    for word, value in values.items():
        argument = argument.replace(word, value)
    return argument


def find_synthesiser(folders: str | None = None, *, volume: float = 1.0) -> Synthesiser | None:
    """Return the best program on the PATH (or in ``folders``, joined as in PATH); None where there is none."""
    for name, arguments in KNOWN.items():
        program = shutil.which(name, path=folders)
        if program is not None:
            return Synthesiser(program, arguments, volume)
    return None
