"""Fault injection: faults of the robot during a test, as in a test file: ``camera frozen from 5 s to 8 s``."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from drivers.api.kinds import KINDS
from drivers.api.steering import BUTTON_COUNT
from missions.plugins.testing.event_specs import EventSpec, NodeError, read_event
from missions.plugins.testing.phrases import Phrase

UNPLUGGED = ("unplugged",)

DRIVE_STATES = (
    "blocked", "slipping", "reversed", "uncounted", "drifting", "late", "e_stopped", "back_limited",
)  # fmt: skip
"""Words for faults of a base's drive and odometry in a test file."""

FAULT_STATES: dict[str, tuple[str, ...]] = {
    "base": ("unplugged", "bumped", "cliff", "lifted", "battery", "button", "docked", "driven", *DRIVE_STATES),
    "arm": ("unplugged", "overloaded", "turned", "blocked", "frozen", "reversed", "silent", "pushed"),
    "head": ("unplugged", "blocked", "frozen", "reversed"),
    "camera": ("unplugged", "frozen", "covered", "slow"),
    "microphone": ("unplugged", "deaf"),
    "voice": ("unplugged", "hanging"),
    "run": ("stalled", "paused", "stopped"),
}
"""Fault states by kind of part, and of the run itself; other kinds can only be ``UNPLUGGED``."""

RUN = "run"
"""Word that stands in place of a part in a fault of the tick loop: "run stalled"."""

SIDES = ("left", "centre", "right")
PERMANENT_STATES = ("battery", "overloaded", "turned")
"""Fault states that never end by themselves."""

TEMPORARY_STATES = ("stalled", "paused", "stopped")
"""Fault states that suspend the mission, and so must have an end."""

JOINT_STATES = {
    "overloaded": "elbow",
    "turned": "elbow to 30 deg",
    "blocked": "elbow",
    "frozen": "elbow",
    "reversed": "elbow",
    "silent": "elbow",
    "pushed": "elbow to 30 deg",
}
"""Fault states of one arm joint, each with an example of its words in a test file.

``turned`` is a turn by hand, which a stiff joint resists. ``pushed`` holds the joint at an angle by force.
"""

NO_OTHERS: Mapping[str, str] = MappingProxyType({})
"""Empty mapping, for a robot without additional parts."""

AMOUNT_STATES = {"drifting": ("at", "turn rate"), "late": ("by", "duration")}
"""Fault states with an amount: the word before the amount, and the dimension of the amount."""

TIME_WORDS = ("from", "at", "for", "when")


@dataclass(frozen=True, slots=True)
class FaultSpec:
    """Fault: a ``part`` is in a ``state`` for ``seconds`` from ``start`` on, or from the first ``trigger`` on.

    ``detail`` is the side of a bumper or cliff sensor, a joint name, or a button number; ``amount`` a battery level
    (0..1), the angle (radians) to which a person turns a joint, a gyro drift (rad/s), or an odometry delay (s).
    """

    part: str
    state: str
    detail: str = ""
    amount: float = 0.0
    start: float = 0.0
    seconds: float = math.inf
    trigger: EventSpec | None = None

    @property
    def is_joint_fault(self) -> bool:
        """Whether ``detail`` is a joint name."""
        return self.state in JOINT_STATES and bool(self.detail)


def read_fault(phrase: Phrase, node_error: NodeError, others: Mapping[str, str] = NO_OTHERS) -> FaultSpec:
    """Read ``PART STATE [from T [to T] | at T [for T] | [for] T | when MOMENT [for T]]``.

    ``others`` maps the names of additional parts of this robot to their kinds.
    """
    part = phrase.take_if(*KINDS, RUN, *others)
    if not part:
        phrase.reject("the part with the fault", (*KINDS, RUN, *others))
        return FaultSpec("", "")
    states = FAULT_STATES.get(others.get(part, part), UNPLUGGED)
    state = phrase.take_if(*states)
    if not state:
        phrase.reject(f"the fault of the {part}", states)
        return FaultSpec(part, "")
    of_joint = state in JOINT_STATES and others.get(part, part) == "arm"
    detail, amount = _read_joint(phrase, state) if of_joint else _read_detail(phrase, state)
    start, seconds, moment = _read_time(phrase, node_error)
    if state in PERMANENT_STATES and seconds < math.inf:
        again = "; write the next level as another fault: 'base battery at 90 % at 15 s'" if state == "battery" else ""
        phrase.add_fault(f"'{state}' does not end by itself", f"remove its end{again}")
    if state in TEMPORARY_STATES and seconds == math.inf:
        phrase.add_fault(f"'{part} {state}' needs an end", f"such as '{part} {state} at 3 s for 2 s'")
    phrase.expect_end()
    return FaultSpec(part, state, detail, amount, start, seconds, moment)


def _read_detail(phrase: Phrase, state: str) -> tuple[str, float]:
    if state in ("bumped", "cliff"):
        return phrase.take_if(*SIDES) or "centre", 0.0
    if state == "button":
        return _read_button(phrase), 0.0
    if state in AMOUNT_STATES:
        word, dimension = AMOUNT_STATES[state]
        if not phrase.take_if(word):
            phrase.reject(f"the word after '{state}'", (word,))
        low = -math.inf if state == "drifting" else 0.0
        return "", phrase.take_quantity(f"'{state}'", dimension, low=low, high=math.inf if state == "drifting" else 2.0)
    if state == "battery" and not phrase.take_if("at"):
        phrase.reject("the word after 'battery'", ("at",))
    if state == "battery":
        return "", phrase.take_quantity(f"'{state}'", "share", high=1.0)
    return "", 0.0


def _read_joint(phrase: Phrase, state: str) -> tuple[str, float]:
    """Return a joint name, and the angle to which a fault turns the joint."""
    if phrase.word in ("", "to", *TIME_WORDS):
        phrase.add_fault(f"which joint is {state} is missing here", f"such as 'arm {state} {JOINT_STATES[state]}'")
    joint = phrase.take()
    if state not in ("turned", "pushed"):
        return joint, 0.0
    if not phrase.take_if("to"):
        phrase.reject(f"the word after '{joint}'", ("to",))
    return joint, phrase.take_quantity(f"'{state}'", "angle", low=-math.pi, high=math.pi)


def _read_button(phrase: Phrase) -> str:
    """Read a button fault such as ``0 pressed``; return the number of the button."""
    numbers = tuple(map(str, range(BUTTON_COUNT)))
    number = phrase.take_if(*numbers)
    if not number:
        phrase.reject("the number of a button", numbers)
    elif not phrase.take_if("pressed"):
        phrase.reject(f"the state of button {number}", ("pressed",))
    return number


def _read_time(phrase: Phrase, node_error: NodeError) -> tuple[float, float, EventSpec | None]:
    """Return start, duration and trigger of a fault; by default it lasts from the beginning, without end."""
    start, moment = 0.0, None
    if phrase.take_if("from"):
        start = phrase.take_quantity("'from'", "duration")
        if phrase.take_if("to"):
            end = phrase.take_quantity("'to'", "duration")
            if end <= start:
                phrase.add_fault("it ends before it begins")
            return start, end - start, None
        return start, math.inf, None
    if phrase.take_if("at"):
        start = phrase.take_quantity("'at'", "duration")
    elif phrase.take_if("when"):
        moment = read_event(phrase, node_error)
    seconds = (
        phrase.take_quantity("'for'", "duration") if phrase.take_if("for") or phrase.word[:1].isdigit() else math.inf
    )
    return start, seconds, moment
