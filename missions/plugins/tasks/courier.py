"""Takes notices from the outbox to their channels, each on a thread of its own: a dead broker delays nobody else."""

import sqlite3
from collections.abc import Callable, Collection
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from config.notices import named
from drivers.clock import Clock, SystemClock
from missions.plugins.tasks.notice import Channel
from missions.plugins.tasks.outbox import Letter, Outbox
from missions.plugins.tasks.schema import in_a_line, open_db

# Which notice is next: each channel takes its own in order, and one that takes none rests, longer each time.

FIRST_DELAY, MAX_DELAY = 1.0, 600.0
"""Seconds to the second try, and from one try to the next at most; each is twice the one before."""

STUBBORN = 5
"""Tries after which another notice is tried as well: perhaps it is not the channel that is to blame."""

LONG, TIRED = 7 * 24 * 3600.0, 20
"""Seconds, and tries, after which a notice is given up: two hours of tries, for a clock that is set leaps by years."""


@dataclass(slots=True)
class _Channel:
    """What is known of a channel: ``failures`` in a row, and ``rest``, until when it is left alone.

    ``aside`` are the notices that others may pass, and until when; ``doubt`` while such another one is tried.
    """

    failures: int = 0
    rest: float = 0.0
    doubt: bool = False
    aside: dict[int, float] = field(default_factory=dict)


class Turns:
    """Chooses from the ``outbox`` what is to be delivered, and keeps in it what came of that.

    ``now`` is the wall clock (Unix), ``tell`` hears what people should know. How long channels rest is measured by
    ``clock``, and forgotten with this: a server that is started again tries all at once.
    """

    def __init__(self, outbox: Outbox, now: Callable[[], float], clock: Clock, tell: Callable[[str], None]) -> None:
        self._outbox, self._now, self._clock, self._tell = outbox, now, clock, tell
        self._channels: dict[str, _Channel] = {}

    def next(self, busy: Collection[str] = ()) -> list[Letter]:
        """Return one notice for each channel for which some wait, unless it rests or is ``busy``."""
        found = [self._first(channel) for channel in self._outbox.channels() if channel not in busy]
        return [letter for letter in found if letter is not None]

    def taken(self, letter: Letter) -> None:
        """Keep in mind that a notice was delivered."""
        self._outbox.delivered(letter, self._now())
        state = self._state(letter.channel)
        if state.failures:
            self._tell(f"notices are delivered again to {named(letter.channel)}")
        state.failures, state.doubt = 0, False

    def refused(self, letter: Letter, error: str) -> None:
        """Keep in mind that a notice was not delivered, and why; its channel rests, unless that is to blame alone."""
        state, tries = self._state(letter.channel), letter.tries + 1
        self._outbox.failed(letter, error)
        if tries >= TIRED and self._now() - letter.added > LONG:
            count = self._outbox.give_up(letter.channel, self._now() - LONG)
            self._tell(f"after a week, what waits for {named(letter.channel)} is given up ({count}): {error}")
        if tries >= STUBBORN and not state.doubt:
            state.aside[letter.id] = self._clock.now() + delay(tries)
            state.doubt = self._outbox.first(letter.channel, state.aside) is not None
            if state.doubt:
                return
        state.failures += 1
        state.rest, state.doubt = self._clock.now() + delay(state.failures), False
        state.aside.clear()  # it was the channel, which begins with the first again
        if state.failures == 1:
            self._tell(f"a notice of task {letter.notice.task} is not delivered yet: {error}")

    def _state(self, channel: str) -> _Channel:
        return self._channels.setdefault(channel, _Channel())

    def _first(self, channel: str) -> Letter | None:
        state, now = self._state(channel), self._clock.now()
        if state.rest > now:
            return None
        state.aside = {each: until for each, until in state.aside.items() if until > now}
        return self._outbox.first(channel, state.aside, fresh=state.doubt)


def delay(failures: int) -> float:
    """Return the seconds to wait after so many tries that failed: 1, 2, 4 ... and 600 at most."""
    return min(MAX_DELAY, FIRST_DELAY * 2.0 ** min(failures - 1, 20))


PERIOD = 0.5
"""Seconds from one look into the outbox to the next."""

FAREWELL = 5.0
"""Seconds for which the end waits until all that is due was tried."""

LEAVE = 2.0
"""Seconds that a channel has to give up what it is at, once it was told to."""


@runtime_checkable
class Breakable(Protocol):
    """A channel that leaves something behind, unless it is told to give up."""

    def give_up(self) -> None:
        """End what it is at: its call raises. From any thread."""
        ...


