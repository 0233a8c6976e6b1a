"""``mission servo scan``: find the servos on a bus, and show their states."""

import json
import re
from collections.abc import Collection, Mapping, Sequence
from math import degrees
from typing import get_args

import click

from drivers.servos.bus_scan import ScannedServo, scan_bus
from drivers.servos.joint import Joint
from drivers.servos.units import Framing, Protocol, protocol_label
from missions.cli.commands import SharingCommand
from missions.cli.root import FAILURE, SUCCESS
from missions.plugins.setup.servo.connections import open_bus
from missions.plugins.setup.servo.target import ServoTarget, target_options

VIRTUAL_REPLY_TIMEOUT = 0.015
"""Maximum seconds that a virtual servo may take to reply; short, since a scan tries many unused IDs."""

BAUD_RATES = (
    *(1_000_000, 57_600, 115_200, 500_000, 2_000_000, 200_000, 250_000, 400_000, 9600, 19_200, 3_000_000, 4_000_000),
    *(128_000, 76_800, 38_400),  # Feetech only
)
"""Baud rates of servos, most common first."""

FACTORY_BAUD_RATES = BAUD_RATES[:2]
"""Baud rates of new servos: models AX and STS have the first one, all others the second."""

HEADINGS = ("id", "protocol", "baud", "model", "firmware", "position", "volts", "degC", "joint", "errors")

ROW_FORMAT = "{:>3}  {:>8}  {:>8}  {:<12} {:>8}  {:>10}  {:>6}  {:>4}  {:<14} {}"
"""Format of a row of the servo table, which is printed as soon as the servo has replied."""


def _parse_ids(ctx: click.Context, option: click.Parameter, value: str) -> list[int]:
    """Parse IDs such as "1-20,30"."""
    found: dict[int, None] = {}
    for part in value.split(","):
        ends = re.fullmatch(r"\s*([0-9]{1,3})\s*(?:-\s*([0-9]{1,3})\s*)?", part)
        if ends is None or int(ends[2] or ends[1]) > 253:
            raise click.BadParameter(
                f"'{part}' is not an ID or range of IDs within 0-253: 1-20,30", ctx=ctx, param=option
            )
        found |= dict.fromkeys(range(int(ends[1]), int(ends[2] or ends[1]) + 1))
    return list(found)


@click.command(cls=SharingCommand, epilog="Example: mission servo scan --ids 1-10 --port /dev/ttyUSB0")
@target_options
@click.option(
    "--ids", default="0-252", show_default=True, callback=_parse_ids, metavar="1-20,30", help="IDs to search."
)
@click.option(
    "--protocol", type=click.Choice(["1", "2", "STS"], case_sensitive=False), help="Search only this protocol."
)
@click.option("--all-bauds", is_flag=True, help="Try all common baud rates; slow.")
@click.option("--framing", type=click.Choice(get_args(Framing)), help="Packet code: ours, or the vendor's.")
@click.option("--json", "as_json", is_flag=True, help="Print a line of JSON for each servo; angles in radians.")
def scan(
    target: ServoTarget, ids: list[int], protocol: str | None, all_bauds: bool, framing: Framing | None, as_json: bool
) -> int:
    """Find all servos on a bus, and compare them with the robot file. Only reads.

    Without --baud it tries the file's rate, and the factory rates. Exit code 1: no servo is found, or one of the file
    is missing.
    """
    known: tuple[Protocol, ...] = (1, "STS", 2)
    protocols = [each for each in known if protocol in (None, str(each))]
    with open_bus(target, reply_timeout=VIRTUAL_REPLY_TIMEOUT, framing=framing) as bench:
        bus, joints = bench.bus, bench.joints
        wanted, names = bus.baud, {joint.spec.id: joint.name for joint in joints.values()}
        bauds = _rates_to_try(wanted, fixed=target.is_virtual or target.baud is not None, all_bauds=all_bauds)
        if not as_json:
            click.echo(ROW_FORMAT.format(*HEADINGS).rstrip())
        found = []
        for servo in scan_bus(bus, bauds, protocols, ids):
            found.append(servo)
            click.echo(_servo_json(servo) if as_json else _servo_row(servo, names))
    if not found:
        click.echo(_no_reply_text(bus.port, bauds), err=True)
        return FAILURE
    troubles = find_differences(found, joints, wanted, searched_ids=ids)
    for servo in found:
        if servo.answers_ping_only:
            baud = "" if servo.baud == wanted else f" --baud {servo.baud}"
            fix = f"mission servo set {servo.address.id} status_return_level 2{target.options}{baud}"
            troubles.append(f"servo {servo.address.id} replies to a ping, but not to a read\n  try: {fix}")
    for trouble in troubles:
        click.echo(trouble, err=True)
    return FAILURE if troubles else SUCCESS


