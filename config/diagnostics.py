"""Diagnostics: errors in a file with line and column, all reported together, with suggestions."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from unicodedata import combining, east_asian_width

from drivers.api.secrets import without_secrets

SHORT_WORD_LENGTH = 5
"""Length up to which an unknown word must be one edit from the suggested one, or a prefix of it."""

SMART_QUOTES = re.compile("[\u201c-\u201f\u00ab\u00bb]|^[\u2018-\u201b]|[\u2018-\u201b]$")
ODD_SPACES = re.compile("[\u00a0\u2007\u202f\u3000\u200b\ufeff]")

MAX_DIAGNOSTICS = 100
"""Number of errors at which reading stops, since the file is probably of another kind."""


@dataclass(frozen=True, slots=True, order=True)
class Mark:
    """Position in a file: ``line`` and ``column`` count from 1; ``length`` is the number of characters to underline."""

    line: int = 1
    column: int = 1
    length: int = 1


@dataclass(frozen=True, slots=True)
class SourceText:
    """Name of a file, as given by the user, and its text."""

    name: str
    text: str

    def line(self, number: int) -> str:
        """Return line ``number`` (from 1) without its end, or an empty text past the last line."""
        lines = self.text.splitlines()
        return lines[number - 1] if 0 < number <= len(lines) else ""


def mark_at(text: str, position: int) -> Mark:
    """Return the line and column of the character at ``position`` (from 0)."""
    lines = (text[:position] + "x").splitlines()
    return Mark(len(lines), len(lines[-1]))


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """Error in a file: position, message, and a suggestion if there is one.

    ``repaired_lines`` are lines that the parser read differently because of this error; further errors in them are
    dropped.
    """

    source: SourceText
    mark: Mark
    message: str
    suggestion: str = ""
    repaired_lines: frozenset[int] = field(default=frozenset(), compare=False)

    def __post_init__(self) -> None:
        for name in ("message", "suggestion"):  # what is quoted of a file may be the address of a camera
            object.__setattr__(self, name, without_secrets(getattr(self, name)))

    def is_same(self, other: "Diagnostic") -> bool:
        """Return whether ``other`` is the same error, found once more on the way to another file."""
        return (self.source.name, self.mark, self.message) == (other.source.name, other.mark, other.message)

    @property
    def place(self) -> str:
        """Position as ``FILE:LINE:COLUMN``, which editors and terminals turn into a link."""
        return f"{self.source.name}:{self.mark.line}:{self.mark.column}"

    def __str__(self) -> str:
        lines = [f"{self.place}: {self.message}", *self._excerpt()]
        if self.suggestion:
            lines.append(f"  {self.suggestion}")
        return "\n".join(lines)

    def _excerpt(self) -> list[str]:
        """Return the file's line with carets under the error; only a part of a long line."""
        line = without_secrets(self.source.line(self.mark.line).rstrip(), aligned=True)
        if not line:
            return []
        start = min(self.mark.column - 1, len(line))
        cut = start - 40 if start > 100 else 0
        # A tab is shown as one blank, and control codes as a sign, so that carets stand under what they mean.
        visible = "".join(c if c.isprintable() else " " if c == "\t" else "\ufffd" for c in line[cut : cut + 160])
        before, marked = visible[: start - cut], visible[start - cut :][: self.mark.length]
        lead = "..." if cut else ""
        number = f"{self.mark.line:6d} | "
        carets = " " * (len(lead) + _width(before)) + "^" * max(1, _width(marked))
        return [number + lead + visible, " " * (len(number) - 2) + "| " + carets]


class InvalidInputError(ValueError):
    """Unusable input of the user: ``mission`` prints the message and exits with 2."""


class InvalidFileError(InvalidInputError):
    """Unusable file; ``diagnostics`` are all errors (MAX_DIAGNOSTICS at most), in the order of the file."""

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        # What an alias repeats is one mistake, not two.
        once = dict.fromkeys(diagnostics)
        self.diagnostics = tuple(sorted(once, key=lambda fault: (fault.source.name, fault.mark)))
        super().__init__("\n".join(str(fault) for fault in self.diagnostics))


