"""The acoustic model that pocketsphinx carries, read from its files: how well a sound fits each state of each phone.

A phone has three states, and sounds otherwise between other phones. 42 codebooks of 128 Gaussians for each of three
streams (cepstra, their slopes, and the slopes of these) are shared by all states of a phone; a state weighs them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from perception.hearing.sound import Floats

Whole = npt.NDArray[np.int64]
Short = npt.NDArray[np.float32]

STATES = 3
"""Of a phone, one after the other."""

SILENCE = "SIL"

FEATURES = {
    "-lowerf": "130",
    "-upperf": "6800",
    "-nfilt": "25",
    "-transform": "dct",
    "-lifter": "22",
    "-feat": "1s_c_d_dd",
    "-svspec": "0-12/13-25/26-38",
    "-remove_noise": "yes",
}
"""What it must have been trained on, as its ``feat.params`` tells: what ``cepstra`` makes."""

_WEIGHT = 1024 * np.log(1.0001)  # of a state for a Gaussian: minus the logarithm, in these units
_PLACES = {"inside": 0, "first": 1, "last": 2, "alone": 3}  # of a phone in its word


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """The states of a word one after the other: which, and the logarithms of the chance to stay and to go on."""

    which: Whole
    stay: Floats
    leave: Floats


class AcousticModel:
    """Reads the model in a ``folder``. Raises OSError where it is not, ValueError for one of another form."""

    def __init__(self, folder: Path) -> None:
        told = dict(line.split() for line in (folder / "feat.params").read_text("utf-8").splitlines() if line.strip())
        if other := [f"{key} {told.get(key)}" for key, value in FEATURES.items() if told.get(key) != value]:
            raise ValueError(f"the acoustic model was trained on other features: {', '.join(other)}")
        means, variances = _table(folder / "means"), np.maximum(_table(folder / "variances"), 1e-4)
        self.slopes = np.concatenate([-0.5 / variances, means / variances], axis=-1).astype(np.float32)
        self.constants = -0.5 * (np.log(2 * np.pi * variances) + means**2 / variances).sum(axis=-1).astype(np.float32)
        chances = _table(folder / "transition_matrices")
        self._chances = chances / chances.sum(axis=-1, keepdims=True)
        self._read_phones((folder / "mdef").read_bytes())
        self.weights = self._weights((folder / "sendump").read_bytes(), means.shape[1:3])

    def _read_phones(self, data: bytes) -> None:
        """Read which states belong to which phone between which others."""
        if data[:4] != b"BMDF":
            raise ValueError("the acoustic model has no binary mdef")
        at = 12 + int(np.frombuffer(data, "<i4", 1, 8)[0])
        phones, everywhere, states, _, self.count, _, rows, _, tree, _ = np.frombuffer(data, "<i4", 10, at).tolist()
        if states != STATES:
            raise ValueError(f"the acoustic model has {states} states in a phone, not {STATES}")
        at += 40
        names = data[at:].split(b"\0", phones)[:phones]
        self._number = {name.decode(): number for number, name in enumerate(names)}
        at += -(-sum(len(name) + 1 for name in names) // 4) * 4 + 8 * tree
        kind = [("row", "<i4"), ("chances", "<i4"), ("place", "u1"), ("context", "u1", 3)]
        self._phones = np.frombuffer(data, kind, everywhere, at)
        self._rows = np.frombuffer(data, "<i2", rows * STATES, at + 12 * everywhere + 4).reshape(rows, STATES)
        context = self._phones["context"].astype(np.int64)
        keys = self._key(self._phones["place"].astype(np.int64), *context.T)
        keys[:phones] = -1
        self._order = np.argsort(keys)
        self._keys = keys[self._order]
        self.phone_of = np.zeros(self.count, np.int64)
        bases = np.concatenate([np.arange(phones), context[phones:, 0]])
        self.phone_of[self._rows[self._phones["row"]]] = bases[:, None]

    def _weights(self, data: bytes, shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
        """Read how a state weighs the Gaussians: shape (streams, Gaussians, states)."""
        size = int(np.prod(shape)) * self.count
        if len(data) < size or b"cluster_count 0" not in data[:4096]:
            raise ValueError("the acoustic model has weights of another form")
        return np.frombuffer(data, np.uint8, size, len(data) - size).reshape(*shape, self.count)

    def _key(self, place: Whole, phone: Whole, before: Whole, after: Whole) -> Whole:
        count = len(self._number)
        return ((place * count + phone) * count + before) * count + after

    def states(self, phones: Sequence[str]) -> States:
        """Return the states of a word between silences. Raises KeyError for a phone that the model has not."""
        around = (SILENCE, *phones, SILENCE)
        found = [
            self._phones[self._phone(number, len(phones), around[number : number + 3])] for number in range(len(phones))
        ]
        chances = np.concatenate([self._chances[each["chances"]] for each in found])
        state = np.arange(len(chances)) % STATES
        stay, leave = (chances[np.arange(len(chances)), state + more] for more in (0, 1))
        return States(np.concatenate([self._rows[each["row"]] for each in found]), np.log(stay), np.log(leave))

    def _phone(self, number: int, count: int, around: Sequence[str]) -> int:
        """Return the phone that stands ``number`` in a word of ``count``, the likest that is known."""
        before, phone, after = (self._number[each] for each in around)
        name = "alone" if count == 1 else "first" if number == 0 else "last" if number == count - 1 else "inside"
        for place in (_PLACES[name], *_PLACES.values()):
            key = ((place * len(self._number) + phone) * len(self._number) + before) * len(self._number) + after
            at = int(np.searchsorted(self._keys, key))
            if at < len(self._keys) and self._keys[at] == key:
                return int(self._order[at])
        return phone


class Fits:
    """How well sounds fit some ``states`` of a model."""

    def __init__(self, model: AcousticModel, states: Iterable[int]) -> None:
        self.states = np.unique(np.fromiter(states, np.int64))
        self._model = model
        phones = model.phone_of[self.states]
        self._groups = [
            (phone, mine, np.exp(-_WEIGHT * model.weights[:, :, self.states[mine]]).astype(np.float32))
            for phone in np.unique(phones).tolist()
            for mine in [np.flatnonzero(phones == phone)]
        ]

    def columns(self, states: Whole) -> Whole:
        """Return in which columns of the fits some states are."""
        return np.searchsorted(self.states, states)

    def __call__(self, features: Floats) -> Short:
        """Return the logarithm of the density of each row of ``features`` in each state: shape (rows, states)."""
        found = np.zeros((len(features), len(self.states)), np.float32)
        squares = np.concatenate([features**2, features], axis=-1).astype(np.float32)
        for phone, mine, weights in self._groups:
            for stream in range(features.shape[1]):
                each = squares[:, stream] @ self._model.slopes[phone, stream].T + self._model.constants[phone, stream]
                best = each.max(axis=1, keepdims=True)
                found[:, mine] += np.log(np.exp(each - best) @ weights[stream] + 1e-30) + best
        return found


def _table(path: Path) -> Floats:
    """Read a file of floats of Sphinx-3: their shape stands before them, then how many, but for what comes last."""
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
