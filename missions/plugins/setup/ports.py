"""``mission ports``: what is plugged in, what answers there, and what is in the way."""

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from threading import Event

import click

from config.defaults import load_defaults
from config.faults import InvalidFileError
from config.library import MINE, UnknownNameError
from config.library import find as find_file
from config.robot import Section
from drivers.api.driver import Finding
from drivers.clock import SystemClock
from drivers.finding.asking import Heard, drivers_that_probe
from drivers.finding.machine import Machine
from drivers.finding.serial_ports import SerialPort, Trouble
from drivers.finding.survey import Desk, Plug, asker, survey
from missions.cli.keys import interruptible
from missions.cli.names import ROBOT
from missions.cli.root import FAILURE, SUCCESS
from missions.library.drivers import Table, load_robot
from missions.plugins.setup.checkup import check_part

LOOK_EVERY = 0.3
"""Seconds between two looks while somebody plugs."""

Pause = Callable[[], object]

root_option = click.option(
    "--root",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    default=Path("/"),
    metavar="DIR",
    help="The files of a recorded machine instead of this one's.",
)
"""Whose /sys, /proc and /dev are read."""


@click.command(epilog="Example: mission ports --find")
@click.option("--no-ask", is_flag=True, help="Say what is plugged in, and open no port.")
@click.option("--ask", "consented", multiple=True, metavar="PORT", help="Ask this port too, which else is left alone: "
              "an Arduino starts anew by it, and may move.")  # fmt: skip