def add_diagnostic(diagnostics: list[Diagnostic], diagnostic: Diagnostic) -> None:
    """Add an error, unless it is there already, or follows from an earlier one.

    Raises InvalidFileError at MAX_DIAGNOSTICS errors.
    """
    if any(
        diagnostic.source.name == other.source.name
        and (diagnostic.mark.line in other.repaired_lines or diagnostic.is_same(other))
        for other in diagnostics
    ):
        return
    diagnostics.append(
        diagnostic
        if diagnostic.repaired_lines
        else replace(diagnostic, suggestion=_word_processor_hint(diagnostic) or diagnostic.suggestion)
    )
    if len(diagnostics) >= MAX_DIAGNOSTICS:
        raise InvalidFileError(diagnostics)


def _word_processor_hint(fault: Diagnostic) -> str:
    """Return a hint if the error marks a typographic quote or an unusual space, else an empty text."""
    begin = fault.mark.column - 1
    marked = fault.source.line(fault.mark.line)[begin : begin + fault.mark.length]
    if (quote := SMART_QUOTES.search(marked)) is not None:
        return f"{quote[0]} is not a quote here: write \" or '"
    if (blank := ODD_SPACES.search(marked)) is not None:
        return f"it contains an unusual space or an invisible character (U+{ord(blank[0]):04X}): type it again"
    return ""


def closest(word: str, known: Iterable[str]) -> str:
    """Return the known word that is closest to ``word``, or an empty text.

    A short word must be a prefix of the known word, or one edit away. Otherwise "dance" would be suggested for "race",
    since they share most letters. Opposites of ``word`` are never suggested.
    """
    spelt = {each.lower(): each for each in known}
    meant = word.lower()
    if len(meant) > SHORT_WORD_LENGTH:
        close = get_close_matches(meant, spelt, n=1, cutoff=0.6)
    else:
        like = [each for each in spelt if is_one_edit(meant, each) or each.startswith(meant)]
        close = get_close_matches(meant, like, n=1, cutoff=0.51)
    return spelt[close[0]] if close and not are_opposites(meant, close[0]) else ""


NEGATIONS = frozenset({"not", "no", "non", "never", "without", "isnt"})
NEGATING = ("un", "in", "im", "dis", "de", "non", "not", "no", "anti", "counter")

OPPOSITES = [
    frozenset(words.split())
    for words in (
        "left right",
        "up down",
        "upper lower",
        "raise lower",
        "high low",
        "open close",
        "opened closed",
        "on off",
        "start stop",
        "begin end",
        "first last",
        "min max",
        "front back",
        "forward backward back",
        "forwards backwards",
        "ahead behind",
        "before after",
        "in out",
        "near far",
        "success failure",
        "succeed fail",
        "hot cold",
        "full empty",
        "push pull",
        "sit stand",
        "fast slow",
        "light dark",
        "all any none",
    )
]


