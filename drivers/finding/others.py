"""Cameras, microphones, loudspeakers and game pads that are plugged in."""

import fcntl
import re
from dataclasses import dataclass

from drivers.camera.devices import CSI_HINT, CSI_SOURCE, Ioctl, list_devices
from drivers.finding.machine import Machine
from drivers.finding.serial_ports import Trouble
from drivers.finding.usb import Usb, usb_of
from drivers.programs import Program, end_command

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
