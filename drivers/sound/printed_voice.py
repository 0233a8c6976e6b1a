"""The voice of a machine without one: it prints the words, and takes as long as they would."""

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import RLock

from drivers.api import DEFAULT_STYLE, Health, MouthShape, Priority, SpeechStyle, Utterance, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.sound.utterances import UtteranceQueue, fill_manner, speaking_time
from drivers.sound.wav import check_sound_file, sound_duration


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
        default_manner: SpeechStyle = DEFAULT_STYLE,
        changed: Callable[[], None] = ignore,
    ) -> None:
        self._clock = clock
        self._out = out
        self._default_manner = default_manner
        self._changed = changed
        self._lock = RLock()
        self._queue = UtteranceQueue[PrintedUtterance]()  # the first is being said
        self._utterance_count = 0
        self._open = False

    def open(self) -> None:
        """Be ready to print."""
        self._open = True

    def rest(self) -> None:
        """Fall silent: cancel all that is being said or waiting."""
        with self._lock:
            for words in reversed(tuple(self._queue)):  # so that nobody's turn comes
                words.cancel()

    def close(self) -> None:
        """Fall silent for good."""
        self.rest()
        self._open = False

    def health(self) -> Health:
        """Say that words are printed here, not spoken."""
        return Health(
            self._open, "" if self._open else f"{self.name}: not opened yet", counters={"said": self._utterance_count}
        )

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print ``text`` in its turn; it lasts as its speed says. Raises NotConnected before open."""
        return self._enqueue(text, speaking_time(text, fill_manner(manner, self._default_manner).speed), priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print the name of a file in its turn; it lasts as long as the sound. Raises BadRequest, NotConnected."""
        return self._enqueue(f"[{check_sound_file(self.name, path).name}]", sound_duration(path), priority)

    def speaking(self) -> Utterance | None:
        """Return what is being said now."""
        with self._lock:
            self.update()
            return self._queue.first

    def _enqueue(self, text: str, duration: float, priority: Priority) -> Utterance:
        if not self._open:
            raise NotConnected(f"{self.name}: not open, cannot say {text!r}")
        words = PrintedUtterance(self, text, duration, priority)
        if not duration:
            words.ended = True
            return words
        with self._lock:
            self.update()
            self._queue.insert(words)
            self._utterance_count += 1
            self._start_first(self._clock.now())
        return words

    def update(self) -> None:
        """Take out of the queue what has ended by now; what follows has had its turn from then on."""
        with self._lock:
            changed = False
            while (first := self._queue.first) is not None and self._clock.now() >= first.end:
                self._queue.remove(first)
                first.ended = changed = True
                self._start_first(first.end)
        if changed:
            self._changed()

    def remove(self, utterance: "PrintedUtterance") -> None:
        """Take ``words`` out of the queue before their time; those behind them move up."""
        with self._lock:
            self.update()
            utterance.cancelled = utterance.cancelled or not utterance.ended
            utterance.ended = True
            self._queue.remove(utterance)
            self._start_first(self._clock.now())

    def _start_first(self, now: float) -> None:
        """Print the first of the queue, if it has not begun; what it breaks off begins anew afterwards."""
        first = self._queue.first
        for words in self._queue:
            if words is not first:
                words.started = None
        if first is not None and first.started is None:
            first.started = now
            self._out(first.text)


class PrintedUtterance:
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
        self._voice.update()
        return self.ended

    def cancel(self) -> None:
        """End now."""
        self._voice.remove(self)
