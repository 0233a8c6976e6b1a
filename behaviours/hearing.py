"""Leaves that listen."""

import math
from collections.abc import Mapping, Sequence

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from perception.api import Words

MAX_LISTENING_DELAY = 1.0
"""Seconds for which the robot may be behind with listening; more, and it does not listen at all."""

DEFAULT_MAX_AGE = 3.0
"""Seconds for which something heard counts as heard, unless a mission says otherwise."""

MAX_AGE = 30.0
"""Seconds for which every ``perception.api.Hearing`` keeps words."""


class HearingLeaf(Leaf):
    """Hears phrases, among all those that the mission listens for."""

    needs = frozenset({"microphone"})
    output_doc = "the phrase, as the mission writes it"
    output_type = str
    phrases: Mapping[str, str]  # as the mission writes them, by how they are listened for

    def newest_phrase(self, since: float) -> Words | None:
        """Return the newest of the phrases that was begun at ``since`` (s, on the run's clock) or later."""
        words = self.robot.hearing.words()
        return next((each for each in words if each.start >= since and each.phrase in self.phrases), None)

    def accept(self, words: Words) -> Status:
        """Succeed with what was heard."""
        self.result = self.phrases[words.phrase]
        self.feedback_message = f'heard "{words.phrase}"'
        return SUCCESS

    def deafness_reason(self) -> str:
        """Say that the robot does not hear anything at all, whatever is missing; nothing where it does."""
        listened = self.robot.hearing.listened()
        there = listened is not None and self.run.now() - listened <= MAX_LISTENING_DELAY
        return "" if there else "no sound from the microphone, or no recogniser: see the notices"


class Listen(HearingLeaf):
    """Wait until somebody says one of some phrases.

    Running until it is heard, then succeeds; fails after `timeout` without. What was begun before it started does not
    count, nor does what the robot says itself. All phrases of the mission, in small letters, are listened for at all
    times: what is not one of them is refused, and another step's are ignored.
    """

    tag = "listen"
    phrases: Mapping[str, str] = argument("phrases", "what may be said", name="for", principal=True)
    timeout: float | None = argument("duration", "how long to wait; else for ever", default=None, low=0.1)

    def update(self) -> Status:
        words = self.newest_phrase(self.started_at)
        if words is not None:
            return self.accept(words)
        if self.timeout is not None and self.elapsed >= self.timeout:
            return self.fail(self.deafness_reason() or self._other_words() or "nothing heard")
        return self.wait(self.deafness_reason() or self._other_words() or "listening")

    def _other_words(self) -> str:
        """Say what else was heard; empty where nothing was."""
        hearing = self.robot.hearing
        others: Sequence[Words] = [
            each for each in (*hearing.words(), *hearing.refused()) if each.start >= self.started_at
        ]
        if not others:
            return ""
        times = "once" if len(others) == 1 else f"{len(others)} times"
        nearest = max(others, key=lambda each: each.stamp).phrase
        return f"heard something else {times}" + (f" (nearest: {nearest})" if nearest else "")


class HeardLeaf(HearingLeaf):
    """Was something said just now?

    Succeeds when it was heard lately, fails when not. It never runs, so that a mission can do something else until
    then; it is suspended while there is no sound.
    """

    tag = "heard"
    instant = True
    phrases: Mapping[str, str] = argument("phrases", "what counts", name="phrase", principal=True)
    within: float = argument("duration", "how long ago still counts", default=DEFAULT_MAX_AGE, low=0.01, high=MAX_AGE)

    def update(self) -> Status:
        now = self.run.now()
        words = self.newest_phrase(-math.inf)
        if words is not None and words.stamp >= now - self.within:
            return self.accept(words)
        return self.suspend("microphone") if self.deafness_reason() else self.fail("not heard")
