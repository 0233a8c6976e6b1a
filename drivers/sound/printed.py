"""The voice of a machine without one: it prints the words, and takes as long as they would."""

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import RLock

from drivers.api import AS_USUAL, Health, Manner, MouthShape, Priority, Utterance, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.sound.spoken import Turns, filled, seconds_of
from drivers.sound.wav import checked, length_of


class PrintedVoice:
    """A ``drivers.api.Voice`` that hands each text to ``out`` in its turn, and is then busy as long as it would take.

    It has no thread: whether something has ended shows when somebody asks, and ``changed`` is called then. ``usual``
    has the speed; of a file, the name is printed.
    """

    name = "voice"

    def __init__(
        self,
        clock: Clock,
        out: Callable[[str], None],
        *,
        usual: Manner = AS_USUAL,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self._clock = clock
        self._out = out
        self._usual = usual
        self._changed = changed
        self._lock = RLock()
        self._turns = Turns[PrintedWords]()  # the first is being said
        self._said = 0
        self._open = False

    def open(self) -> None:
        """Be ready to print."""
        self._open = True

    def rest(self) -> None:
        """Fall silent: cancel all that is being said or waiting."""
        with self._lock:
            for words in reversed(tuple(self._turns)):  # so that nobody's turn comes
                words.cancel()

    def close(self) -> None:
        """Fall silent for good."""
        self.rest()
        self._open = False

    def health(self) -> Health:
        """Say that words are printed here, not spoken."""
        return Health(self._open, "" if self._open else f"{self.name}: not opened yet", counters={"said": self._said})

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print ``text`` in its turn; it lasts as its speed says. Raises NotConnected before open."""
        return self._queued(text, seconds_of(text, filled(manner, self._usual).speed), priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print the name of a file in its turn; it lasts as long as the sound. Raises BadRequest, NotConnected."""
        return self._queued(f"[{checked(self.name, path).name}]", length_of(path), priority)

    def speaking(self) -> Utterance | None:
        """Return what is being said now."""
        with self._lock:
            self.settle()
            return self._turns.first

    def _queued(self, text: str, duration: float, priority: Priority) -> Utterance:
        if not self._open:
            raise NotConnected(f"{self.name}: not open, cannot say {text!r}")
        words = PrintedWords(self, text, duration, priority)
        if not duration:
            words.ended = True
            return words
        with self._lock:
            self.settle()
            self._turns.insert(words)
            self._said += 1
            self._begin(self._clock.now())
        return words

    def settle(self) -> None:
        """Take out of the queue what has ended by now; what follows has had its turn from then on."""
        with self._lock:
            changed = False
            while (first := self._turns.first) is not None and self._clock.now() >= first.end:
                self._turns.drop(first)
                first.ended = changed = True
                self._begin(first.end)
        if changed:
            self._changed()

    def drop(self, words: "PrintedWords") -> None:
        """Take ``words`` out of the queue before their time; those behind them move up."""
        with self._lock:
            self.settle()
            words.cancelled = words.cancelled or not words.ended
            words.ended = True
            self._turns.drop(words)
            self._begin(self._clock.now())

    def _begin(self, now: float) -> None:
        """Print the first of the queue, if it has not begun; what it breaks off begins anew afterwards."""
        first = self._turns.first
        for words in self._turns:
            if words is not first:
                words.started = None
        if first is not None and first.started is None:
            first.started = now
            self._out(first.text)


class PrintedWords:
    """A ``drivers.api.Utterance`` that is printed and lasts ``duration`` seconds from its turn on."""

    mouth: Sequence[MouthShape] = ()

    def __init__(self, voice: PrintedVoice, text: str, duration: float, priority: Priority) -> None:
        self.text = text
        self.duration = duration
        self.priority = priority
        self.started: float | None = None
        self.ended = False
        self.cancelled = False
        self._voice = voice

    @property
    def end(self) -> float:
        """When it will have been said, if nothing breaks it off; its turn has come."""
        return (self.started or 0.0) + self.duration

    def done(self) -> bool:
        """True once as much time has passed as the words take."""
        self._voice.settle()
        return self.ended

    def cancel(self) -> None:
        """End now."""
        self._voice.drop(self)
