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
