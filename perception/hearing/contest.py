"""Which of many single words a sound fits best, and how well each: all of them at once, by one search (Viterbi).

Silence and noises may come before and after a word. What a word gets is the logarithm of the density of the whole
sound on its best path; that of two words differs by the same whatever the sound was recorded with.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from perception.hearing.acoustic_model import SILENCE, STATES, AcousticModel, Fits, Short, States
from perception.hearing.cepstra import cepstra, normalised, with_slopes
from perception.hearing.sound import Floats, Samples

FILLERS = {SILENCE: 0.005, "+NSN+": 1e-8, "+SPN+": 1e-8}
"""What may sound beside a word, and its chance: silence, noise, and voices."""

_NEVER = np.float32(-np.inf)


@dataclass(frozen=True, slots=True)
class Entry:
    """How one word did: in how many frames of 10 ms it was said, and the logarithm of the density of all the sound."""

    word: str
    frames: int
    score: float


class Contest:
    """Some ``ways`` to say words: pairs of a word and its phones. For one thread."""

    def __init__(self, model: AcousticModel, ways: Iterable[tuple[str, Sequence[str]]]) -> None:
        ways = list(ways)
        self._words = [word for word, _ in ways]
        each = [model.states(phones) for _, phones in ways]
        self._fillers = [(model.states([phone]), np.log(chance)) for phone, chance in FILLERS.items()]
        which = np.concatenate([states.which for states in each])
        self._fits = Fits(model, [*which.tolist(), *(s for states, _ in self._fillers for s in states.which.tolist())])
        self._columns = self._fits.columns(which)
        self._stay = np.concatenate([states.stay for states in each]).astype(np.float32)
        self._leave = np.concatenate([states.leave for states in each]).astype(np.float32)
        self._last = np.cumsum([len(states.which) for states in each]) - 1
        self._first = np.append(0, self._last[:-1] + 1)

    def entries(self, samples: Samples) -> list[Entry]:
        """Return how each word did, the best first, each word once."""
        fits = self._fits(with_slopes(normalised(cepstra(samples))))
        before, after = self._beside(fits), self._beside(fits[::-1], back=True)[::-1]
        scores, frames = self._search(fits, before, after)
        found: dict[str, Entry] = {}
        for at in np.argsort(-scores, kind="stable").tolist():
            entry = Entry(self._words[at], int(frames[at]), float(scores[at]))
            found.setdefault(entry.word, entry)
        return list(found.values())

    def _search(self, fits: Short, before: Floats, after: Floats) -> tuple[Floats, Floats]:
        """Return the score of each way and in how many frames it was said."""
        score = np.full(len(self._stay), _NEVER)
        begun = np.zeros(len(score), np.int32)
        best, frames = np.full(len(self._last), -np.inf), np.zeros(len(self._last))
        came, came_begun = np.empty_like(score), np.empty_like(begun)
        for number, fit in enumerate(fits):
            came[1:], came_begun[1:] = (score + self._leave)[:-1], begun[:-1]
            came[self._first], came_begun[self._first] = before[number], number
            score += self._stay
            moved = came > score
            np.copyto(score, came, where=moved)
            np.copyto(begun, came_begun, where=moved)
            score += fit[self._columns]
            ended = score[self._last].astype(np.float64) + self._leave[self._last] + after[number + 1]
            better = ended > best
            best[better] = ended[better]
            frames[better] = (number + 1 - begun[self._last])[better]
        return best, frames

    def _beside(self, fits: Short, *, back: bool = False) -> Floats:
        """Return the score of the best fillers up to each frame, shape (frames + 1,); ``back`` in time."""
        turn = -1 if back else 1
        states = [filler for filler, _ in self._fillers]
        columns = np.array([self._fits.columns(each.which)[::turn] for each in states])
        stay, leave = (np.array([part(each)[::turn] for each in states]) for part in (_stay, _leave))
        begin = np.array([chance for _, chance in self._fillers])
        score, came = np.full((len(states), STATES), -np.inf), np.empty((len(states), STATES))
        found = np.full(len(fits) + 1, -np.inf)
        found[0] = 0.0
        for number, fit in enumerate(fits):
            came[:, 1:] = score[:, :-1] + (leave[:, 1:] if back else leave[:, :-1])
            came[:, 0] = found[number] + begin + (leave[:, 0] if back else 0.0)
            score = np.maximum(score + stay, came) + fit[columns]
            found[number + 1] = np.max(score[:, -1] + (0.0 if back else leave[:, -1]))
        return found


def _stay(states: States) -> Floats:
    return states.stay


def _leave(states: States) -> Floats:
    return states.leave
