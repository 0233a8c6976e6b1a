"""Simulated microphone and speech recognition: words of simulated people arrive as text, without sound.

``drivers`` must not import perception, so the caller passes ``perception.hearing.grammar.PhraseGrammar`` and
``perception.api.Words``.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import Generic, Protocol, TypeVar

from drivers.api import Health, StatusCallback, ignore
from drivers.clock import Clock
from drivers.sim.person_actions import PersonReply
from drivers.sim.plug import SimulatedPlug
from drivers.transport.loop import guard_callback

SECONDS_PER_WORD = 0.4
"""Seconds that a simulated person needs to speak a word."""

MAX_WORD_AGE = 30.0
"""Seconds for which words are kept."""

ACCEPTED_SCORE, REFUSED_SCORE = 3.0, -3.0
"""Scores of accepted and of refused speech."""

SILENCE_LEVEL, SPEECH_LEVEL = -90.0, -25.0
"""dBFS in silence, and during speech."""

W = TypeVar("W")
W_co = TypeVar("W_co", covariant=True)


class WordsFactory(Protocol[W_co]):
    """Function that makes the value of one utterance, such as a ``perception.api.Words``."""

    def __call__(self, id: int, phrase: str, start: float, stamp: float, score: float, who: str) -> W_co:  # noqa: A002
        """Return the value of one utterance with its number, phrase, times in seconds, score and speaker.

        ``start`` is the time of its beginning, ``stamp`` that of its end.
        """
        ...


class PhraseFinder(Protocol):
    """Grammar of a mission: the phrases that it listens for."""

    @property
    def phrases(self) -> Sequence[str]:
        """All phrases that the mission listens for."""
        ...

    def find(self, text: str) -> str:
        """Return the phrase that occurs in ``text``; empty if there is none."""
        ...


def never_deaf(_start: float, _end: float) -> bool:
    """Default for ``is_deaf``: always return False, as for a robot that never speaks itself."""
    return False


@dataclass(slots=True)
class _OngoingReply:
    """Reply of a simulated person, waiting or being spoken.

    ``started_at`` is None until it is spoken; ``is_drowned`` is True if the robot spoke meanwhile.
    """

    reply: PersonReply
    started_at: float | None = None
    is_drowned: bool = False

    def end_time(self) -> float:
        return (self.reply.time if self.started_at is None else self.started_at) + SECONDS_PER_WORD * len(
            self.reply.text.split()
        )


class HearingTwin(Generic[W]):
    """Simulated speech recognition: a device and a ``perception.api.Hearing`` that hears simulated people.

    People speak a word in 0.4 s. ``grammar`` finds the phrases of the mission in their replies, ``make_words`` makes
    the results. ``is_deaf(start, end)`` returns True if the robot itself speaks in that time. People wait until it is
    False before they begin, and words during which it becomes True are lost. ``mishearing`` (0..1) is the share of
    phrases that are missed or mistaken for another phrase, at random. While ``hears_nothing`` is True, all speech is
    lost without an error. Call ``step`` every ``STEP_INTERVAL``; ``changed`` is called after new words.
    """

    name = "microphone"

    STEP_INTERVAL = 0.05

    def __init__(
        self,
        clock: Clock,
        grammar: PhraseFinder,
        make_words: WordsFactory[W],
        *,
        is_deaf: Callable[[float, float], bool] = never_deaf,
        mishearing: float = 0.0,
        seed: int = 0,
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self.hears_nothing = False
        self.plug = SimulatedPlug(self.name, report, on_offline=self._clear)
        self._clock = clock
        self._grammar = grammar
        self._make_words = make_words
        self._is_deaf = is_deaf
        self._mishearing = mishearing
        self._random = Random(seed)  # noqa: S311 - a simulation
        self._changed = guard_callback(changed)
        self._ongoing_replies: list[_OngoingReply] = []
        self._accepted: deque[tuple[float, W]] = deque()
        self._refused: deque[tuple[float, W]] = deque()
        self._counters = {"heard": 0, "understood": 0, "lost": 0}
        self._listened_until: float | None = None

    # --- the device ---------------------------------------------------------------------------------------------------

    def open(self) -> None:
        self.plug.open()

    def rest(self) -> None:
        """Do nothing: a microphone has no actuator."""

    def close(self) -> None:
        self.plug.close()
        self._clear()

    def health(self) -> Health:
        return self.plug.health(self._counters)

    # --- the hearing --------------------------------------------------------------------------------------------------

    def words(self) -> tuple[W, ...]:
        """Accepted phrases of the last 30 s, newest first."""
        return self._recent_words(self._accepted)

    def refused(self) -> tuple[W, ...]:
        """Speech of the last 30 s that is not a phrase, newest first."""
        return self._recent_words(self._refused)

    def listened(self) -> float | None:
        """Time up to which speech has been recognised; it does not advance while the microphone is unplugged."""
        return self._listened_until

    def level(self) -> float:
        """Current sound level in dBFS."""
        return SPEECH_LEVEL if any(speech.started_at is not None for speech in self._ongoing_replies) else SILENCE_LEVEL

    # --- the world ----------------------------------------------------------------------------------------------------

    def on_reply(self, reply: PersonReply) -> None:
        """Add a reply of a simulated person; it is heard at its time, or once the robot is silent."""
        if self.plug.online and not self.hears_nothing and reply.text.strip():
            self._ongoing_replies.append(_OngoingReply(reply))

    def step(self) -> None:
        """Process all speech up to now."""
        if not self.plug.online:
            return
        now = self._clock.now()
        deaf = self._is_deaf(max(0.0, now - self.STEP_INTERVAL), now)
        self._listened_until = now
        ended = []
        for speech in self._ongoing_replies:
            if speech.started_at is None and not deaf and now >= speech.reply.time:
                speech.started_at = now
            elif speech.started_at is not None:
                speech.is_drowned |= deaf or self.hears_nothing
                if now >= speech.end_time():
                    ended.append(speech)
        for speech in ended:
            self._ongoing_replies.remove(speech)
            self._finish_reply(speech, now)

    def _finish_reply(self, speech: _OngoingReply, now: float) -> None:
        self._counters["heard"] += 1
        said = self._grammar.find(speech.reply.text)
        phrase = self._mishear(said)
        if speech.is_drowned or (said and not phrase):
            self._counters["lost"] += 1
            return
        self._counters["understood"] += phrase != ""
        begun = now if speech.started_at is None else speech.started_at
        score = ACCEPTED_SCORE if phrase else REFUSED_SCORE
        words = self._make_words(self._counters["heard"], phrase, begun, now, score, speech.reply.speaker)
        (self._accepted if phrase else self._refused).appendleft((now, words))
        self._changed()

    def _mishear(self, phrase: str) -> str:
        """Return the phrase as recognised: usually itself; sometimes nothing, or another one."""
        if not phrase or self._random.random() >= self._mishearing:
            return phrase
        others = ["", *(other for other in self._grammar.phrases if other != phrase)]
        return self._random.choice(others)

    def _recent_words(self, kept: deque[tuple[float, W]]) -> tuple[W, ...]:
        while kept and kept[-1][0] < self._clock.now() - MAX_WORD_AGE:
            kept.pop()
        return tuple(words for _, words in kept)

    def _clear(self) -> None:
        self._ongoing_replies.clear()
