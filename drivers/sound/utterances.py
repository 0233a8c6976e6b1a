"""What a voice says or plays: whose turn it is, how far it has come, and how the mouth looks meanwhile."""

from bisect import insort
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from threading import Event
from typing import Generic, Protocol, TypeVar

from drivers.api import Mouth, MouthShape, Priority, SpeechStyle

# Voices, languages and speeds: what a mission leaves open, the robot file says.

WORDS_PER_MINUTE = 150.0
"""How fast people talk, and synthesisers by default."""


def fill_manner(manner: SpeechStyle, default: SpeechStyle) -> SpeechStyle:
    """Return ``manner`` with what it leaves open taken from ``usual``.

    Of a usual voice such as "en-us+f2", only the variant "+f2" goes with another language, and "en-us" with another
    variant.
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
    """Return the voice as espeak calls it: "en-us+f2", or "" for its own choice; a variant goes with the language."""
    base, plus, variant = manner.voice.partition("+")
    base = base or manner.language
    return f"{base or 'en'}+{variant}" if plus else base


def speaking_time(text: str, speed: float) -> float:
    """Return how long a text takes to say, at so many words a minute."""
    return len(text.split()) * 60.0 / speed


def speaking_timeout(text: str, manner: SpeechStyle) -> float:
    """Return after how many seconds a program that speaks a text, or makes sound of it, is taken to hang.

    0.4 s for each letter are five times what English takes, and enough for digits and for Chinese.
    """
    return 10.0 + 0.4 * len(text) * WORDS_PER_MINUTE / (manner.speed or WORDS_PER_MINUTE)


class PrioritisedItem(Protocol):
    """What has a priority."""

    @property
    def priority(self) -> Priority:
        """What it goes before."""
        ...


W = TypeVar("W", bound=PrioritisedItem)


class UtteranceQueue(Generic[W]):
    """What is heard and what waits: of the highest priority first, then the oldest. Who uses it has the lock."""

    def __init__(self) -> None:
        self._queue: list[W] = []

    def __iter__(self) -> Iterator[W]:
        """Yield what there is now, in order."""
        return iter(tuple(self._queue))

    @property
    def first(self) -> W | None:
        """Whose turn it is."""
        return self._queue[0] if self._queue else None

    def insert(self, item: W) -> None:
        """Put ``words`` where they belong, which may be first."""
        insort(self._queue, item, key=lambda each: -each.priority)

    def remove(self, item: W) -> None:
        """Take ``words`` out, if they are there."""
        if item in self._queue:
            self._queue.remove(item)


STRESS_MARKS = "',=%|!"
"""Marks that espeak puts before a phoneme: how it is stressed."""

PHONEME_LETTERS = {
    Mouth.CLOSED: "pbm_",
    Mouth.TEETH: "fv",
    Mouth.ROUND: "uUoOwWyYSZ",
    Mouth.WIDE: "iIeEj",
    Mouth.OPEN: "aAV0",
}
"""First letters of phonemes (docs/phonemes.md of espeak-ng); all others are sounds of the tongue, with a narrow mouth.

S and Z are those of *shoe* and *measure*, 0 and V the vowels of *lot* and *cup*, _ is a pause.
"""

_BY_LETTER = {letter: shape for shape, letters in PHONEME_LETTERS.items() for letter in letters}


def mouth_shape(phoneme: str) -> Mouth:
    """Return the shape for one phoneme, such as ``'oU``; a diphthong by its beginning, tS and dZ as S and Z."""
    bare = phoneme.lstrip(STRESS_MARKS)
    if bare in ("tS", "dZ"):
        return Mouth.ROUND
    return _BY_LETTER.get(bare[:1], Mouth.NARROW) if bare else Mouth.CLOSED


def mouth_movement(phonemes: Iterable[tuple[float, str]], end: float) -> tuple[MouthShape, ...]:
    """Return how the mouth moves with ``phonemes``, each with the second when it begins; closed from ``end`` on."""
    shapes: list[MouthShape] = []
    for at, shape in (*((at, mouth_shape(phoneme)) for at, phoneme in phonemes), (end, Mouth.CLOSED)):
        if not shapes or shapes[-1].shape is not shape:
            shapes.append(MouthShape(at, shape))
    return tuple(shapes)


class SpokenUtterance:
    """A ``drivers.api.Utterance``: a text, or the file at ``path``. ``ended`` is set once it was heard or cancelled.

    ``remove`` takes it out of its voice.
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
        """True once it was heard to the end, or cancelled."""
        return self.ended.is_set()

    def cancel(self) -> None:
        """Fall silent now."""
        self._remove(self)

    @property
    def started(self) -> float | None:
        """When its first sample was heard; of a program that plays by itself, when that was started."""
        return self._started

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """How the mouth moves with it."""
        return () if self._started is None else self.shapes

    @property
    def end(self) -> float:
        """When it will have been heard."""
        return (self._started or 0.0) + self.seconds

    def on_start(self, at: float, seconds: float) -> None:
        """Note that it is heard from ``at`` on."""
        self._started, self.seconds = at, seconds

    def reset_start(self) -> None:
        """Forget a beginning that came to no end: it waits again."""
        if not self.done():
            self._started = None
