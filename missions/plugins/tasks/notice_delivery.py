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

from config.notices import public_text
from drivers.clock import Clock, SystemClock
from missions.plugins.tasks.notice import Channel
from missions.plugins.tasks.outbox import Outbox, QueuedNotice
from missions.plugins.tasks.queue_database import describe_retry, open_db

# Which notice is next: each channel takes its own in order, and one that takes none rests, longer each time.

FIRST_RETRY_DELAY, MAX_RETRY_DELAY = 1.0, 600.0
"""Seconds to the second try, and from one try to the next at most; each is twice the one before."""

MAX_BLOCKING_TRIES = 5
"""Tries after which another notice is tried as well: perhaps it is not the channel that is to blame."""

MAX_NOTICE_AGE, MIN_TRIES = 7 * 24 * 3600.0, 20
"""Seconds, and tries, after which a notice is given up: two hours of tries, for a clock that is set leaps by years."""


@dataclass(slots=True)
class _ChannelState:
    """What is known of a channel: ``failures`` in a row, and ``retry_at``, until when it is left alone.

    ``postponed`` are the notices that others may pass, and until when; ``is_probing`` while such another one is tried.
    """

    failures: int = 0
    retry_at: float = 0.0
    is_probing: bool = False
    postponed: dict[int, float] = field(default_factory=dict)


class DeliverySchedule:
    """Chooses from the ``outbox`` what is to be delivered, and keeps in it what came of that.

    ``now`` is the wall clock (Unix), ``tell`` hears what people should know. How long channels rest is measured by
    ``clock``, and forgotten with this: a server that is started again tries all at once.
    """

    def __init__(self, outbox: Outbox, now: Callable[[], float], clock: Clock, report: Callable[[str], None]) -> None:
        self._outbox, self._now, self._clock, self._report = outbox, now, clock, report
        self._channels: dict[str, _ChannelState] = {}

    def due_notices(self, busy: Collection[str] = ()) -> list[QueuedNotice]:
        """Return one notice for each channel for which some wait, unless it rests or is ``busy``."""
        found = [self._first(channel) for channel in self._outbox.channels() if channel not in busy]
        return [letter for letter in found if letter is not None]

    def on_delivered(self, queued: QueuedNotice) -> None:
        """Keep in mind that a notice was delivered."""
        self._outbox.mark_delivered(queued, self._now())
        state = self._state(queued.channel)
        if state.failures:
            self._report(f"notices are delivered again to {public_text(queued.channel)}")
        state.failures, state.is_probing = 0, False

    def on_failed(self, queued: QueuedNotice, error: str) -> None:
        """Keep in mind that a notice was not delivered, and why; its channel rests, unless that is to blame alone."""
        state, tries = self._state(queued.channel), queued.tries + 1
        self._outbox.mark_failed(queued, error)
        if tries >= MIN_TRIES and self._now() - queued.added > MAX_NOTICE_AGE:
            count = self._outbox.give_up(queued.channel, self._now() - MAX_NOTICE_AGE)
            self._report(f"after a week, what waits for {public_text(queued.channel)} is given up ({count}): {error}")
        if tries >= MAX_BLOCKING_TRIES and not state.is_probing:
            state.postponed[queued.id] = self._clock.now() + retry_delay(tries)
            state.is_probing = self._outbox.first(queued.channel, state.postponed) is not None
            if state.is_probing:
                return
        state.failures += 1
        state.retry_at, state.is_probing = self._clock.now() + retry_delay(state.failures), False
        state.postponed.clear()  # it was the channel, which begins with the first again
        if state.failures == 1:
            self._report(f"a notice of task {queued.notice.task} is not delivered yet: {error}")

    def _state(self, channel: str) -> _ChannelState:
        return self._channels.setdefault(channel, _ChannelState())

    def _first(self, channel: str) -> QueuedNotice | None:
        state, now = self._state(channel), self._clock.now()
        if state.retry_at > now:
            return None
        state.postponed = {each: until for each, until in state.postponed.items() if until > now}
        return self._outbox.first(channel, state.postponed, fresh=state.is_probing)


def retry_delay(failures: int) -> float:
    """Return the seconds to wait after so many tries that failed: 1, 2, 4 ... and 600 at most."""
    return min(MAX_RETRY_DELAY, FIRST_RETRY_DELAY * 2.0 ** min(failures - 1, 20))


POLL_INTERVAL = 0.5
"""Seconds from one look into the outbox to the next."""

FINAL_FLUSH_TIMEOUT = 5.0
"""Seconds for which the end waits until all that is due was tried."""

ABORT_TIMEOUT = 2.0
"""Seconds that a channel has to give up what it is at, once it was told to."""


@runtime_checkable
class AbortableChannel(Protocol):
    """A channel that leaves something behind, unless it is told to give up."""

    def abandon_halt(self) -> None:
        """End what it is at: its call raises. From any thread."""
        ...


