"""The proxy of a voice, written by hand: what is said goes by its number, from 1.

The answer to ``say`` is the number, by which ``done`` and its like are asked: a record cannot keep an utterance itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from drivers.api import AS_USUAL, Health, Manner, MouthShape, Priority, Utterance, Voice
from missions.executive.answers import Answers, Memo
from missions.executive.proxy import Proxy


class _Numbered:
    """The utterances of a ``voice`` by their numbers, as far as they go on; and the newest."""

    def __init__(self, voice: Voice) -> None:
        self.voice = voice
        self.said: dict[int, Utterance] = {}
        self._number = 0

    def say(self, text: str, manner: Manner | None, priority: Priority | None) -> int:
        return self._keep(self.voice.say(text, manner or AS_USUAL, _given(priority)))

    def play(self, path: str, priority: Priority | None) -> int:
        return self._keep(self.voice.play(Path(path), _given(priority)))

    def speaking(self) -> int | None:
        now = self.voice.speaking()
        return next((number for number, said in self.said.items() if said is now), None)

    def _keep(self, said: Utterance) -> int:
        self.said = {number: earlier for number, earlier in self.said.items() if not earlier.done()}
        self._number += 1
        self.said[self._number] = said
        return self._number


class VoiceProxy(Proxy):
    """A voice whose words are told, with how they are said where that is not as usual."""

    __slots__ = ("close", "health", "name", "open")
    open: Callable[[], None]
    close: Callable[[], None]
    health: Callable[[], Health]

    def __init__(self, device: _Numbered, memo: Memo) -> None:
        super().__init__(device, memo)
        voice = device.voice
        self.name, self.open, self.close = voice.name, voice.open, voice.close
        self.health = partial(memo.__getitem__, "health")

    def rest(self) -> None:
        """See drivers.api.Device."""
        if self._tell is not None:
            self._tell(self.name, self._source, {"rest": True})
        self._memo.command("rest", self._device.voice.rest)

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """See drivers.api.Voice."""
        if self._tell is not None:
            told = {name: value for name, value in asdict(manner).items() if value}
            self._tell(self.name, self._source, {"say": text, **told, **_raised(priority)})
        return self._numbered(self._memo.command("say", self._device.say, text, *unusual(manner, priority)))

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """See drivers.api.Voice."""
        if self._tell is not None:
            self._tell(self.name, self._source, {"play": str(path), **_raised(priority)})
        _, otherwise = unusual(AS_USUAL, priority)
        return self._numbered(self._memo.command("play", self._device.play, str(path), otherwise))

    def speaking(self) -> Utterance | None:
        """See drivers.api.Voice."""
        number: int | None = self._memo["speaking"]
        return None if number is None else self._numbered(number)

    def _numbered(self, number: int) -> "_Utterance":
        return _Utterance(number, self._device.said[number], self._memo)


def voice_proxy(voice: Voice, answers: Answers) -> Voice:
    """Return ``voice`` behind its proxy, see ``missions.executive.proxy.proxied``: a voice needs no permit."""
    numbered = _Numbered(voice)
    memo = answers.memo("voice", {"health": voice.health, "speaking": numbered.speaking})
    return VoiceProxy(numbered, memo)


class _Utterance:
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
        self._known.command("cancel", lambda _: self._said.cancel(), self._number)

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


def unusual(manner: Manner, priority: Priority) -> tuple[Manner | None, Priority | None]:
    """Return how something is said, None for what is as usual: so a record has no more than what was asked for."""
    return None if manner == AS_USUAL else manner, None if priority is Priority.NORMAL else priority


def _given(priority: Priority | None) -> Priority:
    return Priority.NORMAL if priority is None else priority


def _raised(priority: Priority) -> dict[str, str]:
    return {} if priority is Priority.NORMAL else {"priority": priority.name.lower()}
