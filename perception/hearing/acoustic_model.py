"""Acoustic model of pocketsphinx, read from its files: likelihoods of sounds in the states of phones.

A phone has three states, and depends on its neighbours. 42 codebooks of 128 Gaussians for each of three streams
(cepstra, their slopes, and the slopes of these) are shared by all states of a phone; each state has its own weights.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from perception.hearing.sound import RATE, Floats, Samples

# From sound to cepstra: what the ear would make of it, as the acoustic model of pocketsphinx was trained on it.
#
# The front end of SphinxBase with the model's own settings (``feat.params``): 25 triangles on the mel scale between
# 130 and 6800 Hz, its removal of steady noise, cosine transform, lifter. One row for each 10 ms.

HOP_SAMPLES, WINDOW_SAMPLES, FFT_SIZE = RATE // 100, 410, 512
"""Samples from one row to the next, samples per row, and samples per spectrum."""

CEPSTRUM_SIZE, BAND_COUNT, MIN_FREQUENCY, MAX_FREQUENCY = 13, 25, 130.0, 6800.0
"""Number of cepstra and of triangles, and frequency range of the triangles (Hz)."""

TYPICAL_CEPSTRA = (41.6, -6.2, -4.3, -0.8, -3.5, -6.0, -4.9, -2.5, 0.8, -2.2, -1.2, -1.6, -0.7)
"""Mean cepstra of words at the level ``perception.hearing.sound.TARGET_LEVEL``, over people and microphones."""

TYPICAL_ROWS = 100
"""Weight of ``TYPICAL_CEPSTRA`` in the mean of a word, as a number of rows (one row per 10 ms).

