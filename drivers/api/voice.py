"""What a behaviour sees of a voice."""

from collections.abc import Sequence
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import Annotated, Protocol

from drivers.api.device import Device
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import UNSAMPLED, command


class Priority(IntEnum):
    """What breaks off what: higher words break off lower ones, which are said again from their beginning afterwards."""

    LOW = 0
    NORMAL = 1
    HIGH = 2


@dataclass(frozen=True, slots=True)
class SpeechStyle:
    """How to speak: a synthesiser's voice, words per minute, a language; empty and 0 as the robot file says."""

    voice: str = ""
    speed: float = 0.0
    language: str = ""


class Mouth(StrEnum):
    """How the mouth is shaped for a sound."""

    CLOSED = "closed"
    NARROW = "narrow"
    OPEN = "open"
    WIDE = "wide"
    ROUND = "round"
    TEETH = "teeth"


@dataclass(frozen=True, slots=True)
class MouthShape:
    """A shape of the mouth, from ``at`` seconds after the beginning of the sound until the next."""

    at: float
    shape: Mouth


DEFAULT_STYLE = SpeechStyle()
"""As the robot file says."""


class Utterance(Protocol):
    """Something being said or played, or waiting to be."""

    def done(self) -> bool:
        """True once it was heard to the end, or cancelled."""
        ...

    @command("never")
    def cancel(self) -> None:
        """Fall silent now. Safe more than once."""
        ...

    @property
    def cancelled(self) -> bool:
        """True once it was cancelled before it was heard to the end: also by a voice that rests or has gone."""
        ...

    @property
    def started(self) -> float | None:
        """When its first sample was heard, on the driver's clock; None while it waits, also to be said again."""
        ...

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """How the mouth moves with it, from ``started`` on; empty while it waits, and where that is not known."""
        ...


class Voice(Device, Protocol):
    """What the robot speaks with. One thing is heard at a time: what has the highest priority, else the oldest."""

    @command("before")
    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Start to speak ``text`` in its turn; returns at once. Raises NotConnected before ``open``."""
        ...

    @command("before")
    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Start to play a file (WAV, MP3, FLAC or Ogg Vorbis) in its turn; returns at once.

        Raises BadRequest where there is no such file, or it is no sound, and NotConnected before ``open``.
        """
        ...

    def speaking(self) -> Annotated[Utterance | None, UNSAMPLED]:
        """Return what is heard now; None while it is silent."""
        ...
