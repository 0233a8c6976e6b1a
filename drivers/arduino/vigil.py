"""Whether a board is still the one whose servos we know: by what it says unasked, and by what it answers to probes.

A sketch obeys angles from the moment it runs, asked for its topics or not, and tells nobody that it has started anew.
So angles may be sent only while it is sure that it has not: for less long after the newest proof than any board needs
to start. Without proof it is probed, and says by its answers whether it is in step, or has forgotten us.
"""

from collections import deque
from enum import Enum
from math import inf

FRESH = 0.05
"""Seconds for which a proof is good. The quickest boards start within 65 ms; the encoders are told every 50 ms."""

ANSWER = 0.25
"""Seconds in which a board that runs answers a probe: 200 bytes at 57600 baud, and the adapter's latency."""

TWICE = 2.3
"""Seconds within which a board in step never asks for the time twice: it does so every 2.5 s."""

FORGETS = 10.5
"""Seconds after an answer to such a question for which a board remembers us for sure; the sketch takes 11."""

QUESTIONS = 4
"""Questions for the time that a board which hears no answer asks until it forgets us."""

NUDGED = 3
"""Questions for the time that tell a board which has forgotten us: a probe gets four of it, one or two of others."""


class Life(Enum):
    """What a probe has found."""

    SAME = "in step with us, or with somebody before us: it has not started since"
    ANEW = "it has started since we last knew it"
    FORGOTTEN = "it has forgotten us, for which it may or may not have started anew"


class Vigil:
    """Watches one connection, ``before`` the one before it, if there was one.

    ``met`` is until when the board remembers us for sure, None for one that we have never known; ``asked_at`` when the
    probe was sent that is not answered yet, None for none; ``deaf`` is set once one was not. ``dozing`` is for how
    long (s) nobody means to look.
    """

    def __init__(self, before: "Vigil | None" = None) -> None:
        self.met: float | None = None if before is None else before.met
        self.asked_at: float | None = None
        self.deaf: bool = before is not None and before.deaf
        self._proved_at = -inf  # when it was in step for sure
        self._probed_at = -inf
        self._looked_at: float | None = None
        self.dozing = 0.0
        self._known_from = -inf  # what is read now has come since then
        self._own = False  # it has known us on this connection
        self._doubt = False  # we were held up, and it has not answered since
        self._late = False  # what is being read may have waited since long ago
        self._questioned_at = -inf
        self._questions = 0  # behind the probe
        self._waited = 0  # questions that waited because we were held up
        self._sent: deque[float] = deque()  # angles that may be acknowledged by a line of the log

    @property
    def doubtful(self) -> bool:
        """Whether nothing proves anything but an answer to a probe."""
        return self._doubt

    def sure(self, now: float) -> bool:
        """Whether angles may be sent."""
        return self.asked_at is None and now - self._proved_at <= FRESH

    def look(self, now: float) -> None:
        """To be called before whatever is read, and between: who was held up reads what is old."""
        before, self._looked_at = self._looked_at, now
        held_up = self._late = before is not None and now - before > FRESH + self.dozing
        self._known_from = -inf if before is None or held_up else before
        if held_up:
            self._proved_at, self._doubt = -inf, True
            self._sent.clear()

    def expects(self, now: float) -> bool:
        """Whether a proof is about to come by itself, since it is to acknowledge angles that were just sent."""
        return bool(self._sent) and now - self._sent[-1] <= 2 * FRESH

    def probed(self, now: float) -> None:
        """A probe was sent."""
        if not self.deaf:  # else its answer may have been garbled, but for these
            self._questions = 0
        self.asked_at = self._probed_at = now
        self._proved_at = -inf
        self._sent.clear()

    def sent(self, count: int, now: float) -> None:
        """So many angles were sent, behind a nudge."""
        self._sent.extend([now] * count)

    def overdue(self, now: float) -> bool:
        """Whether the probe should have been answered; once it is so, it counts as not sent, and the board as deaf."""
        if self.asked_at is None or now - self.asked_at <= ANSWER or self._late:
            return False
        self.asked_at, self.deaf = None, True
        return True

    def published(self) -> None:
        """It has told of its encoders, which it does only in step."""
        if self.asked_at is None and not self._doubt:
            self._proved_at = max(self._proved_at, self._known_from)

    def acknowledged(self) -> None:
        """It has written a line to its log, as the first sketches do for each angle that they take."""
        if self._sent:
            self._proved_at = max(self._proved_at, self._sent.popleft())

    def questioned(self, now: float) -> bool:
        """It has asked for the time; say whether one in step would not have, so that it has to be probed.

        A question belongs to each answer to a probe. One that comes soon after a probe which has been answered may be
        that of an answer which took too long: were it probed for that, so would it be for the next one, without end.
        Then it is doubted, until something is to be sent, or it answers once more.
        """
        self._questions += 1
        if self._late:
            self._waited += 1
            return False
        again, self._questioned_at = now - self._questioned_at < TWICE, now
        if self.asked_at is None and not again:
            self.met, self._own = now + FORGETS, True
        if self.asked_at is None and again and now - self._probed_at <= ANSWER:
            self._proved_at, self._doubt = -inf, True
            return False
        return self.asked_at is None and again

    def answered(self, now: float) -> Life:
        """It has named its topics to a probe: say what became of it; the proof is as old as the probe."""
        asked_at = now if self.asked_at is None else self.asked_at
        known = self.met is not None and (asked_at <= self.met or (self._own and self._waited < QUESTIONS))
        deaf, forgotten = self.deaf, self._questions >= NUDGED
        self.asked_at, self.deaf, self._doubt, self._own = None, False, False, True
        self._waited = self._questions = 0
        self._proved_at, self._questioned_at, self.met = asked_at, now, asked_at + FORGETS
        if forgotten:
            return Life.ANEW if deaf or known else Life.FORGOTTEN
        return Life.FORGOTTEN if deaf else Life.SAME
