"""What the ears deal in: pieces of sound, and the levels of short frames of it."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

RATE = 16_000
"""Samples a second."""

FRAME_SAMPLES = 320
"""Samples whose level is measured at a time: 20 ms."""

FULL_SCALE_LEVEL = 20 * np.log10(32768.0)
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


def levels(samples: Samples | Floats, size: int = FRAME_SAMPLES) -> Floats:
    """Return the level of each whole frame of ``size`` samples, in dB over one step; silence is 0."""
    whole = np.asarray(samples[: len(samples) // size * size], np.float64).reshape(-1, size)
    return np.asarray(10 * np.log10(np.mean(whole**2, axis=1) + 1.0), np.float64)


# Speech made clearer before it is recognised: a steady background is taken away, and the level made alike.
#
# A Wiener filter that estimates the speech in each frame by the decision-directed rule of Ephraim and Malah ("Speech
# enhancement using a minimum mean-square error short-time spectral amplitude estimator", 1984).

WINDOW_SAMPLES, HOP_SAMPLES = 512, 128
"""Samples of which a spectrum is taken, and how many later the next one: faded so, the pieces add up to a constant."""

OVERSUBTRACTION = 1.5
"""By how much more than was measured is taken away: what is left of noise sounds like voices."""

MIN_GAIN = 0.1
"""What is left of a frequency at least."""

SMOOTHING = 0.95
"""How much of the estimate comes from the frame before."""

TARGET_LEVEL = 66.0
"""dB to which the loud frames of a clip are brought."""

MAX_AMPLIFICATION = 30.0
"""dB by which a clip is amplified at most."""


def enhance_speech(samples: Samples, noise: Samples) -> Samples:
    """Return ``samples`` with less of the ``noise`` that was heard before them, and at the usual level."""
    sound = np.asarray(samples, np.float64)
    if len(noise) >= WINDOW_SAMPLES:
        sound = wiener_filter(sound, np.asarray(noise, np.float64))
    loud = float(np.percentile(levels(sound), 95)) if len(sound) >= RATE // 10 else TARGET_LEVEL
    return _to_int16(sound * 10 ** (min(TARGET_LEVEL - loud, MAX_AMPLIFICATION) / 20))


def add_noise(samples: Samples, deviation: float) -> Samples:
    """Return ``samples`` over noise of that standard deviation, in steps: no model of speech knows digital silence."""
    return _to_int16(samples + np.random.default_rng(0).standard_normal(len(samples)) * deviation)


def wiener_filter(sound: Floats, noise: Floats) -> Floats:
    """Return ``sound``, as long as it is, without what is like ``noise`` (at least a window of it)."""
    spectra = np.fft.rfft(_windowed_pieces(np.pad(sound, (WINDOW_SAMPLES, 2 * WINDOW_SAMPLES))))
    expected = OVERSUBTRACTION * np.mean(np.abs(np.fft.rfft(_windowed_pieces(noise))) ** 2, axis=0) + 1e-9
    ratios = np.abs(spectra) ** 2 / expected
    clean = np.zeros(ratios.shape[1])  # power of the speech in the frame before, in units of the noise
    for number, ratio in enumerate(ratios):
        before = SMOOTHING * clean + (1 - SMOOTHING) * np.maximum(ratio - 1, 0)
        gain = np.maximum(before / (1 + before), MIN_GAIN)
        clean = gain**2 * ratio
        spectra[number] *= gain
    return _overlap_add(np.fft.irfft(spectra, WINDOW_SAMPLES))[WINDOW_SAMPLES : WINDOW_SAMPLES + len(sound)]


def _to_int16(sound: Floats) -> Samples:
    """Return a sound in whole steps of 16 bits."""
    return np.asarray(np.clip(np.rint(sound), -32768, 32767), np.int16)


def _windowed_pieces(sound: Floats) -> Floats:
    """Return the overlapping pieces of a sound, faded in and out: shape (n, WINDOW)."""
    pieces = np.lib.stride_tricks.sliding_window_view(sound, WINDOW_SAMPLES)[::HOP_SAMPLES]
    return np.asarray(pieces * _hann_window(), np.float64)


def _overlap_add(pieces: Floats) -> Floats:
    """Lay faded pieces over each other: the sound that they are of, but for its first and last window."""
    sound = np.zeros((len(pieces) - 1) * HOP_SAMPLES + WINDOW_SAMPLES)
    for number, piece in enumerate(pieces):
        sound[number * HOP_SAMPLES : number * HOP_SAMPLES + WINDOW_SAMPLES] += piece
    return sound / (np.sum(_hann_window()) / HOP_SAMPLES)


def _hann_window() -> Floats:
    """The Hann window, of which overlapping copies add up to a constant."""
    return np.hanning(WINDOW_SAMPLES + 1)[:-1]


# Where in an endless sound somebody speaks: by its level over that of the background.

LEAD_TIME = 0.3
"""Seconds of sound before the speech that are kept with it: weak beginnings such as f and h."""

TAIL_TIME = 0.3
"""Seconds after it that are kept."""

MIN_BACKGROUND_LEVEL = 20.0
"""dB over one step below which no background counts: the hiss after digital silence is no speech."""


@dataclass(frozen=True, slots=True)
class SpeechGate:
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

    def __init__(self, gate: SpeechGate = SpeechGate()) -> None:
        self._gate = gate
        self._partial_frame = np.zeros(0, np.int16)  # less than a frame
        self._background_levels: deque[float] = deque(maxlen=100)  # levels of the last 2 s without speech
        self._quiet_frames: deque[Samples] = deque(maxlen=40)  # the last 0.8 s without speech
        self._lead_frames: deque[Samples] = deque(maxlen=_frame_count(LEAD_TIME))
        self._speech_frames: list[Samples] = []
        self._loud_flags: list[bool] = []
        self._peak = 0.0
        self._lead_count = 0

    def reset(self) -> None:
        """Forget what is being said: sound is missing now. What the background is like stays known."""
        self._partial_frame = np.zeros(0, np.int16)
        self._lead_frames.clear()
        self._speech_frames, self._loud_flags = [], []

    def process(self, samples: Samples, stamp: float) -> list[Clip]:
        """Take the next sound, whose first sample is of the time ``stamp``; return the clips that end in it."""
        stamp -= len(self._partial_frame) / RATE
        sound = np.concatenate([self._partial_frame, samples])
        found = []
        for number, level in enumerate(levels(sound)):
            frame = sound[number * FRAME_SAMPLES : (number + 1) * FRAME_SAMPLES]
            clip = self._process_frame(frame, float(level), stamp + (number + 1) * FRAME_SAMPLES / RATE)
            if clip is not None:
                found.append(clip)
        self._partial_frame = sound[len(sound) // FRAME_SAMPLES * FRAME_SAMPLES :]
        return found

    def _process_frame(self, frame: Samples, level: float, now: float) -> Clip | None:
        """Take one frame that ends ``now``; return the clip that it ends."""
        gate = self._gate
        loud = level > max(MIN_BACKGROUND_LEVEL, float(np.median(self._background_levels or [level]))) + gate.rise
        if not self._speech_frames:
            if loud:
                self._speech_frames, self._loud_flags, self._peak = [*self._lead_frames, frame], [True], level
                self._lead_count = len(self._lead_frames)
            else:
                self._add_background(frame, level)
            return None
        self._peak = max(self._peak, level)
        self._speech_frames.append(frame)
        self._loud_flags.append(loud and level > self._peak - gate.drop)
        if len(self._loud_flags) >= _frame_count(gate.longest):
            return self._end_clip(now)
        return self._end_clip(now) if not any(self._loud_flags[-_frame_count(gate.pause) :]) else None

    def _add_background(self, frame: Samples, level: float) -> None:
        self._background_levels.append(level)
        self._quiet_frames.append(frame)
        self._lead_frames.append(frame)

    def _end_clip(self, now: float) -> Clip | None:
        """End what is being said; what follows its tail is background again."""
        said, loud, self._speech_frames, self._loud_flags = self._speech_frames, self._loud_flags, [], []
        spoken = len(loud) - loud[::-1].index(True)
        endless = len(loud) >= _frame_count(self._gate.longest)
        kept = min(self._lead_count + spoken + _frame_count(TAIL_TIME), len(said))
        noise = list(self._quiet_frames)[:-8]  # 0.16 s before the first loud frame something may be heard already
        self._lead_frames.clear()
        for frame, level in (
            _select_quiet_frames(said[self._lead_count :], self._gate.rise) if endless else _with_levels(said[kept:])
        ):
            self._add_background(frame, level)
        if sum(loud) < _frame_count(self._gate.shortest):
            return None
        start = now - len(loud) * FRAME_SAMPLES / RATE
        return Clip(
            start=start,
            end=start + spoken * FRAME_SAMPLES / RATE,
            lead=self._lead_count * FRAME_SAMPLES / RATE,
            samples=np.concatenate(said[:kept]),
            noise=np.concatenate(noise) if noise else np.zeros(0, np.int16),
        )


def _with_levels(frames: Sequence[Samples]) -> Iterator[tuple[Samples, float]]:
    """Yield each frame with its level."""
    return ((frame, float(levels(frame)[0])) for frame in frames)


def _select_quiet_frames(frames: Sequence[Samples], rise: float) -> list[tuple[Samples, float]]:
    """Return the quiet ones of many frames, with their levels: all of a fan that was switched on, pauses of speech."""
    found = list(_with_levels(frames))
    low = float(np.percentile([level for _, level in found], 20))
    return [(frame, level) for frame, level in found if level <= low + rise]


def _frame_count(seconds: float) -> int:
    """Return how many frames that is."""
    return round(seconds * RATE / FRAME_SAMPLES)
