"""``mission ros2``: list nodes and topics of ROS 2, print messages, and capture them for tests."""

import base64
import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import click

from config.file_io import save_file
from config.fleet import refusal_reason
from config.library import find_file
from drivers.clock import SystemClock
from drivers.errors import NotConnected
from missions.cli.commands import LazyGroup, shared_option
from missions.cli.names import ROBOT, WORLD
from missions.cli.numbers import QuantityInUnit, WholeNumber
from missions.cli.outputs import report_write_errors
from missions.cli.root import FAILURE, SUCCESS
from missions.library.drivers import load_robot

DISCOVERY_TIME = 1.0
"""Seconds to wait for other ROS 2 nodes to announce themselves."""


@click.group(
    "ros2",
    cls=LazyGroup,
    epilog="Example: mission ros2 topics --router tcp/192.168.1.20:7447",
)
def command() -> None:
    """Inspect the nodes and topics of ROS 2 over Zenoh, without ROS."""


def options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of robot, router and domain to a command."""
    for option in (
        shared_option("--domain", type=WholeNumber(0, 232), help="ROS domain ID; by default that of the robot file."),
        shared_option("--router", metavar="ADDRESS", help="Address of the Zenoh router, instead of the robot's."),
        shared_option("--robot", type=ROBOT, default="turtlebot4", show_default=True, help="Robot: a name or a file."),
    ):
        function = option(function)
    return function


@contextmanager
def open_node(robot: str, router: str | None, domain: int | None) -> Iterator[Any]:
    """Open a session, yield the node once others are discovered, and close it. Raises NotConnected."""
    from drivers.ros2.make import ros_domain  # noqa: PLC0415 - an extra
    from drivers.ros2.node import Ros2Node  # noqa: PLC0415
    from drivers.ros2.session import open_session, zenoh_access  # noqa: PLC0415

    config = load_robot(find_file("robots", robot))
    if "ros2" not in config.sections:
        raise click.UsageError(f"{config.name} has no ros2 section: mission ros2 topics --robot turtlebot4")
    keys = config.sections["ros2"].keys
    session = open_session("ros2", zenoh_access(keys, router or ""), timeout=2.0)
    try:
        node = Ros2Node(
            session, SystemClock(), domain=ros_domain(keys) if domain is None else domain, name="mission_ros2"
        )
        _wait(DISCOVERY_TIME)
        yield node
        node.close()
    finally:
        session.close()  # type: ignore[no-untyped-call]


def _print_line(text: str) -> None:
    """Print a line that may contain names from other programs.

    Line breaks in it are escaped here, other control characters by the console.
    """
    click.echo(text.replace("\r", "\\r").replace("\n", "\\n"))


def _wait(seconds: float) -> None:
    Event().wait(seconds)  # in a read-only command


@command.command(epilog="Example: mission ros2 topics --all")
@options
@click.option("--all", "every", is_flag=True, help="Include services and actions.")
def topics(robot: str, router: str | None, domain: int | None, every: bool) -> int:
    """List the topics.

    Prints their types, and the numbers of publishers and subscribers.
    """
    from drivers.ros2 import wire  # noqa: PLC0415 - an extra

    with open_node(robot, router, domain) as node:
        found: dict[tuple[str, str], list[str]] = {}
        for each in node.entities():
            if each.role != wire.NODE and (every or each.role in {wire.PUBLISHER, wire.SUBSCRIBER}):
                found.setdefault((each.name, each.kind), []).append(each.role)
        for (name, kind), roles in sorted(found.items()):
            words = {
                wire.PUBLISHER: "publishes",
                wire.SUBSCRIBER: "subscribes",
                wire.SERVER: "serves",
                wire.CLIENT: "calls",
            }
            told = ", ".join(f"{roles.count(role)} {words[role]}" for role in words if role in roles)
            _print_line(f"{name}  {kind}  ({told})")
        if not found:
            click.echo("no topics: is the domain right, and are nodes started with rmw_zenoh?", err=True)
    return SUCCESS if found else FAILURE


@command.command(epilog="Example: mission ros2 graph")
@options
def graph(robot: str, router: str | None, domain: int | None) -> int:
    """List the nodes with their topics, services and actions."""
    from drivers.ros2 import wire  # noqa: PLC0415 - an extra

    with open_node(robot, router, domain) as node:
        nodes: dict[tuple[str, str, str], list[Any]] = {}
        for each in node.entities():
            nodes.setdefault((each.namespace, each.node, each.zid), []).append(each)
        words = {
            wire.PUBLISHER: "publishes",
            wire.SUBSCRIBER: "subscribes",
            wire.SERVER: "serves",
            wire.CLIENT: "calls",
        }
        for (namespace, name, _), entities in sorted(nodes.items()):
            _print_line("/".join((namespace.rstrip("/"), name)))
            for each in sorted(entities, key=lambda it: (it.role, it.name)):
                if each.role != wire.NODE:
                    _print_line(f"  {words.get(each.role, each.role):10} {each.name}  {each.kind}")
    return SUCCESS if nodes else FAILURE


@command.command(epilog="Example: mission ros2 echo /odom --seconds 2")
@click.argument("topic")
@options
@click.option("--seconds", type=QuantityInUnit("s", 0.1), default=5.0, show_default=True, help="Duration.")
def echo(topic: str, robot: str, router: str | None, domain: int | None, seconds: float) -> int:
    """Print the messages of a topic, one line of JSON each."""
    from drivers.ros2.types import MalformedMessage, types  # noqa: PLC0415 - an extra

    heard: list[tuple[str, bytes]] = []
    with open_node(robot, router, domain) as node:
        name = topic if topic.startswith("/") else f"/{topic}"
        kinds = {each.kind for each in node.entities("MP", name)}
        known = {kind for kind in kinds if types().is_known(kind)}
        if not known:
            what = f"{name}: its type {', '.join(kinds)} is not known" if kinds else f"no publisher of {name}"
            raise NotConnected(what, hint="`mission ros2 topics` lists what is available")
        node.subscribe(name, known, lambda kind, payload: heard.append((kind, payload)))
        end, clock = seconds, SystemClock()
        while clock.now() < end:
            _wait(min(0.1, seconds))
            told, heard[:] = heard[:], []
            for kind, payload in told:
                try:
                    click.echo(json.dumps(types().to_plain(types().decode(kind, payload))))
                except MalformedMessage as error:
                    click.echo(f"{error}", err=True)
    return SUCCESS


@command.command(epilog="Example: mission ros2 capture robot.jsonl --seconds 10")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@options
@click.option("--seconds", type=QuantityInUnit("s", 0.1), default=5.0, show_default=True, help="Duration.")
def capture(file: Path, robot: str, router: str | None, domain: int | None, seconds: float) -> int:
    """Capture the messages of a ROS 2 robot to a file.

    Each line is a JSON object; pictures and session names are left out. Attach the file to an issue of MissionTree, and
    it becomes a test of your robot.
    """
    from drivers.ros2 import wire  # noqa: PLC0415 - an extra
    from drivers.ros2.types import types  # noqa: PLC0415

    lines: list[str] = []
    with open_node(robot, router, domain) as node:
        sessions: dict[str, str] = {}
        for each in node.entities():
            scrubbed = sessions.setdefault(each.zid, f"{len(sessions) + 1:032x}")
            lines.append(json.dumps({"token": replace(each, zid=scrubbed).token}))
        clock = SystemClock()

        def keep(name: str) -> Callable[[str, bytes], None]:
            def heard(kind: str, payload: bytes) -> None:
                data = base64.b64encode(payload).decode()
                lines.append(json.dumps({"t": round(clock.now(), 4), "topic": name, "type": kind, "payload": data}))

            return heard

        wanted = {(each.name, each.kind) for each in node.entities(wire.PUBLISHER) if types().is_known(each.kind)}
        for name, kind in wanted:
            if not kind.endswith(("Image", "CameraInfo")):
                node.subscribe(name, [kind], keep(name))
        _wait(seconds)
    with report_write_errors(file, "-o"):
        save_file(file, "\n".join(lines) + "\n")
    click.echo(f"{file}: {len(lines)} lines")
    return SUCCESS


@command.command(epilog="Example: mission ros2 serve --robot turtlebot4 --simulate wire")
@options
@click.option("--simulate", type=click.Choice(["fast", "wire"]), help="Run the missions on a simulated robot.")
@click.option("--world", type=WORLD, help="World of the simulated robot.")
def serve(robot: str, router: str | None, domain: int | None, simulate: str | None, world: str | None) -> int:
    """Serve the action /run_mission until Ctrl-C.

    ROS 2 nodes start missions by it.

    Its type is missiontree_msgs/action/RunMission; docs/ros2.md explains how to define it in ROS.
    """
    from missions.plugins.ros2.mission_server import MissionServer  # noqa: PLC0415

    _require_secure_router(robot, router)
    ending = Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: ending.set())
    with open_node(robot, router, domain) as node:
        server = MissionServer(node, run_arguments(robot, router, domain, simulate, world))
        click.echo("serves /run_mission")
        try:
            while not ending.wait(0.2):
                continue
        finally:
            server.close()
    return SUCCESS


def run_arguments(
    robot: str, router: str | None, domain: int | None, simulate: str | None, world: str | None
) -> list[str]:
    """Return the arguments with which the server starts `mission run` when a ROS 2 node requests a mission.

    They include ``--ros2``, so that the run is published on ROS 2, too.
    """
    chosen = [("--robot", robot), ("--simulate", simulate), ("--world", world), ("--ros2-router", router)]
    chosen.append(("--ros2-domain", None if domain is None else str(domain)))
    return [word for option, value in chosen if value is not None for word in (option, value)] + ["--ros2"]


def _require_secure_router(robot: str, router: str | None) -> None:
    """Raise click.UsageError if missions could be started over a network without authentication."""
    from drivers.ros2.session import zenoh_access  # noqa: PLC0415 - an extra

    config = load_robot(find_file("robots", robot))
    if "ros2" not in config.sections:
        return  # reported by the search for its nodes
    access = zenoh_access(config.sections["ros2"].keys, router or "")
    certified = bool(access.ca and ((access.certificate and access.private_key) or access.user))
    for endpoint in (*access.endpoints, *access.listen):
        if why := refusal_reason(endpoint, certified=certified):
            raise click.UsageError(
                f"{why}, and who reaches it could start missions\n  try: router: tls/HOST:PORT in the ros2 section, "
                "with `ca`, and `certificate` and `private_key`, or `user` and `password_file` (docs/ros2.md); "
                "or --router tcp/127.0.0.1:7447"
            )
