"""Whether a machine is fit to run a robot: rights, ports, sound, disk, clock, processor; as its files tell."""

import os
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

from drivers.api.driver import Finding, failure, warning
from drivers.finding.hardware_scan import HardwareScan
from drivers.finding.machine import HostMachine
from drivers.finding.serial_ports import DeviceProblem, SerialPortInfo

GROUPS = ("dialout", "video", "audio", "input")
"""The groups whose members may open ports, cameras, sound cards and game pads, on Debian and its like."""

MIN_FREE_BYTES = {"wrong": 200e6, "warning": 2e9}
"""Bytes on the disk below which a record will not fit."""

MIN_FREE_MEMORY = 300e6
"""Bytes of memory that must be there."""

MAX_TEMPERATURE = 80.0
"""Degrees at which small computers slow down."""

CPU_FOLDER = "/sys/devices/system/cpu"
THROTTLED_FILE = "/sys/devices/platform/soc/soc:firmware/get_throttled"
"""Where a Raspberry Pi says that it had too little power (bits 0 and 16) or slowed down (1, 2, 17 to 19)."""


def check_machine(
    machine: HostMachine,
    scan: HardwareScan,
    *,
    now: float,
    installed_at: float,
    folder: Path,
    free_bytes: Callable[[Path], float] | None = None,
) -> Iterator[Finding]:
    """Yield what is found of a machine with what is plugged in.

    ``now`` is the time of day, ``installed`` that of this installation, ``folder`` where records go, and ``free`` says
    how many bytes there are left: by the disk, unless somebody else says it.
    """
    yield from _check_groups(machine)
    yield from chain.from_iterable(_check_port(plug.port) for plug in scan.ports)
    for usb, trouble in scan.portless_adapters:
        yield failure(f"adapter {usb.title}", trouble.message, trouble.fix)
    for device in scan.cameras:
        yield _device_finding(f"camera {device.path}", device.name, device.trouble)
    for pad in scan.game_pads:
        yield _device_finding(f"game pad {pad.path}", pad.name, pad.trouble)
    for card in scan.sound_cards:
        what = " and ".join(["microphone"] * card.hears + ["loudspeaker"] * card.speaks) or "neither hears nor speaks"
        yield Finding(f"sound card {card.number}", f"{what}: {card.name}")
    yield from _check_disk(folder, free_bytes or _free_bytes)
    yield from _check_clock(machine, now, installed_at)
    yield from _check_governor(machine)
    yield from _check_power_and_heat(machine)
    yield from _check_memory(machine)


def _check_groups(machine: HostMachine) -> Iterator[Finding]:
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


def _check_port(port: SerialPortInfo) -> Iterator[Finding]:
    about = f"port {port.path}"
    if port.shut is not None:
        yield failure(about, port.shut.message, port.shut.fix)
    yield from (warning(about, trouble.message, trouble.fix) for trouble in port.troubles)
    if port.shut is None and not port.troubles:
        yield Finding(about, port.title + ("" if port.latency is None else f", its latency timer {port.latency} ms"))


def _device_finding(about: str, name: str, trouble: DeviceProblem | None) -> Finding:
    return Finding(about, name) if trouble is None else failure(about, f"{name}: {trouble.message}", trouble.fix)


def _free_bytes(folder: Path) -> float:
    there = next(each for each in (folder, *folder.parents) if each.exists())
    disk = os.statvfs(there)
    return disk.f_bavail * disk.f_frsize


def _check_disk(folder: Path, free_bytes: Callable[[Path], float]) -> Iterator[Finding]:
    room = free_bytes(folder)
    told = f"{room / 1e9:.1f} GB free where records are kept"
    cure = "mission record list  (which may go?); sudo apt clean"
    if room < MIN_FREE_BYTES["wrong"]:
        yield failure("disk", told, cure)
    elif room < MIN_FREE_BYTES["warning"]:
        yield warning("disk", told, cure)
    else:
        yield Finding("disk", told)


def _check_clock(machine: HostMachine, now: float, installed_at: float) -> Iterator[Finding]:
    """Judge the time of day: a computer without a battery for its clock wakes up in the past."""
    cure = "sudo timedatectl set-ntp true  (with a network)"
    if now < installed_at:
        yield failure("clock", "the time of day lies before this installation: records and tasks get wrong times", cure)
    elif (
        machine.list_names("/run/systemd/timesync")
        and not machine.local_path("/run/systemd/timesync/synchronized").exists()
    ):
        yield warning("clock", "the time of day was not set by the network yet", cure)
    else:
        yield Finding("clock", "the time of day is plausible")


def _check_governor(machine: HostMachine) -> Iterator[Finding]:
    """Judge how the processor's clock is governed: one that rises late makes ticks late."""
    policies = [f"{CPU_FOLDER}/{name}/cpufreq" for name in machine.list_names(CPU_FOLDER) if name[3:].isdecimal()]
    found = {
        (machine.read_text(f"{path}/scaling_governor"), machine.read_text(f"{path}/scaling_driver"))
        for path in policies
    }
    found.discard(("", ""))
    slow = [
        name for name, driver in found if name == "powersave" and not driver.startswith(("intel_pstate", "amd-pstate"))
    ]
    if slow:
        cure = f"echo performance | sudo tee {CPU_FOLDER}/cpu*/cpufreq/scaling_governor  (until the next start)"
        yield warning("processor", "its governor is powersave: it stays at its lowest rate", cure)
    else:
        names = ", ".join(sorted({name for name, _ in found})) or "not told"
        yield Finding(
            "processor",
            f"{sum(name[3:].isdecimal() for name in machine.list_names(CPU_FOLDER))} cores, governor {names}",
        )
    load, cores = machine.read_text("/proc/loadavg").split(), max(1, len(policies))
    if load and float(load[0]) > 2 * cores:
        yield warning(
            "load", f"{load[0]} programs want to run on {cores} cores: ticks will be late", "top  (which ones?)"
        )


def _check_power_and_heat(machine: HostMachine) -> Iterator[Finding]:
    told = machine.read_text(THROTTLED_FILE)
    if told and int(told, 16) & 0x1_0001:
        yield warning("power", "this Raspberry Pi had too little of it", "a supply of 5 V, 3 A or more; a short cable")
    elif told:
        yield Finding("power", "enough since the start")
    zones = [machine.read_text(f"/sys/class/thermal/{zone}/temp") for zone in machine.list_names("/sys/class/thermal")]
    warmest = max((int(heat) / 1000 for heat in zones if heat.lstrip("-").isdecimal()), default=0.0)
    if warmest >= MAX_TEMPERATURE:
        yield warning("heat", f"the processor has {warmest:.0f} degC, and slows down", "a heat sink, or a fan")
    elif warmest > 0:
        yield Finding("heat", f"the processor has {warmest:.0f} degC")


def _check_memory(machine: HostMachine) -> Iterator[Finding]:
    told = {line.split(":")[0]: line.split()[1] for line in _lines(machine, "/proc/meminfo") if ":" in line}
    if "MemAvailable" not in told:
        return
    left = int(told["MemAvailable"]) * 1024
    if left < MIN_FREE_MEMORY:
        yield warning("memory", f"{left / 1e6:.0f} MB are left", "end programs that need much: top -o %MEM")
    else:
        yield Finding("memory", f"{left / 1e9:.1f} GB are left")


def _lines(machine: HostMachine, path: str) -> list[str]:
    return machine.read_text(path).splitlines()
