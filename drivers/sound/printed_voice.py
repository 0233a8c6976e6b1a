"""Voice of a machine without sound: prints the words, and takes their usual time."""

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import RLock

from drivers.api import DEFAULT_STYLE, Health, MouthShape, Priority, SpeechStyle, Utterance, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.sound.utterances import UtteranceQueue, fill_manner, speaking_time
from drivers.sound.wav import check_sound_file, sound_duration


class PrintedVoice:
    """Voice that prints its texts: a ``drivers.api.Voice`` for a machine without sound.

    Each text is passed to ``out`` when its turn comes. Then the voice is busy for the time that speech would take;
    ``default_manner`` has the speed. For a sound file, the name is printed. The voice has no thread: the end of an
    utterance is noticed at the next query, which calls ``changed``.
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
        self._open = True

    def rest(self) -> None:
        """Cancel the current utterance and all waiting ones."""
        with self._lock:
            for words in reversed(tuple(self._queue)):  # last first, so that none of them starts
                words.cancel()

    def close(self) -> None:
        self.rest()
        self._open = False

    def health(self) -> Health:
        return Health(
            self._open, "" if self._open else f"{self.name}: not opened yet", counters={"said": self._utterance_count}
        )

    def say(self, text: str, manner: SpeechStyle = DEFAULT_STYLE, priority: Priority = Priority.NORMAL) -> Utterance:
        """Print ``text`` in its turn; it lasts as long as speech at its speed. Raises NotConnected before ``open``."""
        return self._enqueue(text, speaking_time(text, fill_manner(manner, self._default_manner).speed), priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Queue a sound file; its name is printed in its turn, and lasts as long as the sound.

        Raises BadRequest, NotConnected.
        """
        return self._enqueue(f"[{check_sound_file(self.name, path).name}]", sound_duration(path), priority)

    def speaking(self) -> Utterance | None:
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
        """Remove the utterances that have ended by now, and start the next one at the end of the one before."""
        with self._lock:
            changed = False
            while (first := self._queue.first) is not None and self._clock.now() >= first.end:
                self._queue.remove(first)
                first.ended = changed = True
                self._start_first(first.end)
        if changed:
            self._changed()

    def remove(self, utterance: "PrintedUtterance") -> None:
        """Remove an utterance from the queue early; the next one starts now."""
        with self._lock:
            self.update()
            utterance.cancelled = utterance.cancelled or not utterance.ended
            utterance.ended = True
            self._queue.remove(utterance)
            self._start_first(self._clock.now())

    def _start_first(self, now: float) -> None:
        """Print the first utterance of the queue, unless it has started.

        Utterances after it in the queue count as not started, so an interrupted one is printed again.
        """
        first = self._queue.first
        for words in self._queue:
            if words is not first:
                words.started = None
        if first is not None and first.started is None:
            first.started = now
            self._out(first.text)


class PrintedUtterance:
    """Utterance of a ``PrintedVoice``, a ``drivers.api.Utterance``.

    ``duration`` is in seconds from its start; ``started`` is None before.
    """

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
        """Time at which the utterance ends if nothing interrupts it; valid only after it has started."""
        return (self.started or 0.0) + self.duration

    def done(self) -> bool:
        self._voice.update()
        return self.ended

    def cancel(self) -> None:
        self._voice.remove(self)
