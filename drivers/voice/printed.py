"""The voice of a machine without one: it prints the words, and takes as long as they would."""

from collections import deque
from collections.abc import Callable
from threading import RLock

from drivers.api import Health, Utterance, unheard
from drivers.clock import Clock
from drivers.errors import NotConnected

WORDS_PER_MINUTE = 150
"""How fast people talk, and synthesisers by default."""


class PrintedVoice:
    """A ``drivers.api.Voice`` that hands each text to ``out`` and is then busy for as long as speaking would take.

    It has no thread: whether something has ended shows when somebody asks, and ``changed`` is called then.
    """

    def __init__(
        self, clock: Clock, out: Callable[[str], None], *, changed: Callable[[], None] = unheard, name: str = "voice"
    ) -> None:
        self.name = name
        self._clock = clock
        self._out = out
        self._changed = changed
        self._lock = RLock()
        self._queue: deque[PrintedWords] = deque()
        self._begun = 0.0  # when the first of the queue had its turn
        self._said = 0
        self._open = False

    def open(self) -> None:
        """Be ready to print."""
        self._open = True

    def rest(self) -> None:
        """Fall silent: cancel all that is being said or waiting."""
        with self._lock:
            for words in tuple(self._queue):
                words.cancel()

    def close(self) -> None:
        """Fall silent for good."""
        self.rest()
        self._open = False

    def health(self) -> Health:
        """Say that words are printed here, not spoken."""
        return Health(self._open, "" if self._open else f"{self.name}: not opened yet", counters={"said": self._said})

    def say(self, text: str) -> Utterance:
        """Print ``text`` now; its time runs after that of whatever is being said. Raises NotConnected before open."""
        if not self._open:
            raise NotConnected(f"{self.name}: not open, cannot say {text!r}")
        words = PrintedWords(self, len(text.split()) * 60 / WORDS_PER_MINUTE)
        if not words.duration:
            words.ended = True
            return words
        self._out(text)
        with self._lock:
            self.settle()
            self._said += 1
            if not self._queue:
                self._begun = self._clock.now()
            self._queue.append(words)
        return words

    def settle(self) -> None:
        """Take out of the queue what has ended by now."""
        with self._lock:
            before = len(self._queue)
            while self._queue and self._clock.now() >= self._begun + self._queue[0].duration:
                self._begun += self._queue[0].duration
                self._queue.popleft().ended = True
            ended = len(self._queue) < before
        if ended:
            self._changed()

    def drop(self, words: "PrintedWords") -> None:
        """Take ``words`` out of the queue before their time; those behind them move up."""
        with self._lock:
            self.settle()
            if words in self._queue:
                if words is self._queue[0]:
                    self._begun = self._clock.now()
                self._queue.remove(words)
            words.ended = True


class PrintedWords:
    """A ``drivers.api.Utterance`` that was printed and lasts ``duration`` seconds from its turn on."""

    def __init__(self, voice: PrintedVoice, duration: float) -> None:
        self.duration = duration
        self.ended = False
        self._voice = voice

    def done(self) -> bool:
        """True once as much time has passed as the words take."""
        self._voice.settle()
        return self.ended

    def cancel(self) -> None:
        """End now."""
        self._voice.drop(self)
