"""Scan of all connected hardware: serial ports, cameras, sound cards and game pads."""

import fcntl
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from drivers.api.driver import Driver
from drivers.clock import Clock
from drivers.finding.machine import HostMachine
from drivers.finding.port_probe import EXTRA_TIMEOUT, PortScan, probe_port
from drivers.finding.serial_ports import (
    DeviceProblem,
    SerialPortInfo,
    UsbDevice,
    find_portless_adapters,
    find_serial_ports,
    find_usb_device,
)
from drivers.finding.video import CSI_HINT, CSI_SOURCE, Ioctl, list_devices
from drivers.transport.programs import Program, end_command

# Connected cameras, sound cards and game pads.

_CARD = re.compile(r"^\s*(\d+) \[(\S+)\s*\]: .* - (.+)$", re.MULTILINE)
_STREAM = re.compile(r"^(\d+)-\d+: [^:]*:[^:]*: ?(.*)$", re.MULTILINE)
_JOYSTICK = re.compile(r"\bjs\d+\b")
_EVENT = re.compile(r"\bevent\d+\b")


@dataclass(frozen=True, slots=True)
class ConnectedCamera:
    """Camera: its device, name, picture sizes, USB device, the programs that have it open, and its problem or None.

    ``source`` is the value for ``source`` in a robot file: an address for a CSI camera, which ``rpicam-vid`` must
    serve.
    """

    path: str
    name: str
    sizes: tuple[tuple[int, int], ...] = ()
    usb: UsbDevice | None = None
    holders: tuple[Program, ...] = ()
    trouble: DeviceProblem | None = None
    source: int | str = 0


@dataclass(frozen=True, slots=True)
class SoundCard:
    """Sound card: its number, its name, and whether it has a microphone and a loudspeaker."""

    number: int
    name: str
    hears: bool
    speaks: bool


@dataclass(frozen=True, slots=True)
class ConnectedGamePad:
    """Game pad: its device file, its name, and the problem why it cannot be used; None if it can."""

    path: str
    name: str
    trouble: DeviceProblem | None = None


def find_cameras(machine: HostMachine, ioctl: Ioctl = fcntl.ioctl) -> list[ConnectedCamera]:
    """Return the connected cameras, each once; no picture is taken."""
    holders = machine.device_holders()
    cameras = []
    for device in list_devices(machine.local_path("/sys/class/video4linux"), machine.local_path("/dev"), ioctl):
        path = f"/dev/{device.path.name}"
        camera_holders = tuple(holders.get(path, ()))
        usb = find_usb_device(machine, f"/sys/class/video4linux/{device.path.name}/device")
        trouble = DeviceProblem(device.trouble, f"ls -l {path}") if device.trouble else None
        source: int | str = int(device.path.name.removeprefix("video"))
        if device.csi:
            source, trouble = CSI_SOURCE, DeviceProblem(device.trouble, CSI_HINT)
        elif machine.can_open(path) is False:
            trouble = DeviceProblem(*machine.explain_denied(path))
        elif camera_holders:
            trouble = DeviceProblem(
                f"in use by {', '.join(map(str, camera_holders))}",
                end_command(camera_holders, f"end that program, or: fuser -v {path}"),
            )
        cameras.append(ConnectedCamera(path, device.name, device.sizes, usb, camera_holders, trouble, source))
    return cameras


def find_sound_cards(machine: HostMachine) -> list[SoundCard]:
    """Return the sound cards, from the files of ALSA."""
    streams: dict[int, str] = {}
    for number, stream in _STREAM.findall(machine.read_text("/proc/asound/pcm")):
        streams[int(number)] = streams.get(int(number), "") + stream
    cards = _CARD.findall(machine.read_text("/proc/asound/cards"))
    return [
        SoundCard(
            int(number), name, "capture" in streams.get(int(number), ""), "playback" in streams.get(int(number), "")
        )
        for number, _, name in cards
    ]


def find_game_pads(machine: HostMachine) -> list[ConnectedGamePad]:
    """Return the game pads, with the event nodes for `mission teleop --pad`."""
    pads = []
    for block in machine.read_text("/proc/bus/input/devices").split("\n\n"):
        event = _EVENT.search(block)
        if _JOYSTICK.search(block) and event:
            path, name = f"/dev/input/{event[0]}", re.search(r'^N: Name="(.*)"$', block, re.MULTILINE)
            denied = None if machine.can_open(path) else DeviceProblem(*machine.explain_denied(path))
            pads.append(ConnectedGamePad(path, name[1] if name else path, denied))
    return pads


@dataclass(frozen=True, slots=True)
class ScannedPort:
    """Serial port and the result of probing it; ``scan`` is None if the port was not probed."""

    port: SerialPortInfo
    scan: PortScan | None = None


@dataclass(frozen=True, slots=True)
class HardwareScan:
    """All connected hardware. ``portless_adapters`` are USB adapters without a serial port, each with the reason."""

    ports: tuple[ScannedPort, ...] = ()
    portless_adapters: tuple[tuple[UsbDevice, DeviceProblem], ...] = ()
    cameras: tuple[ConnectedCamera, ...] = ()
    sound_cards: tuple[SoundCard, ...] = ()
    game_pads: tuple[ConnectedGamePad, ...] = ()

    @property
    def device_names(self) -> list[tuple[str, str]]:
        """Devices of the cameras and game pads, each with its name."""
        return [(camera.path, camera.name) for camera in self.cameras] + [
            (pad.path, pad.name) for pad in self.game_pads
        ]

    @property
    def paths(self) -> frozenset[str]:
        """Device files of the ports, cameras and game pads."""
        return frozenset(path for path, _ in self.device_names) | {plug.port.path for plug in self.ports}

    @property
    def identified(self) -> list[tuple[SerialPortInfo, PortScan]]:
        """Ports on which a driver has identified its device, each with the result."""
        return [(plug.port, plug.scan) for plug in self.ports if plug.scan is not None and plug.scan.device is not None]


PortProber = Callable[[SerialPortInfo], PortScan | None]
"""Function that probes a serial port and returns the result, or None if it does not probe the port."""


def scan_hardware(machine: HostMachine, ask: PortProber | None = None, ioctl: Ioctl = fcntl.ioctl) -> HardwareScan:
    """Return all connected hardware. If ``ask`` is given, each serial port is probed with it, one after another.

    ``ioctl`` is replaced in tests.
    """
    plugs = tuple(ScannedPort(port, None if ask is None else ask(port)) for port in find_serial_ports(machine))
    return HardwareScan(
        plugs,
        tuple(find_portless_adapters(machine)),
        tuple(find_cameras(machine, ioctl)),
        tuple(find_sound_cards(machine)),
        tuple(find_game_pads(machine)),
    )


def make_prober(
    machine: HostMachine,
    drivers: Iterable[Driver],
    clock: Clock,
    *,
    consented_ports: Iterable[str] = (),
    extra_timeout: float = EXTRA_TIMEOUT,
) -> PortProber:
    """Return a function that probes a serial port with the probes of ``drivers``.

    ``consented_ports`` are names of ports that the user allows to be probed, even if opening them may reset a board.
    ``extra_timeout`` in seconds is added to the timeout of each request.
    """
    drivers, consented_ports = tuple(drivers), frozenset(consented_ports)

    def ask(port: SerialPortInfo) -> PortScan:
        consent = bool(consented_ports & {port.path, port.call, *port.names})
        return probe_port(
            port, drivers, clock, consent=consent, extra_timeout=extra_timeout, path=str(machine.local_path(port.path))
        )

    return ask
