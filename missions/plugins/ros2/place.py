"""``mission ros2 place``: named places on a robot's map."""

from math import cos, degrees, isfinite, sin
from threading import Event
from typing import Any

import click

from config.library import find_file
from config.places import PLACE_NAME, PlaceKeys, places_text
from config.robot import RobotConfig
from config.units import si_value
from config.yaml_edit import rewrite
from drivers.errors import NotConnected
from missions.cli.commands import LazyGroup, shared_option
from missions.cli.names import ROBOT
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot
from missions.library.folders import places_file, places_of

POSE_TIMEOUT = 5.0
"""Seconds to wait for the robot's pose."""

BODY_FRAMES = ("base_link", "base_footprint")
"""Names that robots usually give their own coordinate frame."""

FramePose = tuple[float, float, float]


@click.group("ros2 place", cls=LazyGroup, epilog="Example: mission ros2 place add kitchen --robot turtlebot4")
def place() -> None:
    """Name places on a robot's map, for `navigate`."""


def _load_robot(name: str) -> RobotConfig:
    return load_robot(find_file("robots", name))


robot_option = shared_option(
    "--robot", type=ROBOT, default="turtlebot4", show_default=True, help="Robot: a name or a file."
)


@place.command(epilog="Example: mission ros2 place add kitchen --at '1.2 m, 0.4 m, 90 deg'")
@click.argument("name")
@robot_option
@click.option("--router", metavar="ADDRESS", help="Address of the Zenoh router, instead of the robot's.")
@click.option("--at", metavar="'X, Y, HEADING'", help="Position, instead of the robot's current one.")
def add(name: str, robot: str, router: str | None, at: str | None) -> int:
    """Name the current position of the robot on its map (from /tf)."""
    config = _load_robot(robot)
    if "ros2" not in config.sections:
        raise click.UsageError(f"{config.name} has no ros2 section, and so no map: --robot turtlebot4")
    if not PLACE_NAME.fullmatch(name):
        raise click.UsageError(f"{name!a}: give letters, digits, '-', '_' and spaces between them, 40 at most")
    x, y, heading = _parse_pose(at) if at is not None else _current_pose(config, robot, router)
    if not all(map(isfinite, (x, y, heading))):
        raise click.UsageError(
            f"{name}: {x:g}, {y:g}, {heading:g} is not a finite position: give --at '1.2 m, 0.4 m, 90 deg'"
        )
    places = {**places_of(config), name: PlaceKeys(x=x, y=y, heading=heading)}
    _write(config, places)
    click.echo(f"{name}: {x:.2f} m, {y:.2f} m, {degrees(heading):.0f} deg  ({places_file(config)})")
    return SUCCESS


@place.command("list", epilog="Example: mission ros2 place list")
@robot_option
def list_places(robot: str) -> int:
    """List the named places on a robot's map."""
    config = _load_robot(robot)
    places = places_of(config)
    click.echo(
        places_text(places).rstrip() if places else f"no places yet: mission ros2 place add NAME --robot {robot}"
    )
    return SUCCESS


@place.command(epilog="Example: mission ros2 place remove kitchen")
@click.argument("name")
@robot_option
def remove(name: str, robot: str) -> int:
    """Remove a named place from a robot's map."""
    config = _load_robot(robot)
    places = dict(places_of(config))
    if name not in places:
        raise click.UsageError(f"unknown place '{name}': known are {', '.join(sorted(places)) or 'none'}")
    del places[name]
    _write(config, places)
    click.echo(f"{name}: removed  ({places_file(config)})")
    return SUCCESS


def _write(config: RobotConfig, places: Any) -> None:
    file = places_file(config)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    rewrite(file, places_text(places))


def _parse_pose(text: str) -> FramePose:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3:
        raise click.BadParameter(f"'{text}': give x, y and heading, such as '1.2 m, 0.4 m, 90 deg'")
    try:
        x, y = (si_value(part, "length") for part in parts[:2])
        return x, y, si_value(parts[2], "angle")
    except ValueError as error:
        raise click.BadParameter(f"'{text}': {error}") from error


