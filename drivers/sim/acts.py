"""What people in a simulated world do of their own accord, or because of what they hear."""

from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, pi, sin
from typing import Literal

from drivers.errors import BadRequest

Facing = float | Literal["camera", "away"]
"""An angle about z in radians; or ``camera``, turned to whoever looks; or ``away``, turned from whoever looks."""

REACTION = 0.6
"""Seconds from hearing something to doing something about it."""

NOD_TIME = 1.2
"""Seconds that a nod takes: down and up, twice."""

NOD_DEPTH = 0.05
"""Metres by which the eyes go down in a nod."""


@dataclass(frozen=True, slots=True)
class Act:
    """One thing that somebody does: at a time, or ``after`` seconds from hearing something that contains ``hears``.

    ``at`` is in seconds; the empty text is contained in everything. What they hear makes them do it so many ``times``
    at most, 0 for always. Then they ``say`` something, ``nod``, ``turn``, or ``leave``: all that is set. Raises
    BadRequest where there are both ``at`` and ``hears``, or neither, or numbers that are not finite or below 0.
    """

    at: float | None = None
    hears: str | None = None
    after: float = REACTION
    say: str = ""
    nod: bool = False
    turn: Facing | None = None
    leave: bool = False
    times: int = 0

    def __post_init__(self) -> None:
        if (self.at is None) == (self.hears is None):
            raise BadRequest(f"act: at={self.at}, hears={self.hears!r}: needs one of them")
        if not all(isfinite(time) and time >= 0 for time in (self.at or 0.0, self.after)):
            raise BadRequest(f"act: at={self.at}, after={self.after}: must be 0 s or more")

    def heeds(self, text: str) -> bool:
        """Say whether ``text`` sets it off; capital and small letters are alike."""
        return self.hears is not None and self.hears.casefold() in text.casefold()


@dataclass(frozen=True, slots=True)
class Cue:
    """When an act is done, in seconds."""

    time: float
    act: Act


@dataclass(frozen=True, slots=True)
class Heard:
    """What was said aloud by the robot, when, in seconds, and the names of those who heard it."""

    text: str
    time: float
    by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Reply:
    """What somebody of the name ``who`` says, and ``when``, in seconds."""

    who: str
    text: str
    when: float


class Cues:
    """What one person does when: the acts that have a time, and those that what they hear sets off."""

    def __init__(self, name: str, acts: Sequence[Act]) -> None:
        self._name = name
        self._waiting = [act for act in acts if act.hears is not None]
        self._times = [0 for _ in self._waiting]  # how often each has been set off
        self._due: list[Cue] = []
        for act in acts:
            if act.at is not None:
                self._add(Cue(act.at, act))

    def listens(self, time: float) -> bool:
        """Say whether they listen at ``time`` seconds: who is leaving does not."""
        return not any(cue.act.leave for cue in self.until(time))

    def hear(self, text: str, time: float) -> list[Reply]:
        """Note what is set off by something said, and return the answers."""
        cues = []
        for number, act in enumerate(self._waiting):
            if act.heeds(text) and (act.times == 0 or self._times[number] < act.times):
                self._times[number] += 1
                cues.append(Cue(time + act.after, act))
        for cue in cues:
            self._add(cue)
        return [Reply(self._name, cue.act.say, cue.time) for cue in cues if cue.act.say]

    def until(self, time: float) -> list[Cue]:
        """Return what is done by ``time`` seconds, in order; nothing follows a leave."""
        done = []
        for cue in self._due:
            if cue.time > time:
                break
            done.append(cue)
            if cue.act.leave:
                break
        return done

    def said(self, after: float, until: float) -> list[Reply]:
        """Return what they say later than ``after`` and up to ``until`` seconds."""
        spoken = (cue for cue in self.until(until) if cue.act.say and cue.time > after)
        return [Reply(self._name, cue.act.say, cue.time) for cue in spoken]

    def _add(self, cue: Cue) -> None:
        insort(self._due, cue, key=lambda each: each.time)


def nod_at(since: float) -> float:
    """Return how many metres lower the eyes are, ``since`` seconds after the beginning of a nod."""
    return NOD_DEPTH * sin(2 * pi * since / NOD_TIME) ** 2 if 0 <= since < NOD_TIME else 0.0
