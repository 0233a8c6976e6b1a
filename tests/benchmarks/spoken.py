"""What the ears are taught and tried with: synthetic speech in a background, on and on, and what was said when.

Voices, phrases, sentences and babble of the examples to learn from are others than those of the trial.
"""

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

RATE = 16_000
LEVEL = 2000.0
"""Root mean square, in steps, of the loud parts of everything said: so that 10 dB are 10 dB for every word."""

HISS = 25.0
"""Standard deviation, in steps, of the noise of the microphone itself."""

RATIO = 10.0
"""dB by which speech is louder than a background."""

GAP = (1.0, 1.6)
"""Seconds between what is said, from .. to."""

BACKGROUNDS = ("clean", "pink", "white", "babble")
SPEEDS = (130, 160, 195)
"""Words a minute."""

Samples = npt.NDArray[np.int16]
Floats = npt.NDArray[np.float64]
Say = Callable[[str, str, int], Samples]
"""Speak: a text, in a voice, at a speed in words a minute; 16 kHz."""


@dataclass(frozen=True, slots=True)
class Said:
    """Something said: when, and which phrase it was; "" when it was none of them."""

    start: float
    end: float
    text: str
    phrase: str


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """A long sound in which one ``voice`` says one thing after another, while ``phrases`` are listened for."""

    key: str
    background: str
    voice: str
    phrases: tuple[str, ...]
    samples: Samples
    said: tuple[Said, ...]


@dataclass(frozen=True, slots=True)
class Material:
    """Who says what: ``others`` are sentences beside the phrases of ``grammars``; ``babble`` is for the background."""

    name: str
    voices: tuple[str, ...]
    grammars: tuple[tuple[str, ...], ...]
    others: tuple[str, ...]
    babble: str
    seed: int
    speeds: int = len(SPEEDS)
    sentences: int = 1
    share: int = 1

    def streams(self, say: Say, done: Container[str] = ()) -> Iterator[Stream]:
        """Yield the streams whose key is not ``done``: each voice before each background, with one grammar.

        The phrases are said at ``speeds`` of the speeds, in turn by the voice, and each ``sentences``-th of the others
        at one. Of all streams, each ``share``-th is made.
        """
        choices = product(enumerate(BACKGROUNDS), enumerate(self.voices), enumerate(self.grammars))
        for (one, background), (two, voice), (three, phrases) in choices:
            key = f"{self.name}/{background}/{voice}/{three}"
            if (one + two + three) % self.share == 0 and key not in done:
                turns = product(range(self.speeds), phrases)
                texts = [(text, SPEEDS[(two + turn) % len(SPEEDS)], text) for turn, text in turns]
                for turn, text in enumerate(self.others):
                    if (turn + two + three) % self.sentences == 0:
                        texts.append((text, SPEEDS[(two + turn) % len(SPEEDS)], ""))
                yield self._stream(say, key, background, voice, phrases, texts)

    def _stream(
        self,
        say: Say,
        key: str,
        background: str,
        voice: str,
        phrases: tuple[str, ...],
        texts: list[tuple[str, int, str]],
    ) -> Stream:
        rng = np.random.default_rng([self.seed, *key.encode()])
        rng.shuffle(texts)
        parts: list[Floats] = [np.zeros(2 * RATE)]
        said: list[Said] = []
        for text, speed, phrase in texts:
            sound = levelled(trimmed(say(text, voice, speed)))
            start = sum(map(len, parts)) / RATE
            said.append(Said(start, start + len(sound) / RATE, text, phrase))
            parts += [sound, np.zeros(int(rng.uniform(*GAP) * RATE))]
        sound = np.concatenate(parts)
        sound += rng.standard_normal(len(sound)) * HISS
        if background != "clean":
            talk = [say(self.babble, each, 140 + 10 * place) for place, each in enumerate(self.voices[:6])]
            sound += noise(background, len(sound), rng, talk) * LEVEL * 10 ** (-RATIO / 20)
        whole = np.asarray(np.clip(sound, -32768, 32767), np.int16)
        return Stream(key, background, voice, phrases, whole, tuple(said))


def trimmed(sound: Samples) -> Floats:
    """Return a sound without the silence at its ends."""
    loud = np.flatnonzero(np.abs(sound) > 0.02 * np.abs(sound).max())
    return np.asarray(sound[loud[0] : loud[-1] + 1], np.float64)


def levelled(sound: Floats) -> Floats:
    """Return a sound whose loud parts have the level of all."""
    loud = sound[np.abs(sound) > 0.02 * np.abs(sound).max()]
    return np.asarray(sound * LEVEL / np.sqrt(np.mean(loud**2)), np.float64)


