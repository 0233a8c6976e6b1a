"""What the Kobuki says: each sub-payload as a value, to and from its bytes (protocol table of the vendor).

Pure. Fields are the raw integers of the wire, properties are in SI units. Read with
``wire.decode(payload, FEEDBACK)``; packed (by the virtual base and by tests) with ``wire.encode``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag
from math import radians
from struct import Struct, pack, unpack
from typing import ClassVar, Self

from drivers.kobuki.wire import Part

METRES_PER_TICK = 0.0000852920905
"""How far a wheel rolls for one tick of its encoder."""

GYRO_STEP = radians(0.00875)
"""rad/s for one step of the raw gyro."""


class Side(IntFlag):
    """The bits of bumper and cliff."""

    RIGHT = 1
    CENTRE = 2
    LEFT = 4


DROPPED_RIGHT, DROPPED_LEFT = 1, 2
"""The bits of the wheel drop, which are not those of ``Side``."""


class Charger(IntFlag):
    """The bits of the charger: 0 discharging, 2 dock and full, 6 dock charging, 18 adapter and full, 22 charging."""

    POWERED = 0x02
    CHARGING = 0x04
    ADAPTER = 0x10


_POWERED, _CHARGING, _ADAPTER = (flag.value for flag in Charger)
"""As plain numbers, whose arithmetic takes a fraction of the time: a report comes 50 times a second."""


@dataclass(frozen=True, slots=True)
class Core(Part):
    """The report that comes in every frame. Encoders rise forward and wrap at 16 bits, as does the time."""

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
        """The battery in volts."""
        return self.battery_decivolts / 10

    @property
    def full(self) -> bool:
        """True when the base is on external power and charges no more."""
        return bool(self.charger & _POWERED) and not self.charging

    @property
    def charging(self) -> bool:
        """True while the battery is charged."""
        return bool(self.charger & _CHARGING)

    @property
    def docked(self) -> bool:
        """True while the dock powers the base."""
        return bool(self.charger & _POWERED) and not self.charger & _ADAPTER


@dataclass(frozen=True, slots=True)
class DockInfrared(Part):
    """What each receiver sees of the dock: 1, 2, 4 near left, centre, right; 8, 16, 32 far centre, left, right."""

    right: int = 0
    centre: int = 0
    left: int = 0
    ID: ClassVar[int] = 3
    LAYOUT: ClassVar[Struct] = Struct("<BBB")


@dataclass(frozen=True, slots=True)
class Inertia(Part):
    """Heading and rate of turn by the gyro, anticlockwise positive, in hundredths of a degree (per second)."""

    heading_cdeg: int = 0
    rate_cdeg: int = 0
    ID: ClassVar[int] = 4
    LAYOUT: ClassVar[Struct] = Struct("<hh3x")

    @property
    def rate(self) -> float:
        """The rate of turn in rad/s."""
        return radians(self.rate_cdeg / 100)


@dataclass(frozen=True, slots=True)
class CliffDistance(Part):
    """What the floor sensors measure: 12 bits, for 2 to 15 cm, not linear."""

    right: int = 0
    centre: int = 0
    left: int = 0
    ID: ClassVar[int] = 5
    LAYOUT: ClassVar[Struct] = Struct("<HHH")


@dataclass(frozen=True, slots=True)
class MotorCurrent(Part):
    """The wheel motors' current in steps of 10 mA; the vendor's table says 2 bytes each, the wire has 1."""

    left_10ma: int = 0
    right_10ma: int = 0
    ID: ClassVar[int] = 6
    LAYOUT: ClassVar[Struct] = Struct("<BB")


@dataclass(frozen=True, slots=True)
class Version(Part):
    """Patch, minor and major number, least first as on the wire."""

    patch: int
    minor: int
    major: int
    LAYOUT: ClassVar[Struct] = Struct("<BBBx")

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read it; old firmware sends two bytes with a number of its own. Raises as ``Part.unpack``."""
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
    """Which board it is; told when asked."""

    ID: ClassVar[int] = 10


class FirmwareVersion(Version):
    """Which firmware it runs; told when asked."""

    ID: ClassVar[int] = 11


@dataclass(frozen=True, slots=True)
class RawGyro(Part):
    """The gyro's last two or three samples (100 Hz) as x, y, z of the chip, in steps of 0.00875 degrees/s."""

    number: int
    samples: tuple[tuple[int, int, int], ...]
    ID: ClassVar[int] = 13

    @property
    def rates(self) -> tuple[tuple[float, float, float], ...]:
        """The samples in rad/s about the robot's x, y, z; the chip is mounted a quarter turn round."""
        return tuple((-y * GYRO_STEP, x * GYRO_STEP, z * GYRO_STEP) for x, y, z in self.samples)

    def pack(self) -> bytes:
        """Return the data of the part. Raises struct.error for a value out of range."""
        values = [value for sample in self.samples for value in sample]
        return pack(f"<BB{len(values)}h", self.number, len(values), *values)

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read the part. Raises ValueError when the count does not agree with the length, or is no multiple of 3."""
        if len(data) < 2 or data[1] % 3 or len(data) != 2 + 2 * data[1]:
            raise ValueError(f"raw gyro: {len(data)} bytes do not agree with their count")
        values = iter(unpack(f"<{data[1]}h", data[2:]))
        return cls(data[0], tuple(zip(values, values, values, strict=True)))


@dataclass(frozen=True, slots=True)
class Inputs(Part):
    """The user's sockets: four digital bits, and four analogue values 0..4095 for 0..3.3 V."""

    digital: int = 0
    analogue_0: int = 0
    analogue_1: int = 0
    analogue_2: int = 0
    analogue_3: int = 0
    ID: ClassVar[int] = 16
    LAYOUT: ClassVar[Struct] = Struct("<H4H6x")


@dataclass(frozen=True, slots=True)
class UniqueId(Part):
    """The three words that tell one base from another; told when asked."""

    first: int
    second: int
    third: int
    ID: ClassVar[int] = 19
    LAYOUT: ClassVar[Struct] = Struct("<III")


@dataclass(frozen=True, slots=True)
class Gains(Part):
    """The gains of the wheel controller in thousandths; told when asked."""

    user: int = 0
    p_thousandths: int = 100_000
    i_thousandths: int = 100
    d_thousandths: int = 2000
    ID: ClassVar[int] = 21
    LAYOUT: ClassVar[Struct] = Struct("<BIII")


FEEDBACK: Mapping[int, type[Part]] = {
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
        Gains,
    )
}
"""All sub-payloads of the base by ID."""
