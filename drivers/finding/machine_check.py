"""Check whether a machine is fit to run a robot: rights, ports, sound, disk, clock, processor, from its files."""

import os
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

from drivers.api.driver import Finding, failure, warning
from drivers.finding.hardware_scan import HardwareScan
from drivers.finding.machine import HostMachine
from drivers.finding.serial_ports import DeviceProblem, SerialPortInfo

GROUPS = ("dialout", "video", "audio", "input")
"""Groups whose members may open ports, cameras, sound cards and game pads, on Debian and similar systems."""

MIN_FREE_BYTES = {"wrong": 200e6, "warning": 2e9}
"""Free bytes on the disk of the records below which the checkup reports a failure ("wrong") or a warning."""

MIN_FREE_MEMORY = 300e6
"""Minimum bytes of available memory."""

MAX_TEMPERATURE = 80.0
"""Degrees Celsius at which small computers slow down."""

CPU_FOLDER = "/sys/devices/system/cpu"
THROTTLED_FILE = "/sys/devices/platform/soc/soc:firmware/get_throttled"
"""File in which a Raspberry Pi reports low power (bits 0 and 16) or a reduced clock (1, 2, 17 to 19)."""


def check_machine(
    machine: HostMachine,
    scan: HardwareScan,
    *,
    now: float,
    installed_at: float,
    folder: Path,
    free_bytes: Callable[[Path], float] | None = None,
) -> Iterator[Finding]:
    """Yield the findings about a computer with its connected hardware.

    ``now`` is the time of day and ``installed_at`` that of MissionTree's installation, both in seconds. ``folder`` is
    the folder of records. ``free_bytes`` returns the free bytes of the disk of a folder, by default of this computer.
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
        message = (
            " and ".join(["microphone"] * card.hears + ["loudspeaker"] * card.speaks) or "no microphone, no loudspeaker"
        )
        yield Finding(f"sound card {card.number}", f"{message}: {card.name}")
    yield from _check_disk(folder, free_bytes or _free_bytes)
    yield from _check_clock(machine, now, installed_at)
    yield from _check_governor(machine)
    yield from _check_power_and_heat(machine)
    yield from _check_memory(machine)


def _check_groups(machine: HostMachine) -> Iterator[Finding]:
    """Check the groups of the user. Root needs none, and groups that the system does not have are not required."""
    if machine.uid == 0:
        yield Finding("rights", "root may open all devices")
        return
    numbers = {
        line.split(":")[0]: int(line.split(":")[2]) for line in _lines(machine, "/etc/group") if line.count(":") > 2
    }
    missing = [name for name in GROUPS if name in numbers and numbers[name] not in machine.groups]
    if missing:
        fix = f"sudo usermod -a -G {','.join(missing)} $USER  (then log in again)"
        yield warning("rights", f"you are not in {', '.join(missing)}: their devices cannot be opened", fix)
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
    existing = next(each for each in (folder, *folder.parents) if each.exists())
    disk = os.statvfs(existing)
    return disk.f_bavail * disk.f_frsize


def _check_disk(folder: Path, free_bytes: Callable[[Path], float]) -> Iterator[Finding]:
    free = free_bytes(folder)
    message = f"{free / 1e9:.1f} GB free for records"
    fix = "mission record list  (which may go?); sudo apt clean"
    if free < MIN_FREE_BYTES["wrong"]:
        yield failure("disk", message, fix)
    elif free < MIN_FREE_BYTES["warning"]:
        yield warning("disk", message, fix)
    else:
        yield Finding("disk", message)


def _check_clock(machine: HostMachine, now: float, installed_at: float) -> Iterator[Finding]:
    """Check the time of day: a computer without a battery for its clock boots with a time in the past."""
    fix = "sudo timedatectl set-ntp true  (with a network)"
    if now < installed_at:
        yield failure("clock", "the time of day is before this installation: records and tasks get wrong times", fix)
    elif (
        machine.list_names("/run/systemd/timesync")
        and not machine.local_path("/run/systemd/timesync/synchronized").exists()
    ):
        yield warning("clock", "the time of day was not set by the network yet", fix)
    else:
        yield Finding("clock", "the time of day is plausible")


def _check_governor(machine: HostMachine) -> Iterator[Finding]:
    """Check the frequency governor of the processor and the load: either may make ticks late."""
    policies = [f"{CPU_FOLDER}/{name}/cpufreq" for name in machine.list_names(CPU_FOLDER) if name[3:].isdecimal()]
    governors = {
        (machine.read_text(f"{path}/scaling_governor"), machine.read_text(f"{path}/scaling_driver"))
        for path in policies
    }
    governors.discard(("", ""))
    slow = [
        name
        for name, driver in governors
        if name == "powersave" and not driver.startswith(("intel_pstate", "amd-pstate"))
    ]
    if slow:
        fix = f"echo performance | sudo tee {CPU_FOLDER}/cpu*/cpufreq/scaling_governor  (until the next start)"
        yield warning("processor", "its governor is powersave: it stays at its lowest rate", fix)
    else:
        names = ", ".join(sorted({name for name, _ in governors})) or "unknown"
        yield Finding(
            "processor",
            f"{sum(name[3:].isdecimal() for name in machine.list_names(CPU_FOLDER))} cores, governor {names}",
        )
    load, cores = machine.read_text("/proc/loadavg").split(), max(1, len(policies))
    if load and float(load[0]) > 2 * cores:
        yield warning("load", f"{load[0]} programs compete for {cores} cores: ticks will be late", "top  (which ones?)")


def _check_power_and_heat(machine: HostMachine) -> Iterator[Finding]:
    flags = machine.read_text(THROTTLED_FILE)
    if flags and int(flags, 16) & 0x1_0001:
        yield warning("power", "this Raspberry Pi had too little power", "a supply of 5 V, 3 A or more; a short cable")
    elif flags:
        yield Finding("power", "enough since the start")
    zones = [machine.read_text(f"/sys/class/thermal/{zone}/temp") for zone in machine.list_names("/sys/class/thermal")]
    warmest = max((int(heat) / 1000 for heat in zones if heat.lstrip("-").isdecimal()), default=0.0)
    if warmest >= MAX_TEMPERATURE:
        yield warning("heat", f"the processor is at {warmest:.0f} degC and slows down", "a heat sink, or a fan")
    elif warmest > 0:
        yield Finding("heat", f"the processor is at {warmest:.0f} degC")


def _check_memory(machine: HostMachine) -> Iterator[Finding]:
    values = {line.split(":")[0]: line.split()[1] for line in _lines(machine, "/proc/meminfo") if ":" in line}
    if "MemAvailable" not in values:
        return
    available = int(values["MemAvailable"]) * 1024
    if available < MIN_FREE_MEMORY:
        yield warning("memory", f"{available / 1e6:.0f} MB are left", "end programs that need much: top -o %MEM")
    else:
        yield Finding("memory", f"{available / 1e9:.1f} GB are left")


def _lines(machine: HostMachine, path: str) -> list[str]:
    return machine.read_text(path).splitlines()
