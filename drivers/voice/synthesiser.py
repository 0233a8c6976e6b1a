"""Which speech synthesiser there is, and how it is told what to say."""

import shutil
from dataclasses import dataclass

KNOWN = (("espeak-ng", ("--stdin",)), ("espeak", ("--stdin",)), ("say", ("-f", "-")))
"""Programs that speak their standard input, best first, and the arguments that make them; the last is of macOS."""


@dataclass(frozen=True, slots=True)
class Synthesiser:
    """A program that speaks what it reads from its standard input (UTF-8), and ends when it has."""

    program: str
    arguments: tuple[str, ...] = ()

    @property
    def command(self) -> list[str]:
        """What to run; never through a shell, and the text is no part of it."""
        return [self.program, *self.arguments]


def find_synthesiser(folders: str | None = None) -> Synthesiser | None:
    """Return the best synthesiser on the PATH (or in ``folders``, joined as in PATH); None where there is none."""
    for name, arguments in KNOWN:
        program = shutil.which(name, path=folders)
        if program is not None:
            return Synthesiser(program, arguments)
    return None
