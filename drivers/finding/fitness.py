"""Whether a machine is fit to run a robot: rights, ports, sound, disk, clock, processor; as its files tell."""

import os
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

from drivers.api.driver import Finding, warning, wrong
from drivers.finding.machine import Machine
from drivers.finding.serial_ports import SerialPort, Trouble
from drivers.finding.survey import Desk

GROUPS = ("dialout", "video", "audio", "input")
"""The groups whose members may open ports, cameras, sound cards and game pads, on Debian and its like."""

ROOM = {"wrong": 200e6, "warning": 2e9}
"""Bytes on the disk below which a record will not fit."""

MEMORY = 300e6
"""Bytes of memory that must be there."""

HOT = 80.0
"""Degrees at which small computers slow down."""

CPU = "/sys/devices/system/cpu"
THROTTLED = "/sys/devices/platform/soc/soc:firmware/get_throttled"
"""Where a Raspberry Pi says that it had too little power (bits 0 and 16) or slowed down (1, 2, 17 to 19)."""


def fitness(
    machine: Machine,
    desk: Desk,
    *,
    now: float,
    installed: float,
    folder: Path,
    free: Callable[[Path], float] | None = None,
) -> Iterator[Finding]:
    """Yield what is found of a machine with what is plugged in.

    ``now`` is the time of day, ``installed`` that of this installation, ``folder`` where records go, and ``free`` says
    how many bytes there are left: by the disk, unless somebody else says it.
    """
    yield from _groups(machine)
    yield from chain.from_iterable(_port(plug.port) for plug in desk.plugs)
    for usb, trouble in desk.lost:
        yield wrong(f"adapter {usb.title}", trouble.what, trouble.cure)
    for device in desk.cameras:
        yield _told(f"camera {device.path}", device.name, device.trouble)
    for pad in desk.pads:
        yield _told(f"game pad {pad.path}", pad.name, pad.trouble)
    for card in desk.sounds:
        what = " and ".join(["microphone"] * card.hears + ["loudspeaker"] * card.speaks) or "neither hears nor speaks"
        yield Finding(f"sound card {card.number}", f"{what}: {card.name}")
    yield from _disk(folder, free or _free)
    yield from _clock(machine, now, installed)
    yield from _governor(machine)
    yield from _power_and_heat(machine)
    yield from _memory(machine)


def _groups(machine: Machine) -> Iterator[Finding]:
    """Look which of the groups the user lacks; root needs none, and a system that has not got them uses others."""
    if machine.uid == 0:
        yield Finding("rights", "root may open everything")
        return
    numbers = {
        line.split(":")[0]: int(line.split(":")[2]) for line in _lines(machine, "/etc/group") if line.count(":") > 2
    }
    lacking = [name for name in GROUPS if name in numbers and numbers[name] not in machine.groups]
    if lacking:
        cure = f"sudo usermod -a -G {','.join(lacking)} $USER  (then log in again)"
        yield warning("rights", f"you are not in {', '.join(lacking)}: what belongs to them cannot be opened", cure)
    else:
        yield Finding("rights", f"you are in {', '.join(name for name in GROUPS if name in numbers)}")


def _port(port: SerialPort) -> Iterator[Finding]:
    about = f"port {port.path}"
    if port.shut is not None:
        yield wrong(about, port.shut.what, port.shut.cure)
    yield from (warning(about, trouble.what, trouble.cure) for trouble in port.troubles)
    if port.shut is None and not port.troubles:
        yield Finding(about, port.title + ("" if port.latency is None else f", its latency timer {port.latency} ms"))


def _told(about: str, name: str, trouble: Trouble | None) -> Finding:
    return Finding(about, name) if trouble is None else wrong(about, f"{name}: {trouble.what}", trouble.cure)


def _free(folder: Path) -> float:
    there = next(each for each in (folder, *folder.parents) if each.exists())
    disk = os.statvfs(there)
    return disk.f_bavail * disk.f_frsize


def _disk(folder: Path, free: Callable[[Path], float]) -> Iterator[Finding]:
    room = free(folder)
    told = f"{room / 1e9:.1f} GB free where records are kept"
    cure = "mission record list  (which may go?); sudo apt clean"
    if room < ROOM["wrong"]:
        yield wrong("disk", told, cure)
    elif room < ROOM["warning"]:
        yield warning("disk", told, cure)
    else:
        yield Finding("disk", told)


def _clock(machine: Machine, now: float, installed: float) -> Iterator[Finding]:
    """Judge the time of day: a computer without a battery for its clock wakes up in the past."""
    cure = "sudo timedatectl set-ntp true  (with a network)"
    if now < installed:
        yield wrong("clock", "the time of day lies before this installation: records and tasks get wrong times", cure)
    elif machine.names("/run/systemd/timesync") and not machine.at("/run/systemd/timesync/synchronized").exists():
        yield warning("clock", "the time of day was not set by the network yet", cure)
    else:
        yield Finding("clock", "the time of day is plausible")


def _governor(machine: Machine) -> Iterator[Finding]:
    """Judge how the processor's clock is governed: one that rises late makes ticks late."""
    policies = [f"{CPU}/{name}/cpufreq" for name in machine.names(CPU) if name[3:].isdecimal()]
    found = {(machine.text(f"{path}/scaling_governor"), machine.text(f"{path}/scaling_driver")) for path in policies}
    found.discard(("", ""))
    slow = [
        name for name, driver in found if name == "powersave" and not driver.startswith(("intel_pstate", "amd-pstate"))
    ]
    if slow:
        cure = f"echo performance | sudo tee {CPU}/cpu*/cpufreq/scaling_governor  (until the next start)"
        yield warning("processor", "its governor is powersave: it stays at its lowest rate", cure)
    else:
        names = ", ".join(sorted({name for name, _ in found})) or "not told"
        yield Finding(
            "processor", f"{sum(name[3:].isdecimal() for name in machine.names(CPU))} cores, governor {names}"
        )
    load, cores = machine.text("/proc/loadavg").split(), max(1, len(policies))
    if load and float(load[0]) > 2 * cores:
        yield warning(
            "load", f"{load[0]} programs want to run on {cores} cores: ticks will be late", "top  (which ones?)"
        )


def _power_and_heat(machine: Machine) -> Iterator[Finding]:
    told = machine.text(THROTTLED)
    if told and int(told, 16) & 0x1_0001:
        yield warning("power", "this Raspberry Pi had too little of it", "a supply of 5 V, 3 A or more; a short cable")
    elif told:
        yield Finding("power", "enough since the start")
    zones = [machine.text(f"/sys/class/thermal/{zone}/temp") for zone in machine.names("/sys/class/thermal")]
    warmest = max((int(heat) / 1000 for heat in zones if heat.lstrip("-").isdecimal()), default=0.0)
    if warmest >= HOT:
        yield warning("heat", f"the processor has {warmest:.0f} degC, and slows down", "a heat sink, or a fan")
    elif warmest > 0:
        yield Finding("heat", f"the processor has {warmest:.0f} degC")


def _memory(machine: Machine) -> Iterator[Finding]:
    told = {line.split(":")[0]: line.split()[1] for line in _lines(machine, "/proc/meminfo") if ":" in line}
    if "MemAvailable" not in told:
        return
    left = int(told["MemAvailable"]) * 1024
    if left < MEMORY:
        yield warning("memory", f"{left / 1e6:.0f} MB are left", "end programs that need much: top -o %MEM")
    else:
        yield Finding("memory", f"{left / 1e9:.1f} GB are left")


def _lines(machine: Machine, path: str) -> list[str]:
    return machine.text(path).splitlines()
