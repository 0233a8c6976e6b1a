"""A robot that answers out of a record: voice, sight and hearing here, its other parts in ``answering_parts``."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from behaviours.robot import Robot
from drivers.api import AS_USUAL, Manner, MouthShape, Priority, Utterance
from missions.executive.asked_sight import unusual
from missions.replay.answering_parts import (
    Answering,
    AnsweringBase,
    AnsweringHead,
    AnsweringJoints,
    AnsweringRanger,
    AnsweringScreen,
    nothing,
)
from missions.replay.memory import Memory
from perception.api import Face, Marker, Scene, Thing, Words

LETTER_TIME = 0.06
"""Seconds that a letter takes to say, where nobody knows how long it took."""

SOUND_TIME = 1.0
"""The same for a sound."""


def answering(
    parts: Collection[str],
    memory: Memory,
    now: Callable[[], float],
    *,
    eye: tuple[float, float, float],
    groups: Mapping[str, tuple[str, ...]],
) -> Robot:
    """Return a robot of these parts that answers out of ``memory``; ``now`` tells the time of the record."""
    return Robot(
        base_part=AnsweringBase("base", memory) if "base" in parts else None,
        head_part=AnsweringHead("head", memory) if "head" in parts else None,
        arm_part=AnsweringJoints("arm", memory) if "arm" in parts else None,
        ranger_part=AnsweringRanger("range", memory, "ranger") if "range" in parts else None,
        voice_part=AnsweringVoice("voice", memory, now) if "voice" in parts else None,
        sight_part=AnsweringSight(memory) if "camera" in parts else None,
        hearing_part=AnsweringHearing(memory) if "microphone" in parts else None,
        screen_part=AnsweringScreen("screen", memory) if "screen" in parts else None,
        eye=eye,
        groups=groups,
    )


class AnsweringVoice(Answering):
    """A voice that is as long about its words as it was then."""

    def __init__(self, name: str, memory: Memory, now: Callable[[], float]) -> None:
        super().__init__(name, memory)
        self._now = now

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Say nothing; what comes back is done when it was then, or after about the time that other words take."""
        return self._said(self._do("say", nothing, text, *unusual(manner, priority)), LETTER_TIME * len(text))

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Play nothing, as ``say`` does."""
        _, otherwise = unusual(AS_USUAL, priority)
        return self._said(self._do("play", nothing, str(path), otherwise), SOUND_TIME)

    def speaking(self) -> Utterance | None:
        """What was heard then."""
        number: int | None = self._ask("speaking")
        return None if number is None else _Recalled(self.name, self._memory, number)

    def _said(self, number: int | None, seconds: float) -> Utterance:
        if number is None:
            return _Guessed(self._now, seconds)
        return _Recalled(self.name, self._memory, number)


class _Recalled(Answering):
    """Words that were said then, by their number."""

    def __init__(self, name: str, memory: Memory, number: int) -> None:
        super().__init__(name, memory)
        self._number = number

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return bool(self._ask("done", self._number))

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self._do("cancel", nothing, self._number)

    @property
    def cancelled(self) -> bool:
        """See drivers.api.Utterance."""
        return bool(self._ask("cancelled", self._number))

    @property
    def started(self) -> float | None:
        """See drivers.api.Utterance."""
        found: float | None = self._ask("started", self._number)
        return found

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """See drivers.api.Utterance."""
        found: Sequence[MouthShape] = self._ask("mouth", self._number)
        return found


class _Guessed:
    """Words that nobody said: they begin at once, and are done after some ``seconds``."""

    mouth: Sequence[MouthShape] = ()
    cancelled = False

    def __init__(self, now: Callable[[], float], seconds: float) -> None:
        self.started: float | None = now()
        self._now = now
        self._until = now() + seconds

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return self._now() >= self._until

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self.cancelled = self.cancelled or not self.done()
        self._until = self._now()


class AnsweringSight:
    """What the camera saw then: see perception.api.Sight."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def faces(self) -> Sequence[Face]:
        """As they were then."""
        found: Sequence[Face] = self._memory.ask("sight", "faces")
        return found

    def things(self) -> Sequence[Thing]:
        """As they were then."""
        found: Sequence[Thing] = self._memory.ask("sight", "things")
        return found

    def markers(self) -> Sequence[Marker]:
        """As they were then."""
        found: Sequence[Marker] = self._memory.ask("sight", "markers")
        return found

    def looked(self) -> float | None:
        """As it was then."""
        found: float | None = self._memory.ask("sight", "looked")
        return found

    def scene(self) -> Scene | None:
        """As it was then."""
        found: Scene | None = self._memory.ask("sight", "scene")
        return found


class AnsweringHearing:
    """What the microphone heard then: see perception.api.Hearing."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def words(self) -> Sequence[Words]:
        """As they were then."""
        found: Sequence[Words] = self._memory.ask("hearing", "words")
        return found

    def refused(self) -> Sequence[Words]:
        """As they were then."""
        found: Sequence[Words] = self._memory.ask("hearing", "refused")
        return found

    def listened(self) -> float | None:
        """As it was then."""
        found: float | None = self._memory.ask("hearing", "listened")
        return found

    def level(self) -> float:
        """As it was then."""
        found: float = self._memory.ask("hearing", "level")
        return found
