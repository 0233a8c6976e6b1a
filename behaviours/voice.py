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
"""Regular expression of the emoticons of each mood."""
EMOJI = {
    Mood.HAPPY: "\u263a\U0001f600-\U0001f60a\U0001f642\U0001f643\U0001f929\U0001f970",
    Mood.SAD: "\u2639\U0001f61e\U0001f61f\U0001f622\U0001f625\U0001f62d\U0001f641",
    Mood.SURPRISED: "\U0001f62e\U0001f62f\U0001f632\U0001f633",
    Mood.ASLEEP: "\U0001f62a\U0001f634\U0001f4a4",
}
"""Emoji of each mood, as the characters of a regular expression's set."""

SMILEY = re.compile(
    r"\s*(?:(?<![\w/])(?:"
    + "|".join(f"(?P<{mood.name}>{signs})" for mood, signs in EMOTICONS.items())
    + r")(?!\w)|"
    + "|".join(f"(?P<{mood.name}_>[{signs}])\ufe0f?" for mood, signs in EMOJI.items())
    + ")"
)
"""Pattern of an emoticon or emoji with the space before it.

It does not match within "at 8:00", "a list:[1]" and addresses.
"""


def split_mood(text: str) -> tuple[str, Mood | None]:
    """Return ``text`` without its smileys, and the mood of the last one or None."""
    found = list(SMILEY.finditer(text))
    if not found:
        return text, None
    return SMILEY.sub("", text).strip(), Mood[str(found[-1].lastgroup).rstrip("_")]


PRIORITIES = tuple(each.name.lower() for each in Priority)
MIN_WORDS_PER_MINUTE, MAX_WORDS_PER_MINUTE = 80, 450
"""Range of speech rates that synthesisers support."""


class SpeechLeaf(Leaf):
    """Base class of leaves that play audio: RUNNING until playback ends, cancelled on halt.

    If the voice disconnects before the end, the leaf waits for it and repeats the audio once. A second interruption is
    a failure.
    """

    needs = frozenset({"voice"})
    drives = frozenset({"voice"})
    priority: str = "normal"
    _utterance: Utterance | None = None
    _again = False

    @abstractmethod
    def utter(self, priority: Priority) -> Utterance:
        """Start playback and return it."""

    @property
    @abstractmethod
    def activity(self) -> str:
        """Present activity of the leaf as text, such as the text that is being spoken, for its reason."""

    def initialise(self) -> None:
        self._again, self._utterance = False, None
        self._begin()

    def update(self) -> Status:
        utterance = self._utterance
        if utterance is None or not utterance.done():
            return self.wait(self.activity)
        if not utterance.cancelled:
            return SUCCESS
        if self._again:
            return self.fail("interrupted")
        self._begin()  # which raises NotConnected until the voice is back
        self._again = True
        return self.wait(self.activity)

    def _begin(self) -> None:
        self._utterance = self.utter(Priority[self.priority.upper()])

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS and self._utterance is not None:
            self._utterance.cancel()


class Say(SpeechLeaf):
    """Say a text.

    Running until it is spoken, then succeeds; a halt silences it. Speech with a higher priority starts at once, and the
    interrupted text is repeated from its beginning afterwards. The same holds for a voice that was unplugged. A second
    interruption is a failure. Smileys are not spoken: they set the mood of the face. The mouth moves with the words.
    """

    tag = "say"
    example = "- say: Hello"
    optional_parts = frozenset({"screen"})
    text: str = argument("text", "text to say", principal=True)
    voice: str | None = argument("text", "voice, such as en-us+f2; by default that of the robot file", default=None)
    speed: float | None = argument(
        "number",
        "words per minute; by default as in the robot file",
        default=None,
        low=MIN_WORDS_PER_MINUTE,
        high=MAX_WORDS_PER_MINUTE,
    )
    language: str | None = argument("text", "language, such as de; by default that of the robot file", default=None)
    priority: str = argument("choice", "priority over other speech", default="normal", choices=PRIORITIES)

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
    """Play a sound file.

    Running until it was played, then succeeds; a halt silences it. Fails if the file is not a sound. It takes turns
    with speech. If the voice is unplugged before the end, the sound is played once more.
    """

    tag = "play_sound"
    example = "- play_sound: bell.wav"
    sound: Path = argument("file", "file (.wav, .mp3, .flac or .ogg), relative to the mission's folder", principal=True)
    priority: str = argument("choice", "priority over other speech", default="normal", choices=PRIORITIES)

    def utter(self, priority: Priority) -> Utterance:
        return self.robot.voice.play(self.sound, priority)

    @property
    def activity(self) -> str:
        return f"playing {self.sound.name}"
