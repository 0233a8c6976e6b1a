"""The check-up of a robot at rest: each part of its file is looked at by what its driver declares for that."""

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
from drivers.api.driver import Finding, Site, resolved, wrong
from drivers.api.sections import Wired
from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.extras import OURS, extras, lacking
from drivers.finding.asking import look
from drivers.finding.machine import Machine
from drivers.finding.serial_ports import ADAPTERS, SerialPort, serial_ports
from drivers.transport.ports import DEBUGGING, PINS_CURE, leads_to_debug_connector
from missions.assembly.lags import BASE, CAMERA, kept
from missions.library.folders import data_folder, state_folder

# The installed MissionTree: its version, and which of its extras are there.


def own_folders() -> Iterator[Finding]:
    """Say which of the user's folders cannot be written: records, answers and defaults are kept there."""
    for what, folder in (("configuration", config_folder()), ("state", state_folder()), ("data", data_folder())):
        there = next(each for each in (folder, *folder.parents) if os.path.lexists(each))
        if not there.is_dir():
            yield wrong("folders", f"{folder}, of the {what}: {there} is not a folder", f"ls -ld {there}")
        elif not os.access(there, os.W_OK | os.X_OK):
            yield wrong(
                "folders", f"{folder}, of the {what}: {there} cannot be written", f"ls -ld {there}; df -h {there}"
            )


def installation() -> Iterator[Finding]:
    """Say what is installed, and what is broken in it."""
    wanted = extras()
    yield Finding("program", f"MissionTree {version(OURS)}, Python {platform.python_version()}")
    if missing := lacking(wanted.pop("", ())):
        cure = f"pip install {' '.join(missing)}"
        yield wrong("packages", f"{', '.join(missing)}: asked for by MissionTree, and not installed", cure)
    there = {extra: not lacking(names) for extra, names in wanted.items()}
    have = ", ".join(extra for extra, whole in there.items() if whole) or "none"
    rest = ", ".join(extra for extra, whole in there.items() if not whole)
    cure = f"pip install 'missiontree[{rest.split(', ')[0]}]'  (and so on, where you need it)" if rest else ""
    yield Finding("extras", f"{have}" + (f"; not installed: {rest}" if rest else ""), cure=cure)


PROBE_PATIENCE = 0.02
"""Seconds beyond what a question waits: here a busy machine is not to be taken for a silent device."""

VIRTUAL = "/dev/pts/"
"""Where virtual devices are, which answer late."""


@dataclass(frozen=True, slots=True)
class Checked:
    """A part of the robot, and what was found of it."""

    part: str
    finding: Finding


def check_robot(
    config: RobotConfig,
    called: str,
    machine: Machine,
    clock: Clock,
    *,
    ports: Mapping[str, str],
    resets: bool = False,
) -> Iterator[Checked]:
    """Yield what is found of each part of the robot that is ``called`` so, in the order of the file. Nothing moves.

    ``ports`` are instead of those that the file says. A board that starts anew when its port is opened is asked only
    with ``resets``.
    """
    there = {name: port for port in serial_ports(machine) for name in (port.path, *port.names)}
    named = {
        part: ports.get(part) or (section.keys.port if isinstance(section.keys, Wired) else "")
        for part, section in config.sections.items()
    }
    wires = {port: Lock() for port in named.values()}  # parts on one wire are looked at one after another

    delays = kept(config)

    def look_at(part: str) -> list[Finding]:
        section, port = config.sections[part], named[part]
        with wires[port] if port else nullcontext():
            found = [*_extra(section), *_part(section, port, there, machine, clock, resets=resets)]
        late = f"{delays[part] * 1000:.0f} ms, as earlier runs have learnt" if part in delays else "not learnt yet"
        return found + [Finding("delay", late)] * (part in (CAMERA, BASE))

    with ThreadPoolExecutor(max(1, len(named))) as pool:  # most of the time each waits for its device
        for part, findings in zip(named, pool.map(look_at, named), strict=True):
            robot = f"{called} --port {named[part]}" if part in ports else called
            for finding in findings:
                which = f" --arm {part}" if part in config.others and " servo " in finding.cure else ""
                cure = finding.cure.replace("--robot ROBOT", f"--robot {robot}{which}").replace("ROBOT", called)
                yield Checked(part, replace(finding, cure=cure.replace("PORT", named[part])))


