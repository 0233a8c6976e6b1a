"""Actions of simulated people: at given times, or in reply to speech of the robot."""

from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, pi, sin
from typing import Literal

from drivers.errors import BadRequest

Facing = float | Literal["camera", "away"]
"""An angle about z in radians; or ``camera``: towards the robot's camera; or ``away``: away from it."""

REACTION_TIME = 0.6
"""Seconds from the end of speech to a person's reaction."""

NOD_TIME = 1.2
"""Seconds that a nod takes: down and up, twice."""

NOD_DEPTH = 0.05
"""Metres by which the eyes move down in a nod."""


@dataclass(frozen=True, slots=True)
class PersonAction:
    """Action of a person: at the time ``at``, or ``after`` seconds from speech that contains ``hears``.

    ``at`` and ``after`` are in seconds. An empty ``hears`` matches all speech, and letter case is ignored. Speech
    triggers the action at most ``times`` times; 0 is unlimited. All of ``say``, ``nod``, ``turn`` and ``leave`` that
    are set are done. Raises BadRequest unless exactly one of ``at`` and ``hears`` is set, and for times that are
    negative or not finite.
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
            raise BadRequest(f"act: at={self.at}, hears={self.hears!r}: exactly one of them must be set")
        if not all(isfinite(time) and time >= 0 for time in (self.at or 0.0, self.after)):
            raise BadRequest(f"act: at={self.at}, after={self.after}: must be 0 s or more")

    def is_triggered_by(self, text: str) -> bool:
        """Return whether the speech ``text`` triggers the action; letter case is ignored."""
        return self.hears is not None and self.hears.casefold() in text.casefold()


@dataclass(frozen=True, slots=True)
class ScheduledAction:
    """An action and its time, in seconds."""

    time: float
    action: PersonAction


@dataclass(frozen=True, slots=True)
class RobotUtterance:
    """Speech of the robot: its time in seconds, and the names of the people within earshot."""

    text: str
    time: float
    listeners: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PersonReply:
    """Speech of the person named ``speaker``, at ``time`` in seconds."""

    speaker: str
    text: str
    time: float


class ActionSchedule:
    """Actions of one person in the order of time: actions with a fixed time, and actions triggered by speech."""

    def __init__(self, name: str, actions: Sequence[PersonAction]) -> None:
        self._name = name
        self._triggered_actions = [act for act in actions if act.hears is not None]
        self._trigger_counts = [0 for _ in self._triggered_actions]  # how often each has been set off
        self._schedule: list[ScheduledAction] = []
        for act in actions:
            if act.at is not None:
                self._add(ScheduledAction(act.at, act))

    def is_listening(self, time: float) -> bool:
        """Return whether the person can be spoken to at ``time`` seconds: True until the person leaves."""
        return not any(cue.action.leave for cue in self.actions_until(time))

    def on_speech(self, text: str, time: float) -> list[PersonReply]:
        """Schedule the actions that the robot's speech at ``time`` seconds triggers; return the spoken replies."""
        cues = []
        for number, act in enumerate(self._triggered_actions):
            if act.is_triggered_by(text) and (act.times == 0 or self._trigger_counts[number] < act.times):
                self._trigger_counts[number] += 1
                cues.append(ScheduledAction(time + act.after, act))
        for cue in cues:
            self._add(cue)
        return [PersonReply(self._name, cue.action.say, cue.time) for cue in cues if cue.action.say]

    def actions_until(self, time: float) -> list[ScheduledAction]:
        """Return the actions up to ``time`` seconds, in order; none that come after the person has left."""
        done = []
        for cue in self._schedule:
            if cue.time > time:
                break
            done.append(cue)
            if cue.action.leave:
                break
        return done

    def replies_between(self, after: float, until: float) -> list[PersonReply]:
        """Return the person's speech later than ``after`` and up to ``until`` seconds."""
        spoken = (cue for cue in self.actions_until(until) if cue.action.say and cue.time > after)
        return [PersonReply(self._name, cue.action.say, cue.time) for cue in spoken]

    def _add(self, cue: ScheduledAction) -> None:
        insort(self._schedule, cue, key=lambda each: each.time)


def eye_drop(elapsed: float) -> float:
    """Return how far the eyes are below their usual height, in metres, ``elapsed`` seconds after a nod began."""
    return NOD_DEPTH * sin(2 * pi * elapsed / NOD_TIME) ** 2 if 0 <= elapsed < NOD_TIME else 0.0
