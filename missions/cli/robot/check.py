"""``mission robot check``: whether what a robot file says is plugged in, and answers as it says. Nothing moves."""

from collections.abc import Iterator
from pathlib import Path

import click

from config.library import MINE, find
from config.robot import RobotConfig, Section
from drivers.api.sections import Wired
from drivers.clock import SystemClock
from drivers.dynamixel.declared import DynamixelKeys
from drivers.dynamixel.probe import IDS
from drivers.finding.asking import PATIENCE, Heard, drivers_that_probe, look
from drivers.finding.machine import Machine
from drivers.finding.others import cameras
from drivers.finding.serial_ports import SerialPort, Trouble, serial_ports
from missions.cli.keys import interruptible
from missions.cli.ports import root_option
from missions.cli.root import FAILURE, SUCCESS
from missions.library.drivers import Table, load_robot


@click.command(epilog="Example: mission robot check turtlebot2_arm")
@click.argument("name", required=False, default=MINE)
@click.option("--reset", is_flag=True, help="Ask Arduinos too, which start anew by it, and may move.")
@root_option
def check(name: str, reset: bool, root: Path) -> int:
    """Check a robot at rest: its file, its ports, and what answers there; without NAME, this computer's own.

    Exit code 1 where something is wrong.
    """
    config, machine = load_robot(find("robots", name)), Machine(root)
    wrong = 0
    with interruptible():
        for part, trouble in checked(config, machine, consent=reset):
            wrong += trouble is not None
            click.echo(f"{'ok   ' if trouble is None else 'wrong'}  {part}" + (f": {trouble.what}" if trouble else ""))
            if trouble is not None and trouble.cure:
                click.echo(f"       try: {trouble.cure}")
    return FAILURE if wrong else SUCCESS


def checked(
    config: RobotConfig, machine: Machine, *, consent: bool = False, patience: float = PATIENCE
) -> Iterator[tuple[str, Trouble | None]]:
    """Yield each part that is plugged in somewhere, with what is wrong with it; None where it is as the file says."""
    yield f"{config.path}", None
    ports = {name: port for port in serial_ports(machine) for name in (port.path, *port.names)}
    for kind, section in config.sections.items():
        if isinstance(section.keys, Wired):
            port = ports.get(section.keys.port) or ports.get(machine.real(section.keys.port))
            title = f"{kind} at {section.keys.port}"
            yield title, _port(section, port, machine, consent=consent, patience=patience)
    if config.camera is not None and str(config.camera.source).isdecimal():
        path = f"/dev/video{config.camera.source}"
        found = next((camera for camera in cameras(machine) if camera.path == path), None)
        missing = Trouble("no camera is plugged in there", "mission camera list")
        yield f"camera at {path}", missing if found is None else found.trouble


def _port(
    section: Section, port: SerialPort | None, machine: Machine, *, consent: bool, patience: float
) -> Trouble | None:
    """Say what is wrong with the port of a part."""
    if port is None:
        return Trouble("nothing is plugged in there", "mission ports  (what is, and how to call it)")
    if port.shut is not None:
        return port.shut
    drivers = drivers_that_probe(Table().all())
    if not section.driver.probe:
        return None
    heard = look(port, drivers, SystemClock(), consent=consent, patience=patience, path=str(machine.at(port.path)))
    return _difference(section, heard)


def _difference(section: Section, heard: Heard) -> Trouble | None:
    """Say in what that which answered is not what the file says."""
    found = heard.found
    if found is None:
        return heard.trouble or heard.unasked
    if found.driver.name != section.driver.name:
        return Trouble(f"{found.title} answers there: {found.answer.about}", "mission ports --find  (which is which)")
    baud = found.answer.keys.get("baud", section.keys.baud)
    if baud != section.keys.baud:
        return Trouble(f"it answers at {baud} baud, the file says {section.keys.baud}", f"write baud: {baud}")
    if isinstance(section.keys, DynamixelKeys):
        there = {unit.id for unit in found.answer.units}
        asked = {name: joint.id for name, joint in section.keys.joints.items() if joint.id in IDS}
        lost = [f"{name} (ID {number})" for name, number in asked.items() if number not in there]
        if lost:
            return Trouble(f"no answer of {', '.join(lost)}", "mission servo scan --robot NAME  (all IDs and rates)")
    return heard.trouble
