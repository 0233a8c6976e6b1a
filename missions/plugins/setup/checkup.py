"""Checks of the installation and of each part of a robot at rest; a driver declares how its part is checked."""

import os
import platform
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from threading import Lock

from config.defaults import config_folder
from config.robot import RobotConfig, Section
from drivers.api.driver import DriverContext, Finding, failure, resolve_name
from drivers.api.sections import SerialKeys
from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.extras import DISTRIBUTION, extras, missing_distributions
from drivers.finding.machine import HostMachine
from drivers.finding.port_probe import probe_port
from drivers.finding.serial_ports import ADAPTERS, SerialPortInfo, find_serial_ports
from drivers.transport.ports import DEBUG_CONNECTOR_PROBLEM, PINS_HINT, leads_to_debug_connector
from missions.assembly.learnt_delays import BASE, CAMERA, load_delays
from missions.library.folders import data_folder, state_folder

# Installation: version, packages and extras.


def check_folders() -> Iterator[Finding]:
    """Yield a finding for each of the user's folders (configuration, state, data) that cannot be written."""
    for what, folder in (("configuration", config_folder()), ("state", state_folder()), ("data", data_folder())):
        there = next(each for each in (folder, *folder.parents) if os.path.lexists(each))
        if not there.is_dir():
            yield failure("folders", f"{what} folder {folder}: {there} is not a folder", f"ls -ld {there}")
        elif not os.access(there, os.W_OK | os.X_OK):
            yield failure(
                "folders", f"{what} folder {folder}: {there} is not writable", f"ls -ld {there}; df -h {there}"
            )


def check_installation() -> Iterator[Finding]:
    """Yield findings on the installed packages and extras."""
    extra_packages = extras()
    yield Finding("program", f"MissionTree {version(DISTRIBUTION)}, Python {platform.python_version()}")
    if missing := missing_distributions(extra_packages.pop("", ())):
        fix = f"pip install {' '.join(missing)}"
        yield failure("packages", f"{', '.join(missing)}: required by MissionTree, but not installed", fix)
    there = {extra: not missing_distributions(names) for extra, names in extra_packages.items()}
    installed = ", ".join(extra for extra, whole in there.items() if whole) or "none"
    rest = ", ".join(extra for extra, whole in there.items() if not whole)
    fix = f"pip install 'missiontree[{rest.split(', ')[0]}]'  (and others that you need)" if rest else ""
    yield Finding("extras", f"{installed}" + (f"; not installed: {rest}" if rest else ""), fix=fix)


PROBE_EXTRA_TIMEOUT = 0.02
"""Extra seconds to wait for a device's reply to a probe: on a busy computer, MissionTree may read the reply late."""

VIRTUAL_PORT_PREFIX = "/dev/pts/"
"""Path prefix of the serial ports of virtual devices, which reply late."""


@dataclass(frozen=True, slots=True)
class PartFinding:
    """A finding of a check-up (ok, warning or failure), with the name of the part of the robot that it is about."""

    part: str
    finding: Finding


def check_robot(
    config: RobotConfig,
    robot_name: str,
    machine: HostMachine,
    clock: Clock,
    *,
    ports: Mapping[str, str],
    resets: bool = False,
) -> Iterator[PartFinding]:
    """Yield the findings on each part of a robot, in the order of the robot file. Nothing moves.

    ``robot_name`` is the robot's name in the suggested commands. ``ports`` replace the ports in the robot file, by
    part. A board that resets when its port is opened is probed only if ``resets`` is True.
    """
    known_ports = {name: port for port in find_serial_ports(machine) for name in (port.path, *port.names)}
    port_names = {
        part: ports.get(part) or (section.keys.port if isinstance(section.keys, SerialKeys) else "")
        for part, section in config.sections.items()
    }
    wires = {port: Lock() for port in port_names.values()}  # parts on one port are checked one after another

    delays = load_delays(config)

    def look_at(part: str) -> list[Finding]:
        section, port = config.sections[part], port_names[part]
        with wires[port] if port else nullcontext():
            found = [*_check_extra(section), *_check_device(section, port, known_ports, machine, clock, resets=resets)]
        late = f"{delays[part] * 1000:.0f} ms, learnt in earlier runs" if part in delays else "not learnt yet"
        return found + [Finding("delay", late)] * (part in (CAMERA, BASE))

    with ThreadPoolExecutor(max(1, len(port_names))) as pool:  # each check mostly waits for its device
        for part, findings in zip(port_names, pool.map(look_at, port_names), strict=True):
            robot = f"{robot_name} --port {port_names[part]}" if part in ports else robot_name
            for finding in findings:
                which = f" --arm {part}" if part in config.extra_parts and " servo " in finding.fix else ""
                fix = finding.fix.replace("--robot ROBOT", f"--robot {robot}{which}").replace("ROBOT", robot_name)
                yield PartFinding(part, replace(finding, fix=fix.replace("PORT", port_names[part])))


