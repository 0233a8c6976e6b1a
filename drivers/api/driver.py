"""Declaration of a driver: its keys in the robot file, and the dotted names of the code that makes the device.

A declaration imports no driver. The factories of device, twin and virtual device are dotted names such as
``drivers.kobuki.driver:make``, resolved when they are used, so a robot loads only the drivers that it needs.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, Protocol

from drivers.api.device import StatusCallback, ignore
from drivers.api.fast_dataclass import dataclass
from drivers.api.keys import KeyDiagnostic
from drivers.api.steering import SteeringCallback
from drivers.clock import Clock


@dataclass(frozen=True, slots=True)
class DriverContext:
    """Context in which a device is made: clock, port, callbacks, and the parts that it needs.

    ``part`` is the name of the part in the robot file and in reports. ``port`` is the port of the robot file or of the
    command line; empty for a part without one. ``print_line`` prints a line for the user. ``needed_parts`` are the
    devices that the driver ``needs``, by kind. ``state_folder`` is the folder in which the device may store files
    between runs; None for a virtual device.

    A virtual device has booted before its port is opened. It may reply late, since it runs in this Python process.
    """

    clock: Clock
    port: str = ""
    report: StatusCallback = ignore
    on_change: Callable[[], None] = ignore
    on_steering: SteeringCallback = ignore
    print_line: Callable[[str], None] = lambda _: None
    needed_parts: Mapping[str, Any] = field(default_factory=dict)
    state_folder: Path | None = None
    part: str = ""

    @property
    def is_virtual(self) -> bool:
        """True if the port is that of a virtual device."""
        return self.state_folder is None


@dataclass(frozen=True, slots=True)
class Driver:
    """Declaration of a driver: ``driver: name`` in the section of a part of ``kind``.

    ``about`` describes the hardware. ``keys`` is the class of the section, which extends that of the kind. ``make`` is
    the dotted name of the factory of the device, called with the keys and a ``DriverContext``. ``twin`` and ``virtual``
    are the dotted names of the factories of the simulated and of the virtual device, called with the keys and a
    ``drivers.sim.context.SimContext``. They are empty for cameras, microphones, voices and screens: all drivers of such
    a kind have the same simulated device. ``needs`` are the kinds of the parts that the device uses, ``extra`` is the
    optional dependency. ``check`` yields errors that involve other sections of the robot file; it is called with the
    keys and with the other sections, by kind.

    ``probe`` is the dotted name of a ``drivers.api.probe.Probe``, which recognises the device on a serial port. ``usb``
    lists its possible adapters, as ``0403:6014``, or with a serial number that no other device has,
    ``0403:6001:kobuki_*``. Without ``usb`` all adapters are probed.

    ``checkup`` is the dotted name of a ``Checkup``, with which `mission doctor` checks the device at rest. Without one
    the probe is used.
    """

    name: str
    kind: str
    about: str
    keys: type
    make: str
    twin: str = ""
    virtual: str = ""
    needs: tuple[str, ...] = ()
    check: Callable[[Any, Mapping[str, Any]], Iterable[KeyDiagnostic]] | None = None
    extra: str = ""
    probe: str = ""
    usb: tuple[str, ...] = ()
    checkup: str = ""


class DriverCatalogue(Protocol):
    """Catalogue of all drivers: the built-in ones, and those of other installed Python distributions."""

    def names(self, kind: str) -> Sequence[str]:
        """Return the names of the drivers of a kind of part."""
        ...

    def find(self, kind: str, name: str) -> Driver:
        """Return a driver. Raises BrokenDriver for an invalid declaration, KeyError for an unknown name."""
        ...


class BrokenDriver(Exception):
    """Invalid declaration of a driver; the message names its distribution and the error."""


def resolve_name(name: str) -> Any:
    """Return the object with the dotted name ``package.module:attribute``.

    Raises ImportError, AttributeError, ValueError.
    """
    module, colon, attribute = name.partition(":")
    if not colon or not module or not attribute:
        raise ValueError(f"'{name}' is not a dotted name such as my_robot.base:make")
    return getattr(import_module(module), attribute)


# Findings of a check-up: of the machine, or of a device by its driver.

Verdict = Literal["ok", "warning", "wrong"]


@dataclass(frozen=True, slots=True)
class Finding:
    """Line of a check-up: the subject, the result, its verdict, and a fix unless it is ok.

    In a fix, ``ROBOT`` and ``PORT`` stand for the robot and the port; two spaces separate a command from a remark.
    """

    about: str
    message: str
    verdict: Verdict = "ok"
    fix: str = ""


def warning(about: str, message: str, fix: str) -> Finding:
    """Return a line of a check-up: a problem that may do harm.

    ``about`` is its subject, ``message`` the result, and ``fix`` the remedy.
    """
    return Finding(about, message, "warning", fix)


def failure(about: str, message: str, fix: str) -> Finding:
    """Return a line of a check-up: a problem that keeps the robot from working.

    ``about`` is its subject, ``message`` the result, and ``fix`` the remedy.
    """
    return Finding(about, message, "wrong", fix)


Checkup = Callable[[Any, DriverContext], Iterable[Finding]]
"""Checks a device at rest: called with the keys of its section and a ``DriverContext``.

The port of the context exists, and no other program uses it. The check opens the device, only reads, and closes it in
any case: nothing moves, nothing is written. A ``DriverError`` becomes a finding "wrong", with its hint.
"""
