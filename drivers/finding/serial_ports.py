"""Serial ports of a machine: their USB ids and names, the programs that use them, and why they cannot be opened.

The list is read from /sys, without pyserial's ``list_ports.comports``.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from types import MappingProxyType

from drivers.finding.machine import HostMachine
from drivers.transport.ports import DEBUG_CONNECTOR, PINS_PORT, UART_SETTING, is_raspberry_pi_5
from drivers.transport.programs import Program, end_command

# USB devices, and known adapters.


@dataclass(frozen=True, slots=True)
class UsbDevice:
    """USB device: vendor and product id (four hexadecimal digits each), descriptors, and USB socket.

    A socket is a path of ports such as ``1-1.4``.
    """

    vendor: str
    product: str
    serial: str = ""
    maker: str = ""
    name: str = ""
    socket: str = ""

    @property
    def ids(self) -> str:
        """Vendor and product id in the format of `lsusb`, such as ``0403:6001``."""
        return f"{self.vendor}:{self.product}"

    @property
    def title(self) -> str:
        """Name of the USB device: from the table of known adapters, else from its descriptors."""
        known = ADAPTERS.get(self.ids)
        descriptors = " ".join(word for word in (self.maker, self.name) if word)
        return (
            (known.name if known else "")
            or descriptors
            or ("an Arduino" if self.vendor in _ARDUINO else "a USB device")
        )

    @property
    def resets_on_open(self) -> bool:
        """Whether the device may be a board that is reset when its port is opened."""
        return self.vendor in _ARDUINO or (self.ids in ADAPTERS and ADAPTERS[self.ids].resets)

    def matches(self, pattern: str) -> bool:
        """Return whether the device matches a driver's pattern, such as ``0403:6014`` or ``0403:6001:kobuki_*``."""
        whole = pattern if pattern.count(":") > 1 else f"{pattern}:*"
        return fnmatchcase(f"{self.ids}:{self.serial}", whole)


@dataclass(frozen=True, slots=True)
class Adapter:
    """Known USB adapter: its name, and whether opening its serial port resets a board."""

    name: str
    resets: bool = False


_ARDUINO = frozenset({"2341", "2a03"})
"""Vendor ids of Arduino boards. A rising DTR resets them, and Linux raises DTR at each opening."""

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
"""Adapters that robots use, by their ids. Others are not probed unless the user names their port."""


def find_usb_device(machine: HostMachine, device: str) -> UsbDevice | None:
    """Return the USB device to which a device in /sys belongs; None if it belongs to none."""
    here = PurePosixPath(machine.resolve(device))
    for folder in map(str, (here, *here.parents)):
        vendor = machine.read_text(f"{folder}/idVendor")
        if vendor:
            descriptors = {
                each: machine.read_text(f"{folder}/{each}")
                for each in ("idProduct", "serial", "manufacturer", "product")
            }
            socket = PurePosixPath(folder).name
            return UsbDevice(
                vendor,
                descriptors["idProduct"],
                descriptors["serial"],
                descriptors["manufacturer"],
                descriptors["product"],
                socket,
            )
    return None


def iter_usb_devices(machine: HostMachine) -> Iterator[tuple[str, UsbDevice]]:
    """Yield every connected USB device, with its folder in /sys."""
    for name in machine.list_names("/sys/bus/usb/devices"):
        folder = machine.resolve(f"/sys/bus/usb/devices/{name}")
        if machine.read_text(f"{folder}/idVendor") and (found := find_usb_device(machine, folder)) is not None:
            yield folder, found


MAX_LATENCY_MS = 1
"""Milliseconds for which an adapter may delay bytes without harm."""

PORT_GRABBER_FIXES = {
    "ModemManager": "sudo systemctl disable --now ModemManager  (it takes robots for modems)",
    "brltty": "sudo systemctl mask --now brltty-udev brltty  (it takes adapters for Braille displays)",
}
"""Fixes for programs that open ports by themselves."""


@dataclass(frozen=True, slots=True)
class DeviceProblem:
    """Problem of a device, and a fix."""

    message: str
    fix: str = ""

    def __str__(self) -> str:
        return self.message + (f"\n  try: {self.fix}" if self.fix else "")


@dataclass(frozen=True, slots=True)
class SerialPortInfo:
    """Serial port: ``path`` is its device file, ``names`` are its other names, ``call`` is the most stable of them.

    ``usb`` is its USB device, or None. ``latency`` is the delay of the adapter in milliseconds, None if unknown.
    ``holders`` are the programs that have the port open. ``shut`` is the problem why it cannot be opened, or None;
    ``troubles`` are other problems. ``own`` describes a port without a USB device.
    """

    path: str
    call: str
    names: tuple[str, ...] = ()
    usb: UsbDevice | None = None
    latency: int | None = None
    holders: tuple[Program, ...] = ()
    shut: DeviceProblem | None = None
    troubles: tuple[DeviceProblem, ...] = ()
    own: str = "a port of the computer itself"

    @property
    def title(self) -> str:
        """Description of the port: name and ids of its USB device, or its position on the computer."""
        return self.own if self.usb is None else f"{self.usb.title}, {self.usb.ids}"


def find_serial_ports(machine: HostMachine) -> list[SerialPortInfo]:
    """Return the serial ports of a machine, in the order of their names."""
    paths = list(_iter_paths(machine))
    links, holders = _read_links(machine), machine.device_holders()
    ports = [_read_port(machine, path, links.get(path, ()), tuple(holders.get(path, ()))) for path in paths]
    counts = Counter(port.usb.ids + port.usb.serial for port in ports if port.usb is not None)
    named_ports = [
        _with_stable_name(port, unique=port.usb is None or counts[port.usb.ids + port.usb.serial] == 1)
        for port in ports
    ]
    return [_with_pi_5_name(port) for port in named_ports] if is_raspberry_pi_5(machine.root) else named_ports