def check_part(section: Section, machine: Machine, clock: Clock) -> Iterator[Finding]:
    """Yield what is found of one part that is plugged into nothing, such as the nodes of ROS 2."""
    yield from _extra(section)
    yield from _part(section, "", {}, machine, clock, resets=False)


def _extra(section: Section) -> Iterator[Finding]:
    """Look whether what a driver wants besides is installed; a voice does without."""
    wanted = section.driver.extra
    if wanted and section.driver.kind != "voice" and (missing := lacking(extras().get(wanted, ()))):
        what = f"{', '.join(missing)}: not installed, and its driver needs it"
        yield wrong("packages", what, f"pip install 'missiontree[{wanted}]'")


def _part(
    section: Section, named: str, there: Mapping[str, SerialPort], machine: Machine, clock: Clock, *, resets: bool
) -> Iterator[Finding]:
    """Look at a part where it is plugged in, if it is one that is, and if nobody else has it."""
    wired, keys = isinstance(section.keys, Wired), section.keys
    port = there.get(named) or there.get(machine.real(named)) or SerialPort(named, named)
    if wired and machine.may_open(port.path) is None:
        yield wrong("port", f"nothing is plugged in at {named}", "mission ports  (what is, and how to call it)")
    elif wired and port.shut is not None:
        yield wrong("port", f"{named}: {port.shut.what}", port.shut.cure)
    elif wired and leads_to_debug_connector(named, machine.root):
        yield wrong("port", f"{named}: {DEBUGGING}", PINS_CURE)
    elif wired and _may_start_anew(section, port) and not resets:
        cure = "mission doctor --move --robot ROBOT  (hands off the robot)"
        yield Finding("port", f"{port.title}: left alone, for it starts anew when it is asked, and may move", cure=cure)
    elif section.driver.checkup:
        where = str(machine.at(port.path)) if wired else ""
        virtual = str(Path(where).resolve()).startswith(VIRTUAL)
        site = Site(clock, where, state=None if virtual else state_folder(), part=section.part)
        yield from _examined(section, replace(keys, port=where) if wired else keys, site)
    elif wired and section.driver.probe:
        yield _asked(section, port, machine, clock)
    elif not section.driver.needs:  # what is made of another part is looked at with that
        yield Finding("driver", f"{section.driver.name}: not looked at, for it has no check-up")


def _may_start_anew(section: Section, port: SerialPort) -> bool:
    """Say whether opening a port may start a board anew; behind an adapter that nobody knows a head may be one."""
    if port.usb is None:
        return False
    return port.usb.resets or (section.driver.kind == "head" and port.usb.ids not in ADAPTERS)


def _examined(section: Section, keys: object, site: Site) -> Iterator[Finding]:
    """Have a driver look at its device; what is wrong with the driver itself is told, too."""
    found: Iterable[Finding] = ()
    try:
        found = resolved(section.driver.checkup)(keys, site)
        yield from found
    except DriverError as error:
        yield wrong("device", str(error), error.hint)
    except Exception as error:
        about = f"{section.driver.kind}.{section.driver.name}"
        yield wrong("driver", f"the check-up of {about} fails: {type(error).__name__}: {error}", "mission list drivers")


def _asked(section: Section, port: SerialPort, machine: Machine, clock: Clock) -> Finding:
    """Ask a port by the probe of the part's driver."""
    path = str(machine.at(port.path))
    heard = look(port, [section.driver], clock, consent=True, patience=PROBE_PATIENCE, path=path)
    trouble = heard.trouble or heard.unasked
    if trouble is not None:
        return wrong("device", trouble.what, trouble.cure)
    return Finding("device", "" if heard.found is None else heard.found.answer.about)
