"""``mission robot show``: what a robot is made of, where it is plugged in, and whether that is there."""

from collections.abc import Iterator
from math import degrees

import click

from config.library import MINE
from config.robot import RobotConfig, Section
from drivers.api.sections import ArmKeys, AxisKeys, HeadKeys, Wired
from drivers.api.senses import CameraKeys
from drivers.camera.source import shown
from drivers.finding.machine import Machine
from missions.cli.names import ROBOT
from missions.cli.origin import robot_file
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot


@click.command(epilog="Example: mission robot show turtlebot2_arm")
@click.argument("name", required=False, default=MINE, type=ROBOT)
def show(name: str) -> int:
    """Show what a robot is made of; without NAME, this computer's own. No port is opened."""
    config = load_robot(robot_file(name))
    click.echo("\n".join(lines(config, Machine())))
    return SUCCESS


def lines(config: RobotConfig, machine: Machine) -> Iterator[str]:
    """Yield a robot in words."""
    yield f"{config.name}  {config.path}"
    if config.summary:
        yield f"  {config.summary}"
    for kind, section in config.sections.items():
        yield f"{kind}: {section.driver.name}  {section.driver.about}"
        yield from (f"  {line}" for line in _part(section, machine))


def _part(section: Section, machine: Machine) -> Iterator[str]:
    keys = section.keys
    if isinstance(keys, Wired):
        there = "" if machine.at(keys.port).exists() else ", where nothing is plugged in"
        yield f"at {keys.port}{there}, {keys.baud} baud"
    if isinstance(keys, HeadKeys):
        yield from _axes(keys)
    if isinstance(keys, ArmKeys):
        for name, limit in keys.limits.items():
            number = getattr(getattr(keys, "joints", {}).get(name), "id", None)
            of = "" if number is None else f" (ID {number})"
            yield f"{name}{of}: {degrees(limit.lower):.0f} to {degrees(limit.upper):.0f} deg"
    if isinstance(keys, CameraKeys):
        device = shown(keys.source)
        there = (
            "" if not device.startswith("/dev/") or machine.at(device).exists() else ", where no camera is plugged in"
        )
        yield f"at {device}{there}"


def _axes(keys: HeadKeys) -> Iterator[str]:
    """Yield how far each axis of a head turns, by which servo or joint, and how it is trimmed."""
    for name in ("pan", "tilt"):
        axis = getattr(keys, name, None)
        if isinstance(axis, AxisKeys):
            servo = getattr(axis, "servo", None)
            by = f"servo {servo}" if servo is not None else f"joint {getattr(axis, 'joint', '')}"
            trim = f", trim {degrees(axis.trim):+g} deg" if axis.trim else ""
            yield f"{name} ({by}): {degrees(axis.lower):.0f} to {degrees(axis.upper):.0f} deg{trim}"