The mean of the word's own rows shows the effect of the microphone only if the word is long: that of a short word
depends as much on its sounds.
"""

_KEPT, _RISE, _FALL, _FADE, _MASK, _GAIN, _BESIDE = 0.7, 0.995, 0.5, 0.85, 0.2, 20.0, 4


def cepstra(samples: Samples) -> Floats:
    """Return the cepstra of a sound of at least ``WINDOW_SAMPLES``: shape (rows, 13)."""
    sound = np.asarray(samples, np.float64)
    sound = np.append(sound[:1], sound[1:] - 0.97 * sound[:-1])
    rows = max(1, -(-(len(sound) - WINDOW_SAMPLES + HOP_SAMPLES) // HOP_SAMPLES))
    pieces = np.lib.stride_tricks.sliding_window_view(np.pad(sound, (0, WINDOW_SAMPLES)), WINDOW_SAMPLES)[
        ::HOP_SAMPLES
    ][:rows]
    power = np.abs(np.fft.rfft(pieces * np.hamming(WINDOW_SAMPLES), FFT_SIZE)) ** 2
    return np.asarray(np.log(remove_noise(np.maximum(power @ _TRIANGLES, 1e-4))) @ _COSINES, np.float64)


def remove_noise(bands: Floats) -> Floats:
    """Return the power in each band over time without steady noise: input and output of shape (rows, bands)."""
    power, noise, floor = bands[0].copy(), bands[0] / _GAIN, bands[0] / _GAIN
    peak, found = np.zeros(len(power)), np.empty_like(bands)
    for number, band in enumerate(bands):
        power = _KEPT * power + (1 - _KEPT) * band
        noise = _lower_envelope(noise, power)
        signal = np.maximum(power - noise, 1.0)
        floor = _lower_envelope(floor, signal)
        peak = peak * _FADE
        masked = np.where(signal < _FADE * peak, peak * _MASK, signal)
        peak = np.maximum(peak, signal)
        gain = np.clip(np.maximum(masked, floor) / power, 1 / _GAIN, _GAIN)
        found[number] = band * (_NEIGHBOURS @ gain)
    return found


def normalise_cepstra(rows: Floats) -> Floats:
    """Return cepstra minus their mean, which removes the effect of microphone and voice; see ``TYPICAL_ROWS``."""
    mean = (rows.sum(axis=0) + TYPICAL_ROWS * np.array(TYPICAL_CEPSTRA)) / (len(rows) + TYPICAL_ROWS)
    return np.asarray(rows - mean, np.float64)


def add_slopes(rows: Floats) -> Floats:
    """Return cepstra with their first and second slopes: shape (rows, 3, 13)."""
    count, padded = len(rows), np.pad(rows, ((3, 3), (0, 0)), mode="edge")

    def later(by: int) -> Floats:
        return padded[3 + by : 3 + by + count]

    return np.stack([rows, later(2) - later(-2), later(3) - later(1) - later(-1) + later(-3)], axis=1)


def _lower_envelope(envelope: Floats, level: Floats) -> Floats:
    """Return the updated lower envelope of a sound level: it rises slowly and falls fast.

    ``envelope`` is its previous value, ``level`` the newest level.
    """
    keep = np.where(level >= envelope, _RISE, _FALL)
    return np.asarray(keep * envelope + (1 - keep) * level, np.float64)


def _mel_triangles() -> Floats:
    """Return the triangular filters as weights of a spectrum, each of area 1: shape (FFT_SIZE // 2 + 1, BAND_COUNT)."""
    low, high = (2595 * np.log10(1 + edge / 700) for edge in (MIN_FREQUENCY, MAX_FREQUENCY))
    step = RATE / FFT_SIZE
    edges = np.floor(700 * (10 ** (np.linspace(low, high, BAND_COUNT + 2) / 2595) - 1) / step + 0.5) * step
    begin, top, end = edges[:-2], edges[1:-1], edges[2:]
    at = np.arange(FFT_SIZE // 2 + 1)[:, None] * step
    return np.maximum(np.minimum((at - begin) / (top - begin), (end - at) / (end - top)), 0) * 2 / (end - begin)


def _cosine_transform() -> Floats:
    """Return the cosine transform with the lifter: shape (BAND_COUNT, CEPSTRUM_SIZE)."""
    number = np.arange(CEPSTRUM_SIZE)
    waves = np.cos(np.pi * number * (np.arange(BAND_COUNT)[:, None] + 0.5) / BAND_COUNT) * np.sqrt(2 / BAND_COUNT)
    waves[:, 0] /= np.sqrt(2)
    return np.asarray(waves * (1 + 11 * np.sin(number * np.pi / 22)), np.float64)


def _neighbour_means() -> Floats:
    """Return the averaging matrix over neighbouring bands: shape (BAND_COUNT, BAND_COUNT)."""
    band = np.arange(BAND_COUNT)
    near = np.abs(band[:, None] - band) <= _BESIDE
    return np.asarray(near / near.sum(axis=1, keepdims=True), np.float64)


_TRIANGLES, _COSINES, _NEIGHBOURS = _mel_triangles(), _cosine_transform(), _neighbour_means()


Integers = npt.NDArray[np.int64]
Floats32 = npt.NDArray[np.float32]

STATES_PER_PHONE = 3
"""Number of consecutive states of a phone."""

SILENCE = "SIL"

REQUIRED_FEATURES = {
    "-lowerf": "130",
    "-upperf": "6800",
    "-nfilt": "25",
    "-transform": "dct",
    "-lifter": "22",
    "-feat": "1s_c_d_dd",
    "-svspec": "0-12/13-25/26-38",
    "-remove_noise": "yes",
}
"""Settings that the model's file ``feat.params`` must have, since ``cepstra`` computes the features in this way."""

_WEIGHT_SCALE = 1024 * np.log(1.0001)  # of a state for a Gaussian: minus the logarithm, in these units
_WORD_POSITIONS = {"inside": 0, "first": 1, "last": 2, "alone": 3}  # of a phone in its word


@dataclass(frozen=True, slots=True, eq=False)
class WordStates:
    """Consecutive states of the acoustic model for a word.

    ``numbers`` are those of the states in the model, ``log_stay`` and ``log_leave`` the log probabilities of staying in
    each state and of leaving it.
    """

    numbers: Integers
    log_stay: Floats
    log_leave: Floats


class AcousticModel:
    """Acoustic model of pocketsphinx in a ``folder``. Raises OSError (no such file), ValueError (another format)."""

    def __init__(self, folder: Path) -> None:
        settings = dict(
            line.split() for line in (folder / "feat.params").read_text("utf-8").splitlines() if line.strip()
        )
        if other := [
            f"{key} {settings.get(key)}" for key, value in REQUIRED_FEATURES.items() if settings.get(key) != value
        ]:
            raise ValueError(f"the acoustic model was trained on other features: {', '.join(other)}")
        means, variances = _read_table(folder / "means"), np.maximum(_read_table(folder / "variances"), 1e-4)
        self.slopes = np.concatenate([-0.5 / variances, means / variances], axis=-1).astype(np.float32)
        self.constants = -0.5 * (np.log(2 * np.pi * variances) + means**2 / variances).sum(axis=-1).astype(np.float32)
        chances = _read_table(folder / "transition_matrices")
        self._transitions = chances / chances.sum(axis=-1, keepdims=True)
        self._read_phones((folder / "mdef").read_bytes())
        self.weights = self._read_weights((folder / "sendump").read_bytes(), means.shape[1:3])

    def _read_phones(self, data: bytes) -> None:
        """Store the states of each phone from the model's file ``mdef``, whose content is ``data``.

        The states of a phone depend on the phones before and after it.
        """
        if data[:4] != b"BMDF":
            raise ValueError("the acoustic model has no binary mdef")
        at = 12 + int(np.frombuffer(data, "<i4", 1, 8)[0])
        phones, everywhere, states, _, self.state_count, _, rows, _, tree, _ = np.frombuffer(
            data, "<i4", 10, at
        ).tolist()
        if states != STATES_PER_PHONE:
            raise ValueError(f"the acoustic model has {states} states in a phone, not {STATES_PER_PHONE}")
        at += 40
        names = data[at:].split(b"\0", phones)[:phones]
        self._phone_numbers = {name.decode(): number for number, name in enumerate(names)}
        at += -(-sum(len(name) + 1 for name in names) // 4) * 4 + 8 * tree
        kind = [("row", "<i4"), ("chances", "<i4"), ("place", "u1"), ("context", "u1", 3)]
        self._phones = np.frombuffer(data, kind, everywhere, at)
        self._rows = np.frombuffer(data, "<i2", rows * STATES_PER_PHONE, at + 12 * everywhere + 4).reshape(
            rows, STATES_PER_PHONE
        )
        context = self._phones["context"].astype(np.int64)
        keys = self._key(self._phones["place"].astype(np.int64), *context.T)
        keys[:phones] = -1
        self._order = np.argsort(keys)
        self._keys = keys[self._order]
        self.phone_of = np.zeros(self.state_count, np.int64)
        bases = np.concatenate([np.arange(phones), context[phones:, 0]])
        self.phone_of[self._rows[self._phones["row"]]] = bases[:, None]

    def _read_weights(self, data: bytes, shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
        """Return the weights of the Gaussians in each state: shape (streams, Gaussians, states)."""
        size = int(np.prod(shape)) * self.state_count
        if len(data) < size or b"cluster_count 0" not in data[:4096]:
            raise ValueError("the acoustic model has weights of another form")
        return np.frombuffer(data, np.uint8, size, len(data) - size).reshape(*shape, self.state_count)

    def _key(self, place: Integers, phone: Integers, before: Integers, after: Integers) -> Integers:
        count = len(self._phone_numbers)
        return ((place * count + phone) * count + before) * count + after

    def word_states(self, phones: Sequence[str]) -> WordStates:
        """Return the states of a word between silences. Raises KeyError for an unknown phone."""
        around = (SILENCE, *phones, SILENCE)
        found = [
            self._phones[self._find_phone(number, len(phones), around[number : number + 3])]
            for number in range(len(phones))
        ]
        chances = np.concatenate([self._transitions[each["chances"]] for each in found])
        state = np.arange(len(chances)) % STATES_PER_PHONE
        stay, leave = (chances[np.arange(len(chances)), state + more] for more in (0, 1))
        return WordStates(np.concatenate([self._rows[each["row"]] for each in found]), np.log(stay), np.log(leave))

    def _find_phone(self, number: int, count: int, around: Sequence[str]) -> int:
        """Return the model's number of the phone at position ``number`` in a word of ``count`` phones.

        ``around`` are the phone before, the phone itself, and the phone after. If the model lacks it with these
        neighbours, the phone without neighbours is returned.
        """
        before, phone, after = (self._phone_numbers[each] for each in around)
        name = "alone" if count == 1 else "first" if number == 0 else "last" if number == count - 1 else "inside"
        for place in (_WORD_POSITIONS[name], *_WORD_POSITIONS.values()):
            key = ((place * len(self._phone_numbers) + phone) * len(self._phone_numbers) + before) * len(
                self._phone_numbers
            ) + after
            at = int(np.searchsorted(self._keys, key))
            if at < len(self._keys) and self._keys[at] == key:
                return int(self._order[at])
        return phone


class StateLikelihoods:
    """Likelihoods of sounds in some ``states`` of an acoustic model."""

    def __init__(self, model: AcousticModel, states: Iterable[int]) -> None:
        self.states = np.unique(np.fromiter(states, np.int64))
        self._model = model
        phones = model.phone_of[self.states]
        self._groups = [
            (phone, mine, np.exp(-_WEIGHT_SCALE * model.weights[:, :, self.states[mine]]).astype(np.float32))
            for phone in np.unique(phones).tolist()
            for mine in [np.flatnonzero(phones == phone)]
        ]

    def columns(self, states: Integers) -> Integers:
        """Return the columns of the likelihood table that belong to ``states``."""
        return np.searchsorted(self.states, states)

    def __call__(self, features: Floats) -> Floats32:
        """Return the log likelihood of each row of ``features`` in each state: shape (rows, states)."""
        found = np.zeros((len(features), len(self.states)), np.float32)
        squares = np.concatenate([features**2, features], axis=-1).astype(np.float32)
        for phone, mine, weights in self._groups:
            for stream in range(features.shape[1]):
                each = squares[:, stream] @ self._model.slopes[phone, stream].T + self._model.constants[phone, stream]
                best = each.max(axis=1, keepdims=True)
                found[:, mine] += np.log(np.exp(each - best) @ weights[stream] + 1e-30) + best
        return found


def _read_table(path: Path) -> Floats:
    """Read a file of floats of Sphinx-3: a header with the shape, then the values."""
    data = path.read_bytes()
    at = data.index(b"endhdr\n") + 11
    sizes = np.frombuffer(data, "<i4", 3, at)
    if path.name == "transition_matrices":
        at += 16
        return np.frombuffer(data, "<f4", int(sizes.prod()), at).reshape(sizes).astype(np.float64)
    lengths = np.frombuffer(data, "<i4", int(sizes[1]), at + 12)
    if len(set(lengths.tolist())) != 1:
        raise ValueError(f"{path.name} of the acoustic model has streams of different lengths")
    shape = (*sizes.tolist(), int(lengths[0]))
    return np.frombuffer(data, "<f4", int(np.prod(shape)), at + 16 + 4 * len(lengths)).reshape(shape).astype(np.float64)


# Which of many single words a sound fits best, and how well each: all of them at once, by one search (Viterbi).
#
# Silence and noises may come before and after a word. What a word gets is the logarithm of the density of the whole
# sound on its best path; that of two words differs by the same whatever the sound was recorded with.

FILLERS = {SILENCE: 0.005, "+NSN+": 1e-8, "+SPN+": 1e-8}
"""Sounds before and after a word (silence, noise, and voices) and their probabilities."""

_LOG_ZERO = np.float32(-np.inf)


@dataclass(frozen=True, slots=True)
class WordScore:
    """Result of one word: the frames (10 ms) in which it was spoken, and the log likelihood of the whole sound."""

    word: str
    frames: int
    score: float


class WordContest:
    """Search for the word that fits a sound best, for sounds with a single word. For one thread.

    ``pronunciations`` are pairs of a word and its phones; a word may have several.
    """

    def __init__(self, model: AcousticModel, pronunciations: Iterable[tuple[str, Sequence[str]]]) -> None:
        pronunciations = list(pronunciations)
        self._words = [word for word, _ in pronunciations]
        each = [model.word_states(phones) for _, phones in pronunciations]
        self._fillers = [(model.word_states([phone]), np.log(chance)) for phone, chance in FILLERS.items()]
        which = np.concatenate([states.numbers for states in each])
        self._likelihoods = StateLikelihoods(
            model, [*which.tolist(), *(s for states, _ in self._fillers for s in states.numbers.tolist())]
        )
        self._columns = self._likelihoods.columns(which)
        self._log_stay = np.concatenate([states.log_stay for states in each]).astype(np.float32)
        self._log_leave = np.concatenate([states.log_leave for states in each]).astype(np.float32)
        self._last_states = np.cumsum([len(states.numbers) for states in each]) - 1
        self._first_states = np.append(0, self._last_states[:-1] + 1)

    def rank_words(self, samples: Samples) -> list[WordScore]:
        """Return the score of each word, the best first, each word once."""
        fits = self._likelihoods(add_slopes(normalise_cepstra(cepstra(samples))))
        before, after = self._filler_scores(fits), self._filler_scores(fits[::-1], backwards=True)[::-1]
        scores, frames = self._search(fits, before, after)
        found: dict[str, WordScore] = {}
        for at in np.argsort(-scores, kind="stable").tolist():
            entry = WordScore(self._words[at], int(frames[at]), float(scores[at]))
            found.setdefault(entry.word, entry)
        return list(found.values())

    def _search(self, fits: Floats32, before: Floats, after: Floats) -> tuple[Floats, Floats]:
        """Return the score of each pronunciation, and in how many frames it was spoken (Viterbi search).

        ``fits`` are the log likelihoods of each frame in each state. ``before`` and ``after`` are the scores of noise
        or silence up to each frame, and from each frame on.
        """
        score = np.full(len(self._log_stay), _LOG_ZERO)
        begun = np.zeros(len(score), np.int32)
        best, frames = np.full(len(self._last_states), -np.inf), np.zeros(len(self._last_states))
        came, came_begun = np.empty_like(score), np.empty_like(begun)
        for number, fit in enumerate(fits):
            came[1:], came_begun[1:] = (score + self._log_leave)[:-1], begun[:-1]
            came[self._first_states], came_begun[self._first_states] = before[number], number
            score += self._log_stay
            moved = came > score
            np.copyto(score, came, where=moved)
            np.copyto(begun, came_begun, where=moved)
            score += fit[self._columns]
            ended = score[self._last_states].astype(np.float64) + self._log_leave[self._last_states] + after[number + 1]
            better = ended > best
            best[better] = ended[better]
            frames[better] = (number + 1 - begun[self._last_states])[better]
        return best, frames

    def _filler_scores(self, fits: Floats32, *, backwards: bool = False) -> Floats:
        """Return the score of the best noise or silence up to each frame: shape (frames + 1,).

        ``fits`` are the log likelihoods of each frame in each state. With ``backwards``, time runs from the last frame.
        """
        turn = -1 if backwards else 1
        states = [filler for filler, _ in self._fillers]
        columns = np.array([self._likelihoods.columns(each.numbers)[::turn] for each in states])
        stay, leave = (np.array([part(each)[::turn] for each in states]) for part in (_log_stay_of, _log_leave_of))
        begin = np.array([chance for _, chance in self._fillers])
        score, came = np.full((len(states), STATES_PER_PHONE), -np.inf), np.empty((len(states), STATES_PER_PHONE))
        found = np.full(len(fits) + 1, -np.inf)
        found[0] = 0.0
        for number, fit in enumerate(fits):
            came[:, 1:] = score[:, :-1] + (leave[:, 1:] if backwards else leave[:, :-1])
            came[:, 0] = found[number] + begin + (leave[:, 0] if backwards else 0.0)
            score = np.maximum(score + stay, came) + fit[columns]
            found[number + 1] = np.max(score[:, -1] + (0.0 if backwards else leave[:, -1]))
        return found


def _log_stay_of(states: WordStates) -> Floats:
    return states.log_stay


def _log_leave_of(states: WordStates) -> Floats:
    return states.log_leave