def _rates_to_try(first: int, *, fixed: bool, all_bauds: bool) -> list[int]:
    """Return the baud rates to try in a scan, each once, beginning with ``first``.

    With ``fixed``, the factory rates are left out; with ``all_bauds``, all known rates are added.
    """
    return list(dict.fromkeys((first, *(() if fixed else FACTORY_BAUD_RATES), *(BAUD_RATES if all_bauds else ()))))


def _servo_row(servo: ScannedServo, names: Mapping[int, str]) -> str:
    """Return the table row of a servo that has replied; ``names`` are the joint names by servo ID."""
    return ROW_FORMAT.format(
        servo.address.id,
        protocol_label(servo.address.protocol),
        servo.baud,
        _model_text(servo),
        _firmware_text(servo),
        "-" if servo.position is None else f"{degrees(servo.position):+.1f} deg",
        "-" if servo.voltage is None else f"{servo.voltage:.1f}",
        "-" if servo.temperature is None else f"{servo.temperature:.0f}",
        names.get(servo.address.id, "-"),
        ", ".join(_servo_problems(servo)) or "none",
    ).rstrip()


def _model_text(servo: ScannedServo) -> str:
    """Return the model name of a servo, or its model number."""
    if servo.model is not None:
        return servo.model.name
    return "?" if servo.number is None else f"number {servo.number}"


def _firmware_text(servo: ScannedServo) -> str:
    """Return the firmware version of a servo, "-" if unknown; that of an STS servo has two numbers, such as 3.10."""
    if servo.firmware is None:
        return "-"
    return f"{servo.firmware & 0xFF}.{servo.firmware >> 8}" if servo.address.protocol == "STS" else str(servo.firmware)


def _servo_problems(servo: ScannedServo) -> list[str]:
    """Return the faults that a servo reports, and the problems with its replies."""
    return [
        *[servo.faults.description] * bool(servo.faults),
        *["damaged replies: two with this ID?"] * servo.has_damaged_replies,
        *["replies to a ping, but not to a read: status return level 0"] * servo.answers_ping_only,
    ]


def _servo_json(servo: ScannedServo) -> str:
    """Return a servo as a line of JSON."""
    return json.dumps(
        {
            "id": servo.address.id,
            "protocol": servo.address.protocol,
            "baud": servo.baud,
            "number": servo.number,
            "model": None if servo.model is None else servo.model.name,
            "firmware": servo.firmware,
            "position": servo.position,
            "voltage": servo.voltage,
            "temperature": servo.temperature,
            "errors": _servo_problems(servo),
        }
    )


def find_differences(
    all_servos: Sequence[ScannedServo], joints: Mapping[str, Joint], baud: int, *, searched_ids: Collection[int]
) -> list[str]:
    """Return a line for each joint whose servo is missing, or differs from the robot file in model or baud rate.

    Joints with an ID that was not among ``searched_ids`` are left out.
    """
    troubles = []
    for joint in joints.values():
        servos = [servo for servo in all_servos if servo.address.id == joint.spec.id]
        right = [servo for servo in servos if servo.baud == baud and servo.model is joint.model]
        if right or joint.spec.id not in searched_ids:
            continue
        if not servos:
            troubles.append(f"{joint.title} does not reply\n  try: check its cable, and those before it")
        for servo in servos:
            if servo.baud != baud:
                fix = f"mission servo set {servo.address.id} baud {baud} --baud {servo.baud} --port PORT"
                troubles.append(f"{joint.title} is at {servo.baud} baud, the robot file says {baud}\n  try: {fix}")
            elif servo.model is not joint.model and not servo.answers_ping_only:
                fix = "connect it alone, and scan again" if servo.model is None else servo.model.robot_file_hint
                models = f"{_model_text(servo)}, the robot file says {joint.model.name}"
                troubles.append(f"{joint.title} has another model: {models}\n  try: {fix}")
    return troubles


def _no_reply_text(port: str, bauds: Sequence[int]) -> str:
    """Return an error message with the possible causes, most likely first, why no servo replies on a port."""
    rates = ", ".join(str(rate) for rate in bauds)
    more = [] if len(bauds) >= len(BAUD_RATES) else ["another baud rate: add --all-bauds"]
    causes = [
        "the servos have no power: USB powers only the adapter; LEDs flash once when the supply is switched on",
        "the cable: three wires are TTL (AX, MX-T, X, STS), four are RS-485 (RX, EX, MX-R); a bad plug ends the bus",
        "the adapter's switch, where it has one, stands on the other kind of bus",
        *more,
        "two servos with one ID disturb each other: connect only one",
        f"{port} is another device: mission ports",
    ]
    return f"no servo replies on {port} at {rates} baud; possible causes:\n" + "\n".join(
        f"  - {each}" for each in causes
    )
