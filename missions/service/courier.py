"""Takes notices from the outbox to their channels, each on a thread of its own: a dead broker delays nobody else."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from drivers.clock import SystemClock
from missions.service.disk import in_a_line
from missions.service.notice import Channel
from missions.service.outbox import Letter, Outbox
from missions.service.schema import open_db
from missions.service.turns import Turns

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