def are_opposites(word: str, other: str) -> bool:
    """Return True if two words differ by a negation, or in parts that are opposites: "undocked" and "docked"."""
    parts, others = ([part for part in re.split(r"[\W_]+", each) if part] for each in (word, other))
    here, there = (set(a) - set(b) for a, b in ((parts, others), (others, parts)))
    if (here | there) & NEGATIONS:
        return True
    pairs = [(a, b) for a in here for b in there]
    negated = any(one == prefix + two for a, b in pairs for one, two in ((a, b), (b, a)) for prefix in NEGATING)
    return negated or any({a, b} <= words for a, b in pairs for words in OPPOSITES)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return "did you mean 'x'?" for the closest known word, or an empty text."""
    close = closest(word, known)
    return f"did you mean '{close}'?" if close else ""


def is_one_edit(word: str, other: str) -> bool:
    """Return True if inserting, deleting, replacing or swapping one letter turns ``word`` into ``other``."""
    same = next((at for at, (a, b) in enumerate(zip(word, other, strict=False)) if a != b), min(len(word), len(other)))
    word, other = word[same:], other[same:]
    swapped = word[:2] == other[1::-1] and word[2:] == other[2:]
    return swapped or word[1:] == other[1:] or word[1:] == other or word == other[1:]


def suggest_from(word: str, known: Iterable[str]) -> str:
    """Return the closest known word as a question, or the list of all known words."""
    words = sorted(set(known))
    return did_you_mean(word, words) or (f"known are: {', '.join(words)}" if words else "")


def _width(text: str) -> int:
    """Return the width of ``text`` in terminal columns."""
    return sum(0 if combining(c) else 2 if east_asian_width(c) in "WF" else 1 for c in text)


# Words that people bring along from other programs, and ours for them: asked before any likeness of spelling.

KEY_SYNONYMS: Mapping[str, str] = {
    "robot": "name",
    "world": "name",
    "summary": "description descr desc about",
    "rate": "frequency freq hz tick_rate fps",
    "base": "wheels chassis drive mobile_base",
    "head": "neck pan_tilt pantilt",
    "arm": "arms servos dynamixel manipulator",
    "range": "lidar laser rplidar scanner sonar rangefinder range_finder",
    "camera": "cam webcam cameras",
    "microphone": "mic ears",
    "voice": "speech tts speaker",
    "screen": "display monitor",
    "ros2": "ros ros_2 zenoh rmw nodes",
    "notices": "notifications notify alerts",
    "driver": "type kind class plugin backend",
    "port": "device dev path file serial serial_port com tty usb address",
    "baud": "baudrate baud_rate bitrate bit_rate bps speed",
    "max_speed": "max_velocity max_vel max_linear_velocity max_linear_speed top_speed speed_limit speed velocity",
    "max_turn": "max_angular_velocity max_angular_speed max_rotation max_turn_rate max_turn_speed turn_speed turn_rate "
    "rotation_speed angular_speed angular_velocity",
    "acceleration": "accel acc max_acceleration max_accel",
    "turn_acceleration": "angular_acceleration max_angular_acceleration turn_accel",
    "speed": "velocity vel max_speed max_velocity",
    "limits: [low, high]": "min max lower upper low high min_angle max_angle lower_limit upper_limit range limit",
    "torque": "effort max_torque force max_effort",
    "reverse": "invert inverted reversed flip mirrored",
    "flip": "invert inverted reversed reverse mirrored mirror hflip vflip",
    "rotate": "rotation orientation rotated",
    "trim": "offset",
    "zero": "offset home center centre",
    "id": "servo_id dxl_id motor_id",
    "servo": "pin index channel output",
    "track": "track_width wheel_separation wheel_track",
    "field_of_view": "fov hfov view_angle",
    "width": "resolution size w",
    "height": "resolution size h",
    "source": "device index path url video file port camera",
    "position": "pose location xyz place translation",
    "people": "persons humans faces",
    "room": "map arena",
    "params": "parameters args arguments inputs vars variables",
    "expect": "expected expects assert asserts then",
    "given": "mocks mock setup when",
    "case": "name title test",
    "said": "sayed say says speech speaks spoken",
    "tests": "mission",
    "cases": "scenarios",
    "behaviours": "behaviors leaves plugins",
}
"""Our keys, each with the names that other programs use for it. A key that the section has already is not suggested."""


def to_snake_case(word: str) -> str:
    """Return a word in small letters, its parts joined by ``_``: "MaxSpeed" and "max-speed" are "max_speed"."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", word.strip())
    return re.sub(r"[\s-]+", "_", parted).lower()


def own_words_for(word: str, table: Mapping[str, str], known: Iterable[str]) -> list[str]:
    """Return our names for ``word``: the ``known`` names that have it as a synonym in ``table``, in its order."""
    known, word = set(known), to_snake_case(word)
    return [ours for ours, theirs in table.items() if key_of(ours) in known and word in theirs.split()]


def suggest_key(word: str, known: Collection[str], table: Mapping[str, str] = KEY_SYNONYMS) -> str:
    """Return a suggestion for an unknown key: our name for it, else the closest key, else all keys."""
    if to_snake_case(word) in known:
        return f"did you mean '{to_snake_case(word)}'?"
    ours = own_words_for(word, table, known)
    return f"write {alternatives_text(ours)}" if ours else suggest_from(word, known)


def alternatives_text(words: Iterable[str]) -> str:
    """Return the words, quoted, as alternatives: "'this' or 'that'"."""
    return " or ".join(f"'{word}'" for word in words)


def key_of(ours: str) -> str:
    """Return the key of a ``KEY: VALUE`` entry: "invert" of ``invert: true``."""
    return ours.partition(":")[0]
