"""What the ears deal in: pieces of sound, and the levels of short frames of it."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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


# Where in an endless sound somebody speaks: by its level over that of the background.

LEAD = 0.3
"""Seconds of sound before the speech that are kept with it: weak beginnings such as f and h."""

TAIL = 0.3
"""Seconds after it that are kept."""

QUIETEST = 20.0
"""dB over one step below which no background counts: the hiss after digital silence is no speech."""


@dataclass(frozen=True, slots=True)
class Gate:
    """What counts as speech. Levels in dB, times in seconds.

    It is ``rise`` over the background, and ``drop`` at most below the loudest frame of what is being said. It has
    ended when that was so for ``pause``, or has gone on for ``longest``. Less than ``shortest`` of it is a click.
    """

    rise: float = 6.0
    drop: float = 20.0
    pause: float = 0.5
    shortest: float = 0.08
    longest: float = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """What somebody said, cut out: ``start`` and ``end`` of the speech, on the clock of the microphone.

    ``samples`` begin ``lead`` seconds before ``start``. ``noise`` is the background from before, perhaps empty.
    """

    start: float
    end: float
    lead: float
    samples: Samples
    noise: Samples


class EndPointer:
    """Cuts an endless sound into clips. For one thread."""

    def __init__(self, gate: Gate = Gate()) -> None:
        self._gate = gate
        self._rest = np.zeros(0, np.int16)  # less than a frame
        self._background: deque[float] = deque(maxlen=100)  # levels of the last 2 s without speech
        self._quiet: deque[Samples] = deque(maxlen=40)  # the last 0.8 s without speech
        self._before: deque[Samples] = deque(maxlen=_frames(LEAD))
        self._said: list[Samples] = []
        self._loud: list[bool] = []
        self._peak = 0.0
        self._lead = 0

    def reset(self) -> None:
        """Forget what is being said: sound is missing now. What the background is like stays known."""
        self._rest = np.zeros(0, np.int16)
        self._before.clear()
        self._said, self._loud = [], []

    def take(self, samples: Samples, stamp: float) -> list[Clip]:
        """Take the next sound, whose first sample is of the time ``stamp``; return the clips that end in it."""
        stamp -= len(self._rest) / RATE
        sound = np.concatenate([self._rest, samples])
        found = []
        for number, level in enumerate(levels(sound)):
            frame = sound[number * FRAME : (number + 1) * FRAME]
            clip = self._next(frame, float(level), stamp + (number + 1) * FRAME / RATE)
            if clip is not None:
                found.append(clip)
        self._rest = sound[len(sound) // FRAME * FRAME :]
        return found

    def _next(self, frame: Samples, level: float, now: float) -> Clip | None:
        """Take one frame that ends ``now``; return the clip that it ends."""
        gate = self._gate
        loud = level > max(QUIETEST, float(np.median(self._background or [level]))) + gate.rise
        if not self._said:
            if loud:
                self._said, self._loud, self._peak = [*self._before, frame], [True], level
                self._lead = len(self._before)
            else:
                self._rests(frame, level)
            return None
        self._peak = max(self._peak, level)
        self._said.append(frame)
        self._loud.append(loud and level > self._peak - gate.drop)
        if len(self._loud) >= _frames(gate.longest):
            return self._cut(now)
        return self._cut(now) if not any(self._loud[-_frames(gate.pause) :]) else None

    def _rests(self, frame: Samples, level: float) -> None:
        self._background.append(level)
        self._quiet.append(frame)
        self._before.append(frame)

    def _cut(self, now: float) -> Clip | None:
        """End what is being said; what follows its tail is background again."""
        said, loud, self._said, self._loud = self._said, self._loud, [], []
        spoken = len(loud) - loud[::-1].index(True)
        endless = len(loud) >= _frames(self._gate.longest)
        kept = min(self._lead + spoken + _frames(TAIL), len(said))
        noise = list(self._quiet)[:-8]  # 0.16 s before the first loud frame something may be heard already
        self._before.clear()
        for frame, level in _steady(said[self._lead :], self._gate.rise) if endless else _measured(said[kept:]):
            self._rests(frame, level)
        if sum(loud) < _frames(self._gate.shortest):
            return None
        start = now - len(loud) * FRAME / RATE
        return Clip(
            start=start,
            end=start + spoken * FRAME / RATE,
            lead=self._lead * FRAME / RATE,
            samples=np.concatenate(said[:kept]),
            noise=np.concatenate(noise) if noise else np.zeros(0, np.int16),
        )


def _measured(frames: Sequence[Samples]) -> Iterator[tuple[Samples, float]]:
    """Yield each frame with its level."""
    return ((frame, float(levels(frame)[0])) for frame in frames)


def _steady(frames: Sequence[Samples], rise: float) -> list[tuple[Samples, float]]:
    """Return the quiet ones of many frames, with their levels: all of a fan that was switched on, pauses of speech."""
    found = list(_measured(frames))
    low = float(np.percentile([level for _, level in found], 20))
    return [(frame, level) for frame, level in found if level <= low + rise]


def _frames(seconds: float) -> int:
    """Return how many frames that is."""
    return round(seconds * RATE / FRAME)