def check_part(section: Section, machine: HostMachine, clock: Clock) -> Iterator[Finding]:
    """Yield the findings on a part that has no serial port, such as a part whose driver uses ROS 2."""
    yield from _check_extra(section)
    yield from _check_device(section, "", {}, machine, clock, resets=False)


def _check_extra(section: Section) -> Iterator[Finding]:
    """Yield a finding if packages that a part's driver needs are missing.

    A voice is not checked, because it can also speak without these packages.
    """
    extra = section.driver.extra
    if extra and section.driver.kind != "voice" and (missing := missing_distributions(extras().get(extra, ()))):
        what = f"{', '.join(missing)}: not installed, but its driver needs it"
        yield failure("packages", what, f"pip install 'missiontree[{extra}]'")


def _check_device(
    section: Section,
    port_name: str,
    known_ports: Mapping[str, SerialPortInfo],
    machine: HostMachine,
    clock: Clock,
    *,
    resets: bool,
) -> Iterator[Finding]:
    """Yield the findings on a part's device: first on its port, then on the device behind the port.

    ``known_ports`` are the serial ports of the computer, by path and by each other name. A port whose board resets when
    it is opened is probed only if ``resets`` is True.
    """
    wired, keys = isinstance(section.keys, SerialKeys), section.keys
    port = (
        known_ports.get(port_name)
        or known_ports.get(machine.resolve(port_name))
        or SerialPortInfo(port_name, port_name)
    )
    if wired and machine.can_open(port.path) is None:
        yield failure("port", f"no device at {port_name}", "mission ports  (lists the ports and their names)")
    elif wired and port.shut is not None:
        yield failure("port", f"{port_name}: {port.shut.message}", port.shut.fix)
    elif wired and leads_to_debug_connector(port_name, machine.root):
        yield failure("port", f"{port_name}: {DEBUG_CONNECTOR_PROBLEM}", PINS_HINT)
    elif wired and _may_reset(section, port) and not resets:
        fix = "mission doctor --move --robot ROBOT  (hands off the robot)"
        yield Finding("port", f"{port.title}: not probed, because that resets it, and it may move", fix=fix)
    elif section.driver.checkup:
        where = str(machine.local_path(port.path)) if wired else ""
        virtual = str(Path(where).resolve()).startswith(VIRTUAL_PORT_PREFIX)
        site = DriverContext(clock, where, state_folder=None if virtual else state_folder(), part=section.part)
        yield from _run_checkup(section, replace(keys, port=where) if wired else keys, site)
    elif wired and section.driver.probe:
        yield _probe_port(section, port, machine, clock)
    elif not section.driver.needs:  # a part made of another one is checked with that
        yield Finding("driver", f"{section.driver.name}: not checked, because its driver has no check-up")


def _may_reset(section: Section, port: SerialPortInfo) -> bool:
    """Return whether opening a port may reset the board behind it.

    For a head, an unknown USB adapter counts as a board that resets, since it may belong to an Arduino.
    """
    if port.usb is None:
        return False
    return port.usb.resets_on_open or (section.driver.kind == "head" and port.usb.ids not in ADAPTERS)


def _run_checkup(section: Section, keys: object, site: DriverContext) -> Iterator[Finding]:
    """Yield the findings of a driver's check-up; an exception in the check-up is a finding too."""
    found: Iterable[Finding] = ()
    try:
        found = resolve_name(section.driver.checkup)(keys, site)
        yield from found
    except DriverError as error:
        yield failure("device", str(error), error.hint)
    except Exception as error:
        about = f"{section.driver.kind}.{section.driver.name}"
        yield failure(
            "driver", f"the check-up of {about} fails: {type(error).__name__}: {error}", "mission list drivers"
        )


def _probe_port(section: Section, port: SerialPortInfo, machine: HostMachine, clock: Clock) -> Finding:
    """Probe a port with the part's driver; return the description of the device that replied, or the problem."""
    path = str(machine.local_path(port.path))
    reply = probe_port(port, [section.driver], clock, consent=True, extra_timeout=PROBE_EXTRA_TIMEOUT, path=path)
    trouble = reply.trouble or reply.skip_reason
    if trouble is not None:
        return failure("device", trouble.message, trouble.fix)
    return Finding("device", "" if reply.device is None else reply.device.result.about)
