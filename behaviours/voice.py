"""Leaves that speak and play sounds."""

import re
from abc import abstractmethod
from pathlib import Path

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Mood, Priority, SpeechStyle, Utterance

EMOTICONS = {
    Mood.HAPPY: r"[:;=]-?[)\]D]+",
    Mood.SAD: r"[:=]'?-?[(\[]+",
    Mood.SURPRISED: r"[:=]-?[Oo]",
}
EMOJI = {
    Mood.HAPPY: "\u263a\U0001f600-\U0001f60a\U0001f642\U0001f643\U0001f929\U0001f970",
    Mood.SAD: "\u2639\U0001f61e\U0001f61f\U0001f622\U0001f625\U0001f62d\U0001f641",
    Mood.SURPRISED: "\U0001f62e\U0001f62f\U0001f632\U0001f633",
    Mood.ASLEEP: "\U0001f62a\U0001f634\U0001f4a4",
}
"""The signs of each mood, as patterns and as sets of letters."""

SMILEY = re.compile(
    r"\s*(?:(?<![\w/])(?:"
    + "|".join(f"(?P<{mood.name}>{signs})" for mood, signs in EMOTICONS.items())
    + r")(?!\w)|"
    + "|".join(f"(?P<{mood.name}_>[{signs}])\ufe0f?" for mood, signs in EMOJI.items())
    + ")"
)
"""One of them, with the space before it. In "at 8:00", "a list:[1]" and addresses there are none."""


def split_mood(text: str) -> tuple[str, Mood | None]:
    """Return ``text`` without its smileys, and the mood of the last one; None where there is none."""
    found = list(SMILEY.finditer(text))
    if not found:
        return text, None
    return SMILEY.sub("", text).strip(), Mood[str(found[-1].lastgroup).rstrip("_")]


PRIORITIES = tuple(each.name.lower() for each in Priority)
MIN_WORDS_PER_MINUTE, MAX_WORDS_PER_MINUTE = 80, 450
"""Words a minute that synthesisers can speak."""


class SpeechLeaf(Leaf):
    """Something that is heard: running until it was, silent when it is halted.

    Where the voice has gone before the end, it is waited for, and all of it is heard once more; what is broken off
    again fails.
    """

    needs = frozenset({"voice"})
    drives = frozenset({"voice"})
    priority: str = "normal"
    _utterance: Utterance | None = None
    _again = False

    @abstractmethod
    def utter(self, priority: Priority) -> Utterance:
        """Begin."""

    @property
    @abstractmethod
    def activity(self) -> str:
        """What it does, in words."""

    def initialise(self) -> None:
        self._again, self._utterance = False, None
        self._begin()

    def update(self) -> Status:
        said = self._utterance
        if said is None or not said.done():
            return self.wait(self.activity)
        if not said.cancelled:
            return SUCCESS
        if self._again:
            return self.fail("broken off")
        self._begin()  # which raises NotConnected until the voice is back
        self._again = True
        return self.wait(self.activity)

    def _begin(self) -> None:
        self._utterance = self.utter(Priority[self.priority.upper()])

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS and self._utterance is not None:
            self._utterance.cancel()


class Say(SpeechLeaf):
    """Speak.

    Running until it is spoken, then succeeds. Falls silent when it is halted. What has a higher priority is heard at
    once; what it breaks off is said again from its beginning afterwards, and so is what a voice that was unplugged has
    broken off; the second time that fails. A smiley in the text is not spoken: it sets the mood of the face. The mouth
    moves with the words.
    """

    tag = "say"
    optional_parts = frozenset({"screen"})
    text: str = argument("text", "what to say", principal=True)
    voice: str | None = argument("text", "whose voice, such as en-us+f2; else as the robot file says", default=None)
    speed: float | None = argument(
        "number",
        "words per minute; else as the robot file says",
        default=None,
        low=MIN_WORDS_PER_MINUTE,
        high=MAX_WORDS_PER_MINUTE,
    )
    language: str | None = argument("text", "such as de; else as the robot file says", default=None)
    priority: str = argument("choice", "what it goes before", default="normal", choices=PRIORITIES)

    def utter(self, priority: Priority) -> Utterance:
        manner = SpeechStyle(self.voice or "", self.speed or 0.0, self.language or "")
        words, mood = split_mood(self.text)
        if mood is not None and self.robot.screen_part is not None:
            self.robot.screen.mood(mood)
        return self.robot.voice.say(words, manner, priority)

    @property
    def activity(self) -> str:
        return f'saying "{self.text}"'


class PlaySound(SpeechLeaf):
    """Play a sound.

    Running until it was heard, then succeeds; fails when the file is no sound. Silent when it is halted. It takes turns
    with what is said, and is heard once more where the voice was unplugged before its end.
    """

    tag = "play_sound"
    sound: Path = argument("file", "a .wav, .mp3, .flac or .ogg; from the folder of the mission", principal=True)
    priority: str = argument("choice", "what it goes before", default="normal", choices=PRIORITIES)

    def utter(self, priority: Priority) -> Utterance:
        return self.robot.voice.play(self.sound, priority)

    @property
    def activity(self) -> str:
        return f"playing {self.sound.name}"