class Courier:
    """While it is entered, delivers what is in the outbox of the queue at ``path``; at its end it tries all once more.

    ``channel_of`` makes a channel of its name in the outbox. ``now`` is the wall clock (Unix), ``tell`` hears what
    people should know. ``farewell`` is how long the end may take, in seconds.
    """

    def __init__(
        self,
        path: Path,
        channel_of: Callable[[str], Channel],
        now: Callable[[], float],
        tell: Callable[[str], None],
        *,
        farewell: float = FAREWELL,
    ) -> None:
        self._path, self._channel_of, self._now, self._tell = path, channel_of, now, tell
        self._farewell = farewell
        self._ending, self._ended = Event(), Event()
        self._heard: SimpleQueue[_Trial | Event | None] = SimpleQueue()  # trials that are over, requests, and the end
        self._trials: dict[str, _Trial] = {}  # by channel
        self._over: list[_Trial] = []
        self._asked: list[Event] = []
        self._trouble = ""
        self._thread = Thread(target=self._work, name="courier", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.flush(self._farewell)
        self._ending.set()
        self._heard.put(None)
        self._thread.join(2 * LEAVE)

    def flush(self, seconds: float) -> None:
        """Wait until all that is due was tried, for so many seconds at most."""
        tried = Event()
        self._heard.put(tried)
        if not self._ended.is_set():
            tried.wait(seconds)

    def _work(self) -> None:
        try:
            with closing(open_db(self._path)) as connection:
                turns = Turns(Outbox(connection), self._now, SystemClock(), self._tell)
                while not self._ending.is_set():
                    self._round(turns)
                    self._listen(PERIOD)
                self._leave()
                self._judge(turns)
        except Exception as error:  # a damaged file may hold anything; the tasks go on
            self._tell(f"notices are not delivered any more: {error}")
        finally:
            self._ended.set()
            self._leave()
            self._answer()

    def _round(self, turns: Turns) -> None:
        """Keep what came of the trials that are over, and begin with what is due: one notice for each channel."""
        try:
            self._judge(turns)
            for letter in turns.next(self._trials):
                self._begin(letter)
            self._trouble = ""
        except sqlite3.OperationalError as error:  # a full disk, say
            if str(error) != self._trouble:
                self._trouble = str(error)
                self._tell(f"notices wait: {in_a_line(self._path, error)}")
        else:
            if not self._trials:
                self._answer()

    def _begin(self, letter: Letter) -> None:
        trial = self._trials[letter.channel] = _Trial(letter, self._channel_of, self._heard.put)
        trial.start()

    def _judge(self, turns: Turns) -> None:
        while self._over:
            trial = self._over[0]  # it stays there, and its channel busy, until this is written
            if trial.problem is None:
                turns.taken(trial.letter)
            else:
                turns.refused(trial.letter, trial.problem)
            del self._over[0], self._trials[trial.letter.channel]

    def _listen(self, seconds: float) -> bool:
        """Wait for something to happen, for so long at most; say whether something did."""
        try:
            heard = self._heard.get(timeout=seconds)
        except Empty:
            return False
        if isinstance(heard, _Trial):
            self._over.append(heard)
        elif heard is not None:
            self._asked.append(heard)
        return True

    def _answer(self) -> None:
        """Say to those who wait that all was tried."""
        while self._asked:
            self._asked.pop().set()

    def _leave(self) -> None:
        """End the trials that would go on behind the server's back, and hear what is left."""
        for trial in self._trials.values():
            if trial.breakable is not None:
                trial.breakable.give_up()
        for trial in self._trials.values():
            trial.join(LEAVE if trial.breakable is not None else 0.0)
        while self._listen(0.0):
            pass


class _Trial(Thread):
    """One try to deliver a ``letter``; once it is ``over``, ``problem`` says what went wrong, None for nothing."""

    def __init__(self, letter: Letter, channel_of: Callable[[str], Channel], over: Callable[["_Trial"], None]) -> None:
        super().__init__(name=f"notice {letter.id}", daemon=True)
        self.letter, self._over = letter, over
        self.problem: str | None = None
        self._channel: Channel | None = None
        try:
            self._channel = channel_of(letter.channel)
        except Exception as error:  # whatever it raises, the notice is not delivered
            self.problem = _words(error)
        self.breakable = _breakable(self._channel)

    def run(self) -> None:
        """Deliver it."""
        try:
            if self._channel is not None:
                self._channel(self.letter.notice)
        except Exception as error:
            self.problem = _words(error)
        finally:
            self._over(self)


def _breakable(channel: object) -> Breakable | None:
    return channel if isinstance(channel, Breakable) else None


def _words(error: Exception) -> str:
    return str(error) or type(error).__name__
