"""Processing of sound: levels, noise removal, and cutting of speech into clips."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

RATE = 16_000
"""Samples per second."""

FRAME_SAMPLES = 320
"""Samples per level measurement: 20 ms."""

FULL_SCALE_LEVEL = 20 * np.log10(32768.0)
"""Level of a full-scale square wave in dB, relative to a square wave of amplitude 1 (full scale is 32768).

All levels in dB of this module are relative to amplitude 1. A level in dBFS is this constant less.
"""

Samples = npt.NDArray[np.int16]
"""Sound: shape (n,), dtype int16, one channel, ``RATE`` samples per second."""

Floats = npt.NDArray[np.float64]


class Piece(Protocol):
    """A piece of sound from a microphone: see ``drivers.api.Sound``."""

    @property
    def number(self) -> int:
        """Sequence number, so that gaps are visible."""
        ...

    @property
    def stamp(self) -> float:
        """Time of the first sample."""
        ...

    @property
    def samples(self) -> Samples:
        """The samples."""
        ...

    @property
    def end(self) -> float:
        """Time of the end of the piece."""
        ...


def levels(samples: Samples | Floats, size: int = FRAME_SAMPLES) -> Floats:
    """Return the level of each whole frame of ``size`` samples, in dB relative to a square wave of amplitude 1.

    Full scale is 32768; silence is 0 dB.
    """
    whole = np.asarray(samples[: len(samples) // size * size], np.float64).reshape(-1, size)
    return np.asarray(10 * np.log10(np.mean(whole**2, axis=1) + 1.0), np.float64)


# Speech made clearer before it is recognised: a steady background is taken away, and the level made alike.
#
# A Wiener filter that estimates the speech in each frame by the decision-directed rule of Ephraim and Malah ("Speech
# enhancement using a minimum mean-square error short-time spectral amplitude estimator", 1984).

WINDOW_SAMPLES, HOP_SAMPLES = 512, 128
"""Samples per spectrum, and from one spectrum to the next; the windowed pieces add up to a constant."""

OVERSUBTRACTION = 1.5
"""Factor by which more noise is removed than was measured, because residual noise sounds like voices."""

MIN_GAIN = 0.1
"""Smallest gain of a frequency in noise reduction."""

SMOOTHING = 0.95
"""Weight of the previous frame in the estimate of the signal-to-noise ratio."""

TARGET_LEVEL = 66.0
"""Level to which the loud frames of a clip are amplified, in dB relative to a square wave of amplitude 1."""

MAX_AMPLIFICATION = 30.0
"""Largest amplification of a clip, in dB."""


def enhance_speech(samples: Samples, noise: Samples) -> Samples:
    """Return ``samples`` amplified to ``TARGET_LEVEL``, with noise reduced.

    ``noise`` is the sound before the speech, from which the noise is estimated; it may be empty.
    """
    sound = np.asarray(samples, np.float64)
    if len(noise) >= WINDOW_SAMPLES:
        sound = wiener_filter(sound, np.asarray(noise, np.float64))
    loud = float(np.percentile(levels(sound), 95)) if len(sound) >= RATE // 10 else TARGET_LEVEL
    return _to_int16(sound * 10 ** (min(TARGET_LEVEL - loud, MAX_AMPLIFICATION) / 20))


def add_noise(samples: Samples, deviation: float) -> Samples:
    """Return ``samples`` plus noise with the standard deviation ``deviation``.

    Speech models are trained on recordings with noise, and do not know digital silence.
    """
    return _to_int16(samples + np.random.default_rng(0).standard_normal(len(samples)) * deviation)


def wiener_filter(sound: Floats, noise: Floats) -> Floats:
    """Return ``sound``, of the same length, without noise like ``noise`` (at least ``WINDOW_SAMPLES`` long)."""
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
    return np.asarray(np.clip(np.rint(sound), -32768, 32767), np.int16)


def _windowed_pieces(sound: Floats) -> Floats:
    """Return the overlapping pieces of a sound, faded in and out: shape (n, WINDOW_SAMPLES)."""
    pieces = np.lib.stride_tricks.sliding_window_view(sound, WINDOW_SAMPLES)[::HOP_SAMPLES]
    return np.asarray(pieces * _hann_window(), np.float64)


def _overlap_add(pieces: Floats) -> Floats:
    """Return the sound whose overlapping, faded pieces are ``pieces``: their sum.

    The first and the last window of the sound stay faded.
    """
    sound = np.zeros((len(pieces) - 1) * HOP_SAMPLES + WINDOW_SAMPLES)
    for number, piece in enumerate(pieces):
        sound[number * HOP_SAMPLES : number * HOP_SAMPLES + WINDOW_SAMPLES] += piece
    return sound / (np.sum(_hann_window()) / HOP_SAMPLES)


def _hann_window() -> Floats:
    """Return the Hann window, whose overlapping copies add up to a constant."""
    return np.hanning(WINDOW_SAMPLES + 1)[:-1]


# Where in an endless sound somebody speaks: by its level over that of the background.

LEAD_TIME = 0.3
"""Seconds of sound kept before the speech, for weak beginnings such as f and h."""

TAIL_TIME = 0.3
"""Seconds of sound kept after the speech."""

MIN_BACKGROUND_LEVEL = 20.0
"""Smallest assumed level of the background, in dB relative to a square wave of amplitude 1.

Without it, hiss after digital silence would count as speech.
"""


@dataclass(frozen=True, slots=True)
class SpeechGate:
    """Criteria of voice activity detection (VAD) in a sound. Levels in dB, times in seconds.

    A frame is speech if its level is at least ``rise`` above the background, and at most ``drop`` below the loudest
    frame of the utterance. An utterance ends after a ``pause`` (hangover), or when it has lasted ``longest``. Less
    speech than ``shortest`` counts as a click, not as an utterance.
    """

    rise: float = 6.0
    drop: float = 20.0
    pause: float = 0.5
    shortest: float = 0.08
    longest: float = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """An utterance cut out of the sound: ``start`` and ``end`` of the speech, on the clock of the microphone.

    ``samples`` begin ``lead`` seconds before ``start``. ``noise`` is the background before the utterance, perhaps
    empty.
    """

    start: float
    end: float
    lead: float
    samples: Samples
    noise: Samples


class EndPointer:
    """Cuts continuous sound into clips. For one thread."""

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
        """Drop the current utterance after a gap in the sound; the background level is kept."""
        self._partial_frame = np.zeros(0, np.int16)
        self._lead_frames.clear()
        self._speech_frames, self._loud_flags = [], []

    def process(self, samples: Samples, stamp: float) -> list[Clip]:
        """Process the next sound, whose first sample has the time ``stamp``; return the clips that end in it."""
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
        """Process a frame that ends ``now``; return the clip that it completes, or None."""
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
        """End the current utterance, and return it as a clip; None if it was too short to be speech.

        Sound later than ``TAIL_TIME`` after the end of the speech counts as background again.
        """
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
    return ((frame, float(levels(frame)[0])) for frame in frames)


def _select_quiet_frames(frames: Sequence[Samples], rise: float) -> list[tuple[Samples, float]]:
    """Return the quiet frames with their levels.

    A frame is quiet if it is less than ``rise`` dB louder than the quietest fifth of the frames. The noise of a fan
    that was switched on is quiet in all frames; of speech, only the pauses are quiet.
    """
    found = list(_with_levels(frames))
    low = float(np.percentile([level for _, level in found], 20))
    return [(frame, level) for frame, level in found if level <= low + rise]


def _frame_count(seconds: float) -> int:
    return round(seconds * RATE / FRAME_SAMPLES)
