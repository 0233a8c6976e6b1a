"""What the ears deal in: pieces of sound, and the levels of short frames of it."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

RATE = 16_000
"""Samples a second."""

FRAME = 320
"""Samples whose level is measured at a time: 20 ms."""

FULL = 20 * np.log10(32768.0)
"""dB by which the loudest square wave is above one of a single step: dBFS is a level less this."""

Samples = npt.NDArray[np.int16]
"""Sound: shape (n,), dtype int16, one channel, ``RATE`` samples a second."""

Floats = npt.NDArray[np.float64]


class Piece(Protocol):
    """A piece of sound from a microphone: ``drivers.api.Sound``."""

    @property
    def number(self) -> int:
        """Counts the pieces, so that a gap shows."""
        ...

    @property
    def stamp(self) -> float:
        """The time of its first sample."""
        ...

    @property
    def samples(self) -> Samples:
        """The sound itself."""
        ...

    @property
    def end(self) -> float:
        """The time at which it ends."""
        ...


def levels(samples: Samples | Floats, size: int = FRAME) -> Floats:
    """Return the level of each whole frame of ``size`` samples, in dB over one step; silence is 0."""
    whole = np.asarray(samples[: len(samples) // size * size], np.float64).reshape(-1, size)
    return np.asarray(10 * np.log10(np.mean(whole**2, axis=1) + 1.0), np.float64)


# Speech made clearer before it is recognised: a steady background is taken away, and the level made alike.
#
# A Wiener filter that estimates the speech in each frame by the decision-directed rule of Ephraim and Malah ("Speech
# enhancement using a minimum mean-square error short-time spectral amplitude estimator", 1984).

WINDOW, HOP = 512, 128
"""Samples of which a spectrum is taken, and how many later the next one: faded so, the pieces add up to a constant."""

TOO_MUCH = 1.5
"""By how much more than was measured is taken away: what is left of noise sounds like voices."""

FLOOR = 0.1
"""What is left of a frequency at least."""

MEMORY = 0.95
"""How much of the estimate comes from the frame before."""

LOUD = 66.0
"""dB to which the loud frames of a clip are brought."""

MAX_GAIN = 30.0
"""dB by which a clip is amplified at most."""


def clarified(samples: Samples, noise: Samples) -> Samples:
    """Return ``samples`` with less of the ``noise`` that was heard before them, and at the usual level."""
    sound = np.asarray(samples, np.float64)
    if len(noise) >= WINDOW:
        sound = filtered(sound, np.asarray(noise, np.float64))
    loud = float(np.percentile(levels(sound), 95)) if len(sound) >= RATE // 10 else LOUD
    return _whole(sound * 10 ** (min(LOUD - loud, MAX_GAIN) / 20))


def dithered(samples: Samples, deviation: float) -> Samples:
    """Return ``samples`` over noise of that standard deviation, in steps: no model of speech knows digital silence."""
    return _whole(samples + np.random.default_rng(0).standard_normal(len(samples)) * deviation)


def filtered(sound: Floats, noise: Floats) -> Floats:
    """Return ``sound``, as long as it is, without what is like ``noise`` (at least a window of it)."""
    spectra = np.fft.rfft(_windows(np.pad(sound, (WINDOW, 2 * WINDOW))))
    expected = TOO_MUCH * np.mean(np.abs(np.fft.rfft(_windows(noise))) ** 2, axis=0) + 1e-9
    ratios = np.abs(spectra) ** 2 / expected
    clean = np.zeros(ratios.shape[1])  # power of the speech in the frame before, in units of the noise
    for number, ratio in enumerate(ratios):
        before = MEMORY * clean + (1 - MEMORY) * np.maximum(ratio - 1, 0)
        gain = np.maximum(before / (1 + before), FLOOR)
        clean = gain**2 * ratio
        spectra[number] *= gain
    return _added(np.fft.irfft(spectra, WINDOW))[WINDOW : WINDOW + len(sound)]


def _whole(sound: Floats) -> Samples:
    """Return a sound in whole steps of 16 bits."""
    return np.asarray(np.clip(np.rint(sound), -32768, 32767), np.int16)


def _windows(sound: Floats) -> Floats:
    """Return the overlapping pieces of a sound, faded in and out: shape (n, WINDOW)."""
    pieces = np.lib.stride_tricks.sliding_window_view(sound, WINDOW)[::HOP]
    return np.asarray(pieces * _fade(), np.float64)


def _added(pieces: Floats) -> Floats:
    """Lay faded pieces over each other: the sound that they are of, but for its first and last window."""
    sound = np.zeros((len(pieces) - 1) * HOP + WINDOW)
    for number, piece in enumerate(pieces):
        sound[number * HOP : number * HOP + WINDOW] += piece
    return sound / (np.sum(_fade()) / HOP)


def _fade() -> Floats:
    """The Hann window, of which overlapping copies add up to a constant."""
    return np.hanning(WINDOW + 1)[:-1]
