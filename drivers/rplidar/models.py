"""What tells the models apart: how far they see, how fast they turn, and what turns them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

MOTOR_PWM = 660
"""The pulse width of 1023 at which the maker runs the motor of an A2."""

SAMPLE_RATE = 2000.0
"""Measurements a second of a plain scan."""


@dataclass(frozen=True, slots=True)
class RPLidarModel:
    """One of the finders that speak this protocol at 115200 baud.

    It measures from ``min_range`` to ``max_range`` metres and turns ``turn_rate`` times a second. ``has_pwm``: the board below it may
    set the pulse width of the motor; the motor of the others is switched by the line DTR alone.
    """

    name: str
    series: int
    min_range: float
    max_range: float
    turn_rate: float
    has_pwm: bool


MODELS: Mapping[str, RPLidarModel] = MappingProxyType(
    {
        "a1": RPLidarModel("A1", series=1, min_range=0.15, max_range=12.0, turn_rate=5.5, has_pwm=False),
        "a2": RPLidarModel("A2", series=2, min_range=0.15, max_range=12.0, turn_rate=10.0, has_pwm=True),
    }
)
