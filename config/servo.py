"""What a robot file must know of each model of Dynamixel servo: its steps, and which protocol it speaks.

``drivers.dynamixel.models`` knows the rest; a test holds the two together.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class ServoModel:
    """A model: ``tick`` is the angle of one step (rad), ``centre`` the step of angle zero, ``last`` the highest one."""

    name: str
    tick: float
    centre: int
    last: int
    protocol: int

    @property
    def reach(self) -> tuple[float, float]:
        """The lowest and the highest angle (rad from the centre) that it can be sent to."""
        return self.angle(0), self.angle(self.last)

    @property
    def last_id(self) -> int:
        """The highest id that it can have."""
        return 253 if self.protocol == 1 else 252

    def angle(self, ticks: float) -> float:
        """Return the angle in radians from the centre."""
        return (ticks - self.centre) * self.tick


_COARSE = ("AX-12A", "AX-12W", "AX-18A", "RX-24F", "RX-28", "RX-64")
_MX = ("MX-28", "MX-64", "MX-106")
_MODERN = ("MX-28(2.0)", "MX-64(2.0)", "MX-106(2.0)", "XL430-W250", "XM430-W210", "XM430-W350")

SERVO_MODELS: Mapping[str, ServoModel] = MappingProxyType(
    {
        model.name: model
        for model in (
            *(ServoModel(name, radians(300) / 1024, 512, 1023, 1) for name in _COARSE),
            ServoModel("EX-106+", radians(250.92) / 4096, 2048, 4095, 1),
            *(ServoModel(name, radians(360) / 4096, 2048, 4095, 1) for name in _MX),
            *(ServoModel(name, radians(360) / 4096, 2048, 4095, 2) for name in _MODERN),
        )
    }
)
"""The models by name; an MX is one with the firmware as delivered, or with that of protocol 2.0."""

ALIASES: Mapping[str, str] = MappingProxyType({"AX-12": "AX-12A", "AX-12+": "AX-12A"})
"""Names of models that are the same to a program."""
