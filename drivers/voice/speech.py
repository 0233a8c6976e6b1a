"""The voice of a machine that has one: words and sounds in their turn, on a thread of its own."""

from bisect import insort
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Condition, Event, Thread

from drivers.api import (
    AS_USUAL,
    Health,
    Manner,
    MouthShape,
    Notice,
    Priority,
    Report,
    Utterance,
    unheard,
    unreported,
)
from drivers.clock import Clock
from drivers.errors import DriverError, NotConnected
from drivers.guard import guarded
from drivers.voice.cut import Cut
from drivers.voice.engines import Engine
from drivers.voice.manner import filled, seconds_of
from drivers.voice.player import HINT, Player
from drivers.voice.sounds import checked, length_of
from drivers.voice.visemes import movement


class SpeechVoice:
    """A ``drivers.api.Voice`` that speaks with ``engine`` and plays with ``player``; ``usual`` is the robot's manner.

    The first of its queue is heard: of the highest priority, then the oldest. Whatever takes that place breaks off
    what has it, which is said again afterwards. What cannot be heard goes to ``out``, and takes as long; why, is
    reported. ``changed`` is called from the thread whenever something has ended.
    """

    def __init__(
        self,
        clock: Clock,
        engine: Engine,
        player: Player,
        out: Callable[[str], None],
        *,
        usual: Manner = AS_USUAL,
        report: Report = unreported,
        changed: Callable[[], None] = unheard,
        name: str = "voice",
    ) -> None:
        self.name = name
        self._clock = clock
        self._engine = engine
        self._player = player
        self._usual = usual
        self._out = guarded(out)
        self._report = guarded(report)
        self._changed = guarded(changed)
        self._turn = Condition()  # over everything below
        self._queue: list[SpokenWords] = []
        self._current: SpokenWords | None = None
        self._cut = Cut()  # of the current one
        self._thread: Thread | None = None
        self._ending = False
        self._trouble = ("", "")
        self._counters = {"said": 0, "failed": 0}

    def open(self) -> None:
        """Start the thread that speaks, and the programs; returns at once."""
        with self._turn:
            if self._thread is None:
                self._ending = False
                self._engine.open()
                if not self._engine.speaks_itself:
                    self._player.open()
                self._thread = Thread(target=self._run, name=f"voice {self.name}", daemon=True)
                self._thread.start()

    def rest(self) -> None:
        """Fall silent: cancel all that is being said or waiting."""
        with self._turn:
            for words in tuple(self._queue):
                words.cancel()

    def close(self) -> None:
        """Fall silent at once, end the thread and the programs."""
        with self._turn:
            self._ending = True
            self.rest()
            self._turn.notify_all()
            thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
        self._engine.close()
        self._player.close()

    def health(self) -> Health:
        """Say whether it can speak; after a failure, how the last utterance failed."""
        with self._turn:
            counters = dict(self._counters)
            if self._thread is None:
                return Health(False, f"{self.name}: not opened yet", counters=counters)
            broken = self._engine.broken or self._player.broken
            if broken:
                return Health(False, broken, "until then it prints what it would say", counters)
            mute = self._player.mute
            trouble = (mute, HINT) if mute else self._trouble
            return Health(True, *trouble, counters=counters)

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """Speak ``text`` in its turn. Raises NotConnected before ``open`` and after ``close``."""
        return self._queued(SpokenWords(self, text, filled(manner, self._usual), priority, None))

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """Play a file in its turn. Raises BadRequest and NotConnected."""
        return self._queued(SpokenWords(self, f"[{path.name}]", self._usual, priority, checked(self.name, path)))

    def speaking(self) -> Utterance | None:
        """Return what is heard now."""
        current = self._current
        return current if current is not None and current.started is not None else None

    def _queued(self, words: "SpokenWords") -> "SpokenWords":
        with self._turn:
            if self._thread is None:
                raise NotConnected(f"{self.name}: not open, cannot say {words.text!r}")
            if not words.text.strip():
                words.ended.set()
                return words
            insort(self._queue, words, key=lambda each: -each.priority)
            if self._current is not None and self._queue[0] is not self._current:
                self._cut.make()
            self._turn.notify_all()
        return words

    def drop(self, words: "SpokenWords") -> None:
        """End ``words`` now: take them out of the queue, and break them off if they are being said."""
        with self._turn:
            words.ended.set()
            if words in self._queue:
                self._queue.remove(words)
            if words is self._current:
                self._cut.make()

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._queue or self._ending)
                if self._ending:
                    return
                words, cut = self._queue[0], Cut()
                self._current, self._cut = words, cut
            whole = self._say(words, cut)
            with self._turn:
                self._current = None
                if whole:
                    self.drop(words)
                words.forget()
            if words.done():
                self._changed()

    def _say(self, words: "SpokenWords", cut: Cut) -> bool:
        """Say or play ``words``; True when they have come to their end. What cannot be heard is printed."""
        try:
            whole = self._sound(words, cut)
        except DriverError as error:
            self._fail(error)
            return self._print(words, cut)
        if whole:
            with self._turn:
                self._counters["said"] += 1
                self._trouble = ("", "")
        return whole

    def _sound(self, words: "SpokenWords", cut: Cut) -> bool:
        def begun(at: float, seconds: float) -> None:
            words.begin(at, seconds)
            if self._player.mute:
                self._out(words.text)

        if words.path is not None:
            words.seconds = length_of(words.path)
            self._player.open()
            return self._player.play_file(words.path, cut, begun)
        words.seconds = seconds_of(words.text, words.manner.speed)
        if self._engine.speaks_itself:
            words.begin(self._clock.now(), words.seconds)
        speech = self._engine.speak(words.text, words.manner, cut)
        if speech is None:
            return not cut.made
        words.seconds, words.shapes = speech.seconds, movement(speech.phonemes, speech.seconds)
        return self._player.play(speech, cut, begun)

    def _fail(self, error: DriverError) -> None:
        trouble = str(error), error.hint
        with self._turn:
            self._counters["failed"] += 1
            known, self._trouble = trouble == self._trouble, trouble
        if not known and not isinstance(error, NotConnected):  # which the program's keeper has told already
            self._report(Notice(self.name, "fault", *trouble))

    def _print(self, words: "SpokenWords", cut: Cut) -> bool:
        """Print what cannot be heard, and take as long, or what is left of that; False when it was broken off."""
        if cut.made:
            return False
        if words.started is None or not self._player.mute:
            self._out(words.text)
        if words.started is None:
            words.begin(self._clock.now(), words.seconds)
        return not cut.wait(words.end - self._clock.now())


class SpokenWords:
    """A ``drivers.api.Utterance``: a text, or the file at ``path``. ``ended`` is set once it was heard or cancelled."""

    def __init__(self, voice: SpeechVoice, text: str, manner: Manner, priority: Priority, path: Path | None) -> None:
        self.text = text
        self.manner = manner
        self.priority = priority
        self.path = path
        self.ended = Event()
        self.seconds = 0.0
        self.shapes: Sequence[MouthShape] = ()
        self._voice = voice
        self._started: float | None = None

    def done(self) -> bool:
        """True once it was heard to the end, or cancelled."""
        return self.ended.is_set()

    def cancel(self) -> None:
        """Fall silent now."""
        self._voice.drop(self)

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

    def begin(self, at: float, seconds: float) -> None:
        """Note that it is heard from ``at`` on."""
        self._started, self.seconds = at, seconds

    def forget(self) -> None:
        """Forget a beginning that came to no end: it waits again."""
        if not self.done():
            self._started = None
