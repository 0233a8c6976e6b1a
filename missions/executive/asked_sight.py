"""Sight, hearing, voice and screen as a mission asks and commands them; see ``asked``."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from drivers.api import AS_USUAL, Manner, Mood, MouthShape, Priority, Screen, Shown, Utterance, Voice
from missions.executive.answers import Answers, Memo
from missions.executive.asked_parts import Asked
from perception.api import Face, Hearing, Marker, Scene, Sight, Thing, Words


class AskedSight:
    """What the camera sees."""

    __slots__ = ("faces", "looked", "markers", "scene", "things")
    faces: Callable[[], Sequence[Face]]
    things: Callable[[], Sequence[Thing]]
    markers: Callable[[], Sequence[Marker]]
    looked: Callable[[], float | None]
    scene: Callable[[], Scene | None]

    def __init__(self, part: str, sight: Sight, answers: Answers) -> None:
        questions: dict[str, Callable[[], object]] = {
            "faces": sight.faces,
            "things": sight.things,
            "markers": sight.markers,
            "looked": sight.looked,
            "scene": sight.scene,
        }
        known = answers.memo(part, questions)
        self.faces = partial(known.__getitem__, "faces")
        self.things = partial(known.__getitem__, "things")
        self.markers = partial(known.__getitem__, "markers")
        self.looked = partial(known.__getitem__, "looked")
        self.scene = partial(known.__getitem__, "scene")


class AskedHearing:
    """What the microphone hears."""

    __slots__ = ("level", "listened", "refused", "words")
    words: Callable[[], Sequence[Words]]
    refused: Callable[[], Sequence[Words]]
    listened: Callable[[], float | None]
    level: Callable[[], float]

    def __init__(self, part: str, hearing: Hearing, answers: Answers) -> None:
        questions: dict[str, Callable[[], object]] = {
            "words": hearing.words,
            "refused": hearing.refused,
            "listened": hearing.listened,
            "level": hearing.level,
        }
        known = answers.memo(part, questions)
        self.words = partial(known.__getitem__, "words")
        self.refused = partial(known.__getitem__, "refused")
        self.listened = partial(known.__getitem__, "listened")
        self.level = partial(known.__getitem__, "level")


class AskedScreen(Asked[Screen]):
    """A screen."""

    __slots__ = ("shown",)
    shown: Callable[[], Shown]

    def __init__(self, part: str, device: Screen, answers: Answers) -> None:
        super().__init__(part, device, answers, questions={"shown": device.shown})
        self.shown = partial(self._known.__getitem__, "shown")

    def mood(self, mood: Mood) -> None:
        """See drivers.api.Screen."""
        self._do("mood", self._device.mood, mood)

    def show(self, text: str) -> None:
        """See drivers.api.Screen."""
        self._do("show", self._device.show, text)

    def mouth(self, opening: float) -> None:
        """See drivers.api.Screen."""
        self._do("mouth", self._device.mouth, opening)


class AskedVoice(Asked[Voice]):
    """A voice. What it says is numbered from 1: the answer to ``say`` is the number, by which ``done`` is asked."""

    __slots__ = ("_number", "_said")

    def __init__(self, part: str, device: Voice, answers: Answers) -> None:
        super().__init__(part, device, answers, questions={"speaking": self._speaking})
        self._number = 0
        self._said: dict[int, Utterance] = {}

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """See drivers.api.Voice."""
        return self._numbered(self._do("say", self._say, text, *unusual(manner, priority)))

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """See drivers.api.Voice."""
        _, otherwise = unusual(AS_USUAL, priority)
        return self._numbered(self._do("play", self._play, str(path), otherwise))

    def speaking(self) -> Utterance | None:
        """See drivers.api.Voice."""
        number: int | None = self._known["speaking"]
        return None if number is None else self._numbered(number)

    def _numbered(self, number: int) -> "AskedUtterance":
        return AskedUtterance(number, self._said[number], self._known)

    def _say(self, text: str, manner: Manner | None, priority: Priority | None) -> int:
        return self._keep(self._device.say(text, manner or AS_USUAL, _given(priority)))

    def _play(self, path: str, priority: Priority | None) -> int:
        return self._keep(self._device.play(Path(path), _given(priority)))

    def _speaking(self) -> int | None:
        now = self._device.speaking()
        return next((number for number, said in self._said.items() if said is now), None)

    def _keep(self, said: Utterance) -> int:
        self._said = {number: earlier for number, earlier in self._said.items() if not earlier.done()}
        self._number += 1
        self._said[self._number] = said
        return self._number


def unusual(manner: Manner, priority: Priority) -> tuple[Manner | None, Priority | None]:
    """Return how something is said, None for what is as usual: so a record has no more than what was asked for."""
    return None if manner == AS_USUAL else manner, None if priority is Priority.NORMAL else priority


def _given(priority: Priority | None) -> Priority:
    return Priority.NORMAL if priority is None else priority


class AskedUtterance:
    """Something being said, by its number."""

    __slots__ = ("_known", "_number", "_said")

    def __init__(self, number: int, said: Utterance, known: Memo) -> None:
        self._number = number
        self._said = said
        self._known = known

    def done(self) -> bool:
        """See drivers.api.Utterance."""
        return self._known.ask("done", lambda _: self._said.done(), self._number)

    def cancel(self) -> None:
        """See drivers.api.Utterance."""
        self._known.command("cancel", self._cancel, self._number)

    @property
    def cancelled(self) -> bool:
        """See drivers.api.Utterance."""
        return self._known.ask("cancelled", lambda _: self._said.cancelled, self._number)

    @property
    def started(self) -> float | None:
        """See drivers.api.Utterance."""
        return self._known.ask("started", lambda _: self._said.started, self._number)

    @property
    def mouth(self) -> Sequence[MouthShape]:
        """See drivers.api.Utterance."""
        return self._known.ask("mouth", lambda _: tuple(self._said.mouth), self._number)

    def _cancel(self, number: int) -> None:
        del number
        self._said.cancel()
