"""Which notice is next: each channel takes its own in order, and one that takes none rests, longer each time."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from config.notices import named
from drivers.clock import Clock
from missions.service.outbox import Letter, Outbox

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