class NoticeSender:
    """While it is entered, delivers what is in the outbox of the queue at ``path``; at its end it tries all once more.

    ``channel_of`` makes a channel of its name in the outbox. ``now`` is the wall clock (Unix), ``tell`` hears what
    people should know. ``farewell`` is how long the end may take, in seconds.
    """

    def __init__(
        self,
        path: Path,
        channel_of: Callable[[str], Channel],
        now: Callable[[], float],
        report: Callable[[str], None],
        *,
        flush_timeout: float = FINAL_FLUSH_TIMEOUT,
    ) -> None:
        self._path, self._channel_of, self._now, self._report = path, channel_of, now, report
        self._flush_timeout = flush_timeout
        self._ending, self._ended = Event(), Event()
        self._events: SimpleQueue[_DeliveryAttempt | Event | None] = (
            SimpleQueue()
        )  # trials that are over, requests, and the end
        self._attempts: dict[str, _DeliveryAttempt] = {}  # by channel
        self._finished: list[_DeliveryAttempt] = []
        self._flush_requests: list[Event] = []
        self._last_error = ""
        self._thread = Thread(target=self._work, name="courier", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.flush(self._flush_timeout)
        self._ending.set()
        self._events.put(None)
        self._thread.join(2 * ABORT_TIMEOUT)

    def flush(self, seconds: float) -> None:
        """Wait until all that is due was tried, for so many seconds at most."""
        tried = Event()
        self._events.put(tried)
        if not self._ended.is_set():
            tried.wait(seconds)

    def _work(self) -> None:
        try:
            with closing(open_db(self._path)) as connection:
                turns = DeliverySchedule(Outbox(connection), self._now, SystemClock(), self._report)
                while not self._ending.is_set():
                    self._deliver_due(turns)
                    self._wait_for_event(POLL_INTERVAL)
                self._abort_attempts()
                self._record_results(turns)
        except Exception as error:  # a damaged file may hold anything; the tasks go on
            self._report(f"notices are not delivered any more: {error}")
        finally:
            self._ended.set()
            self._abort_attempts()
            self._end_flushes()

    def _deliver_due(self, turns: DeliverySchedule) -> None:
        """Keep what came of the trials that are over, and begin with what is due: one notice for each channel."""
        try:
            self._record_results(turns)
            for letter in turns.due_notices(self._attempts):
                self._start_attempt(letter)
            self._last_error = ""
        except sqlite3.OperationalError as error:  # a full disk, say
            if str(error) != self._last_error:
                self._last_error = str(error)
                self._report(f"notices wait: {describe_retry(self._path, error)}")
        else:
            if not self._attempts:
                self._end_flushes()

    def _start_attempt(self, letter: QueuedNotice) -> None:
        trial = self._attempts[letter.channel] = _DeliveryAttempt(letter, self._channel_of, self._events.put)
        trial.start()

    def _record_results(self, turns: DeliverySchedule) -> None:
        while self._finished:
            trial = self._finished[0]  # it stays there, and its channel busy, until this is written
            if trial.problem is None:
                turns.on_delivered(trial.queued)
            else:
                turns.on_failed(trial.queued, trial.problem)
            del self._finished[0], self._attempts[trial.queued.channel]

    def _wait_for_event(self, seconds: float) -> bool:
        """Wait for something to happen, for so long at most; say whether something did."""
        try:
            heard = self._events.get(timeout=seconds)
        except Empty:
            return False
        if isinstance(heard, _DeliveryAttempt):
            self._finished.append(heard)
        elif heard is not None:
            self._flush_requests.append(heard)
        return True

    def _end_flushes(self) -> None:
        """Say to those who wait that all was tried."""
        while self._flush_requests:
            self._flush_requests.pop().set()

    def _abort_attempts(self) -> None:
        """End the trials that would go on behind the server's back, and hear what is left."""
        for trial in self._attempts.values():
            if trial.abortable is not None:
                trial.abortable.abandon_halt()
        for trial in self._attempts.values():
            trial.join(ABORT_TIMEOUT if trial.abortable is not None else 0.0)
        while self._wait_for_event(0.0):
            pass


class _DeliveryAttempt(Thread):
    """One try to deliver a ``queued``; once it is ``over``, ``problem`` says what went wrong, None for nothing."""

    def __init__(
        self, letter: QueuedNotice, channel_of: Callable[[str], Channel], over: Callable[["_DeliveryAttempt"], None]
    ) -> None:
        super().__init__(name=f"notice {letter.id}", daemon=True)
        self.queued, self._over = letter, over
        self.problem: str | None = None
        self._channel: Channel | None = None
        try:
            self._channel = channel_of(letter.channel)
        except Exception as error:  # whatever it raises, the notice is not delivered
            self.problem = _error_text(error)
        self.abortable = _abortable(self._channel)

    def run(self) -> None:
        """Deliver it."""
        try:
            if self._channel is not None:
                self._channel(self.queued.notice)
        except Exception as error:
            self.problem = _error_text(error)
        finally:
            self._over(self)


def _abortable(channel: object) -> AbortableChannel | None:
    return channel if isinstance(channel, AbortableChannel) else None


def _error_text(error: Exception) -> str:
    return str(error) or type(error).__name__
