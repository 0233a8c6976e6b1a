"""All that is plugged in, in one look; and what changed between two looks."""

import fcntl
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from drivers.api.driver import Driver
from drivers.clock import Clock
from drivers.finding.asking import PATIENCE, Heard, look
from drivers.finding.machine import Machine
from drivers.finding.serial_ports import SerialPort, Trouble, Usb, lost_adapters, serial_ports, usb_of
from drivers.finding.video import CSI_HINT, CSI_SOURCE, Ioctl, list_devices
from drivers.transport.programs import Program, end_command

# Cameras, microphones, loudspeakers and game pads that are plugged in.

_CARD = re.compile(r"^\s*(\d+) \[(\S+)\s*\]: .* - (.+)$", re.MULTILINE)
_STREAM = re.compile(r"^(\d+)-\d+: [^:]*:[^:]*: ?(.*)$", re.MULTILINE)
_JOYSTICK = re.compile(r"\bjs\d+\b")
_EVENT = re.compile(r"\bevent\d+\b")


@dataclass(frozen=True, slots=True)
class CameraFound:
    """A camera: its device, its name, its pictures' sizes, who has it open, and what is wrong with it.

    ``source`` is what a robot file calls it: a CSI camera is read by TCP, from ``rpicam-vid``.
    """

    path: str
    name: str
    sizes: tuple[tuple[int, int], ...] = ()
    usb: Usb | None = None
    holders: tuple[Program, ...] = ()
    trouble: Trouble | None = None
    source: int | str = 0


@dataclass(frozen=True, slots=True)
class SoundCard:
    """A sound card: its number, its name, and whether it can hear and be heard."""

    number: int
    name: str
    hears: bool
    speaks: bool


@dataclass(frozen=True, slots=True)
class PadFound:
    """A game pad: its device, its name, and what is wrong with it."""

    path: str
    name: str
    trouble: Trouble | None = None


def cameras(machine: Machine, ioctl: Ioctl = fcntl.ioctl) -> list[CameraFound]:
    """Return the cameras that are plugged in, each once; no picture is taken."""
    holders = machine.holders()
    found = []
    for device in list_devices(machine.at("/sys/class/video4linux"), machine.at("/dev"), ioctl):
        path = f"/dev/{device.path.name}"
        held = tuple(holders.get(path, ()))
        usb = usb_of(machine, f"/sys/class/video4linux/{device.path.name}/device")
        trouble = Trouble(device.trouble, f"ls -l {path}") if device.trouble else None
        source: int | str = int(device.path.name.removeprefix("video"))
        if device.csi:
            source, trouble = CSI_SOURCE, Trouble(device.trouble, CSI_HINT)
        elif machine.may_open(path) is False:
            trouble = Trouble(*machine.explain_denied(path))
        elif held:
            trouble = Trouble(
                f"in use by {', '.join(map(str, held))}", end_command(held, f"end that program, or: fuser -v {path}")
            )
        found.append(CameraFound(path, device.name, device.sizes, usb, held, trouble, source))
    return found


def sound_cards(machine: Machine) -> list[SoundCard]:
    """Return the sound cards, as ALSA tells of them."""
    streams: dict[int, str] = {}
    for number, told in _STREAM.findall(machine.text("/proc/asound/pcm")):
        streams[int(number)] = streams.get(int(number), "") + told
    cards = _CARD.findall(machine.text("/proc/asound/cards"))
    return [
        SoundCard(
            int(number), name, "capture" in streams.get(int(number), ""), "playback" in streams.get(int(number), "")
        )
        for number, _, name in cards
    ]


def pads(machine: Machine) -> list[PadFound]:
    """Return the game pads, by the nodes that `mission teleop --pad` takes."""
    found = []
    for block in machine.text("/proc/bus/input/devices").split("\n\n"):
        event = _EVENT.search(block)
        if _JOYSTICK.search(block) and event:
            path, name = f"/dev/input/{event[0]}", re.search(r'^N: Name="(.*)"$', block, re.MULTILINE)
            denied = None if machine.may_open(path) else Trouble(*machine.explain_denied(path))
            found.append(PadFound(path, name[1] if name else path, denied))
    return found


@dataclass(frozen=True, slots=True)
class Plug:
    """A serial port, and what came of asking it; ``heard`` is None where it was not to be asked."""

    port: SerialPort
    heard: Heard | None = None


@dataclass(frozen=True, slots=True)
class Desk:
    """What is plugged in. ``lost`` are adapters that have no port."""

    plugs: tuple[Plug, ...] = ()
    lost: tuple[tuple[Usb, Trouble], ...] = ()
    cameras: tuple[CameraFound, ...] = ()
    sounds: tuple[SoundCard, ...] = ()
    pads: tuple[PadFound, ...] = ()

    @property
    def named(self) -> list[tuple[str, str]]:
        """The devices of its cameras and pads, each with its name."""
        return [(camera.path, camera.name) for camera in self.cameras] + [(pad.path, pad.name) for pad in self.pads]

    @property
    def paths(self) -> frozenset[str]:
        """The devices of its ports, cameras and pads."""
        return frozenset(path for path, _ in self.named) | {plug.port.path for plug in self.plugs}

    @property
    def found(self) -> list[tuple[SerialPort, Heard]]:
        """The ports on which a driver's device has answered."""
        return [
            (plug.port, plug.heard) for plug in self.plugs if plug.heard is not None and plug.heard.found is not None
        ]


Asker = Callable[[SerialPort], Heard | None]
"""Asks a port who is there; None for one that is not to be asked."""


def survey(machine: Machine, ask: Asker | None = None, ioctl: Ioctl = fcntl.ioctl) -> Desk:
    """Return what is plugged in; with ``ask`` each serial port is asked who is behind it, one after another."""
    plugs = tuple(Plug(port, None if ask is None else ask(port)) for port in serial_ports(machine))
    return Desk(
        plugs,
        tuple(lost_adapters(machine)),
        tuple(cameras(machine, ioctl)),
        tuple(sound_cards(machine)),
        tuple(pads(machine)),
    )


def asker(
    machine: Machine,
    drivers: Iterable[Driver],
    clock: Clock,
    *,
    consented: Iterable[str] = (),
    patience: float = PATIENCE,
) -> Asker:
    """Return what asks ports by the probes of ``drivers``; those ``consented`` without scruple."""
    drivers, consented = tuple(drivers), frozenset(consented)

    def ask(port: SerialPort) -> Heard:
        consent = bool(consented & {port.path, port.call, *port.names})
        return look(port, drivers, clock, consent=consent, patience=patience, path=str(machine.at(port.path)))

    return ask
