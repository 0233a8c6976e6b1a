"""Speech made clearer."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.hearing.sound import (
    RATE,
    TARGET_LEVEL,
    WINDOW_SAMPLES,
    Floats,
    Samples,
    add_noise,
    enhance_speech,
    levels,
    wiener_filter,
)


def hiss(count: int, loudness: float, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).standard_normal(count) * loudness


def words(seconds: float = 1.0, loudness: float = 2000.0) -> Floats:
    """Something like a voice: tones that come and go."""
    time = np.arange(round(seconds * RATE)) / RATE
    tones = sum(np.sin(2 * np.pi * pitch * time) for pitch in (150, 300, 450, 1200))
    return np.asarray(loudness * tones * (np.sin(2 * np.pi * 2 * time) > 0), np.float64)


def power(sound: Floats) -> float:
    return float(np.mean(sound**2))


@pytest.mark.parametrize("loudness", [100.0, 300.0, 1000.0])
def test_noise_becomes_much_weaker_and_speech_hardly(loudness: float) -> None:
    speech = words()
    noisy = speech + hiss(len(speech), loudness)
    clean = wiener_filter(noisy, hiss(RATE // 2, loudness, seed=1))
    assert len(clean) == len(noisy)
    silent = np.flatnonzero(speech == 0)
    assert power(clean[silent]) < 0.1 * power(noisy[silent])
    assert power(clean - speech) < power(noisy - speech)


@given(st.integers(1, 4000))
def test_sound_without_noise_is_unchanged(count: int) -> None:
    sound = hiss(count, 1000.0)
    assert np.allclose(wiener_filter(sound, np.zeros(WINDOW_SAMPLES)), sound, atol=1.0)


@pytest.mark.parametrize("gain", [0.02, 0.1, 1.0, 5.0])
def test_how_loud_the_microphone_is_changes_little(gain: float) -> None:
    sound = enhance_speech(np.asarray(words() * gain, np.int16), np.zeros(0, np.int16))
    assert np.percentile(levels(sound), 95) == pytest.approx(TARGET_LEVEL, abs=1.5)


@given(st.integers(0, 3000), st.integers(0, 3000))
def test_any_sound_before_any_noise_stays_a_sound(count: int, before: int) -> None:
    sound: Samples = np.asarray(hiss(count, 9000.0), np.int16)
    clear = enhance_speech(sound, np.asarray(hiss(before, 50.0), np.int16))
    assert clear.dtype == np.int16
    assert clear.shape == sound.shape


def test_digital_silence_gets_the_requested_noise() -> None:
    clear = add_noise(enhance_speech(np.zeros(RATE, np.int16), np.zeros(RATE // 2, np.int16)), 40.0)
    assert clear.dtype == np.int16
    assert np.std(clear) == pytest.approx(40, rel=0.1)


def test_equal_clips_give_equal_sound() -> None:
    sound, noise = np.asarray(words(), np.int16), np.asarray(hiss(RATE, 30.0), np.int16)
    one, other = (add_noise(enhance_speech(sound, noise), 40.0) for _ in range(2))
    assert np.array_equal(one, other)
