"""Protocol of a voice."""

from collections.abc import Sequence
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import Annotated, Protocol

from drivers.api.device import Device
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import UNSAMPLED, command


class Priority(IntEnum):
    """Priority of an utterance: a higher one interrupts a lower one, which is repeated afterwards."""

    LOW = 0
    NORMAL = 1
    HIGH = 2


@dataclass(frozen=True, slots=True)
class SpeechStyle:
    """Style of speech: synthesiser voice, words per minute, language; empty and 0 are the robot file's defaults."""

    voice: str = ""
    speed: float = 0.0
    language: str = ""


class Mouth(StrEnum):
    """Shape of the mouth of the robot's face for a speech sound."""

    CLOSED = "closed"
    NARROW = "narrow"
    OPEN = "open"
    WIDE = "wide"
    ROUND = "round"
    TEETH = "teeth"


@dataclass(frozen=True, slots=True)
class MouthShape:
    """Shape of the mouth from ``at`` seconds after the start of the sound, until the next ``MouthShape``."""

    at: float
    shape: Mouth


DEFAULT_STYLE = SpeechStyle()
"""Speech style that leaves everything to the robot file."""


class Utterance(Protocol):
    """Speech or sound that is playing or queued."""

    def done(self) -> bool:
        """Return whether the utterance was played to its end, or cancelled."""
        ...

    @command("never")
    def cancel(self) -> None:
        """Stop the sound now. Safe more than once."""
        ...

    @property
    def cancelled(self) -> bool:
        """True if the utterance was cancelled before its end, also by a voice that rests or is offline."""
        ...

    @property
    def started(self) -> float | None:
        """Time of the first sample, on the driver's clock; None while queued.

        An interrupted utterance is queued again, so this is then None again.
        """
        ...

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """Movement of the mouth from ``started`` on; empty while queued, or if unknown."""
        ...


class Voice(Device, Protocol):
    """Voice of the robot. It plays one utterance at a time: the one with the highest priority, else the oldest."""

    @command("before")
    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Queue ``text`` for speech in the style ``manner``; returns at once. Raises NotConnected before ``open``."""
        ...

    @command("before")
    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Queue an audio file (WAV, MP3, FLAC or Ogg Vorbis); returns at once.

        Raises BadRequest if the file is missing or no audio file, and NotConnected before ``open``.
        """
        ...

    def speaking(self) -> Annotated[Utterance | None, UNSAMPLED]:
        """Return the utterance that is playing; None while silent."""
        ...
