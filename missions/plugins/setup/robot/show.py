"""``mission robot show``: parts of a robot, and their ports."""

from collections.abc import Iterator, Mapping
from math import degrees

import click

from config.library import OWN_ROBOT
from config.robot import RobotConfig, Section
from drivers.api.joints import JointLimits
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
    """Yield the description of a robot as lines for the terminal: its parts, drivers and ports."""
    yield f"{config.name}  {config.path}"
    if config.summary:
        yield f"  {config.summary}"
    for kind, section in config.sections.items():
        yield f"{kind}: {section.driver.name}  {section.driver.about}"
        yield from (f"  {line}" for line in _part_lines(config, section, machine))


def _part_lines(config: RobotConfig, section: Section, machine: HostMachine) -> Iterator[str]:
    keys = section.keys
    if isinstance(keys, SerialKeys):
        there = "" if machine.local_path(keys.port).exists() else " (not connected)"
        yield f"at {keys.port}{there}, {keys.baud} baud"
    if isinstance(keys, HeadKeys):
        arm = config.sections.get("arm")
        yield from _axis_lines(keys, arm.keys.limits if arm is not None and isinstance(arm.keys, ArmKeys) else {})
    if isinstance(keys, ArmKeys):
        turned = _head_joints(config) if section is config.sections.get("arm") else {}
        for name, limit in keys.limits.items():
            number = getattr(getattr(keys, "joints", {}).get(name), "id", None)
            of = "" if number is None else f" (ID {number})"
            span = f"{degrees(limit.lower):.0f} to {degrees(limit.upper):.0f} deg"
            yield f"{name}{of}: {turned.get(name, span)}"
    if isinstance(keys, CameraKeys):
        device = display_name(keys.source)
        there = "" if not device.startswith("/dev/") or machine.local_path(device).exists() else " (not connected)"
        yield f"at {device}{there}"


def _head_joints(config: RobotConfig) -> dict[str, str]:
    """Return, for each joint of the arm that turns a head, a text such as "pan of the head"."""
    found = {}
    for part, section in config.sections.items():
        if isinstance(section.keys, HeadKeys) and "arm" in section.driver.needs:
            for name in ("pan", "tilt"):
                joint = getattr(getattr(section.keys, name, None), "joint", "")
                found[joint] = f"{name} of the {part}"
    return found


def _axis_lines(keys: HeadKeys, joints: Mapping[str, JointLimits]) -> Iterator[str]:
    """Yield the range, servo and trim of each axis of a head; ``joints`` are the limits of the arm's joints."""
    for name in ("pan", "tilt"):
        axis = getattr(keys, name, None)
        if isinstance(axis, AxisKeys):
            servo, joint = getattr(axis, "servo", None), getattr(axis, "joint", "")
            by = f"servo {servo}" if servo is not None else f"joint {joint}"
            lower, upper = axis.lower, axis.upper
            if servo is None and joint in joints:
                lower = max(lower, joints[joint].lower - axis.trim)
                upper = min(upper, joints[joint].upper - axis.trim)
            trim = f", trim {degrees(axis.trim):+g} deg" if axis.trim else ""
            yield f"{name} ({by}): {degrees(lower):.0f} to {degrees(upper):.0f} deg{trim}"
