"""What a USB device says of itself, and which adapters there are."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from types import MappingProxyType

from drivers.finding.machine import Machine


@dataclass(frozen=True, slots=True)
class Usb:
    """A device on USB: its ids (four hexadecimal digits each), what it says of itself, and the socket it is in."""

    vendor: str
    product: str
    serial: str = ""
    maker: str = ""
    name: str = ""
    socket: str = ""

    @property
    def ids(self) -> str:
        """Both ids as `lsusb` writes them."""
        return f"{self.vendor}:{self.product}"

    @property
    def title(self) -> str:
        """What it is called, by itself or by us."""
        known = ADAPTERS.get(self.ids)
        told = " ".join(word for word in (self.maker, self.name) if word)
        return (known.name if known else "") or told or ("an Arduino" if self.vendor in _ARDUINO else "a USB device")

    @property
    def resets(self) -> bool:
        """Whether it may be a board that starts anew when its port is opened."""
        return self.vendor in _ARDUINO or (self.ids in ADAPTERS and ADAPTERS[self.ids].resets)

    def matches(self, pattern: str) -> bool:
        """Whether it is what a driver declares as ``0403:6014``, or with a serial number, ``0403:6001:kobuki_*``."""
        whole = pattern if pattern.count(":") > 1 else f"{pattern}:*"
        return fnmatchcase(f"{self.ids}:{self.serial}", whole)


@dataclass(frozen=True, slots=True)
class Adapter:
    """What is known of an adapter: its name, and whether a board that it sits on starts anew when it is opened."""

    name: str
    resets: bool = False


_ARDUINO = frozenset({"2341", "2a03"})
"""The vendor ids of Arduino boards. They pull the reset line when DTR rises, which Linux raises at each opening."""

ADAPTERS: Mapping[str, Adapter] = MappingProxyType(
    {
        "0403:6001": Adapter("FTDI FT232R"),
        "0403:6010": Adapter("FTDI FT2232"),
        "0403:6014": Adapter("FTDI FT232H (U2D2)"),
        "0403:6015": Adapter("FTDI FT231X"),
        "0483:5740": Adapter("STM32 serial port (OpenCR)"),
        "067b:2303": Adapter("Prolific PL2303"),
        "10c4:ea60": Adapter("Silicon Labs CP210x"),
        "16c0:0483": Adapter("Teensy"),
        "16d0:06a7": Adapter("USB2AX"),
        "1a86:55d3": Adapter("WCH CH343"),
        "1a86:55d4": Adapter("WCH CH9102"),
        "1a86:7523": Adapter("WCH CH340, as on an Arduino Nano", resets=True),
        "2f5d:2202": Adapter("ROBOTIS OpenRB-150"),
        "fff1:ff48": Adapter("ROBOTIS OpenCM 9.04"),
    }
)
"""Adapters that robots have, by their ids. Others are not asked unless the user names their port."""


def usb_of(machine: Machine, device: str) -> Usb | None:
    """Return the USB device that a device of /sys is on; None where it is on none."""
    here = PurePosixPath(machine.real(device))
    for folder in map(str, (here, *here.parents)):
        vendor = machine.text(f"{folder}/idVendor")
        if vendor:
            told = {
                each: machine.text(f"{folder}/{each}") for each in ("idProduct", "serial", "manufacturer", "product")
            }
            socket = PurePosixPath(folder).name
            return Usb(vendor, told["idProduct"], told["serial"], told["manufacturer"], told["product"], socket)
    return None


def all_usb(machine: Machine) -> Iterator[tuple[str, Usb]]:
    """Yield every USB device that is plugged in, with its folder in /sys."""
    for name in machine.names("/sys/bus/usb/devices"):
        folder = machine.real(f"/sys/bus/usb/devices/{name}")
        if machine.text(f"{folder}/idVendor") and (found := usb_of(machine, folder)) is not None:
            yield folder, found
