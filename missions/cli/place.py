"""``mission place``: the places of a robot's map, by name."""

from math import atan2, cos, degrees, isfinite, sin
from threading import Event
from typing import Any

import click

from config.editing import rewrite
from config.library import find
from config.places import NAME, PlaceKeys, written_places
from config.robot import RobotConfig
from config.units import in_dimension
from drivers.errors import NotConnected
from missions.cli.names import ROBOT
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot
from missions.library.places import places_file, places_of

PATIENCE = 5.0
"""Seconds in which the robot says where it is."""

BODIES = ("base_link", "base_footprint")
"""What the robot itself is called among its frames."""

Frame = tuple[float, float, float]


@click.group(epilog="Example: mission place add kitchen --robot turtlebot4")
def command() -> None:
    """Name places of a robot's map, for `navigate`."""


def _robot(name: str) -> RobotConfig:
    return load_robot(find("robots", name))


ON = click.option("--robot", type=ROBOT, default="turtlebot4", show_default=True, help="A name or a file.")


@command.command(epilog="Example: mission place add kitchen --at '1.2 m, 0.4 m, 90 deg'")
@click.argument("name")
@ON
@click.option("--router", metavar="ADDRESS", help="Where the router is, instead of the robot's.")
@click.option("--at", metavar="'X, Y, HEADING'", help="There, instead of where the robot stands now.")
def add(name: str, robot: str, router: str | None, at: str | None) -> int:
    """Name the place where the robot stands now, by what it says of its map (/tf)."""
    config = _robot(robot)
    if "ros2" not in config.sections:
        raise click.UsageError(f"{config.name} is no robot of ROS 2, and knows no map: --robot turtlebot4")
    if not NAME.fullmatch(name):
        raise click.UsageError(f"{name!a}: give letters, digits, '-', '_' and spaces between them, 40 at most")
    x, y, heading = _typed(at) if at is not None else _here(config, robot, router)
    if not all(map(isfinite, (x, y, heading))):
        raise click.UsageError(f"{name}: {x:g}, {y:g}, {heading:g} is nowhere: give --at '1.2 m, 0.4 m, 90 deg'")
    places = {**places_of(config), name: PlaceKeys(x=x, y=y, heading=heading)}
    _write(config, places)
    click.echo(f"{name}: {x:.2f} m, {y:.2f} m, {degrees(heading):.0f} deg  ({places_file(config)})")
    return SUCCESS


@command.command("list", epilog="Example: mission place list")
@ON
def list_places(robot: str) -> int:
    """List the places."""
    config = _robot(robot)
    places = places_of(config)
    click.echo(written_places(places).rstrip() if places else f"no places yet: mission place add NAME --robot {robot}")
    return SUCCESS


@command.command(epilog="Example: mission place remove kitchen")
@click.argument("name")
@ON
def remove(name: str, robot: str) -> int:
    """Forget a place."""
    config = _robot(robot)
    places = dict(places_of(config))
    if name not in places:
        raise click.UsageError(f"there is no place '{name}': there are {', '.join(sorted(places)) or 'none'}")
    del places[name]
    _write(config, places)
    click.echo(f"{name}: forgotten  ({places_file(config)})")
    return SUCCESS


def _write(config: RobotConfig, places: Any) -> None:
    file = places_file(config)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    rewrite(file, written_places(places))


def _typed(text: str) -> Frame:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3:
        raise click.BadParameter(f"'{text}': give x, y and heading, such as '1.2 m, 0.4 m, 90 deg'")
    try:
        x, y = (in_dimension(part, "length") for part in parts[:2])
        return x, y, in_dimension(parts[2], "angle")
    except ValueError as error:
        raise click.BadParameter(f"'{text}': {error}") from error


def _here(config: RobotConfig, robot: str, router: str | None) -> Frame:
    """Return where the robot stands on its map. Raises NotConnected."""
    from drivers.ros2.graph import TF  # noqa: PLC0415 - an extra
    from drivers.ros2.types import Malformed, types  # noqa: PLC0415
    from missions.cli.ros2 import looking  # noqa: PLC0415

    frames: dict[tuple[str, str], Frame] = {}

    def heard(kind: str, payload: bytes) -> None:
        try:
            told = types().decode(kind, payload)
        except Malformed:
            return
        for each in told.transforms:
            at, turned = each.transform.translation, each.transform.rotation
            pair = each.header.frame_id.lstrip("/"), each.child_frame_id.lstrip("/")
            frames[pair] = at.x, at.y, 2 * atan2(turned.z, turned.w)

    with looking(robot, router, None) as node:
        for topic in ("/tf", f"{config.sections['ros2'].keys.namespace}/tf"):
            node.subscribe(topic, [TF], heard, lambda: None)
        for _ in range(round(PATIENCE / 0.1)):
            on_map = frames.get(("map", "odom"))
            body = next((frames["odom", each] for each in BODIES if ("odom", each) in frames), None)
            if on_map is not None and body is not None:
                return placed(on_map, body)
            Event().wait(0.1)  # of a command that only looks
    lacking = "map to odom (is it localised?)" if ("map", "odom") not in frames else "odom to base_link"
    raise NotConnected(f"{config.name} does not say on /tf where it is: {lacking} is missing", hint="give --at")


def placed(outer: Frame, inner: Frame) -> Frame:
    """Return where ``inner`` is, in what ``outer`` is in."""
    x, y, turn = outer
    return (
        x + inner[0] * cos(turn) - inner[1] * sin(turn),
        y + inner[0] * sin(turn) + inner[1] * cos(turn),
        turn + inner[2],
    )
