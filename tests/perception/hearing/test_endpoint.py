"""Where somebody speaks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.hearing.sound import LEAD_TIME, RATE, TAIL_TIME, Clip, EndPointer, Samples, SpeechGate

LOUD = 3000.0


def room(seconds: float, loudness: float = 100.0, seed: int = 0) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    return np.random.default_rng(seed).standard_normal(round(seconds * RATE)) * loudness


def scene(*spoken: tuple[float, float], seconds: float, loudness: float = 100.0) -> Samples:
    """A room in which there is something loud from .. to."""
    sound = room(seconds, loudness)
    for start, end in spoken:
        sound[round(start * RATE) : round(end * RATE)] += room(end - start, LOUD, seed=1)
    return np.asarray(np.clip(sound, -32768, 32767), np.int16)


def cut(sound: Samples, *, piece: int = 320, start: float = 0.0) -> list[Clip]:
    pointer = EndPointer()
    return [
        clip
        for at in range(0, len(sound), piece)
        for clip in pointer.process(sound[at : at + piece], start + at / RATE)
    ]


def test_speech_is_cut_out_with_lead_and_tail() -> None:
    sound = scene((2.0, 2.8), seconds=5)
    (clip,) = cut(sound, start=100.0)
    assert clip.start == pytest.approx(102.0, abs=0.03)
    assert clip.end == pytest.approx(102.8, abs=0.03)
    assert clip.lead == pytest.approx(LEAD_TIME)
    assert len(clip.samples) / RATE == pytest.approx(LEAD_TIME + 0.8 + TAIL_TIME, abs=0.05)
    begin = round((clip.start - clip.lead - 100.0) * RATE)
    assert np.array_equal(clip.samples, sound[begin : begin + len(clip.samples)])
    assert len(clip.noise) > 0.3 * RATE
    assert np.abs(clip.noise).max() < LOUD / 2


@settings(max_examples=20)
@given(st.integers(50, 5000))
def test_how_the_sound_is_cut_into_pieces_changes_nothing(piece: int) -> None:
    sound = scene((1.0, 1.5), seconds=2.5)
    (expected,), (clip,) = cut(sound), cut(sound, piece=piece)
    assert clip.start == pytest.approx(expected.start)
    assert np.array_equal(clip.samples, expected.samples)
    assert np.array_equal(clip.noise, expected.noise)


def test_short_pause_is_included_and_long_pause_ends_the_clip() -> None:
    clips = cut(scene((1.0, 1.4), (1.8, 2.2), (3.2, 3.6), seconds=5))
    assert [(round(clip.start, 1), round(clip.end, 1)) for clip in clips] == [(1.0, 2.2), (3.2, 3.6)]


@pytest.mark.parametrize("loudness", [0.0, 3.0, 25.0, 1000.0])
def test_a_steady_room_is_no_speech_however_loud(loudness: float) -> None:
    assert cut(scene(seconds=20, loudness=loudness)) == []


def test_a_click_is_no_speech() -> None:
    assert cut(scene((1.0, 1.03), (3.0, 3.04), seconds=5)) == []


def test_lasting_noise_becomes_the_background() -> None:
    sound = scene((14.0, 14.6), seconds=17)
    sound[3 * RATE :] += np.asarray(room(14, 800, seed=2), np.int16)
    clips = cut(sound)
    assert (round(clips[-1].start, 1), round(clips[-1].end, 1)) == (14.0, 14.6)
    assert len(clips) <= 3
    assert all(clip.end - clip.start <= SpeechGate().longest + 0.1 for clip in clips)


def test_word_after_a_long_speech_is_detected() -> None:
    syllables = [(2.0 + 0.3 * each, 2.15 + 0.3 * each) for each in range(40)]
    clips = cut(scene(*syllables, (15.0, 15.5), seconds=17))
    assert (round(clips[-1].start, 1), round(clips[-1].end, 1)) == (15.0, 15.5)
    assert sum(clip.end - clip.start for clip in clips) > 11


def test_distant_voices_do_not_extend_the_clip() -> None:
    sound = scene((2.0, 2.6), seconds=4).astype(np.float64)
    sound[round(2.6 * RATE) :] += room(1.4, LOUD / 15, seed=3)
    (clip,) = cut(np.asarray(np.clip(sound, -32768, 32767), np.int16))
    assert clip.end == pytest.approx(2.6, abs=0.03)


def test_after_a_reset_the_beginning_is_forgotten_and_the_background_known() -> None:
    sound, pointer = scene((1.0, 3.0), (5.0, 5.5), seconds=7), EndPointer()
    assert pointer.process(sound[: 2 * RATE], 0.0) == []
    pointer.reset()
    (clip,) = pointer.process(sound[round(4.9 * RATE) :], 4.9)
    assert clip.start == pytest.approx(5.0, abs=0.03)
    assert clip.lead == pytest.approx(0.1, abs=0.03)
    assert len(clip.noise) > 0.3 * RATE
