"""Reports of the Kobuki: each sub-payload as an object, decoded from bytes and encoded to bytes.

It follows the protocol table of the vendor. Fields are the raw integers of the wire, properties are in SI units. The
driver decodes with ``wire.decode(payload, FEEDBACK)``; virtual base and tests encode with ``wire.encode``. No I/O.
"""

from collections.abc import Mapping
from enum import IntFlag
from math import radians
from struct import Struct, pack, unpack
from typing import ClassVar, Self

from drivers.api.fast_dataclass import dataclass
from drivers.kobuki.wire import KobukiSubpayload

METRES_PER_TICK = 0.0000852920905
"""Travel of a wheel for one tick of its encoder."""

GYRO_STEP = radians(0.00875)
"""Step of the raw gyro in rad/s."""


class Side(IntFlag):
    """Bits of the bumper and the cliff sensors by side."""

    RIGHT = 1
    CENTRE = 2
    LEFT = 4


DROPPED_RIGHT, DROPPED_LEFT = 1, 2
"""Bits of the wheel drop; they differ from ``Side``."""


class Charger(IntFlag):
    """Bits of the charger byte. A value combines them, such as 6 for charging on the dock.

    0 is discharging, 2 docked and full, 6 charging on the dock, 18 full on the adapter, and 22 charging on the adapter.
    """

    POWERED = 0x02
    CHARGING = 0x04
    ADAPTER = 0x10


_POWERED, _CHARGING, _ADAPTER = (flag.value for flag in Charger)
"""Plain integers, which are faster than flags: 50 reports arrive per second."""


@dataclass(frozen=True, slots=True)
class Core(KobukiSubpayload):
    """Core report of a Kobuki, which is in every frame. The encoder counts rise forward.

    Encoder counts and time are 16-bit numbers that wrap.
    """

    time_ms: int = 0
    bumper: int = 0
    wheel_drop: int = 0
    cliff: int = 0
    left_encoder: int = 0
    right_encoder: int = 0
    left_pwm: int = 0
    right_pwm: int = 0
    buttons: int = 0
    charger: int = 0
    battery_decivolts: int = 0
    overcurrent: int = 0  # 1 left, 2 right
    ID: ClassVar[int] = 1
    LAYOUT: ClassVar[Struct] = Struct("<HBBBHHbbBBBB")

    @property
    def voltage(self) -> float:
        """Battery voltage in volts."""
        return self.battery_decivolts / 10

    @property
    def full(self) -> bool:
        """True if the battery is full: the base has external power and does not charge."""
        return bool(self.charger & _POWERED) and not self.charging

    @property
    def charging(self) -> bool:
        """True while the battery is charging."""
        return bool(self.charger & _CHARGING)

    @property
    def docked(self) -> bool:
        """True while the dock powers the base."""
        return bool(self.charger & _POWERED) and not self.charger & _ADAPTER


@dataclass(frozen=True, slots=True)
class DockInfrared(KobukiSubpayload):
    """Beams of the dock at each receiver: 1, 2, 4 near left, centre, right; 8, 16, 32 far centre, left, right."""

    right: int = 0
    centre: int = 0
    left: int = 0
    ID: ClassVar[int] = 3
    LAYOUT: ClassVar[Struct] = Struct("<BBB")


@dataclass(frozen=True, slots=True)
class Inertia(KobukiSubpayload):
    """Heading and turn rate of the gyro, anticlockwise positive, in hundredths of a degree (per second)."""

    heading_cdeg: int = 0
    rate_cdeg: int = 0
    ID: ClassVar[int] = 4
    LAYOUT: ClassVar[Struct] = Struct("<hh3x")

    @property
    def rate(self) -> float:
        """Turn rate of the gyro in rad/s."""
        return radians(self.rate_cdeg / 100)


@dataclass(frozen=True, slots=True)
class CliffDistance(KobukiSubpayload):
    """Raw values of the floor sensors: 12 bits for 2 to 15 cm, not linear."""

    right: int = 0
    centre: int = 0
    left: int = 0
    ID: ClassVar[int] = 5
    LAYOUT: ClassVar[Struct] = Struct("<HHH")


