"""Anonymous report of ``mission doctor``, for support questions."""

import os
import platform
import pwd
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from drivers.extras import extras
from drivers.finding.machine import HostMachine
from drivers.finding.serial_ports import iter_usb_devices
from missions.plugins.setup.checkup import PartFinding

MIN_SERIAL_LENGTH = 4
"""Minimum length of a USB serial number that is anonymised: shorter ones may be words."""


def report_text(machine: HostMachine, found: Iterable[PartFinding]) -> str:
    """Return the anonymous report of findings on this computer as text."""
    lines, known = list(_lines(machine, found)), private_words(machine)
    return "\n".join([*lines[:4], *(anonymise(line, known) for line in lines[4:])]) + "\n"


def private_words(machine: HostMachine) -> dict[str, str]:
    """Return the names and serial numbers that identify this computer or its user, each with its replacement.

    The longest come first, so that a name inside a longer one is not replaced first.
    """
    names = {platform.node(): "HOST", machine.read_text("/etc/hostname"): "HOST", str(Path.home()): "~"}
    names |= dict.fromkeys((os.environ.get("USER", ""), os.environ.get("LOGNAME", ""), Path.home().name), "USER")
    with suppress(KeyError):  # no passwd entry
        names[pwd.getpwuid(machine.uid).pw_name] = "USER"
    serials = {usb.serial: "SERIAL" for _, usb in iter_usb_devices(machine) if len(usb.serial) >= MIN_SERIAL_LENGTH}
    ours = {name for name in names if name in {"", "root", "/"}}
    found = {name: instead for name, instead in (names | serials).items() if name not in ours}
    return dict(sorted(found.items(), key=lambda each: -len(each[0])))


def anonymise(text: str, replacements: dict[str, str]) -> str:
    """Return a text in which private names, keys, addresses and folders are replaced.

    ``replacements`` are the names from ``private_words``, each with its replacement.
    """
    for name, instead in replacements.items():
        text = re.sub(rf"(?<![A-Za-z0-9]){re.escape(name)}(?![A-Za-z0-9])", instead, text)
    for pattern, instead in _PRIVATE_PATTERNS:
        text = pattern.sub(instead, text)
    return text


_PRIVATE_PATTERNS = (
    (re.compile(r"//[^/\s@]+@"), "//SECRET@"),  # user and password of a URL
    (re.compile(r"(?<=[?&])([\w-]+)=[^&\s]+"), r"\1=SECRET"),
    (re.compile(r"/(home|Users)/[^/\s]+"), "~"),
    (re.compile(r"(?<=/dev/serial/by-id/)(\S+?)_[^_\s-]+(?=-if|-port|\s|$)"), r"\1_SERIAL"),
    (re.compile(r"\b(?:[0-9a-fA-F]{2}:){5}[0-9a-fA-F]{2}\b"), "MAC"),
    (re.compile(r"\b\d{1,3}(?:\.\d{1,3}){3}\b"), "ADDRESS"),
    (re.compile(r"\b(?=\w*\d)(?=\w*[A-Za-z])\w{20,}\b"), "SECRET"),  # long, with digits and letters: a key
)
"""Patterns of private data such as passwords, keys and addresses, with their replacements."""


def _lines(machine: HostMachine, found: Iterable[PartFinding]) -> Iterator[str]:
    system = re.search(r'^PRETTY_NAME="?([^"\n]*)', machine.read_text("/etc/os-release"), re.MULTILINE)
    board = machine.read_text("/proc/device-tree/model") or machine.read_text("/sys/class/dmi/id/product_name")
    yield f"mission doctor, MissionTree {version('missiontree')}"
    yield f"{board.rstrip(chr(0)) or 'a computer'}, {platform.machine()}, {system[1] if system else platform.system()}"
    yield f"kernel {platform.release()}, Python {platform.python_version()}"
    yield "packages: " + ", ".join(sorted({each for names in extras().values() for each in _versions(names)}))
    yield ""
    for each in found:
        finding = each.finding
        yield f"{finding.verdict:<8} {each.part} {finding.about}: {finding.message}"
        if finding.fix:
            yield f"         try: {finding.fix}"


def _versions(names: Iterable[str]) -> Iterator[str]:
    for name in names:
        try:
            yield f"{name} {version(name)}"
        except PackageNotFoundError:
            continue
