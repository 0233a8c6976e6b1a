"""All that is plugged in, in one look; and what changed between two looks."""

import fcntl
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from drivers.api.driver import Driver
from drivers.camera.devices import Ioctl
from drivers.clock import Clock
from drivers.finding.asking import PATIENCE, Heard, look
from drivers.finding.machine import Machine
from drivers.finding.others import CameraFound, PadFound, SoundCard, cameras, pads, sound_cards
from drivers.finding.serial_ports import SerialPort, Trouble, lost_adapters, serial_ports
from drivers.finding.usb import Usb


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
