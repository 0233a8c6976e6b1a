"""``mission ports``: connected devices, and the replies on serial ports."""

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from threading import Event

import click

from config.defaults import load_defaults
from config.diagnostics import InvalidFileError
from config.library import OWN_ROBOT, UnknownNameError, find_file
from config.robot import Section
from drivers.api.driver import Finding
from drivers.clock import SystemClock
from drivers.finding.hardware_scan import HardwareScan, ScannedPort, make_prober, scan_hardware
from drivers.finding.machine import HostMachine
from drivers.finding.port_probe import PortScan, probing_drivers
from drivers.finding.serial_ports import DeviceProblem, SerialPortInfo
from missions.cli.keys import interruptible
from missions.cli.names import ROBOT
from missions.cli.root import FAILURE, SUCCESS
from missions.library.drivers import DriverTable, load_robot
from missions.plugins.setup.checkup import check_part

POLL_INTERVAL = 0.3
"""Seconds between two scans while the user plugs and unplugs devices."""

Pause = Callable[[], object]

root_option = click.option(
    "--root",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    default=Path("/"),
    metavar="DIR",
    help="Folder with a copy of another computer's /dev, /proc and /sys to examine.",
)
"""Decorator that adds ``--root`` to a command: the folder that contains the /sys, /proc and /dev to examine."""


@click.command(epilog="Example: mission ports --find")
@click.option("--no-ask", is_flag=True, help="List devices without opening a port.")
@click.option("--ask", "consented", multiple=True, metavar="PORT",
              help="Also probe this port, which is otherwise skipped: "
              "that resets an Arduino, and it may move.")  # fmt: skip
