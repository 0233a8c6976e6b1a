"""Utterances of a voice: queue, speaking time, and the movement of the robot's mouth."""

from bisect import insort
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from threading import Event
from typing import Generic, Protocol, TypeVar

from drivers.api import Mouth, MouthShape, Priority, SpeechStyle

# Voices, languages and speeds: what a mission leaves open, the robot file says.

WORDS_PER_MINUTE = 150.0
"""Default speed of synthesisers, and of people."""


def fill_manner(manner: SpeechStyle, default: SpeechStyle) -> SpeechStyle:
    """Return ``manner`` with its missing values taken from ``default``.

    A voice such as "en-us+f2" has a language and a variant. If only ``manner.language`` is set, the variant of the
    default voice is kept. If ``manner.voice`` is only a variant, the language of the default voice is kept.
    """
    base, plus, variant = default.voice.partition("+")
    voice = manner.voice or default.voice
    if manner.language and not manner.voice:
        voice = plus + variant
    elif manner.voice.startswith("+") and not manner.language:
        voice = base + manner.voice
    return SpeechStyle(
        voice=voice,
        speed=manner.speed or default.speed or WORDS_PER_MINUTE,
        language=manner.language or default.language,
    )


def espeak_name(manner: SpeechStyle) -> str:
    """Return the name of a voice for espeak, such as "en-us+f2"; empty if espeak shall choose.

    A variant without a language gets "en".
    """
    base, plus, variant = manner.voice.partition("+")
    base = base or manner.language
    return f"{base or 'en'}+{variant}" if plus else base


def speaking_time(text: str, speed: float) -> float:
    """Return the seconds that a text takes at ``speed`` words per minute."""
    return len(text.split()) * 60.0 / speed


def speaking_timeout(text: str, manner: SpeechStyle) -> float:
    """Return the seconds after which a program that speaks or synthesises a text counts as hanging.

    0.4 s per letter is five times the time for English, and enough for digits and for Chinese.
    """
    return 10.0 + 0.4 * len(text) * WORDS_PER_MINUTE / (manner.speed or WORDS_PER_MINUTE)


class PrioritisedItem(Protocol):
    """Item of a queue that has a priority."""

    @property
    def priority(self) -> Priority:
        """Priority of the item."""
        ...


W = TypeVar("W", bound=PrioritisedItem)


class UtteranceQueue(Generic[W]):
    """Queue of current and waiting utterances: highest priority first, then oldest.

    The caller must hold the lock of the voice.
    """

    def __init__(self) -> None:
        self._queue: list[W] = []

    def __iter__(self) -> Iterator[W]:
        """Iterate over a copy of the queue, in order."""
        return iter(tuple(self._queue))

    @property
    def first(self) -> W | None:
        """Utterance to play now; None if the queue is empty."""
        return self._queue[0] if self._queue else None

    def insert(self, item: W) -> None:
        """Insert an item by its priority, possibly first."""
        insort(self._queue, item, key=lambda each: -each.priority)

    def remove(self, item: W) -> None:
        """Remove an item, if it is in the queue."""
        if item in self._queue:
            self._queue.remove(item)


STRESS_MARKS = "',=%|!"
"""Stress marks that espeak puts before a phoneme."""

PHONEME_LETTERS = {
    Mouth.CLOSED: "pbm_",
    Mouth.TEETH: "fv",
    Mouth.ROUND: "uUoOwWyYSZ",
    Mouth.WIDE: "iIeEj",
    Mouth.OPEN: "aAV0",
}
"""First letters of espeak's phonemes by the mouth shape that they need.

All other phonemes have a narrow mouth. S and Z are the sounds in *shoe* and *measure*, 0 and V the vowels of *lot* and
*cup*, _ is a pause. See docs/phonemes.md of espeak-ng.
"""

_BY_LETTER = {letter: shape for shape, letters in PHONEME_LETTERS.items() for letter in letters}


def mouth_shape(phoneme: str) -> Mouth:
    """Return the mouth shape of a phoneme such as ``'oU``.

    A diphthong has the shape of its start, tS and dZ have that of S and Z.
    """
    bare = phoneme.lstrip(STRESS_MARKS)
    if bare in ("tS", "dZ"):
        return Mouth.ROUND
    return _BY_LETTER.get(bare[:1], Mouth.NARROW) if bare else Mouth.CLOSED


def mouth_movement(phonemes: Iterable[tuple[float, str]], end: float) -> tuple[MouthShape, ...]:
    """Return the mouth shapes of ``phonemes``, each with its start in seconds; the mouth closes at ``end``."""
    shapes: list[MouthShape] = []
    for at, shape in (*((at, mouth_shape(phoneme)) for at, phoneme in phonemes), (end, Mouth.CLOSED)):
        if not shapes or shapes[-1].shape is not shape:
            shapes.append(MouthShape(at, shape))
    return tuple(shapes)


class SpokenUtterance:
    """Utterance of a ``SpeechVoice``, a ``drivers.api.Utterance``: a text, or the sound file at ``path``.

    The event ``ended`` is set when it ends or is cancelled. ``remove`` removes it from its voice.
    """

    def __init__(
        self,
        remove: "Callable[[SpokenUtterance], None]",
        text: str,
        manner: SpeechStyle,
        priority: Priority,
        path: Path | None,
    ) -> None:
        self.text = text
        self.manner = manner
        self.priority = priority
        self.path = path
        self.ended = Event()
        self.cancelled = False
        self.seconds = 0.0
        self.shapes: Sequence[MouthShape] = ()
        self._remove = remove
        self._started: float | None = None

    def done(self) -> bool:
        return self.ended.is_set()

    def cancel(self) -> None:
        self._remove(self)

    @property
    def started(self) -> float | None:
        """Time at which the first sample is played, None before.

        If an external program plays the sound, it is the start of that program.
        """
        return self._started

    @property
    def mouth(self) -> Sequence[MouthShape]:
        return () if self._started is None else self.shapes

    @property
    def end(self) -> float:
        """Time at which the utterance ends; meaningful only once it has started."""
        return (self._started or 0.0) + self.seconds

    def on_start(self, at: float, seconds: float) -> None:
        """Store that playback has started at the time ``at``, and that its duration is ``seconds``."""
        self._started, self.seconds = at, seconds

    def reset_start(self) -> None:
        """Store that the utterance has not started, after it was interrupted; it will be played again."""
        if not self.done():
            self._started = None
