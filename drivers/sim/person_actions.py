"""What people in a simulated world do of their own accord, or because of what they hear."""

from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, pi, sin
from typing import Literal

from drivers.errors import BadRequest

Facing = float | Literal["camera", "away"]
"""An angle about z in radians; or ``camera``, turned to whoever looks; or ``away``, turned from whoever looks."""

REACTION_TIME = 0.6
"""Seconds from hearing something to doing something about it."""

NOD_TIME = 1.2
"""Seconds that a nod takes: down and up, twice."""

NOD_DEPTH = 0.05
"""Metres by which the eyes go down in a nod."""


@dataclass(frozen=True, slots=True)
class PersonAction:
    """One thing that somebody does: at a time, or ``after`` seconds from hearing something that contains ``hears``.

    ``at`` is in seconds; the empty text is contained in everything. What they hear makes them do it so many ``times``
    at most, 0 for always. Then they ``say`` something, ``nod``, ``turn``, or ``leave``: all that is set. Raises
    BadRequest where there are both ``at`` and ``hears``, or neither, or numbers that are not finite or below 0.
    """

    at: float | None = None
    hears: str | None = None
    after: float = REACTION_TIME
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

    def is_triggered_by(self, text: str) -> bool:
        """Say whether ``text`` sets it off; capital and small letters are alike."""
        return self.hears is not None and self.hears.casefold() in text.casefold()


@dataclass(frozen=True, slots=True)
class ScheduledAction:
    """When an act is done, in seconds."""

    time: float
    action: PersonAction


@dataclass(frozen=True, slots=True)
class RobotUtterance:
    """What was said aloud by the robot, when, in seconds, and the names of those who heard it."""

    text: str
    time: float
    listeners: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PersonReply:
    """What somebody of the name ``speaker`` says, and ``time``, in seconds."""

    speaker: str
    text: str
    time: float


class ActionSchedule:
    """What one person does when: the acts that have a time, and those that what they hear sets off."""

    def __init__(self, name: str, actions: Sequence[PersonAction]) -> None:
        self._name = name
        self._triggered_actions = [act for act in actions if act.hears is not None]
        self._trigger_counts = [0 for _ in self._triggered_actions]  # how often each has been set off
        self._schedule: list[ScheduledAction] = []
        for act in actions:
            if act.at is not None:
                self._add(ScheduledAction(act.at, act))

    def is_listening(self, time: float) -> bool:
        """Say whether they listen at ``time`` seconds: who is leaving does not."""
        return not any(cue.action.leave for cue in self.actions_until(time))

    def on_speech(self, text: str, time: float) -> list[PersonReply]:
        """Note what is set off by something said, and return the answers."""
        cues = []
        for number, act in enumerate(self._triggered_actions):
            if act.is_triggered_by(text) and (act.times == 0 or self._trigger_counts[number] < act.times):
                self._trigger_counts[number] += 1
                cues.append(ScheduledAction(time + act.after, act))
        for cue in cues:
            self._add(cue)
        return [PersonReply(self._name, cue.action.say, cue.time) for cue in cues if cue.action.say]

    def actions_until(self, time: float) -> list[ScheduledAction]:
        """Return what is done by ``time`` seconds, in order; nothing follows a leave."""
        done = []
        for cue in self._schedule:
            if cue.time > time:
                break
            done.append(cue)
            if cue.action.leave:
                break
        return done

    def replies_between(self, after: float, until: float) -> list[PersonReply]:
        """Return what they say later than ``after`` and up to ``actions_until`` seconds."""
        spoken = (cue for cue in self.actions_until(until) if cue.action.say and cue.time > after)
        return [PersonReply(self._name, cue.action.say, cue.time) for cue in spoken]

    def _add(self, cue: ScheduledAction) -> None:
        insort(self._schedule, cue, key=lambda each: each.time)


def eye_drop(elapsed: float) -> float:
    """Return how many metres lower the eyes are, ``since`` seconds after the beginning of a nod."""
    return NOD_DEPTH * sin(2 * pi * elapsed / NOD_TIME) ** 2 if 0 <= elapsed < NOD_TIME else 0.0
