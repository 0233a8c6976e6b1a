"""What may be chosen on the failsafe page: who drives a base how, what befalls it, how full it is, and its reflexes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import radians
from typing import TYPE_CHECKING, Any, Protocol

from config.library import find
from drivers.api import Base, Reflexes, Sides, Source, Velocity
from drivers.api.quick import dataclass
from drivers.api.sections import BaseKeys
from missions.library.drivers import load_robot

if TYPE_CHECKING:
    from missions.plugins.testing.failsafe.eyes import StagedRanger

ROBOT = "turtlebot2"
"""Whose base it is, with its limits and reflexes."""

LEFT, CENTRE, RIGHT, NOTHING = Sides(left=True), Sides(centre=True), Sides(right=True), Sides()


class Hand(Protocol):
    """Whoever can do to a base what befalls it. ``base`` is what it does about that."""

    @property
    def base(self) -> Base:
        """The driver, or the twin."""
        ...

    @property
    def eyes(self) -> "StagedRanger":
        """The range finder that guards it."""
        ...

    def feel(self, bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset()) -> None:
        """Press and uncover its sensors."""
        ...

    def lift(self, *, up: bool) -> None:
        """Take it off the floor, or put it back."""
        ...

    def plug(self, *, there: bool) -> None:
        """Plug it in, or unplug it."""
        ...

    def fill(self, percent: float, *, charging: bool) -> None:
        """Leave so much in its battery."""
        ...


Befalls = Sequence[tuple[float, Callable[[Hand], object]]]
"""What is done to it, and so many seconds after the first of it."""


def _touched(
    bumper: Sides = NOTHING, cliff: Sides = NOTHING, buttons: frozenset[int] = frozenset(), seconds: float = 0.5
) -> Befalls:
    return (0.0, lambda hand: hand.feel(bumper, cliff, buttons)), (seconds, lambda hand: hand.feel())


def _away(seconds: float) -> Befalls:
    return (0.0, lambda hand: hand.plug(there=False)), (seconds, lambda hand: hand.plug(there=True))


def _freeze(*, frozen: bool) -> Callable[[Hand], object]:
    def do(hand: Hand) -> None:
        hand.eyes.frozen = frozen

    return do


STOP, ENABLE = frozenset({0}), frozenset({2})

WHO: Mapping[str, frozenset[Source]] = {
    "a mission": frozenset({Source.MISSION}),
    "a person": frozenset({Source.TELEOP}),
    "both": frozenset({Source.MISSION, Source.TELEOP}),
    "nobody": frozenset(),
}
"""Who commands: from the beginning on, and until something says no."""

WISHES: Mapping[str, Velocity] = {
    "ahead": Velocity(0.2, 0.0),
    "ahead, gently": Velocity(0.05, 0.0),
    "too fast": Velocity(0.6, 0.0),
    "a curve": Velocity(0.2, radians(60)),
    "back": Velocity(-0.2, 0.0),
    "turn": Velocity(0.0, radians(60)),
}
"""What they want."""

FAULTS: Mapping[str, Befalls] = {
    "nothing": (),
    "bumper left": _touched(bumper=LEFT),
    "bumper centre": _touched(bumper=CENTRE),
    "bumper right": _touched(bumper=RIGHT),
    "cliff left": _touched(cliff=LEFT),
    "cliff centre": _touched(cliff=CENTRE),
    "lifted for 2 s": ((0.0, lambda hand: hand.lift(up=True)), (2.0, lambda hand: hand.lift(up=False))),
    "stop button": _touched(buttons=STOP),
    "stop button, then enable": (*_touched(buttons=STOP), *((at + 2.0, do) for at, do in _touched(buttons=ENABLE))),
    "unplugged for 0.6 s": _away(0.6),
    "unplugged for 2 s": _away(2.0),
    "unplugged for 6 s": _away(6.0),
    "something 2 cm ahead for 2 s": ((0.0, lambda hand: hand.eyes.put(0.02)), (2.0, lambda hand: hand.eyes.put(None))),
    "no scans for 4 s": ((0.0, _freeze(frozen=True)), (4.0, _freeze(frozen=False))),
    "who drives falls silent": (),
}
"""What happens after ``BEGINS``."""

SILENCE = "who drives falls silent"

BATTERIES: Mapping[str, tuple[float, bool]] = {
    "full": (100.0, False),
    "low": (20.0, False),
    "critical": (5.0, False),
    "critical, on the dock": (5.0, True),
}
"""How full its battery is, in percent, and whether it charges."""

REFLEXES: Mapping[str, Mapping[str, Any]] = {
    "as it ships": {},
    "bumper: stop": {"bumper": "stop"},
    "latch": {"bumper": "latch", "cliff": "latch", "wheel_drop": "latch"},
}
"""What its file says of reflexes."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Words of ``WHO``, ``WISHES``, ``FAULTS``, ``BATTERIES`` and ``REFLEXES``. Raises KeyError for others."""

    who: str = "a mission"
    wish: str = "ahead"
    fault: str = "nothing"
    battery: str = "full"
    reflexes: str = "as it ships"

    def __post_init__(self) -> None:
        for name, words in CHOICES.items():
            if getattr(self, name) not in words:
                raise KeyError(f"{name} is one of {', '.join(words)}, not {getattr(self, name)!r}")


CHOICES: Mapping[str, Sequence[str]] = {
    "who": tuple(WHO),
    "wish": tuple(WISHES),
    "fault": tuple(FAULTS),
    "battery": tuple(BATTERIES),
    "reflexes": tuple(REFLEXES),
}
"""What can be chosen, by the members of a ``Setting``."""


@cache
def _shipped() -> BaseKeys:
    keys = load_robot(find("robots", ROBOT)).base
    if keys is None:
        raise LookupError(f"{ROBOT} has no base")
    return keys


def keys_for(setting: Setting) -> BaseKeys:
    """Return what the robot file says of its base, with the reflexes of a setting."""
    keys = _shipped()
    reflexes: Reflexes = replace(keys.reflexes, **REFLEXES[setting.reflexes])
    return replace(keys, reflexes=reflexes)
