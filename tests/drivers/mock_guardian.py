"""The guardian of a Raspberry Pi car, on gpiozero's mock pins and on an I2C bus that is none; a program of its own.

What pins and bus are told is written to the file that JOURNAL names: who, what. What the chips on the bus were
told by guardians before it is read from there: chips outlive who tells them.
"""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import smbus2
from gpiozero import Device
from gpiozero.pins.mock import MockFactory, MockPWMPin

from drivers.pi_car.guardian import main

JOURNAL = Path(os.environ["JOURNAL"])


def note(who: str, what: object) -> None:
    """Write a line of the journal, whole."""
    with JOURNAL.open("a", encoding="utf-8") as file:
        file.write(json.dumps([who, what]) + "\n")


class NotedPin(MockPWMPin):  # type: ignore[misc]
    """One that writes down what it is set to."""

    def _set_state(self, value: float) -> None:
        super()._set_state(value)
        note(f"pin {self.info.name}", float(value))


class NotedBus:
    """Registers behind an address, as a PCA9685 has them after it was switched on."""

    def __init__(self, number: int) -> None:
        self.registers = {0x00: 0x11, 0x01: 0x04, 0xFE: 0x1E, **{9 + 4 * channel: 0x10 for channel in range(16)}}
        for who, what in map(json.loads, JOURNAL.read_text(encoding="utf-8").splitlines()):
            if who == f"bus {number}":
                self._take(*what)
        self._number = number

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        assert i2c_addr == 0x40
        return [self.registers.get(register + place, 0) for place in range(length)]

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        assert i2c_addr == 0x40
        self._take(register, list(data))
        note(f"bus {self._number}", [register, list(data)])

    def _take(self, register: int, data: Sequence[int]) -> None:
        self.registers.update({register + place: byte for place, byte in enumerate(data)})


if __name__ == "__main__":
    Device.pin_factory = MockFactory(pin_class=NotedPin)
    vars(smbus2)["SMBus"] = NotedBus
    sys.exit(main(sys.argv[1]))
