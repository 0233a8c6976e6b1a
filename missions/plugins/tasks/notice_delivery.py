"""Delivery of notices from the outbox to their channels, each on its own thread, so that no channel delays another."""

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

# Order of notices: each channel sends its own in order; a failing channel waits, longer each time.

FIRST_RETRY_DELAY, MAX_RETRY_DELAY = 1.0, 600.0
"""Exponential backoff: seconds before the first retry, and the maximum; each delay is twice the previous one."""

MAX_BLOCKING_TRIES = 5
"""Number of failed tries of a notice after which the next notice is tried, to see whether the channel itself fails."""

MAX_NOTICE_AGE, MIN_TRIES = 7 * 24 * 3600.0, 20
"""Age in seconds and number of tries (two hours) after which a notice is given up; a clock may jump."""


@dataclass(slots=True)
class _ChannelState:
    """Delivery state of a channel: the number of ``failures`` in a row, and ``retry_at``, the time of the next try.

    A notice that fails often is postponed, so that later notices of its channel are tried. ``postponed`` maps the ID of
    such a notice to the time until which it waits. ``is_probing`` is True while a later notice is tried instead.
    """

    failures: int = 0
    retry_at: float = 0.0
    is_probing: bool = False
    postponed: dict[int, float] = field(default_factory=dict)


class DeliverySchedule:
    """Selects due notices of the ``outbox``, and stores the results of their delivery.

    ``now`` returns Unix time, ``report`` prints a text for people. Retry delays are measured by ``clock`` and lost at a
    restart, so a new server tries all notices at once.
    """

    def __init__(self, outbox: Outbox, now: Callable[[], float], clock: Clock, report: Callable[[str], None]) -> None:
        self._outbox, self._now, self._clock, self._report = outbox, now, clock, report
        self._channels: dict[str, _ChannelState] = {}

    def due_notices(self, busy: Collection[str] = ()) -> list[QueuedNotice]:
        """Return the next notice of each channel, except channels in ``busy`` and channels that wait for a retry."""
        found = [self._first(channel) for channel in self._outbox.channels() if channel not in busy]
        return [letter for letter in found if letter is not None]

    def on_delivered(self, queued: QueuedNotice) -> None:
        """Store in the outbox that a notice was delivered; its channel then has no failures."""
        self._outbox.mark_delivered(queued, self._now())
        state = self._state(queued.channel)
        if state.failures:
            self._report(f"notices are delivered again to {public_text(queued.channel)}")
        state.failures, state.is_probing = 0, False

    def on_failed(self, queued: QueuedNotice, error: str) -> None:
        """Store a failed try, and delay the channel, unless the notice itself seems to be the cause."""
        state, tries = self._state(queued.channel), queued.tries + 1
        self._outbox.mark_failed(queued, error)
        if tries >= MIN_TRIES and self._now() - queued.added > MAX_NOTICE_AGE:
            count = self._outbox.give_up(queued.channel, self._now() - MAX_NOTICE_AGE)
            self._report(
                f"after a week, waiting notices for {public_text(queued.channel)} are given up ({count}): {error}"
            )
        if tries >= MAX_BLOCKING_TRIES and not state.is_probing:
            state.postponed[queued.id] = self._clock.now() + retry_delay(tries)
            state.is_probing = self._outbox.first(queued.channel, state.postponed) is not None
            if state.is_probing:
                return
        state.failures += 1
        state.retry_at, state.is_probing = self._clock.now() + retry_delay(state.failures), False
        state.postponed.clear()  # the channel itself failed, so it restarts with the first notice
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
    """Return the seconds to wait after this number of failed tries: 1, 2, 4, ..., at most 600."""
    return min(MAX_RETRY_DELAY, FIRST_RETRY_DELAY * 2.0 ** min(failures - 1, 20))


POLL_INTERVAL = 0.5
"""Seconds between two checks of the outbox."""

FINAL_FLUSH_TIMEOUT = 5.0
"""Seconds for which a NoticeSender that ends waits until all due notices were tried once more."""

ABORT_TIMEOUT = 2.0
"""Seconds for a channel to end an aborted delivery."""


@runtime_checkable
class AbortableChannel(Protocol):
    """Channel whose delivery must be aborted when the sender ends, since it has started a program."""

    def abort(self) -> None:
        """Abort the running delivery: the call of the channel then raises an exception. Thread-safe."""
        ...


class NoticeSender:
    """Delivers the notices of the queue at ``path`` while the context is entered.

    ``channel_of`` makes a channel from its encoding. ``now`` returns Unix time, ``report`` prints a text for people.
    The end takes at most ``flush_timeout`` seconds, in which all due notices are tried once more.
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
        )  # finished attempts, requests, and the end
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
        """Wait until all due notices were tried, at most ``seconds``."""
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
        except Exception as error:  # a damaged file may raise any error; the tasks go on
            self._report(f"notices are not delivered any more: {error}")
        finally:
            self._ended.set()
            self._abort_attempts()
            self._end_flushes()

    def _deliver_due(self, turns: DeliverySchedule) -> None:
        """Store the results of finished attempts, and start one attempt for each channel with a due notice."""
        try:
            self._record_results(turns)
            for letter in turns.due_notices(self._attempts):
                self._start_attempt(letter)
            self._last_error = ""
        except sqlite3.OperationalError as error:  # for example, a full disk
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
            trial = self._finished[0]  # it stays queued, and its channel busy, until the result is written
            if trial.problem is None:
                turns.on_delivered(trial.queued)
            else:
                turns.on_failed(trial.queued, trial.problem)
            del self._finished[0], self._attempts[trial.queued.channel]

    def _wait_for_event(self, seconds: float) -> bool:
        """Wait for a finished attempt or a call of ``flush``, at most ``seconds``; return whether there was one."""
        try:
            event = self._events.get(timeout=seconds)
        except Empty:
            return False
        if isinstance(event, _DeliveryAttempt):
            self._finished.append(event)
        elif event is not None:
            self._flush_requests.append(event)
        return True

    def _end_flushes(self) -> None:
        """Wake the threads that wait in ``flush``, because all due notices were tried."""
        while self._flush_requests:
            self._flush_requests.pop().set()

    def _abort_attempts(self) -> None:
        """Abort attempts that would outlive the server, and collect their results."""
        for trial in self._attempts.values():
            if trial.abortable is not None:
                trial.abortable.abort()
        for trial in self._attempts.values():
            trial.join(ABORT_TIMEOUT if trial.abortable is not None else 0.0)
        while self._wait_for_event(0.0):
            pass


class _DeliveryAttempt(Thread):
    """A thread that tries to deliver a notice once; ``problem`` is the error afterwards, None after success."""

    def __init__(
        self, letter: QueuedNotice, channel_of: Callable[[str], Channel], over: Callable[["_DeliveryAttempt"], None]
    ) -> None:
        super().__init__(name=f"notice {letter.id}", daemon=True)
        self.queued, self._over = letter, over
        self.problem: str | None = None
        self._channel: Channel | None = None
        try:
            self._channel = channel_of(letter.channel)
        except Exception as error:  # any error means that the notice is not delivered
            self.problem = _error_text(error)
        self.abortable = _abortable(self._channel)

    def run(self) -> None:
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
