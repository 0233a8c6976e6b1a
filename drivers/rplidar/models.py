"""Models of the RPLIDAR: measuring range, turn rate, and motor control."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

MOTOR_PWM = 660
"""Duty cycle at which the vendor's driver runs the motor of an A2; 1023 is full power."""

SAMPLE_RATE = 2000.0
"""Measurements per second of a plain scan."""


@dataclass(frozen=True, slots=True)
class RPLidarModel:
    """Model of the RPLIDAR that communicates at 115200 baud.

    The measuring range is ``min_range`` to ``max_range`` metres, ``turn_rate`` in turns per second. With ``has_pwm``
    the adapter board may set the duty cycle of the motor; other motors are switched only by DTR.
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
