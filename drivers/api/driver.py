"""What a driver declares of itself: its keys in the robot file, and where the code is that makes it.

A declaration imports no driver. What makes the device, its twin and its virtual device are dotted names such as
``drivers.kobuki.driver:make``, resolved when they are used: so a robot on the metal loads nothing that it does not use.
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
    """Where a device is made: its clock, its port, and who is told of what.

    ``part`` is what it is called in the robot file, and in all that it tells.
    ``port`` is the one of the robot file, or what the user named instead; empty for a part without one. ``print_line`` prints
    a line for people. ``needed_parts`` are the devices that it ``needs``, by kind. ``state_folder`` is the folder of what a driver
    keeps from one program to the next; None on a virtual device, of which nothing is to be kept, which has booted
    already, and which may answer late, for it shares its interpreter with the driver.
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
        """True where the port is that of a virtual device."""
        return self.state_folder is None


@dataclass(frozen=True, slots=True)
class Driver:
    """One driver, as a robot file names it: a ``kind`` of part with ``driver: name``; ``about`` says what it drives.

    ``keys`` is the class of its section, which extends that of its kind. ``make`` is the dotted name of what makes the
    device, called with the keys and a ``DriverContext``; ``twin`` of what makes its twin for simulated time, and ``virtual`` of
    what makes its virtual device for simulation down to the wire, both called with the keys and a
    ``drivers.sim.context.SimContext``. They are empty where the kind has a stand-in that does for every driver: cameras,
    microphones, voices and screens. ``needs`` are the kinds of the parts that it is made of, ``extra`` the optional
    dependency that it wants. ``check`` yields what is wrong together with other sections, given by kind.

    ``probe`` is the dotted name of a ``drivers.api.probe.Probe``, by which the device is found on a serial port; and
    ``usb`` are the adapters that it may be behind, as ``0403:6014``, or with the serial number of one that is in no
    other device, ``0403:6001:kobuki_*``. Without any it is looked for behind every adapter.

    ``checkup`` is the dotted name of a ``drivers.api.driver.Checkup``, by which `mission doctor` looks at the device
    at rest; a driver without one that has a probe is looked at by that.
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
    """The drivers that there are: the table of the house with those of other distributions."""

    def names(self, kind: str) -> Sequence[str]:
        """Return the names of the drivers of a kind."""
        ...

    def find(self, kind: str, name: str) -> Driver:
        """Return a driver. Raises BrokenDriver for a declaration that cannot be used; KeyError for no such name."""
        ...


class BrokenDriver(Exception):
    """A declaration of a driver that cannot be used: the message says whose it is, and what is wrong with it."""


def resolve_name(name: str) -> Any:
    """Return what a dotted name ``package.module:attribute`` means. Raises ImportError, AttributeError, ValueError."""
    module, colon, attribute = name.partition(":")
    if not colon or not module or not attribute:
        raise ValueError(f"'{name}' is no dotted name such as my_robot.base:make")
    return getattr(import_module(module), attribute)


# What a check-up finds: of the machine, or of a device of the robot that its driver looks at.

Verdict = Literal["ok", "warning", "wrong"]


@dataclass(frozen=True, slots=True)
class Finding:
    """A line of a check-up: ``about`` which thing, ``message`` was found, and the ``fix`` where that is no good.

    In a cure ``ROBOT`` and ``PORT`` stand for the robot and the port that it is about; two blanks part a command from
    words on it.
    """

    about: str
    message: str
    verdict: Verdict = "ok"
    fix: str = ""


def warning(about: str, message: str, fix: str) -> Finding:
    """Return what may do harm, or will."""
    return Finding(about, message, "warning", fix)


def failure(about: str, message: str, fix: str) -> Finding:
    """Return what keeps the robot from working."""
    return Finding(about, message, "wrong", fix)


Checkup = Callable[[Any, DriverContext], Iterable[Finding]]
"""Looks at a device at rest: called with the keys of its section and a ``DriverContext``, whose port is there and free.

It opens the device by itself, only reads, and closes it whatever happens: nothing moves, nothing is written. What it
raises of ``DriverError`` is told as wrong, with its hint.
"""
