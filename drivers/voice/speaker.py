"""The voice of a machine with a speech synthesiser: each utterance is one run of that program."""

import os
import shlex
import signal
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from subprocess import DEVNULL, PIPE, Popen
from threading import Condition, Event, Thread

from drivers.api import Health, Notice, Report, Utterance, unheard, unreported
from drivers.errors import NotConnected
from drivers.guard import guarded
from drivers.voice.synthesiser import Synthesiser

LONGEST_COMPLAINT = 200
"""Characters of a program's last words that are passed on."""


class Speaker:
    """A ``drivers.api.Voice`` that speaks one utterance after another with a ``synthesiser``.

    A thread waits for the program, so nothing here blocks. Where the program fails, the text goes to ``out``, and the
    failure is reported. ``changed`` is called from that thread whenever an utterance has ended.
    """

    def __init__(
        self,
        synthesiser: Synthesiser,
        out: Callable[[str], None],
        *,
        report: Report = unreported,
        changed: Callable[[], None] = unheard,
        name: str = "voice",
    ) -> None:
        self.name = name
        self._synthesiser = synthesiser
        self._out = guarded(out)
        self._report = guarded(report)
        self._changed = guarded(changed)
        self._turn = Condition()  # over everything below
        self._queue: deque[SpokenWords] = deque()
        self._current: SpokenWords | None = None
        self._process: Popen[str] | None = None
        self._thread: Thread | None = None
        self._ending = False
        self._trouble = ("", "")
        self._counters = {"said": 0, "failed": 0}

    def open(self) -> None:
        """Start the thread that speaks."""
        with self._turn:
            if self._thread is None:
                self._ending = False
                self._thread = Thread(target=self._run, name=f"voice {self.name}", daemon=True)
                self._thread.start()

    def rest(self) -> None:
        """Fall silent: cancel all that is being said or waiting."""
        with self._turn:
            for words in (*self._queue, *filter(None, (self._current,))):
                words.cancel()

    def close(self) -> None:
        """Fall silent at once, and end the thread."""
        with self._turn:
            self._ending = True
            self.rest()
            self._turn.notify_all()
            thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()

    def health(self) -> Health:
        """Say whether it can speak; after a failure, how the last utterance failed."""
        with self._turn:
            counters = dict(self._counters)
            if self._thread is None:
                return Health(False, f"{self.name}: not opened yet", counters=counters)
            return Health(True, *self._trouble, counters=counters)

    def say(self, text: str) -> Utterance:
        """Speak ``text`` after whatever is being said. Raises NotConnected before ``open`` and after ``close``."""
        words = SpokenWords(self, text)
        with self._turn:
            if self._thread is None:
                raise NotConnected(f"{self.name}: not open, cannot say {text!r}")
            if not text.strip():
                words.ended.set()
            else:
                self._queue.append(words)
                self._turn.notify_all()
        return words

    def drop(self, words: "SpokenWords") -> None:
        """End ``words`` now: take them out of the queue, or kill the program that is speaking them."""
        with self._turn:
            words.ended.set()
            if words in self._queue:
                self._queue.remove(words)
            if words is self._current and self._process is not None:
                _kill(self._process)

    # --- the thread ---------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._queue or self._ending)
                if self._ending:
                    return
                words = self._current = self._queue.popleft()
            try:
                self._speak(words)
            finally:
                with self._turn:
                    self._current = self._process = None
                    words.ended.set()
            self._changed()

    def _speak(self, words: "SpokenWords") -> None:
        """Run the program to its end; where it fails of its own, print the words instead."""
        try:
            process = Popen(  # noqa: S603 - no shell, and what is said goes in through stdin
                self._synthesiser.command,
                stdin=PIPE,
                stdout=DEVNULL,
                stderr=PIPE,
                encoding="utf-8",
                errors="replace",
                start_new_session=True,  # so that programs which it starts fall silent with it
            )
        except OSError as error:
            self._fail(words, str(error))
            return
        with self._turn:
            self._process = process
            if words.ended.is_set():  # cancelled while the program started
                _kill(process)
        complaint = process.communicate(words.text)[1]
        if process.returncode == 0:
            with self._turn:
                self._counters["said"] += 1
                self._trouble = ("", "")
        elif not words.ended.is_set():
            self._fail(words, f"ended with {process.returncode}: {complaint.strip()[-LONGEST_COMPLAINT:]}")

    def _fail(self, words: "SpokenWords", why: str) -> None:
        command = shlex.join(self._synthesiser.command)
        trouble = (f"{self.name}: {self._synthesiser.program}: {why}", f"echo hello | {command}")
        with self._turn:
            self._counters["failed"] += 1
            self._trouble = trouble
        self._report(Notice(self.name, "fault", *trouble))
        self._out(words.text)


class SpokenWords:
    """A ``drivers.api.Utterance`` of a speaker. ``ended`` is set once it was spoken, cancelled or printed."""

    def __init__(self, speaker: Speaker, text: str) -> None:
        self.text = text
        self.ended = Event()
        self._speaker = speaker

    def done(self) -> bool:
        """True once it was spoken to the end, or cancelled."""
        return self.ended.is_set()

    def cancel(self) -> None:
        """Fall silent now."""
        self._speaker.drop(self)


def _kill(process: "Popen[str]") -> None:
    """Kill a program and whatever it started, unless it has been waited for and its number may be another's."""
    if process.returncode is None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
