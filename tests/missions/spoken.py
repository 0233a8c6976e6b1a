"""Recordings of a synthesiser, over the noise of a quiet room."""

import wave
from pathlib import Path

import numpy as np

from tests.benchmarks.speaking import Speaking

RATE = 16_000


def record(path: Path, seconds: float, *spoken: tuple[float, str]) -> Path:
    """Write a WAV file in which each text begins at its time."""
    sound = np.random.default_rng(0).normal(0, 25, round(seconds * RATE))
    with Speaking() as speaking:
        for when, text in spoken:
            said = speaking.say(text, "en-us", 150)
            sound[round(when * RATE) : round(when * RATE) + len(said)] += said * 0.4
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes(np.clip(sound, -32768, 32767).astype("<i2").tobytes())
    return path