def _with_pi_5_name(port: SerialPortInfo) -> SerialPortInfo:
    """Return ``port`` with a description if it is on the pins or the debug connector of a Raspberry Pi 5.

    Other ports are returned unchanged.
    """
    if port.path == DEBUG_CONNECTOR:
        pins = f"its pins (GPIO 14 and 15) are {PINS_PORT}, after {UART_SETTING}"
        own = f"the debug connector of this Raspberry Pi 5; {pins}"
        return replace(port, own=own, call=port.path)
    return replace(port, own="the pins GPIO 14 and 15", call=port.path) if port.path == PINS_PORT else port


def find_portless_adapters(machine: HostMachine) -> list[tuple[UsbDevice, DeviceProblem]]:
    """Return connected USB adapters without a serial port, each with the probable reason."""
    devices = (f"/sys/class/tty/{name}/device" for name in machine.list_names("/sys/class/tty"))
    sockets = {usb.socket for device in devices if (usb := find_usb_device(machine, device)) is not None}
    brltty = any(process.name == "brltty" for process in machine.processes())
    adapters = []
    for _, usb in iter_usb_devices(machine):
        if usb.ids in ADAPTERS and usb.socket not in sockets:
            message = "it has no port"
            trouble = (
                DeviceProblem(f"{message}: brltty has taken it", PORT_GRABBER_FIXES["brltty"])
                if brltty
                else DeviceProblem(
                    f"{message}: the kernel has no driver for it, or another program has taken it",
                    "sudo dmesg | tail -20",
                )
            )
            adapters.append((usb, trouble))
    return adapters


def _iter_paths(machine: HostMachine) -> Iterator[str]:
    """Yield ports with hardware: neither consoles nor the empty slots of a PC's four UARTs."""
    for name in machine.list_names("/sys/class/tty"):
        here = f"/sys/class/tty/{name}"
        if machine.local_path(f"{here}/device").exists() and machine.read_text(f"{here}/type") != "0":
            yield f"/dev/{name}"


def _read_links(machine: HostMachine) -> dict[str, tuple[str, ...]]:
    """Return the names that udev gives to each serial device, by its path; names by udev rules come first."""
    found: dict[str, tuple[str, ...]] = {}
    for folder in ("/dev", "/dev/serial/by-id", "/dev/serial/by-path"):
        for name in machine.list_names(folder):
            if (target := machine.read_link(f"{folder}/{name}")).startswith("/dev/tty"):
                found[target] = (*found.get(target, ()), f"{folder}/{name}")
    return found


def _read_port(machine: HostMachine, path: str, names: tuple[str, ...], holders: tuple[Program, ...]) -> SerialPortInfo:
    name = path.removeprefix("/dev/")
    text = machine.read_text(f"/sys/bus/usb-serial/devices/{name}/latency_timer")
    latency = int(text) if text.isdecimal() else None
    slow = DeviceProblem(
        f"its adapter delays bytes by {latency} ms: servos and a Kobuki reply late",
        f"echo {MAX_LATENCY_MS} | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer"
        "  (or permanently: mission robot udev)",
    )
    obstacle = _find_obstacle(machine, path, holders)
    troubles = (slow,) if latency is not None and latency > MAX_LATENCY_MS else ()
    return SerialPortInfo(
        path,
        path,
        names,
        find_usb_device(machine, f"/sys/class/tty/{name}/device"),
        latency,
        holders,
        obstacle,
        troubles,
    )


def _find_obstacle(machine: HostMachine, path: str, holders: tuple[Program, ...]) -> DeviceProblem | None:
    """Return the problem why a port cannot be opened, with a fix; None if it can be opened."""
    if holders:
        names = ", ".join(str(each) for each in holders)
        usual = end_command(holders, f"end that program, or: fuser -v {path}")
        return DeviceProblem(
            f"in use by {names}",
            next((PORT_GRABBER_FIXES[each.name] for each in holders if each.name in PORT_GRABBER_FIXES), usual),
        )
    if machine.can_open(path) is None:
        return DeviceProblem("the kernel has it, but it has no device file in /dev", "sudo udevadm trigger")
    if not machine.can_open(path):
        return DeviceProblem(*machine.explain_denied(path))
    return None


def _with_stable_name(port: SerialPortInfo, *, unique: bool) -> SerialPortInfo:
    """Return ``port`` with its most stable name as ``call``: by a udev rule, by serial number, or by USB socket.

    ``unique`` is False if another connected adapter is identical; then the serial number is not used.
    """
    by_rule = [name for name in port.names if not name.startswith("/dev/serial/")]
    by_id = [name for name in port.names if "/by-id/" in name]
    by_path = [name for name in port.names if "/by-path/" in name]
    call = next(iter([*by_rule, *(by_id if unique else []), *by_path, *by_id]), port.path)
    if unique or by_rule:
        return replace(port, call=call)
    where = f"socket {port.usb.socket}" if port.usb is not None else "its socket"
    problem = DeviceProblem(
        f"another adapter is identical: only {where} distinguishes them",
        "leave both in their sockets; mission ports --find  (which is which)",
    )
    return replace(port, call=call, troubles=(*port.troubles, problem))