@click.option("--find", is_flag=True, help="Identify a device: unplug it, and plug it in again.")
@click.option("--watch", is_flag=True, help="Print devices as they come and go, until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="Print one line of JSON; with --watch, one at each change.")
@click.option("--robot", type=ROBOT, help="Robot whose ROS 2 router is checked too; by default this computer's own.")
@root_option
def command(
    no_ask: bool, consented: tuple[str, ...], find: bool, watch: bool, as_json: bool, robot: str | None, root: Path
) -> int:
    """List serial ports, cameras, sound devices and game pads, and identify the device on each port.

    Probing is safe: a Kobuki is only listened to, servos are pinged; nothing moves, and nothing is written. A port that
    another program has open is skipped. For a robot of ROS 2 you see whether its nodes use rmw_zenoh or a DDS bridge.
    Exit code 1: a problem with a port or device was found.
    """
    machine = HostMachine(root)
    ros2 = _find_ros2_section(robot, own=root == Path("/"))

    def pause() -> None:
        Event().wait(POLL_INTERVAL)

    if find:
        return identify_device(machine, pause)
    ask = (
        None
        if no_ask
        else make_prober(
            machine, probing_drivers(DriverTable().iter_drivers()), SystemClock(), consented_ports=consented
        )
    )
    with interruptible():
        desk = scan_hardware(machine, ask)
        for consent in consented:
            if not any(consent in _names(plug.port) for plug in desk.ports):
                raise click.UsageError(f"--ask {consent}: no such serial port; `mission ports --no-ask` lists them")
        nodes = [] if ros2 is None or no_ask else list(check_part(ros2, machine, SystemClock()))
        if as_json:
            click.echo(json.dumps(as_data(desk) | {"ros2": [asdict(each) for each in nodes]}))
        else:
            click.echo("\n".join([*scan_lines(desk), *_ros2_lines(nodes)]))
        if watch:
            watch_devices(machine, desk, lambda: scan_hardware(machine, ask), pause, as_json=as_json)
    ailing = any(each.verdict == "wrong" for each in nodes)
    return FAILURE if ailing or any(find_problems(desk)) else SUCCESS


def _find_ros2_section(robot: str | None, *, own: bool) -> Section | None:
    """Return the section ros2 of the named robot's file; None without one.

    If no robot is named and ``own`` is True, this computer's own robot is used. Raises InvalidFileError and
    UnknownNameError for a named robot.
    """
    if robot is not None:
        return load_robot(find_file("robots", robot)).sections.get("ros2")
    with suppress(InvalidFileError, UnknownNameError):
        if own and load_defaults().robot:
            return load_robot(find_file("robots", OWN_ROBOT)).sections.get("ros2")
    return None


def _ros2_lines(found: list[Finding]) -> Iterator[str]:
    """Yield the findings on ROS 2 nodes as lines."""
    for each in found:
        yield f"ROS 2 {each.about}  {each.message}"
        if each.fix:
            yield f"  try: {each.fix}"


def scan_lines(scan: HardwareScan) -> Iterator[str]:
    """Yield the connected devices as lines for the terminal."""
    for plug in scan.ports:
        yield from port_lines(plug)
    for usb, trouble in scan.portless_adapters:
        yield f"{usb.title}, {usb.ids}, in socket {usb.socket}"
        yield from _problem_lines(trouble)
    if not scan.ports and not scan.portless_adapters:
        yield "no serial port: no adapter found"
        yield "  try: lsusb  (is it listed?); another cable: some carry only power"
    for camera in scan.cameras:
        sizes = " ".join(f"{width}x{height}" for width, height in camera.sizes)
        yield f"{camera.path}  camera: {camera.name}  {sizes}".rstrip()
        yield from _problem_lines(camera.trouble)
    for card in scan.sound_cards:
        what = " and ".join(["microphone"] * card.hears + ["loudspeaker"] * card.speaks) or "sound card"
        yield f"card {card.number}  {what}: {card.name}"
    for pad in scan.game_pads:
        yield f"{pad.path}  game pad: {pad.name}"
        yield from _problem_lines(pad.trouble)
    for what, there in (("camera", scan.cameras), ("sound card", scan.sound_cards), ("game pad", scan.game_pads)):
        if not there:
            yield f"no {what}"


def port_lines(plug: ScannedPort) -> Iterator[str]:
    """Yield lines for the terminal about a serial port: its names, adapter, and the device that replied."""
    port, heard = plug.port, plug.scan
    yield f"{port.path}  {port.title}"
    if port.call != port.path:
        yield f"  call it {port.call}"
    if heard is not None and heard.device is not None:
        yield f"  {heard.device.title}: {heard.device.result.about}"
    for trouble in _port_problems(plug):
        yield from _problem_lines(trouble)


def as_data(scan: HardwareScan) -> dict[str, object]:
    """Return the connected devices as JSON data, by kind.

    Under ``lost`` are USB adapters for which the computer has no serial port.
    """
    return {
        "ports": [_port_data(plug) for plug in scan.ports],
        "lost": [{**asdict(usb), **asdict(trouble)} for usb, trouble in scan.portless_adapters],
        "cameras": [asdict(camera) for camera in scan.cameras],
        "sound": [asdict(card) for card in scan.sound_cards],
        "pads": [asdict(pad) for pad in scan.game_pads],
    }


def identify_device(machine: HostMachine, pause: Pause) -> int:
    """Print the device that the user unplugs and plugs in again; ``pause`` waits between two scans."""
    with interruptible():
        before = scan_hardware(machine)
        if not before.paths:
            click.echo("no device is plugged in, so none can be unplugged", err=True)
            click.echo("  try: plug it in, then: mission ports", err=True)
            return FAILURE
        click.echo(f"{len(before.paths)} devices; now unplug the one that you want to identify", err=True)
        while not (gone := before.paths - (after := scan_hardware(machine)).paths):
            pause()
            before = after if after.paths > before.paths else before
        click.echo(f"it was {', '.join(sorted(gone))}; now plug it in again", err=True)
        while not (back := (again := scan_hardware(machine)).paths - after.paths):
            pause()
    for plug in again.ports:
        if plug.port.path in back:
            click.echo("\n".join(port_lines(plug)))
            click.echo(f"in a robot file:  port: {plug.port.call}")
    for camera in again.cameras:
        if camera.path in back:
            click.echo(f"{camera.path}  camera: {camera.name}\nin a robot file:  source: {camera.path}")
    for pad in again.game_pads:
        if pad.path in back:
            click.echo(f"{pad.path}  game pad: {pad.name}")
    return SUCCESS


def watch_devices(
    machine: HostMachine, scan: HardwareScan, rescan: Callable[[], HardwareScan], pause: Pause, *, as_json: bool = False
) -> None:
    """Print connected and disconnected devices until Ctrl-C; ``rescan`` scans again, ``pause`` waits between checks."""
    try:
        while True:
            pause()
            if scan_hardware(machine).paths == scan.paths:
                continue
            before, scan = scan, rescan()
            if as_json:
                click.echo(json.dumps(as_data(scan)))
                continue
            for path in sorted(before.paths - scan.paths):
                click.echo(f"- {path}")
            for line in device_lines(scan, scan.paths - before.paths):
                click.echo(f"+ {line}")
    except KeyboardInterrupt:
        return


def device_lines(scan: HardwareScan, paths: frozenset[str]) -> Iterator[str]:
    """Yield lines for the terminal about the devices at ``paths``."""
    for plug in scan.ports:
        if plug.port.path in paths:
            yield from port_lines(plug)
    yield from (f"{path}  {name}" for path, name in scan.device_names if path in paths)


def _names(port: SerialPortInfo) -> set[str]:
    return {port.path, port.call, *port.names}


def _port_problems(plug: ScannedPort) -> list[DeviceProblem]:
    """Return the problems of a serial port, and the reason if it was not probed."""
    heard = plug.scan or PortScan()
    said = [trouble for trouble in (plug.port.shut or heard.skip_reason, heard.trouble) if trouble is not None]
    return [*said, *plug.port.troubles]


def find_problems(scan: HardwareScan) -> Iterator[DeviceProblem]:
    """Yield all problems of connected devices.

    A port that was not probed because the user did not agree is not a problem.
    """
    for plug in scan.ports:
        consent = None if plug.scan is None else plug.scan.skip_reason
        yield from (trouble for trouble in _port_problems(plug) if trouble is not consent or trouble is plug.port.shut)
    yield from (trouble for _, trouble in scan.portless_adapters)
    others = [*(camera.trouble for camera in scan.cameras), *(pad.trouble for pad in scan.game_pads)]
    yield from (trouble for trouble in others if trouble is not None)


def _problem_lines(problem: DeviceProblem | None) -> Iterator[str]:
    if problem is not None:
        yield f"  {problem.message}"
        if problem.fix:
            yield f"    try: {problem.fix}"


def _port_data(plug: ScannedPort) -> dict[str, object]:
    heard = plug.scan or PortScan()
    found = heard.device
    answers: dict[str, object] = (
        {}
        if found is None
        else {
            "driver": found.title,
            "about": found.result.about,
            "keys": dict(found.result.keys),
            "units": [asdict(unit) for unit in found.result.units],
        }
    )
    return {
        **asdict(plug.port),
        "troubles": [asdict(each) for each in _port_problems(plug)],
        "answers": answers or None,
    }
