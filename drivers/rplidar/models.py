"""What tells the models apart: how far they see, how fast they turn, and what turns them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

PWM = 660
"""The pulse width of 1023 at which the maker runs the motor of an A2."""

SAMPLES = 2000.0
"""Measurements a second of a plain scan."""


@dataclass(frozen=True, slots=True)
class Model:
    """One of the finders that speak this protocol at 115200 baud.

    It measures from ``least`` to ``most`` metres and turns ``rate`` times a second. ``pwm``: the board below it may
    set the pulse width of the motor; the motor of the others is switched by the line DTR alone.
    """

    name: str
    series: int
    least: float
    most: float
    rate: float
    pwm: bool


MODELS: Mapping[str, Model] = MappingProxyType(
    {
        "a1": Model("A1", series=1, least=0.15, most=12.0, rate=5.5, pwm=False),
        "a2": Model("A2", series=2, least=0.15, most=12.0, rate=10.0, pwm=True),
    }
)
