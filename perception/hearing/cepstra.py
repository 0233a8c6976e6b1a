"""From sound to cepstra: what the ear would make of it, as the acoustic model of pocketsphinx was trained on it.

The front end of SphinxBase with the model's own settings (``feat.params``): 25 triangles on the mel scale between 130
and 6800 Hz, its removal of steady noise, cosine transform, lifter. One row for each 10 ms.
"""

import numpy as np

from perception.hearing.sound import RATE, Floats, Samples

HOP, WINDOW, FFT = RATE // 100, 410, 512
"""Samples from one row to the next, that count for a row, and of which a spectrum is taken."""

COUNT, BANDS, LOWEST, HIGHEST = 13, 25, 130.0, 6800.0
"""Cepstra, triangles, and between which frequencies these lie (Hz)."""

USUAL = (41.6, -6.2, -4.3, -0.8, -3.5, -6.0, -4.9, -2.5, 0.8, -2.2, -1.2, -1.6, -0.7)
"""The mean of the cepstra of words at the level of ``denoise.LOUD``, over people and their microphones."""

WEIGHT = 100
"""Rows for which ``USUAL`` counts: the mean of one word says as much about its sounds as about the microphone."""

_KEPT, _RISE, _FALL, _FADE, _MASK, _GAIN, _BESIDE = 0.7, 0.995, 0.5, 0.85, 0.2, 20.0, 4


def cepstra(samples: Samples) -> Floats:
    """Return the cepstra of a sound of a window at least: shape (rows, 13)."""
    sound = np.asarray(samples, np.float64)
    sound = np.append(sound[:1], sound[1:] - 0.97 * sound[:-1])
    rows = max(1, -(-(len(sound) - WINDOW + HOP) // HOP))
    pieces = np.lib.stride_tricks.sliding_window_view(np.pad(sound, (0, WINDOW)), WINDOW)[::HOP][:rows]
    power = np.abs(np.fft.rfft(pieces * np.hamming(WINDOW), FFT)) ** 2
    return np.asarray(np.log(without_noise(np.maximum(power @ _TRIANGLES, 1e-4))) @ _COSINES, np.float64)


def without_noise(bands: Floats) -> Floats:
    """Return the power in each band over time without what is steady: shape (rows, bands), both ways."""
    power, noise, floor = bands[0].copy(), bands[0] / _GAIN, bands[0] / _GAIN
    peak, found = np.zeros(len(power)), np.empty_like(bands)
    for number, band in enumerate(bands):
        power = _KEPT * power + (1 - _KEPT) * band
        noise = _below(noise, power)
        signal = np.maximum(power - noise, 1.0)
        floor = _below(floor, signal)
        peak = peak * _FADE
        masked = np.where(signal < _FADE * peak, peak * _MASK, signal)
        peak = np.maximum(peak, signal)
        gain = np.clip(np.maximum(masked, floor) / power, 1 / _GAIN, _GAIN)
        found[number] = band * (_NEIGHBOURS @ gain)
    return found


def normalised(rows: Floats) -> Floats:
    """Return cepstra without the colour of microphone and voice: less their mean, as far as one word tells it."""
    mean = (rows.sum(axis=0) + WEIGHT * np.array(USUAL)) / (len(rows) + WEIGHT)
    return np.asarray(rows - mean, np.float64)


def with_slopes(rows: Floats) -> Floats:
    """Return cepstra, how they change, and how that changes: shape (rows, 3, 13)."""
    count, padded = len(rows), np.pad(rows, ((3, 3), (0, 0)), mode="edge")

    def later(by: int) -> Floats:
        return padded[3 + by : 3 + by + count]

    return np.stack([rows, later(2) - later(-2), later(3) - later(1) - later(-1) + later(-3)], axis=1)


def _below(envelope: Floats, level: Floats) -> Floats:
    """Follow the lower edge of a level: slowly up, quickly down."""
    keep = np.where(level >= envelope, _RISE, _FALL)
    return np.asarray(keep * envelope + (1 - keep) * level, np.float64)


def _triangles() -> Floats:
    """The triangles as weights of a spectrum: shape (FFT // 2 + 1, BANDS). Each has the area 1."""
    low, high = (2595 * np.log10(1 + edge / 700) for edge in (LOWEST, HIGHEST))
    step = RATE / FFT
    edges = np.floor(700 * (10 ** (np.linspace(low, high, BANDS + 2) / 2595) - 1) / step + 0.5) * step
    begin, top, end = edges[:-2], edges[1:-1], edges[2:]
    at = np.arange(FFT // 2 + 1)[:, None] * step
    return np.maximum(np.minimum((at - begin) / (top - begin), (end - at) / (end - top)), 0) * 2 / (end - begin)


def _cosines() -> Floats:
    """The cosine transform and the lifter: shape (BANDS, COUNT)."""
    number = np.arange(COUNT)
    waves = np.cos(np.pi * number * (np.arange(BANDS)[:, None] + 0.5) / BANDS) * np.sqrt(2 / BANDS)
    waves[:, 0] /= np.sqrt(2)
    return np.asarray(waves * (1 + 11 * np.sin(number * np.pi / 22)), np.float64)


def _neighbours() -> Floats:
    """The mean over the bands beside each: shape (BANDS, BANDS)."""
    band = np.arange(BANDS)
    near = np.abs(band[:, None] - band) <= _BESIDE
    return np.asarray(near / near.sum(axis=1, keepdims=True), np.float64)


_TRIANGLES, _COSINES, _NEIGHBOURS = _triangles(), _cosines(), _neighbours()