def _current_pose(config: RobotConfig, robot: str, router: str | None) -> FramePose:
    """Return the pose of the robot on its map. Raises NotConnected."""
    from drivers.ros2.graph import TF  # noqa: PLC0415 - an extra
    from drivers.ros2.types import MalformedMessage, types  # noqa: PLC0415
    from missions.plugins.ros2.command import open_node  # noqa: PLC0415

    namespace = config.sections["ros2"].keys.namespace
    frames = FrameTree(namespace)

    def heard(kind: str, payload: bytes) -> None:
        try:
            told = types().decode(kind, payload)
        except MalformedMessage as error:
            frames.fault = str(error)
            return
        for each in told.transforms:
            frames.add_transform(each.header.frame_id, each.child_frame_id, each.transform)

    with open_node(robot, router, None) as node:
        for topic in ("/tf", f"{namespace}/tf", "/tf_static", f"{namespace}/tf_static"):
            node.subscribe(topic, [TF], heard)
        for _ in range(round(POSE_TIMEOUT / 0.1)):
            if (found := frames.body_pose()) is not None:
                return found
            Event().wait(0.1)  # a read-only command
    what = f"{config.name} has no pose on /tf: {frames.missing_frame} is missing"
    what += f"; malformed: {frames.fault}" if frames.fault else ""
    raise NotConnected(what, hint="give --at")


class FrameTree:
    """Coordinate frames of a robot, received on the topic /tf; the prefix ``namespace`` of their names is removed."""

    def __init__(self, namespace: str) -> None:
        self._namespace = f"{namespace.strip('/')}/"
        self._above: dict[str, tuple[str, FramePose]] = {}
        self.fault = ""
        """Error in the newest transform that could not be used; empty without one."""

    def add_transform(self, frame: str, child: str, told: Any) -> None:
        """Store the pose of the frame ``child`` in ``frame``, from the ROS message ``told`` of type Transform.

        An implausible position or rotation, as in a message that was never set, is not stored but described in
        ``fault``.
        """
        from drivers.ros2.base import MAX_PLAUSIBLE_VALUE, yaw  # noqa: PLC0415 - an extra

        above, below = (each.lstrip("/").removeprefix(self._namespace) for each in (frame, child))
        place = told.translation.x, told.translation.y
        try:
            if not all(abs(each) < MAX_PLAUSIBLE_VALUE for each in place):
                raise ValueError(f"its place is {place[0]:g}, {place[1]:g}")
            self._above[below] = above, (*place, yaw(told.rotation))
        except ValueError as error:
            self.fault = f"{below} in {above}: {error}"

    def body_pose(self) -> FramePose | None:
        """Return the pose of the robot on its map; None if the known frames do not connect the two."""
        return next((found for each in BODY_FRAMES if (found := self._pose_on_map(each)) is not None), None)

    @property
    def missing_frame(self) -> str:
        """Description of the missing transform between map and robot, for an error message."""
        return "odom to base_link" if self._pose_on_map("odom") is not None else "map to odom (is it localised?)"

    def _pose_on_map(self, frame: str) -> FramePose | None:
        place, known = (0.0, 0.0, 0.0), dict(self._above)
        while frame in known:
            frame, at = known.pop(frame)  # each frame once: they may form a loop
            place = compose(at, place)
        return place if frame == "map" else None


def compose(outer: FramePose, inner: FramePose) -> FramePose:
    """Return the pose ``inner`` of the frame ``outer``, in the parent of ``outer``."""
    x, y, turn = outer
    return (
        x + inner[0] * cos(turn) - inner[1] * sin(turn),
        y + inner[0] * sin(turn) + inner[1] * cos(turn),
        turn + inner[2],
    )
