"""Commands of the Kobuki protocol, encoded to bytes and decoded from bytes (protocol table of the vendor).

The driver encodes them with ``wire.encode``; the virtual base and tests decode them with ``wire.decode(payload,
COMMANDS)``. No I/O.
"""

from collections.abc import Mapping
from enum import IntEnum, IntFlag
from struct import Struct
from typing import ClassVar, Self

from drivers.api.fast_dataclass import dataclass
from drivers.kobuki.wire import KobukiSubpayload

WHEEL_SEPARATION = 0.23
"""Distance of the wheels of a Kobuki in metres."""

_HALF = 1000 * WHEEL_SEPARATION / 2  # mm
_EPSILON = 0.0001  # m/s and rad/s: slower velocities are zero
_STRAIGHT, _SPIN = 0, 1  # radii with a special meaning
_NOTE_PERIOD = 0.00000275  # s


@dataclass(frozen=True, slots=True)
class BaseControl(KobukiSubpayload):
    """Command to drive: ``speed_mm`` in mm/s and ``radius_mm`` in mm. Radius 0 is straight on, 1 turns on the spot.

    On a circle, a positive radius has its centre on the left. The speed is that of the outer wheel, positive forwards.
    """

    speed_mm: int
    radius_mm: int
    ID: ClassVar[int] = 1
    LAYOUT: ClassVar[Struct] = Struct("<hh")

    @classmethod
    def of(cls, linear: float, angular: float) -> Self:
        """Return the command for ``linear`` m/s and ``angular`` rad/s, both finite, by the rule of the vendor's driver.

        Like that driver, it truncates to whole millimetres and clips to 16 bits.
        """
        if abs(angular) < _EPSILON:
            return cls(_whole(1000 * linear), _STRAIGHT)
        radius = 1000 * linear / angular
        if abs(linear) < _EPSILON or abs(radius) <= _SPIN:
            return cls(_whole(_HALF * angular), _SPIN)
        outer = radius + _HALF if radius > 0 else radius - _HALF
        return cls(_whole(outer * angular), _whole(radius))

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity of the base for this command: m/s along x and rad/s about z."""
        if self.radius_mm == _STRAIGHT:
            return self.speed_mm / 1000, 0.0
        if self.radius_mm == _SPIN:
            return 0.0, self.speed_mm / _HALF
        angular = self.speed_mm / (self.radius_mm + (_HALF if self.radius_mm > 0 else -_HALF))
        return self.radius_mm * angular / 1000, angular


@dataclass(frozen=True, slots=True)
class KobukiSound(KobukiSubpayload):
    """Command to play a tone; ``note`` is its period in steps of 2.75 microseconds."""

    note: int
    duration_ms: int
    ID: ClassVar[int] = 3
    LAYOUT: ClassVar[Struct] = Struct("<HB")

    @classmethod
    def of(cls, frequency: float, duration: float) -> Self:
        """Return the tone of ``frequency`` hertz (5.6 at least) for ``duration`` seconds (0.255 at most)."""
        return cls(int(1 / (frequency * _NOTE_PERIOD)), int(1000 * duration))


class KobukiTune(IntEnum):
    """Built-in tunes of the base, by their number in the protocol."""

    ON = 0
    OFF = 1
    RECHARGE = 2
    BUTTON = 3
    ERROR = 4
    CLEANING_START = 5
    CLEANING_END = 6


@dataclass(frozen=True, slots=True)
class SoundSequence(KobukiSubpayload):
    """Command to play a ``KobukiTune``."""

    tune: int
    ID: ClassVar[int] = 4
    LAYOUT: ClassVar[Struct] = Struct("<B")


class Extra(IntFlag):
    """Flags of the values that the base sends only on request."""

    HARDWARE = 1
    FIRMWARE = 2
    UNIQUE_ID = 8


@dataclass(frozen=True, slots=True)
class RequestExtra(KobukiSubpayload):
    """Request for the values whose ``Extra`` flags are set."""

    flags: int
    ID: ClassVar[int] = 9
    LAYOUT: ClassVar[Struct] = Struct("<H")


class KobukiOutput(IntFlag):
    """Bits of the output word: digital outputs, external supplies and the two lights.

    Both bits of a light together are orange.
    """

    DIGITAL_0 = 0x0001
    DIGITAL_1 = 0x0002
    DIGITAL_2 = 0x0004
    DIGITAL_3 = 0x0008
    SUPPLY_3V3 = 0x0010
    SUPPLY_5V = 0x0020
    SUPPLY_12V_5A = 0x0040
    SUPPLY_12V_1A5 = 0x0080
    LED1_RED = 0x0100
    LED1_GREEN = 0x0200
    LED2_RED = 0x0400
    LED2_GREEN = 0x0800


OUTPUTS_AT_START = (
    KobukiOutput.SUPPLY_3V3 | KobukiOutput.SUPPLY_5V | KobukiOutput.SUPPLY_12V_5A | KobukiOutput.SUPPLY_12V_1A5
)
"""Output word of a base that was just switched on: all external supplies on, lights and digital outputs off.

Every other output word must keep these supplies on.
"""


@dataclass(frozen=True, slots=True)
class SetOutputs(KobukiSubpayload):
    """Command to set all ``KobukiOutput`` bits."""

    word: int
    ID: ClassVar[int] = 12
    LAYOUT: ClassVar[Struct] = Struct("<H")


@dataclass(frozen=True, slots=True)
class SetGains(KobukiSubpayload):
    """Command to set the gains of the wheel controller. Requires firmware 1.2 or newer.

    If ``user`` is 0, the base uses the gains of the factory, else the given ones, in thousandths.
    """

    user: int
    p_thousandths: int = 100_000
    i_thousandths: int = 100
    d_thousandths: int = 2000
    ID: ClassVar[int] = 13
    LAYOUT: ClassVar[Struct] = Struct("<BIII")


@dataclass(frozen=True, slots=True)
class GetGains(KobukiSubpayload):
    """Request for the gains of the wheel controller. The field ``unused`` has no meaning."""

    unused: int = 0
    ID: ClassVar[int] = 14
    LAYOUT: ClassVar[Struct] = Struct("<B")


COMMANDS: Mapping[int, type[KobukiSubpayload]] = {
    kind.ID: kind for kind in (BaseControl, KobukiSound, SoundSequence, RequestExtra, SetOutputs, SetGains, GetGains)
}
"""Classes of the Kobuki's commands by ID. In the vendor's table the IDs 13 and 14 are both misprinted as 1."""


def _whole(value: float) -> int:
    """Truncate towards zero and clip to a signed 16-bit integer."""
    return max(-0x8000, min(int(value), 0x7FFF))
