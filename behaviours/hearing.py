"""Leaves that listen."""

import math
from collections.abc import Mapping, Sequence

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from perception.api import Words

DEAF = 1.0
"""Seconds for which the robot may be behind with listening; more, and it does not listen at all."""

LATELY = 3.0
"""Seconds for which something heard counts as heard, unless a mission says otherwise."""

KEPT = 30.0
"""Seconds for which every ``perception.api.Hearing`` keeps words."""


class Listening(Leaf):
    """Hears phrases, among all those that the mission listens for."""

    needs = frozenset({"microphone"})
    stores = "the phrase, as the mission writes it"
    keeps = str
    phrases: Mapping[str, str]  # as the mission writes them, by how they are listened for

    def heard(self, since: float) -> Words | None:
        """Return the newest of the phrases that was begun at ``since`` (s, on the run's clock) or later."""
        words = self.robot.hearing.words()
        return next((each for each in words if each.start >= since and each.phrase in self.phrases), None)

    def hear(self, words: Words) -> Status:
        """Succeed with what was heard."""
        self.result = self.phrases[words.phrase]
        self.feedback_message = f'heard "{words.phrase}"'
        return SUCCESS

    def deaf(self) -> str:
        """Say that the robot does not hear anything at all, whatever is missing; nothing where it does."""
        listened = self.robot.hearing.listened()
        there = listened is not None and self.run.now() - listened <= DEAF
        return "" if there else "no sound from the microphone, or no recogniser: see the notices"


class Listen(Listening):
    """Wait until somebody says one of some phrases.

    Running until it is heard, then succeeds; fails after `timeout` without. What was begun before it started does not
    count, nor does what the robot says itself. All phrases of the mission, in small letters, are listened for at all
    times: what is not one of them is refused, and another step's are ignored.
    """

    word = "listen"
    phrases: Mapping[str, str] = argument("phrases", "what may be said", called="for", principal=True)
    timeout: float | None = argument("duration", "how long to wait; else for ever", default=None, low=0.1)

    def update(self) -> Status:
        words = self.heard(self.since)
        if words is not None:
            return self.hear(words)
        if self.timeout is not None and self.elapsed >= self.timeout:
            return self.fail(self.deaf() or self._instead() or "nothing heard")
        return self.wait(self.deaf() or self._instead() or "listening")

    def _instead(self) -> str:
        """Say what else was heard; empty where nothing was."""
        hearing = self.robot.hearing
        others: Sequence[Words] = [each for each in (*hearing.words(), *hearing.refused()) if each.start >= self.since]
        if not others:
            return ""
        times = "once" if len(others) == 1 else f"{len(others)} times"
        nearest = max(others, key=lambda each: each.stamp).phrase
        return f"heard something else {times}" + (f" (nearest: {nearest})" if nearest else "")


class Heard(Listening):
    """Was something said just now?

    Succeeds when it was heard lately, fails when not. It never runs, so that a mission can do something else until
    then; it is suspended while there is no sound.
    """

    word = "heard"
    instant = True
    phrases: Mapping[str, str] = argument("phrases", "what counts", called="phrase", principal=True)
    within: float = argument("duration", "how long ago still counts", default=LATELY, low=0.01, high=KEPT)

    def update(self) -> Status:
        now = self.run.now()
        words = self.heard(-math.inf)
        if words is not None and words.stamp >= now - self.within:
            return self.hear(words)
        return self.suspend("microphone") if self.deaf() else self.fail("not heard")
