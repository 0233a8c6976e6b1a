"""``mission robot show``: parts of a robot, and their ports."""

from collections.abc import Iterator
from math import degrees

import click

from config.library import OWN_ROBOT
from config.robot import RobotConfig, Section
from drivers.api.sections import ArmKeys, AxisKeys, HeadKeys, SerialKeys
from drivers.api.sensor_sections import CameraKeys
from drivers.camera.source import display_name
from drivers.finding.machine import HostMachine
from missions.cli.names import ROBOT
from missions.cli.origin import robot_file
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot


@click.command(epilog="Example: mission robot show turtlebot2_arm")
@click.argument("name", required=False, default=OWN_ROBOT, type=ROBOT)
def show(name: str) -> int:
    """Show the parts of a robot; without NAME, of this computer's own. Opens no port."""
    config = load_robot(robot_file(name))
    click.echo("\n".join(robot_lines(config, HostMachine())))
    return SUCCESS


def robot_lines(config: RobotConfig, machine: HostMachine) -> Iterator[str]:
    """Yield the description of a robot as lines."""
    yield f"{config.name}  {config.path}"
    if config.summary:
        yield f"  {config.summary}"
    for kind, section in config.sections.items():
        yield f"{kind}: {section.driver.name}  {section.driver.about}"
        yield from (f"  {line}" for line in _part_lines(section, machine))


def _part_lines(section: Section, machine: HostMachine) -> Iterator[str]:
    keys = section.keys
    if isinstance(keys, SerialKeys):
        there = "" if machine.local_path(keys.port).exists() else " (not connected)"
        yield f"at {keys.port}{there}, {keys.baud} baud"
    if isinstance(keys, HeadKeys):
        yield from _axis_lines(keys)
    if isinstance(keys, ArmKeys):
        for name, limit in keys.limits.items():
            number = getattr(getattr(keys, "joints", {}).get(name), "id", None)
            of = "" if number is None else f" (ID {number})"
            yield f"{name}{of}: {degrees(limit.lower):.0f} to {degrees(limit.upper):.0f} deg"
    if isinstance(keys, CameraKeys):
        device = display_name(keys.source)
        there = "" if not device.startswith("/dev/") or machine.local_path(device).exists() else " (not connected)"
        yield f"at {device}{there}"


def _axis_lines(keys: HeadKeys) -> Iterator[str]:
    """Yield limits, servo and trim of each axis of a head."""
    for name in ("pan", "tilt"):
        axis = getattr(keys, name, None)
        if isinstance(axis, AxisKeys):
            servo = getattr(axis, "servo", None)
            by = f"servo {servo}" if servo is not None else f"joint {getattr(axis, 'joint', '')}"
            trim = f", trim {degrees(axis.trim):+g} deg" if axis.trim else ""
            yield f"{name} ({by}): {degrees(axis.lower):.0f} to {degrees(axis.upper):.0f} deg{trim}"
