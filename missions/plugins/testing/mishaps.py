"""What goes wrong with the robot during a test, as its file writes it: ``camera frozen from 5 s to 8 s``."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from drivers.api.kinds import KINDS
from drivers.api.steering import BUTTONS
from missions.plugins.testing.moments import EventSpec, KnownNode, read_moment
from missions.plugins.testing.phrases import Phrase

UNPLUGGED = ("unplugged",)

OF_THE_DRIVE = (
    "blocked", "slipping", "reversed", "uncounted", "drifting", "late", "e_stopped", "back_limited",
)  # fmt: skip
"""Faults of the drive and the odometry of a base."""

STATES: dict[str, tuple[str, ...]] = {
    "base": ("unplugged", "bumped", "cliff", "lifted", "battery", "button", "docked", "driven", *OF_THE_DRIVE),
    "arm": ("unplugged", "overloaded", "turned", "blocked", "frozen", "reversed", "silent", "pushed"),
    "head": ("unplugged", "blocked", "frozen", "reversed"),
    "camera": ("unplugged", "frozen", "covered", "slow"),
    "microphone": ("unplugged", "deaf"),
    "voice": ("unplugged", "hanging"),
    "run": ("stalled", "paused", "stopped"),
}
"""What can happen to parts, and to the run itself; to a kind that is not here, only that it is ``UNPLUGGED``."""

RUN = "run"
"""What stands for the tick loop, which is no part of the robot."""

SIDES = ("left", "centre", "right")
LASTING = ("battery", "overloaded", "turned")
"""States that do not end by themselves."""

PASSING = ("stalled", "paused", "stopped")
"""States in which nothing of the mission goes on, and which must end for that."""

JOINT = {
    "overloaded": "elbow",
    "turned": "elbow to 30 deg",
    "blocked": "elbow",
    "frozen": "elbow",
    "reversed": "elbow",
    "silent": "elbow",
    "pushed": "elbow to 30 deg",
}
"""States of one joint of the arm, and how each is written. Who turns a joint that is stiff turns it in vain; who pushes
it holds it there by force."""

NO_OTHERS: Mapping[str, str] = MappingProxyType({})
"""A robot without further parts of a kind."""

MEASURED = {"drifting": ("at", "turn rate"), "late": ("by", "duration")}
"""States with an amount: the word before it, and its dimension."""

WHEN = ("from", "at", "for", "when")


@dataclass(frozen=True, slots=True)
class Mishap:
    """A ``part`` of the robot is in a ``state`` for ``seconds`` from ``start`` on, or from the first ``moment`` on.

    ``detail`` is where it bumps or feels a cliff, the name of a joint, or the number of a button; ``amount`` what is
    left of a battery (0..1), the angle (radians) that somebody turns a joint to, the drift of a gyro (rad/s), or the
    delay of odometry (s).
    """

    part: str
    state: str
    detail: str = ""
    amount: float = 0.0
    start: float = 0.0
    seconds: float = math.inf
    moment: EventSpec | None = None

    @property
    def of_joint(self) -> bool:
        """Whether ``detail`` is the name of a joint."""
        return self.state in JOINT and bool(self.detail)


def read_mishap(phrase: Phrase, known: KnownNode, others: Mapping[str, str] = NO_OTHERS) -> Mishap:
    """Read ``PART STATE [from T [to T] | at T [for T] | [for] T | when MOMENT [for T]]``.

    ``others`` are the kinds of further parts of this robot, by names of their own.
    """
    part = phrase.took(*KINDS, RUN, *others)
    if not part:
        phrase.wrong("what something happens to", (*KINDS, RUN, *others))
        return Mishap("", "")
    states = STATES.get(others.get(part, part), UNPLUGGED)
    state = phrase.took(*states)
    if not state:
        phrase.wrong(f"what happens to the {part}", states)
        return Mishap(part, "")
    of_joint = state in JOINT and others.get(part, part) == "arm"
    detail, amount = _joint(phrase, state) if of_joint else _details(phrase, state)
    start, seconds, moment = _when(phrase, known)
    if state in LASTING and seconds < math.inf:
        phrase.fault(f"'{state}' does not end by itself", "leave out when it ends")
    if state in PASSING and seconds == math.inf:
        phrase.fault(f"'{part} {state}' has to end", f"such as '{part} {state} at 3 s for 2 s'")
    phrase.end()
    return Mishap(part, state, detail, amount, start, seconds, moment)


def _details(phrase: Phrase, state: str) -> tuple[str, float]:
    """Read what belongs to a state: where, which one, or how much."""
    if state in ("bumped", "cliff"):
        return phrase.took(*SIDES) or "centre", 0.0
    if state == "button":
        return _button(phrase), 0.0
    if state in MEASURED:
        word, dimension = MEASURED[state]
        if not phrase.took(word):
            phrase.wrong(f"what follows '{state}'", (word,))
        low = -math.inf if state == "drifting" else 0.0
        return "", phrase.quantity(f"'{state}'", dimension, low=low, high=math.inf if state == "drifting" else 2.0)
    if state == "battery" and not phrase.took("at"):
        phrase.wrong("what follows 'battery'", ("at",))
    if state == "battery":
        return "", phrase.quantity(f"'{state}'", "share", high=1.0)
    return "", 0.0


def _joint(phrase: Phrase, state: str) -> tuple[str, float]:
    """Read which joint, and to which angle it is turned."""
    if phrase.word in ("", "to", *WHEN):
        phrase.fault(f"which joint is {state} is missing here", f"such as 'arm {state} {JOINT[state]}'")
    joint = phrase.take()
    if state not in ("turned", "pushed"):
        return joint, 0.0
    if not phrase.took("to"):
        phrase.wrong(f"what follows '{joint}'", ("to",))
    return joint, phrase.quantity(f"'{state}'", "angle", low=-math.pi, high=math.pi)


def _button(phrase: Phrase) -> str:
    """Read ``0 pressed``."""
    numbers = tuple(map(str, range(BUTTONS)))
    number = phrase.took(*numbers)
    if not number:
        phrase.wrong("the number of a button", numbers)
    elif not phrase.took("pressed"):
        phrase.wrong(f"what becomes of button {number}", ("pressed",))
    return number


def _when(phrase: Phrase, known: KnownNode) -> tuple[float, float, EventSpec | None]:
    """Read when it happens, and for how long: from the beginning, and for good, where nothing is said."""
    start, moment = 0.0, None
    if phrase.took("from"):
        start = phrase.quantity("'from'", "duration")
        if phrase.took("to"):
            end = phrase.quantity("'to'", "duration")
            if end <= start:
                phrase.fault("it ends before it begins")
            return start, end - start, None
        return start, math.inf, None
    if phrase.took("at"):
        start = phrase.quantity("'at'", "duration")
    elif phrase.took("when"):
        moment = read_moment(phrase, known)
    seconds = phrase.quantity("'for'", "duration") if phrase.took("for") or phrase.word[:1].isdigit() else math.inf
    return start, seconds, moment
