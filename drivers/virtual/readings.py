"""The registers in which a servo tells its state, filled from what a virtual one feels."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from drivers.dynamixel.models import Model
from drivers.dynamixel.register import Coding, Register

_NO_CURRENT: Mapping[int, int] = MappingProxyType({56: 512, 68: 2048})
"""What the current sensors of protocol 1.0 read without current, by their address."""

STALL_CURRENT = 370
"""What an STS reads at its stall torque: 2.4 A."""


class Feeling(NamedTuple):
    """The state of a servo as its sensors feel it, positive where its ticks rise.

    ``position`` in ticks, ``velocity`` in rad/s, ``drive`` as a share of the stall torque, ``voltage`` in volts,
    ``temperature`` in degrees Celsius, ``now`` in seconds.
    """

    position: int
    velocity: float
    drive: float
    arrived: bool
    voltage: float
    temperature: float
    now: float


Told = Callable[[Feeling], int]
"""What a register says of a feeling."""


class Readings:
    """The registers of one model that tell its state."""

    def __init__(self, model: Model) -> None:
        told = _told(model)
        self._rows = [(row, *_span(row), told[row.name]) for row in model.table.registers.values() if row.name in told]

    def tell(self, table: bytearray, feeling: Feeling) -> None:
        """Bring a control table up to date."""
        for row, least, most, told in self._rows:
            table[row.address : row.end] = row.encode(min(max(told(feeling), least), most))


def _told(model: Model) -> dict[str, Told]:
    """What the registers say, by their names."""

    def velocity(feeling: Feeling) -> int:
        return round(feeling.velocity / model.speed_unit)

    def current(feeling: Feeling) -> int:  # protocol 1.0: half its range at full torque
        if model.protocol == "STS":
            return round(STALL_CURRENT * feeling.drive)
        return round(_NO_CURRENT[model.table["present_current"].address] * (1 + feeling.drive / 2))

    return {
        "present_position": lambda feeling: feeling.position,
        "moving": lambda feeling: int(feeling.velocity != 0),
        "moving_status": lambda feeling: int(feeling.arrived),
        "present_voltage": lambda feeling: round(feeling.voltage * 10),
        "present_temperature": lambda feeling: round(feeling.temperature),
        "realtime_tick": lambda feeling: round(feeling.now * 1000) % 32_768,
        "present_pwm": lambda feeling: round(feeling.drive * model.full),
        "velocity_trajectory": velocity,
        "position_trajectory": lambda feeling: feeling.position,
        "present_current": current,
        model.table.velocity: velocity,
        model.table.effort: lambda feeling: round(feeling.drive / model.effort_unit),
    }


def _span(register: Register) -> tuple[int, int]:
    """Return the least and the most that the bytes of ``register`` can say."""
    if register.coding is Coding.SIGN_BIT:
        return -1023, 1023
    if register.coding is Coding.SIGN_15:
        return -32_767, 32_767
    bits = 8 * register.size
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if register.coding is Coding.TWOS else (0, (1 << bits) - 1)
