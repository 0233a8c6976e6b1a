"""Mistakes in a file, each at its line and column, all reported in one go."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches


@dataclass(frozen=True, slots=True, order=True)
class Mark:
    """A place in a file: ``line`` and ``column`` count from 1; ``length`` is how many characters to underline."""

    line: int = 1
    column: int = 1
    length: int = 1


@dataclass(frozen=True, slots=True)
class Source:
    """A file's name, as the user gave it, and its text."""

    name: str
    text: str

    def line(self, number: int) -> str:
        """Return line ``number`` (from 1) without its end; empty past the last."""
        lines = self.text.splitlines()
        return lines[number - 1] if 0 < number <= len(lines) else ""


@dataclass(frozen=True, slots=True)
class Fault:
    """One mistake: where it is, what is wrong, and what to write instead where that is known."""

    source: Source
    mark: Mark
    message: str
    suggestion: str = ""

    @property
    def place(self) -> str:
        """``FILE:LINE:COLUMN``, as editors and terminals make it a link."""
        return f"{self.source.name}:{self.mark.line}:{self.mark.column}"

    def __str__(self) -> str:
        lines = [f"{self.place}: {self.message}"]
        shown = self.source.line(self.mark.line).rstrip()
        if shown:
            number = f"{self.mark.line:6d} | "
            # Tabs are shown as one blank, so that the caret stands under what it means.
            shown, start = shown.replace("\t", " "), self.mark.column - 1
            if start > 100:
                shown, start = "..." + shown[start - 40 :], 43
            carets = "^" * max(1, min(self.mark.length, len(shown) - start))
            lines += [number + shown[:160], " " * (len(number) - 2) + "| " + " " * start + carets]
        if self.suggestion:
            lines.append(f"  {self.suggestion}")
        return "\n".join(lines)


class InvalidFileError(ValueError):
    """A file that cannot be used; ``faults`` holds every mistake in it, in the order of the file."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self.faults = tuple(sorted(faults, key=lambda fault: (fault.source.name, fault.mark)))
        super().__init__("\n".join(str(fault) for fault in self.faults))


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return "did you mean 'x'?" for the known word that is closest, or the empty string."""
    close = get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else ""


def one_of(word: str, known: Iterable[str]) -> str:
    """Return the closest known word as a question, or the list of all that would be right."""
    words = sorted(known)
    return did_you_mean(word, words) or (f"known are: {', '.join(words)}" if words else "")