@dataclass(frozen=True, slots=True)
class MotorCurrent(KobukiSubpayload):
    """Currents of the wheel motors in steps of 10 mA. Each has one byte, not two as in the vendor's table."""

    left_10ma: int = 0
    right_10ma: int = 0
    ID: ClassVar[int] = 6
    LAYOUT: ClassVar[Struct] = Struct("<BB")


@dataclass(frozen=True, slots=True)
class Version(KobukiSubpayload):
    """Version number of a Kobuki's board or firmware, in the order of the wire."""

    patch: int
    minor: int
    major: int
    LAYOUT: ClassVar[Struct] = Struct("<BBBx")

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode a version from ``data``. Old firmware sends a number of two bytes instead of three version bytes.

        Raises the exceptions of ``KobukiSubpayload.unpack``.
        """
        if len(data) == 2:
            number = int.from_bytes(data, "little")
            if number not in _OLD_VERSIONS:
                raise ValueError(f"{number} is none of the two-byte versions")
            return cls(*_OLD_VERSIONS[number])
        return cls(*cls.LAYOUT.unpack(data))

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}"


_OLD_VERSIONS = {123: (0, 0, 1), 110: (0, 1, 1), 10100: (0, 1, 1), 111: (1, 1, 1), 10101: (1, 1, 1)}


class HardwareVersion(Version):
    """Version of the board; sent on request."""

    ID: ClassVar[int] = 10


class FirmwareVersion(Version):
    """Version of the firmware; sent on request."""

    ID: ClassVar[int] = 11


@dataclass(frozen=True, slots=True)
class RawGyro(KobukiSubpayload):
    """Last two or three samples of the gyro (100 Hz): x, y, z of the chip, in steps of 0.00875 degrees/s."""

    number: int
    samples: tuple[tuple[int, int, int], ...]
    ID: ClassVar[int] = 13

    @property
    def rates(self) -> tuple[tuple[float, float, float], ...]:
        """Samples in rad/s about x, y, z of the robot. The chip is mounted at a right angle."""
        return tuple((-y * GYRO_STEP, x * GYRO_STEP, z * GYRO_STEP) for x, y, z in self.samples)

    def pack(self) -> bytes:
        """Encode the data. Raises struct.error for a value out of range."""
        values = [value for sample in self.samples for value in sample]
        return pack(f"<BB{len(values)}h", self.number, len(values), *values)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Decode the data. Raises ValueError if the number of values in it is wrong, or not a multiple of 3."""
        if len(data) < 2 or data[1] % 3 or len(data) != 2 + 2 * data[1]:
            raise ValueError(f"raw gyro: {len(data)} bytes do not agree with their count")
        values = iter(unpack(f"<{data[1]}h", data[2:]))
        return cls(data[0], tuple(zip(values, values, values, strict=True)))


@dataclass(frozen=True, slots=True)
class Inputs(KobukiSubpayload):
    """Input sockets for users: four digital bits, and four analogue values 0..4095 for 0..3.3 V."""

    digital: int = 0
    analogue_0: int = 0
    analogue_1: int = 0
    analogue_2: int = 0
    analogue_3: int = 0
    ID: ClassVar[int] = 16
    LAYOUT: ClassVar[Struct] = Struct("<H4H6x")


@dataclass(frozen=True, slots=True)
class UniqueId(KobukiSubpayload):
    """Unique ID of a base; sent on request."""

    first: int
    second: int
    third: int
    ID: ClassVar[int] = 19
    LAYOUT: ClassVar[Struct] = Struct("<III")


@dataclass(frozen=True, slots=True)
class KobukiGains(KobukiSubpayload):
    """Gains of the wheel controller in thousandths; sent on request."""

    user: int = 0
    p_thousandths: int = 100_000
    i_thousandths: int = 100
    d_thousandths: int = 2000
    ID: ClassVar[int] = 21
    LAYOUT: ClassVar[Struct] = Struct("<BIII")


FEEDBACK: Mapping[int, type[KobukiSubpayload]] = {
    kind.ID: kind
    for kind in (
        Core,
        DockInfrared,
        Inertia,
        CliffDistance,
        MotorCurrent,
        HardwareVersion,
        FirmwareVersion,
        RawGyro,
        Inputs,
        UniqueId,
        KobukiGains,
    )
}
"""Classes of the parts of a Kobuki's reports by ID."""
