"""Structure of a control table: registers, their encoding, and the blocks that are read at once.

A control table holds settings at its front, which survive a power cut (EEPROM), then goals and readings (RAM). Numbers
are little-endian, except in Feetech's SCS. The tables of the models are in ``tables``.
"""

from collections.abc import Mapping
from difflib import get_close_matches
from enum import Enum
from typing import Literal, NamedTuple

from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest


class Coding(Enum):
    """Encoding of a register's bytes as a number."""

    UNSIGNED = "unsigned"
    SIGN_10 = "sign in bit 10"  # protocol 1.0: size in bits 0..9, bit 10 set when it points clockwise
    SIGN_11 = "sign in bit 11"  # STS
    SIGN_15 = "sign in bit 15"  # STS
    TWOS_COMPLEMENT = "two's complement"  # protocol 2.0, and positions over several turns


# Looking up an enum member is slow, and registers are used many times a second.
_UNSIGNED, _TWOS, _SIGN_BIT, _SIGN_11 = Coding.UNSIGNED, Coding.TWOS_COMPLEMENT, Coding.SIGN_10, Coding.SIGN_11


@dataclass(frozen=True, slots=True)
class Register:
    """A register of a control table.

    ``size`` is in bytes; ``lower`` and ``upper`` bound written values; ``default`` is the factory value or, in RAM, the
    value after power-on. ``unit`` is the value of one step, such as ``0.1 V``; empty for codes and flags.
    """

    name: str
    address: int
    size: int
    default: int
    lower: int
    upper: int
    writable: bool = True
    eeprom: bool = False  # kept without power; the others start from their defaults
    coding: Coding = Coding.UNSIGNED
    unit: str = ""
    byte_order: Literal["little", "big"] = "little"  # of its bytes

    @property
    def end(self) -> int:
        """Address in the control table after the register."""
        return self.address + self.size

    def encode(self, value: int) -> bytes:
        """Return ``value`` as bytes of the table. Raises OverflowError if it does not fit."""
        if value < 0 and (sign := self._sign):
            if value <= -sign:
                raise OverflowError(f"{self.name}: {value} does not fit: its {self.coding.value}")
            value = -value | sign
        return value.to_bytes(self.size, self.byte_order, signed=self.coding is _TWOS)

    def decode(self, data: bytes | bytearray, start: int = 0) -> int:
        """Return the value from ``data``, a copy of the table from address ``start`` on."""
        begin = self.address - start
        value = int.from_bytes(data[begin : begin + self.size], self.byte_order, signed=self.coding is _TWOS)
        if self.coding is _UNSIGNED or self.coding is _TWOS or not value & (sign := self._sign):
            return value
        return -(value & ~sign)

    @property
    def _sign(self) -> int:
        """Mask of the bit that holds the sign in the register's encoding; 0 if the encoding has no such bit."""
        if self.coding is _UNSIGNED or self.coding is _TWOS:
            return 0
        return 0x400 if self.coding is _SIGN_BIT else 0x800 if self.coding is _SIGN_11 else 0x8000


class RegisterBlock(NamedTuple):
    """``size`` bytes of a control table from ``address`` on, read in one transaction."""

    address: int
    size: int


@dataclass(frozen=True, slots=True)
class ControlTable:
    """A control table: registers by name in the order of their addresses, and the use of some of them.

    ``fast_block`` is read each time that the servo is polled, ``slow_blocks`` about once a second, ``setup_block`` when
    the driver has found the servo. The other fields are names of registers: ``goal`` is the position to reach,
    ``speed`` the speed on the way; ``velocity`` and ``effort`` are the measured speed and load; ``torque_limit`` (RAM)
    is bounded by ``torque_ceiling`` (EEPROM); ``limit_registers`` hold the lower and the upper bound of the goal
    (EEPROM).
    """

    registers: Mapping[str, Register]
    fast_block: RegisterBlock
    slow_blocks: tuple[RegisterBlock, ...]
    setup_block: RegisterBlock
    goal: str
    speed: str
    velocity: str
    effort: str
    torque_limit: str
    torque_ceiling: str
    limit_registers: tuple[str, str]

    def __getitem__(self, name: str) -> Register:
        """Return the register ``name``. Raises KeyError if the table has none."""
        return self.registers[name]

    def __contains__(self, name: str) -> bool:
        return name in self.registers

    @property
    def size(self) -> int:
        """Address after the last register of the table."""
        return max(register.end for register in self.registers.values())

    def find_register(self, name: str) -> Register:
        """Return the register with a name that a user typed. Raises BadRequest, with similar names."""
        if name in self.registers:
            return self.registers[name]
        near = get_close_matches(name.lower().replace(" ", "_").replace("-", "_"), self.registers, cutoff=0.5)
        meant = f"did you mean {' or '.join(near)}?" if near else f"it has {', '.join(self.registers)}"
        raise BadRequest(f"no register {name!r} in the servo's control table", hint=meant)
