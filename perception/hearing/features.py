"""Features of a decoding that distinguish a spoken phrase from other speech that was taken for it.

Beside the best path through the grammar there is one through a loop over all phones, which fits all speech. A phrase
that was really spoken fits nearly as well, phone by phone, leaves no loud sound beside its words, and has phones of
ordinary length. Scores are logarithms to the base 1.0001, in units of 2**10; frames last 10 ms.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from perception.hearing.lexicon import KIND_OF, edit_distance
from perception.hearing.sound import RATE, Clip, Floats, levels

DECODER_FRAME = RATE // 100
"""Samples per frame of the decoder."""

_SMOOTHING_FRAMES = 10  # frames over which silence that sounds is looked for


@dataclass(frozen=True, slots=True)
class Segment:
    """A section of sound and its label: first frame, number of frames, total score."""

    name: str
    start: int
    length: int
    score: float

    @property
    def frames(self) -> slice:
        """Frames of the section."""
        return slice(self.start, self.start + self.length)


@dataclass(frozen=True, slots=True)
class Decoding:
    """Result of the recogniser for a clip: the phrase, its words, and its phones as aligned with the sound.

    ``loop_phones`` are the phones recognised without a grammar, by a loop over all phones; ``frames`` is the number of
    frames (10 ms) of the clip.
    """

    phrase: str
    frames: int
    words: tuple[Segment, ...]
    aligned_phones: tuple[Segment, ...]
    loop_phones: tuple[Segment, ...]

    @classmethod
    def from_answer(cls, answer: Mapping[str, Any]) -> "Decoding | None":
        """Return the decoding in a reply of the worker; None if nothing was recognised or aligned."""
        if not answer.get("phrase") or not answer.get("aligned") or not answer.get("loop"):
            return None
        words, aligned, loop = (tuple(Segment(*each) for each in answer[key]) for key in ("words", "aligned", "loop"))
        if not any(segment.name in KIND_OF for segment in aligned):
            return None
        return cls(answer["phrase"], int(answer["frames"]), words, aligned, loop)


def acceptance_features(decoding: Decoding, clip: Clip) -> dict[str, float]:
    """Return the features of the recogniser's result for ``clip``, by name, for ``AcceptanceModel.score``."""
    phones = [segment for segment in decoding.aligned_phones if segment.name in KIND_OF]
    spoken = np.zeros(decoding.frames, bool)
    for segment in phones:
        spoken[segment.frames] = True
    loop = _frame_scores(decoding.loop_phones, decoding.frames)
    return {
        **_fit_features(decoding, phones, loop, spoken),
        **_length_features(phones, spoken),
        **_likeness_features(
            [each.name for each in phones], [each.name for each in decoding.loop_phones if each.name in KIND_OF]
        ),
        **_loudness_features(clip, spoken),
    }


def _frame_scores(segments: Iterable[Segment], frames: int) -> Floats:
    """Return the score of each of ``frames`` frames: the score of a segment is divided equally among its frames."""
    scores = np.zeros(frames)
    for segment in segments:
        scores[segment.frames] = segment.score / segment.length
    return scores


def _fit_features(decoding: Decoding, phones: Sequence[Segment], loop: Floats, spoken: Floats) -> dict[str, float]:
    """Return how much worse the phrase fits the sound than the loop over all phones.

    It is given in total, per phone, at the worst phone, and in silence, by the name of the feature. ``loop`` is the
    score of the loop in each frame, ``spoken`` tells which frames belong to the phrase.
    """
    goodness = np.array([each.score / each.length - float(np.mean(loop[each.frames])) for each in phones])
    difference = _frame_scores(decoding.aligned_phones, decoding.frames) - loop
    smooth = np.convolve(difference, np.full(_SMOOTHING_FRAMES, 1 / _SMOOTHING_FRAMES), "same")[: decoding.frames]
    silent = spoken == 0
    whole = sum(each.score for each in decoding.words) - sum(each.score for each in decoding.loop_phones)
    return {
        "ratio": whole / max(1.0, float(spoken.sum())),
        "goodness": float(np.average(goodness, weights=[each.length for each in phones])),
        "worst": float(goodness.min()),
        "worst two": float(np.sort(goodness)[:2].mean()),
        "uneven": float(goodness.std()),
        "silence": float(difference[silent].mean()) if silent.any() else 0.0,
        "worst silence": float(smooth[silent].min()) if silent.any() else 0.0,
        "clearness": float(loop[~silent].mean()) if spoken.any() else 0.0,
    }


def _length_features(phones: Sequence[Segment], spoken: Floats) -> dict[str, float]:
    """Return logarithms of the lengths of the phones, and the length of the pauses."""
    lengths = np.array([each.length for each in phones], float)
    where = np.flatnonzero(spoken)
    return {
        "phones": float(np.log(len(phones))),
        "shortest": float(np.log(lengths.min())),
        "middle": float(np.log(np.median(lengths))),
        "longest": float(np.log(lengths.max())),
        "stretched": float(np.log(lengths.max() / np.median(lengths))),
        "pauses": float(where[-1] - where[0] + 1 - len(where)) / 10 if len(where) else 0.0,
    }


def _likeness_features(phrase: Sequence[str], loop: Sequence[str]) -> dict[str, float]:
    """Return the edit distances between the phones of the phrase and the phones of ``loop``, per phone of the phrase.

    ``loop`` are the phones recognised without a grammar.
    """
    return {
        "changes": edit_distance(phrase, loop) / len(phrase),
        "changes of kind": edit_distance([KIND_OF[each] for each in phrase], [KIND_OF[each] for each in loop])
        / len(phrase),
        "surplus": abs(len(loop) - len(phrase)) / len(phrase),
    }


def _loudness_features(clip: Clip, spoken: Floats) -> dict[str, float]:
    """Return the level of the speech above the background (dB), and the share of loud sound that is inside the words.

    ``spoken`` tells which frames of the clip belong to words.
    """
    level = np.convolve(levels(clip.samples, DECODER_FRAME), np.full(5, 0.2), "same")[: len(spoken)]
    noise = levels(clip.noise, DECODER_FRAME)
    low = float(np.median(noise)) if len(noise) else float(level.min())
    high = float(np.percentile(level, 95))
    loud = level > low + max(5.0, 0.35 * (high - low))
    inside = spoken[: len(level)] > 0
    return {
        "above noise": high - low,
        "outside": float(np.log1p((loud & ~inside).sum())),
        "covered": float((loud & inside).sum() / max(1, loud.sum())),
    }
