"""Takes notices from the outbox to their channels, on a thread of its own: a dead broker never delays a task."""

import sqlite3
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Self

from drivers.clock import Clock, SystemClock
from missions.tasks.notice import Channel
from missions.tasks.outbox import LONG, Letter, Outbox, delay
from missions.tasks.schema import open_db
from missions.tasks.task import TaskError

PERIOD = 0.5
"""Seconds from one look into the outbox to the next."""

FAREWELL = 5.0
"""Seconds for which the end waits for a delivery that goes on; it is made again otherwise."""


class Courier:
    """While it is entered, delivers what is in the outbox of the queue at ``path``.

    ``channel_of`` makes a channel of its name in the outbox. ``now`` is the wall clock (Unix), ``tell`` hears what
    people should know. A channel that does not take a notice rests, longer each time, and with it all that is for it;
    the others go on.
    """

    def __init__(
        self,
        path: Path,
        channel_of: Callable[[str], Channel],
        now: Callable[[], float],
        tell: Callable[[str], None],
        *,
        clock: Clock | None = None,
    ) -> None:
        self._path, self._channel_of, self._now, self._tell = path, channel_of, now, tell
        self._clock = SystemClock() if clock is None else clock
        self._failures: dict[str, int] = {}  # in a row, by channel
        self._rest: dict[str, float] = {}  # until when, by channel
        self._ending, self._emptied = Event(), Event()
        self._thread: Thread | None = None

    def __enter__(self) -> Self:
        self._ending.clear()
        self._thread = Thread(target=self._work, name="courier", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending.set()
        if self._thread is not None:
            self._thread.join(FAREWELL)

    def flush(self, seconds: float) -> None:
        """Wait until all that is due was tried, for so many seconds at most."""
        self._emptied.clear()
        if not self._ending.is_set():
            self._emptied.wait(seconds)

    def _work(self) -> None:
        try:
            with closing(open_db(self._path)) as connection:
                outbox = Outbox(connection)
                while not self._ending.is_set():
                    self._round(outbox)
        except TaskError as error:
            self._tell(f"notices are not delivered: {error}")
        finally:
            self._ending.set()
            self._emptied.set()

    def _round(self, outbox: Outbox) -> None:
        """Deliver one notice, or rest where there is none."""
        try:
            letter = outbox.due(self._now(), self.resting())
            if letter is not None:
                self.deliver(outbox, letter)
                return
            self._emptied.set()
        except sqlite3.OperationalError as error:  # a full disk: what was delivered now is delivered again
            self._tell(f"the outbox cannot be used: {error}")
        self._ending.wait(PERIOD)

    def resting(self) -> Mapping[str, float]:
        """Return the channels that rest, and until when."""
        now = self._clock.now()
        self._rest = {channel: until for channel, until in self._rest.items() if until > now}
        return self._rest

    def deliver(self, outbox: Outbox, letter: Letter) -> None:
        """Try to deliver one notice, and keep in mind what came of it."""
        try:
            self._channel_of(letter.channel)(letter.notice)
        except Exception as error:  # whatever a channel raises, the notice is not delivered
            self._refused(outbox, letter, str(error) or type(error).__name__)
            return
        outbox.delivered(letter, self._now())
        if self._failures.pop(letter.channel, 0):
            self._tell(f"notices are delivered again to {letter.channel}")

    def _refused(self, outbox: Outbox, letter: Letter, error: str) -> None:
        channel, now = letter.channel, self._now()
        outbox.failed(letter, error, now)
        failures = self._failures[channel] = self._failures.get(channel, 0) + 1
        self._rest[channel] = self._clock.now() + delay(failures)
        if failures == 1:
            self._tell(f"a notice of task {letter.notice.task} is not delivered yet: {error}")
        elif now - letter.added - delay(letter.tries) <= LONG < now - letter.added:
            self._tell(f"a notice of task {letter.notice.task} is not delivered for a week now: {error}")
