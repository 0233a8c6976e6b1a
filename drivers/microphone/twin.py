"""The twin of a microphone and of the ears behind it: simulated people's words as text, without any sound.

``drivers`` do not know perception, so what understands a text and what words are made of are handed in:
``perception.hearing.grammar.Grammar`` and ``perception.api.Words``.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import Generic, Protocol, TypeVar

from drivers.api import Health, Report, ignore
from drivers.clock import Clock
from drivers.sim.acts import Reply
from drivers.sim.plug import Plug
from drivers.transport.loop import guarded

PER_WORD = 0.4
"""Seconds that people take for a word."""

KEPT = 30.0
"""Seconds for which words are kept."""

SURE, UNSURE = 3.0, -3.0
"""Scores of what was understood and of what was not."""

SILENCE, TALK = -90.0, -25.0
"""dBFS when nobody speaks, and when somebody does."""

W = TypeVar("W")
W_co = TypeVar("W_co", covariant=True)


class MakeWords(Protocol[W_co]):
    """Makes words of the number, the phrase, the beginning and end in seconds, the score, and who spoke."""

    def __call__(self, id: int, phrase: str, start: float, stamp: float, score: float, who: str) -> W_co:  # noqa: A002
        """Return them."""
        ...


class Phrases(Protocol):
    """What is listened for."""

    @property
    def phrases(self) -> Sequence[str]:
        """All phrases."""
        ...

    def find(self, text: str) -> str:
        """Return the phrase that a text holds, else ""."""
        ...


def never(_start: float, _end: float) -> bool:
    """Say that the robot is silent."""
    return False


@dataclass(slots=True)
class _Speech:
    """What somebody says, once they have begun."""

    reply: Reply
    begun: float | None = None
    drowned: bool = False

    def ends(self) -> float:
        return (self.reply.when if self.begun is None else self.begun) + PER_WORD * len(self.reply.text.split())


class HearingTwin(Generic[W]):
    """Hears what people answer, a word every 0.4 s; a device, and a ``perception.api.Hearing``.

    People let the robot finish: they begin once ``deaf(start, end)`` is over. What the robot talks into is lost. A
    share ``mishearing`` of the rest is missed or taken for another phrase, by chance. While ``dulled`` it hears
    nothing, and does not know. ``step`` it every ``PERIOD``; ``changed`` is called when words have come.
    """

    name = "microphone"

    PERIOD = 0.05

    def __init__(
        self,
        clock: Clock,
        grammar: Phrases,
        make: MakeWords[W],
        *,
        deaf: Callable[[float, float], bool] = never,
        mishearing: float = 0.0,
        seed: int = 0,
        report: Report = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self.dulled = False
        self.plug = Plug(self.name, report, gone=self._forget)
        self._clock = clock
        self._grammar = grammar
        self._make = make
        self._deaf = deaf
        self._mishearing = mishearing
        self._random = Random(seed)  # noqa: S311 - a simulation
        self._changed = guarded(changed)
        self._speeches: list[_Speech] = []
        self._accepted: deque[tuple[float, W]] = deque()
        self._refused: deque[tuple[float, W]] = deque()
        self._counters = {"heard": 0, "understood": 0, "lost": 0}
        self._listened: float | None = None

    # --- the device ---------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Be there at once, unless it is unplugged."""
        self.plug.open()

    def rest(self) -> None:
        """Do nothing: a microphone moves nothing."""

    def close(self) -> None:
        """Hear nothing more. Safe more than once."""
        self.plug.close()
        self._forget()

    def health(self) -> Health:
        """Say whether it is there."""
        return self.plug.health(self._counters)

    # --- the hearing --------------------------------------------------------------------------------------------------

    def words(self) -> tuple[W, ...]:
        """The phrases of the last 30 s, newest first."""
        return self._recent(self._accepted)

    def refused(self) -> tuple[W, ...]:
        """What was said in the last 30 s and is no phrase, newest first."""
        return self._recent(self._refused)

    def listened(self) -> float | None:
        """The time up to which it has listened: old while it is unplugged."""
        return self._listened

    def level(self) -> float:
        """How loud it is now, in dBFS."""
        return TALK if any(speech.begun is not None for speech in self._speeches) else SILENCE

    # --- the world ----------------------------------------------------------------------------------------------------

    def hear(self, reply: Reply) -> None:
        """Take note of what somebody says, from the time on that is in it."""
        if self.plug.online and not self.dulled and reply.text.strip():
            self._speeches.append(_Speech(reply))

    def step(self) -> None:
        """Listen up to now."""
        if not self.plug.online:
            return
        now = self._clock.now()
        deaf = self._deaf(max(0.0, now - self.PERIOD), now)
        self._listened = now
        ended = []
        for speech in self._speeches:
            if speech.begun is None and not deaf and now >= speech.reply.when:
                speech.begun = now
            elif speech.begun is not None:
                speech.drowned |= deaf or self.dulled
                if now >= speech.ends():
                    ended.append(speech)
        for speech in ended:
            self._speeches.remove(speech)
            self._understand(speech, now)

    def _understand(self, speech: _Speech, now: float) -> None:
        self._counters["heard"] += 1
        said = self._grammar.find(speech.reply.text)
        phrase = self._misheard(said)
        if speech.drowned or (said and not phrase):
            self._counters["lost"] += 1
            return
        self._counters["understood"] += phrase != ""
        begun = now if speech.begun is None else speech.begun
        score = SURE if phrase else UNSURE
        words = self._make(self._counters["heard"], phrase, begun, now, score, speech.reply.who)
        (self._accepted if phrase else self._refused).appendleft((now, words))
        self._changed()

    def _misheard(self, phrase: str) -> str:
        """Return what a phrase is taken for: mostly itself; now and then nothing, or another one."""
        if not phrase or self._random.random() >= self._mishearing:
            return phrase
        others = ["", *(other for other in self._grammar.phrases if other != phrase)]
        return self._random.choice(others)

    def _recent(self, kept: deque[tuple[float, W]]) -> tuple[W, ...]:
        while kept and kept[-1][0] < self._clock.now() - KEPT:
            kept.pop()
        return tuple(words for _, words in kept)

    def _forget(self) -> None:
        self._speeches.clear()
