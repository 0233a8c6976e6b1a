"""The serial ports that there are: what they are, how they are called, who holds them, why they cannot be opened."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

from drivers.finding.machine import Machine
from drivers.finding.usb import ADAPTERS, Usb, all_usb, usb_of
from drivers.transport.ports import DEBUG_CONNECTOR, PINS, UART_ON, is_raspberry_pi_5
from drivers.transport.programs import Program, end_command

SLOW = 1
"""Milliseconds that an adapter may hold bytes back without doing harm."""

CURES = {
    "ModemManager": "sudo systemctl disable --now ModemManager  (it takes robots for modems)",
    "brltty": "sudo systemctl mask --now brltty-udev brltty  (it takes adapters for Braille displays)",
}
"""What helps against programs that grab ports by themselves."""


@dataclass(frozen=True, slots=True)
class Trouble:
    """What is wrong, and what to try."""

    what: str
    cure: str = ""

    def __str__(self) -> str:
        return self.what + (f"\n  try: {self.cure}" if self.cure else "")


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port: its ``path``, its other ``names``, and the one to ``call`` it in a robot file, which stays.

    ``latency`` is for how many milliseconds its adapter holds bytes back, None where it does not tell. ``holders`` have
    it open; ``shut`` says why it cannot be opened, ``troubles`` what is wrong besides.
    """

    path: str
    call: str
    names: tuple[str, ...] = ()
    usb: Usb | None = None
    latency: int | None = None
    holders: tuple[Program, ...] = ()
    shut: Trouble | None = None
    troubles: tuple[Trouble, ...] = ()
    own: str = "a port of the computer itself"

    @property
    def title(self) -> str:
        """What it is."""
        return self.own if self.usb is None else f"{self.usb.title}, {self.usb.ids}"


def serial_ports(machine: Machine) -> list[SerialPort]:
    """Return the serial ports of a machine, in the order of their names."""
    paths = list(_paths(machine))
    links, holders = _links(machine), machine.holders()
    found = [_port(machine, path, links.get(path, ()), tuple(holders.get(path, ()))) for path in paths]
    alike = Counter(port.usb.ids + port.usb.serial for port in found if port.usb is not None)
    called = [_called(port, alone=port.usb is None or alike[port.usb.ids + port.usb.serial] == 1) for port in found]
    return [_of_pi_5(port) for port in called] if is_raspberry_pi_5(machine.root) else called


def _of_pi_5(port: SerialPort) -> SerialPort:
    """Tell the pins of a Raspberry Pi 5 from its debug connector, to which /dev/serial0 leads on this model alone."""
    if port.path == DEBUG_CONNECTOR:
        own = f"the debug connector of this Raspberry Pi 5; its pins (GPIO 14 and 15) are {PINS}, after {UART_ON}"
        return replace(port, own=own, call=port.path)
    return replace(port, own="the pins GPIO 14 and 15", call=port.path) if port.path == PINS else port


def lost_adapters(machine: Machine) -> list[tuple[Usb, Trouble]]:
    """Return adapters that are plugged in and have no port, with what may have taken it."""
    devices = (f"/sys/class/tty/{name}/device" for name in machine.names("/sys/class/tty"))
    sockets = {usb.socket for device in devices if (usb := usb_of(machine, device)) is not None}
    brltty = any(process.name == "brltty" for process in machine.processes())
    lost = []
    for _, usb in all_usb(machine):
        if usb.ids in ADAPTERS and usb.socket not in sockets:
            what = "it has no port"
            trouble = (
                Trouble(f"{what}: brltty has taken it", CURES["brltty"])
                if brltty
                else Trouble(
                    f"{what}: the kernel has no driver for it, or another program has taken it", "sudo dmesg | tail -20"
                )
            )
            lost.append((usb, trouble))
    return lost


def _paths(machine: Machine) -> Iterator[str]:
    """Yield ports behind which there is hardware: not consoles, nor the empty places of a PC's four UARTs."""
    for name in machine.names("/sys/class/tty"):
        here = f"/sys/class/tty/{name}"
        if machine.at(f"{here}/device").exists() and machine.text(f"{here}/type") != "0":
            yield f"/dev/{name}"


def _links(machine: Machine) -> dict[str, tuple[str, ...]]:
    """Return the names that udev gives to devices, those of rules first."""
    found: dict[str, tuple[str, ...]] = {}
    for folder in ("/dev", "/dev/serial/by-id", "/dev/serial/by-path"):
        for name in machine.names(folder):
            if (target := machine.target(f"{folder}/{name}")).startswith("/dev/tty"):
                found[target] = (*found.get(target, ()), f"{folder}/{name}")
    return found


def _port(machine: Machine, path: str, names: tuple[str, ...], holders: tuple[Program, ...]) -> SerialPort:
    name = path.removeprefix("/dev/")
    told = machine.text(f"/sys/bus/usb-serial/devices/{name}/latency_timer")
    latency = int(told) if told.isdecimal() else None
    slow = Trouble(
        f"its adapter holds bytes back for {latency} ms: servos and a Kobuki answer late",
        f"echo {SLOW} | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer  (or for good: mission robot udev)",
    )
    shut = _shut(machine, path, holders)
    troubles = (slow,) if latency is not None and latency > SLOW else ()
    return SerialPort(
        path, path, names, usb_of(machine, f"/sys/class/tty/{name}/device"), latency, holders, shut, troubles
    )


def _shut(machine: Machine, path: str, holders: tuple[Program, ...]) -> Trouble | None:
    """Say why a port cannot be opened; None where it can."""
    if holders:
        who = ", ".join(str(each) for each in holders)
        usual = end_command(holders, f"end that program, or: fuser -v {path}")
        return Trouble(f"in use by {who}", next((CURES[each.name] for each in holders if each.name in CURES), usual))
    if machine.may_open(path) is None:
        return Trouble("the kernel has it, but there is no such device in /dev", "sudo udevadm trigger")
    if not machine.may_open(path):
        return Trouble(*machine.explain_denied(path))
    return None


def _called(port: SerialPort, *, alone: bool) -> SerialPort:
    """Give a port the name that stays with it: of a rule, of its serial number; of its socket where two are alike."""
    own = [name for name in port.names if not name.startswith("/dev/serial/")]
    by_id = [name for name in port.names if "/by-id/" in name]
    by_path = [name for name in port.names if "/by-path/" in name]
    call = next(iter([*own, *(by_id if alone else []), *by_path, *by_id]), port.path)
    if alone or own:
        return replace(port, call=call)
    where = f"socket {port.usb.socket}" if port.usb is not None else "its socket"
    twin = Trouble(
        f"another adapter is just like it: only {where} tells them apart",
        "leave both in their sockets; mission ports --find  (which is which)",
    )
    return replace(port, call=call, troubles=(*port.troubles, twin))
