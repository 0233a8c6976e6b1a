"""Where in an endless sound somebody speaks: by its level over that of the background."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from perception.hearing.sound import FRAME, RATE, Samples, levels

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
