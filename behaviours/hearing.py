"""Leaves that listen for phrases."""

import math
from collections.abc import Mapping, Sequence

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from perception.api import Words

MAX_LISTENING_DELAY = 1.0
"""Seconds that the speech recogniser may lag behind the sound; with more, the robot counts as deaf."""

DEFAULT_MAX_AGE = 3.0
"""Seconds for which a phrase counts as heard by default."""

MAX_AGE = 30.0
"""Seconds for which every implementation of ``perception.api.Hearing`` keeps recognised phrases."""


class HearingLeaf(Leaf):
    """Base class of leaves that wait for phrases, out of all the phrases that the mission listens for."""

    needs = frozenset({"microphone"})
    output_doc = "the phrase, as written in the mission"
    output_type = str
    phrases: Mapping[str, str]  # as the mission writes them, by how they are listened for

    def newest_phrase(self, since: float) -> Words | None:
        """Return the newest matching phrase that began at ``since`` (s, on the run's clock) or later, or None."""
        words = self.robot.hearing.words()
        return next((each for each in words if each.start >= since and each.phrase in self.phrases), None)

    def accept(self, words: Words) -> Status:
        """Store the phrase as the result and return SUCCESS."""
        self.result = self.phrases[words.phrase]
        self.feedback_message = f'heard "{words.phrase}"'
        return SUCCESS

    def deafness_reason(self) -> str:
        """Return why the robot hears nothing at all, or an empty text if it hears."""
        listened = self.robot.hearing.listened()
        there = listened is not None and self.run.now() - listened <= MAX_LISTENING_DELAY
        return "" if there else "no sound from the microphone, or no recogniser: see the notices"


class Listen(HearingLeaf):
    """Wait until a person says one of some phrases.

    Running until a phrase is heard, then succeeds; fails after `timeout`. Phrases that began before the leaf started do
    not count, and neither does the robot's own speech. The robot always listens for all phrases of the mission, in
    small letters: other words are refused, and phrases of other steps are ignored.
    """

    tag = "listen"
    example = '- listen: {for: ["yes", "no"], timeout: 10 s}\n  as: answer'
    phrases: Mapping[str, str] = argument("phrases", "phrases to wait for", name="for", principal=True)
    timeout: float | None = argument("duration", "maximum waiting time; no limit by default", default=None, low=0.1)

    def update(self) -> Status:
        words = self.newest_phrase(self.started_at)
        if words is not None:
            return self.accept(words)
        if self.timeout is not None and self.elapsed >= self.timeout:
            return self.fail(self.deafness_reason() or self._other_words() or "nothing heard")
        return self.wait(self.deafness_reason() or self._other_words() or "listening")

    def _other_words(self) -> str:
        """Return a text that says how often other words were heard since the start; empty if there were none."""
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
    """Check whether a phrase was said recently.

    Succeeds if the phrase was heard within the last `within` seconds, fails if not. It answers at once, so a mission
    can do other things in the meantime. It is suspended while there is no sound.
    """

    tag = "heard"
    example = "- heard: {phrase: stop, within: 2 s}"
    instant = True
    phrases: Mapping[str, str] = argument("phrases", "phrases that count", name="phrase", principal=True)
    within: float = argument(
        "duration", "maximum time since the phrase", default=DEFAULT_MAX_AGE, low=0.01, high=MAX_AGE
    )

    def update(self) -> Status:
        now = self.run.now()
        words = self.newest_phrase(-math.inf)
        if words is not None and words.stamp >= now - self.within:
            return self.accept(words)
        return self.suspend("microphone") if self.deafness_reason() else self.fail("not heard")
