"""``mission ros2 place``: the places of a robot's map, by name."""

from math import cos, degrees, isfinite, sin
from threading import Event
from typing import Any

import click

from config.editing import rewrite
from config.library import find
from config.places import NAME, PlaceKeys, written_places
from config.robot import RobotConfig
from config.units import in_dimension
from drivers.errors import NotConnected
from missions.cli.commands import LazyGroup, shared_option
from missions.cli.names import ROBOT
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot
from missions.library.folders import places_file, places_of

PATIENCE = 5.0
"""Seconds in which the robot says where it is."""

BODIES = ("base_link", "base_footprint")
"""What the robot itself is called among its frames."""

Frame = tuple[float, float, float]


@click.group("ros2 place", cls=LazyGroup, epilog="Example: mission ros2 place add kitchen --robot turtlebot4")
def place() -> None:
    """Name places of a robot's map, for `navigate`."""


def _robot(name: str) -> RobotConfig:
    return load_robot(find("robots", name))


ON = shared_option("--robot", type=ROBOT, default="turtlebot4", show_default=True, help="A name or a file.")


@place.command(epilog="Example: mission ros2 place add kitchen --at '1.2 m, 0.4 m, 90 deg'")
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


@place.command("list", epilog="Example: mission ros2 place list")
@ON
def list_places(robot: str) -> int:
    """List the places."""
    config = _robot(robot)
    places = places_of(config)
    click.echo(
        written_places(places).rstrip() if places else f"no places yet: mission ros2 place add NAME --robot {robot}"
    )
    return SUCCESS


@place.command(epilog="Example: mission ros2 place remove kitchen")
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
    from missions.plugins.ros2.command import looking  # noqa: PLC0415

    namespace = config.sections["ros2"].keys.namespace
    frames = Frames(namespace)

    def heard(kind: str, payload: bytes) -> None:
        try:
            told = types().decode(kind, payload)
        except Malformed as error:
            frames.wrong = str(error)
            return
        for each in told.transforms:
            frames.take(each.header.frame_id, each.child_frame_id, each.transform)

    with looking(robot, router, None) as node:
        for topic in ("/tf", f"{namespace}/tf", "/tf_static", f"{namespace}/tf_static"):
            node.subscribe(topic, [TF], heard)
        for _ in range(round(PATIENCE / 0.1)):
            if (found := frames.here()) is not None:
                return found
            Event().wait(0.1)  # of a command that only looks
    what = f"{config.name} does not say on /tf where it is: {frames.lacking} is missing"
    what += f"; malformed: {frames.wrong}" if frames.wrong else ""
    raise NotConnected(what, hint="give --at")


class Frames:
    """The frames of a robot by what /tf says of them; those of its ``namespace`` go without it."""

    def __init__(self, namespace: str) -> None:
        self._namespace = f"{namespace.strip('/')}/"
        self._above: dict[str, tuple[str, Frame]] = {}
        self.wrong = ""
        """The fault of the newest message that could not be used."""

    def take(self, frame: str, child: str, told: Any) -> None:
        """Take where ``child`` is in ``frame``, as a Transform; one that was never set is none."""
        from drivers.ros2.base import FAR, yaw  # noqa: PLC0415 - an extra

        above, below = (each.lstrip("/").removeprefix(self._namespace) for each in (frame, child))
        place = told.translation.x, told.translation.y
        try:
            if not all(abs(each) < FAR for each in place):
                raise ValueError(f"its place is {place[0]:g}, {place[1]:g}")
            self._above[below] = above, (*place, yaw(told.rotation))
        except ValueError as error:
            self.wrong = f"{below} in {above}: {error}"

    def here(self) -> Frame | None:
        """Return where the robot is on its map; None while no frames lead there."""
        return next((found for each in BODIES if (found := self._on_map(each)) is not None), None)

    @property
    def lacking(self) -> str:
        """Which frame does not lead to the map."""
        return "odom to base_link" if self._on_map("odom") is not None else "map to odom (is it localised?)"

    def _on_map(self, frame: str) -> Frame | None:
        place, known = (0.0, 0.0, 0.0), dict(self._above)
        while frame in known:
            frame, at = known.pop(frame)  # each once: they may go round
            place = placed(at, place)
        return place if frame == "map" else None


def placed(outer: Frame, inner: Frame) -> Frame:
    """Return where ``inner`` is, in what ``outer`` is in."""
    x, y, turn = outer
    return (
        x + inner[0] * cos(turn) - inner[1] * sin(turn),
        y + inner[0] * sin(turn) + inner[1] * cos(turn),
        turn + inner[2],
    )