@click.option("--find", is_flag=True, help="Find out which is which: unplug it, and plug it in again.")
@click.option("--watch", is_flag=True, help="Go on, and say what is plugged in and out, until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="As one line of JSON; with --watch a line at each change.")
@click.option("--robot", type=ROBOT, help="Whose router of ROS 2 is asked too; else this computer's own robot.")
@root_option
def command(
    no_ask: bool, consented: tuple[str, ...], find: bool, watch: bool, as_json: bool, robot: str | None, root: Path
) -> int:
    """Say what is plugged in: serial ports, cameras, sound, game pads; and which device answers on a port.

    Ports are asked politely: a Kobuki is only listened to, servos are pinged; nothing moves, nothing is written. A port
    that another program has open is left alone. Exit code 1 where something is in the way. For a robot of ROS 2 it is
    said whether its nodes speak by rmw_zenoh or by a bridge from DDS.
    """
    machine = Machine(root)
    ros2 = _section_of_ros2(robot, own=root == Path("/"))

    def pause() -> None:
        Event().wait(LOOK_EVERY)

    if find:
        return find_out(machine, pause)
    ask = None if no_ask else asker(machine, drivers_that_probe(Table().all()), SystemClock(), consented=consented)
    with interruptible():
        desk = survey(machine, ask)
        for consent in consented:
            if not any(consent in _names(plug.port) for plug in desk.plugs):
                raise click.UsageError(f"--ask {consent}: no such serial port; `mission ports --no-ask` lists them")
        nodes = [] if ros2 is None or no_ask else list(check_part(ros2, machine, SystemClock()))
        if as_json:
            click.echo(json.dumps(as_data(desk) | {"ros2": [asdict(each) for each in nodes]}))
        else:
            click.echo("\n".join([*lines(desk), *_lines_of_ros2(nodes)]))
        if watch:
            watch_desk(machine, desk, lambda: survey(machine, ask), pause, as_json=as_json)
    ailing = any(each.verdict == "wrong" for each in nodes)
    return FAILURE if ailing or any(in_the_way(desk)) else SUCCESS


def _section_of_ros2(robot: str | None, *, own: bool) -> Section | None:
    """Return the ros2 section of the robot that is named, else of this computer's ``own``; None where it has none.

    Raises InvalidFileError and UnknownNameError for one that is named.
    """
    if robot is not None:
        return load_robot(find_file("robots", robot)).sections.get("ros2")
    with suppress(InvalidFileError, UnknownNameError):
        if own and load_defaults().robot:
            return load_robot(find_file("robots", MINE)).sections.get("ros2")
    return None


def _lines_of_ros2(found: list[Finding]) -> Iterator[str]:
    """Yield how the nodes of a robot of ROS 2 speak, in words."""
    for each in found:
        yield f"ROS 2 {each.about}  {each.what}"
        if each.cure:
            yield f"  try: {each.cure}"


def lines(desk: Desk) -> Iterator[str]:
    """Yield what is plugged in, in words."""
    for plug in desk.plugs:
        yield from port_lines(plug)
    for usb, trouble in desk.lost:
        yield f"{usb.title}, {usb.ids}, in socket {usb.socket}"
        yield from _trouble(trouble)
    if not desk.plugs and not desk.lost:
        yield "no serial port: no adapter is plugged in, as far as this system tells"
        yield "  try: lsusb  (is it there at all?); another cable: some carry power alone"
    for camera in desk.cameras:
        sizes = " ".join(f"{width}x{height}" for width, height in camera.sizes)
        yield f"{camera.path}  camera: {camera.name}  {sizes}".rstrip()
        yield from _trouble(camera.trouble)
    for card in desk.sounds:
        what = " and ".join(["microphone"] * card.hears + ["loudspeaker"] * card.speaks) or "sound card"
        yield f"card {card.number}  {what}: {card.name}"
    for pad in desk.pads:
        yield f"{pad.path}  game pad: {pad.name}"
        yield from _trouble(pad.trouble)
    for what, there in (("camera", desk.cameras), ("sound card", desk.sounds), ("game pad", desk.pads)):
        if not there:
            yield f"no {what}"


def port_lines(plug: Plug) -> Iterator[str]:
    """Yield what is known of a serial port, in words."""
    port, heard = plug.port, plug.heard
    yield f"{port.path}  {port.title}"
    if port.call != port.path:
        yield f"  call it {port.call}"
    if heard is not None and heard.found is not None:
        yield f"  {heard.found.title}: {heard.found.answer.about}"
    for trouble in _told(plug):
        yield from _trouble(trouble)


def as_data(desk: Desk) -> dict[str, object]:
    """Return the same for programs."""
    return {
        "ports": [_port_data(plug) for plug in desk.plugs],
        "lost": [{**asdict(usb), **asdict(trouble)} for usb, trouble in desk.lost],
        "cameras": [asdict(camera) for camera in desk.cameras],
        "sound": [asdict(card) for card in desk.sounds],
        "pads": [asdict(pad) for pad in desk.pads],
    }


def find_out(machine: Machine, pause: Pause) -> int:
    """Say which device it is that somebody unplugs and plugs in again; ``pause`` waits a moment."""
    with interruptible():
        before = survey(machine)
        if not before.paths:
            click.echo("nothing is plugged in that could be unplugged", err=True)
            return FAILURE
        click.echo(f"{len(before.paths)} devices; now unplug the one that you look for", err=True)
        while not (gone := before.paths - (after := survey(machine)).paths):
            pause()
            before = after if after.paths > before.paths else before
        click.echo(f"it was {', '.join(sorted(gone))}; now plug it in again", err=True)
        while not (back := (again := survey(machine)).paths - after.paths):
            pause()
    for plug in again.plugs:
        if plug.port.path in back:
            click.echo("\n".join(port_lines(plug)))
            click.echo(f"in a robot file:  port: {plug.port.call}")
    for camera in again.cameras:
        if camera.path in back:
            click.echo(f"{camera.path}  camera: {camera.name}\nin a robot file:  source: {camera.path}")
    for pad in again.pads:
        if pad.path in back:
            click.echo(f"{pad.path}  game pad: {pad.name}")
    return SUCCESS


def watch_desk(machine: Machine, desk: Desk, look: Callable[[], Desk], pause: Pause, *, as_json: bool = False) -> None:
    """Say what comes and goes, until Ctrl-C; ``look`` is asked where something has, ``pause`` waits a moment."""
    try:
        while True:
            pause()
            if survey(machine).paths == desk.paths:
                continue
            before, desk = desk, look()
            if as_json:
                click.echo(json.dumps(as_data(desk)))
                continue
            for path in sorted(before.paths - desk.paths):
                click.echo(f"- {path}")
            for line in changed_lines(desk, desk.paths - before.paths):
                click.echo(f"+ {line}")
    except KeyboardInterrupt:
        return


def changed_lines(desk: Desk, paths: frozenset[str]) -> Iterator[str]:
    """Yield what is known of some devices of a desk."""
    for plug in desk.plugs:
        if plug.port.path in paths:
            yield from port_lines(plug)
    yield from (f"{path}  {name}" for path, name in desk.named if path in paths)


def _names(port: SerialPort) -> set[str]:
    return {port.path, port.call, *port.names}


def _told(plug: Plug) -> list[Trouble]:
    """Return what is wrong with a port, or why it was left alone."""
    heard = plug.heard or Heard()
    said = [trouble for trouble in (plug.port.shut or heard.unasked, heard.trouble) if trouble is not None]
    return [*said, *plug.port.troubles]


def in_the_way(desk: Desk) -> Iterator[Trouble]:
    """Yield all that is wrong; that a port was left alone is not."""
    for plug in desk.plugs:
        consent = None if plug.heard is None else plug.heard.unasked
        yield from (trouble for trouble in _told(plug) if trouble is not consent or trouble is plug.port.shut)
    yield from (trouble for _, trouble in desk.lost)
    others = [*(camera.trouble for camera in desk.cameras), *(pad.trouble for pad in desk.pads)]
    yield from (trouble for trouble in others if trouble is not None)


def _trouble(trouble: Trouble | None) -> Iterator[str]:
    if trouble is not None:
        yield f"  {trouble.what}"
        if trouble.cure:
            yield f"    try: {trouble.cure}"


def _port_data(plug: Plug) -> dict[str, object]:
    heard = plug.heard or Heard()
    found = heard.found
    told: dict[str, object] = (
        {}
        if found is None
        else {
            "driver": found.title,
            "about": found.answer.about,
            "keys": dict(found.answer.keys),
            "units": [asdict(unit) for unit in found.answer.units],
        }
    )
    return {**asdict(plug.port), "troubles": [asdict(each) for each in _told(plug)], "answers": told or None}