def noise(kind: str, count: int, rng: np.random.Generator, talk: Sequence[Samples]) -> Floats:
    """Return a background of root mean square 1: white, pink (power falls with frequency), or voices at once."""
    if kind == "white":
        found = rng.standard_normal(count)
    elif kind == "pink":
        size = 1 << count.bit_length()
        spectrum = np.fft.rfft(rng.standard_normal(size))
        spectrum[1:] /= np.sqrt(np.maximum(np.fft.rfftfreq(size, 1 / RATE)[1:], 20))
        spectrum[0] = 0
        found = np.fft.irfft(spectrum, size)[:count]
    else:
        turned = (np.resize(np.roll(levelled(trimmed(each)), -rng.integers(len(each))), count) for each in talk)
        found = np.sum(list(turned), axis=0)
    return np.asarray(found / np.sqrt(np.mean(found**2)), np.float64)


LESSON = Material(
    name="lesson",
    voices=(
        "en-us+m1", "en+m2", "en-us+m4", "en+m5", "en-us+f1", "en+f5", "en-us+Annie", "en+Alicia", "en-us+steph",
        "en+Michael",
    ),
    grammars=(
        ("okay", "never", "come here", "good morning", "go back", "turn right", "dance"),
        ("sure", "cancel", "faster", "follow me", "what time is it", "red", "good night robot"),
        ("left", "right", "wait", "hi there", "look at me", "pick it up", "seven"),
    ),
    others=(
        "the weather is nice today", "where did you put my keys", "i would like a cup of coffee",
        "she went to school", "can you see the cat", "have a look at this book", "dinner is ready", "nobody knows",
        "my brother plays football", "please open the window", "it is raining again", "did you call your mother",
        "the train was late this morning", "monday", "maybe later", "i am tired", "what a lovely garden",
        "turn the radio down", "he never comes home early", "we should buy some bread", "give that to your sister",
        "watch out", "the battery is almost empty", "over there", "how much does it cost", "two plus two is four",
        "water", "that is not funny", "look at all those people", "the children are asleep upstairs",
        "some more cheese", "i lost my phone", "read me a story", "bananas", "this picture is upside down",
        "close the door behind you", "they moved the table to the kitchen", "who was that", "is anybody home",
        "quickly",
    ),
    babble="the committee met on tuesday to discuss the budget and the new road which many residents had asked for "
    "over several years",
    seed=1,
    speeds=1,
    sentences=3,
    share=2,
)  # fmt: skip

COMMANDS = ("yes", "no", "stop", "hello robot", "thank you", "go forward", "turn left")

_SENTENCES = (
    "the dog wants to go for a walk", "what shall we eat tonight", "i think the lamp is broken", "tomorrow",
    "put the glass on the shelf", "my father works in the city", "it was a long day", "do you like music",
    "the news starts at eight", "somebody is at the door", "let us watch a film", "orange juice",
    "grandma is coming on sunday", "the red car is very fast", "where are my shoes", "happy birthday",
    "we need more milk and eggs", "he broke his arm last summer", "sing a song", "that sounds wonderful",
    "there is a spider on the wall", "computer", "please be quiet", "i have to leave in ten minutes",
    "the bottle fell under the sofa", "how old are you", "never mind", "the fridge makes a strange noise",
    "close your eyes", "our neighbours have a new baby", "lights", "she wrote a letter to her friend",
    "can i have the salt", "it is too warm in here", "later", "this chair is not comfortable", "the shop is closed",
    "what did you say", "breakfast", "he could not find the right answer",
)  # fmt: skip

_RIVER = (
    "when the rain had stopped the children ran down to the river and threw small stones into the brown water "
    "until evening came"
)

TRIAL = Material(
    name="trial",
    voices=(
        "en-us", "en", "en-us+f2", "en+m3", "en-us+f4", "en-us+m7", "en-gb-x-rp+f3", "en-us+Andy", "en+linda",
        "en-gb-scotland+m6",
    ),
    grammars=(COMMANDS,),
    others=_SENTENCES,
    babble=_RIVER,
    seed=2,
)  # fmt: skip

STRANGERS = Material(
    name="strangers",
    voices=(
        "en-us+m8", "en+adam", "en-us+belinda", "en+grandma", "en-us+paul", "en+john", "en-us-nyc",
        "en-gb-x-gbclan+edward", "en-gb-x-gbcwmd+shelby", "en-us+quincy",
    ),
    grammars=(COMMANDS,),
    others=_SENTENCES,
    babble=_RIVER,
    seed=3,
)  # fmt: skip
"""The trial once more, with voices in which nothing had been tried before its figures were written down."""
