"""What the robot and its programs for speech tell each other, over a ``drivers.transport.pipe``.

To the synthesiser: ``{"id", "text", "voice", "instead", "speed"}``; back ``{"id", "rate", "phonemes", "trouble"}`` and
the samples. To the player: ``{"play": ID, "rate", "last"}`` and samples, a piece after another, each acknowledged by
``{"taken": ID}`` before the next is sent; ``{"file": ID, "path"}``, which may be ``{"refused": ID, "why"}``; and
``{"stop": ID}``. It says ``{"started": ID, "seconds"}`` and ``{"ended": ID, "seconds"}``, in which seconds are what
there is of it so far, and what was heard. Both say ``{"ready": WHAT}`` first, or ``{"absent": WHY}``; the player's
``{"mute": WHY}`` means that it keeps time, but nobody hears it.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from drivers.api.quick import dataclass

Message = dict[str, Any]

PIECE = 32_768
"""Bytes of sound in a message: less than a pipe holds, so that a player that has stopped keeps nobody waiting."""


@dataclass(frozen=True, slots=True, eq=False)
class Speech:
    """Sound: 16-bit ``samples``, one channel; when which phoneme begins (s); what was wrong with the request, or ""."""

    samples: bytes
    rate: int
    phonemes: tuple[tuple[float, str], ...] = ()
    trouble: str = ""

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return len(self.samples) / 2 / self.rate


def request(number: int, text: str, voice: str, instead: str, speed: float) -> Message:
    """Ask for a text in a ``voice``, or ``instead`` in that one where there is no such voice; in words a minute."""
    text, voice = (each.encode("utf-8", "replace").decode() for each in (text, voice))
    return {"id": number, "text": text, "voice": voice, "instead": instead, "speed": round(speed)}


def speech(message: Mapping[str, Any], body: bytes) -> Speech:
    """Return what the synthesiser has answered. Raises LookupError, TypeError or ValueError for what is no answer."""
    phonemes = tuple((int(at) / 1000.0, str(phoneme)) for at, phoneme in message["phonemes"])
    rate = int(message["rate"])
    if rate <= 0:
        raise ValueError(f"not a rate: {rate}")
    return Speech(body[: len(body) & ~1], rate, phonemes, str(message["trouble"]))


def pieces(number: int, sound: Speech) -> Iterator[tuple[Message, bytes]]:
    """Yield the messages that play a sound, each with its samples."""
    size = len(sound.samples)
    for begin in range(0, max(size, 1), PIECE):
        last = begin + PIECE >= size
        yield {"play": number, "rate": sound.rate, "last": last}, sound.samples[begin : begin + PIECE]
