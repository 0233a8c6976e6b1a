"""``mission servo monitor``: what all joints feel, again and again."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from math import degrees

import click
from rich.live import Live
from rich.text import Text

from drivers.api import JointState
from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import Bus
from drivers.servos.joint import Joint
from drivers.servos.register import Block
from missions.cli.columns import in_columns
from missions.cli.numbers import InUnit
from missions.cli.printable import console
from missions.cli.root import FAILURE, SUCCESS
from missions.plugins.setup.servo.bench import Bench, opened_bus, pause
from missions.plugins.setup.servo.target import Target, target_options

# What servos feel, read from them and from nowhere else: nothing is written, so nothing about them changes.

HEADINGS = ("joint", "id", "position", "goal", "error", "speed", "load", "volts", "degC", "torque", "")
"""What the table of joints shows; angles in degrees."""


@dataclass(frozen=True, slots=True)
class Felt:
    """What one joint felt a moment ago; None where its servo did not answer. ``remark`` is what is the matter."""

    joint: Joint
    state: JointState | None
    remark: str = ""


def feel(bus: Bus, joints: Iterable[Joint]) -> list[Felt]:
    """Read the joints one by one. Raises NotConnected."""
    return [_felt(bus, joint) for joint in joints]


def _felt(bus: Bus, joint: Joint) -> Felt:
    """Read all from what shuts it down to the last of the readings, in one transaction."""
    table = joint.model.table
    start = table["shutdown"].address
    whole = Block(start, max(table[name].end for name in ("present_temperature", "moving")) - start)
    try:
        joint.take(whole, bus.read_block(joint.at, whole.address, whole.size, tries=2))
    except (NoReply, BadRequest):
        return Felt(joint, None, "no reply")
    joint.torque = bool(joint.value("torque_enable"))
    joint.goal = joint.angle(joint.value(table.goal)) if joint.torque else None
    remarks = [bus.faults(joint.spec.id).words, "has shut down" if joint.down else ""]
    return Felt(joint, joint.state(), ", ".join(word for word in remarks if word))


def table_of(felt: Iterable[Felt]) -> str:
    """Return the joints as a table."""
    return in_columns(HEADINGS, [_row(each) for each in felt], left=frozenset({"joint", "torque", ""}))


def _row(felt: Felt) -> list[str]:
    state, name, servo = felt.state, felt.joint.name, str(felt.joint.spec.id)
    if state is None:
        return [name, servo, *["-"] * 8, felt.remark]
    return [
        name,
        servo,
        f"{degrees(state.position):+.1f}",
        "-" if state.goal is None else f"{degrees(state.goal):+.1f}",
        "-" if state.error is None else f"{degrees(state.error):+.1f}",
        f"{degrees(state.velocity):+.0f}",
        f"{state.load:+.0%}",
        f"{state.voltage:.1f}",
        f"{state.temperature:.0f}",
        "stiff" if state.torque else "limp",
        felt.remark,
    ]


@click.command(epilog="Example: mission servo monitor elbow --once")
@target_options
@click.argument("joints", nargs=-1, metavar="[JOINT|GROUP]...")
@click.option("--once", is_flag=True, help="Print one table, and end.")
@click.option("--json", "as_json", is_flag=True, help="A line of JSON a round, in SI units; angles in radians.")
@click.option("--rate", type=InUnit("Hz", 0.1, 50.0), default=5.0, show_default=True, help="Rounds a second.")
def monitor(target: Target, joints: tuple[str, ...], once: bool, as_json: bool, rate: float) -> int:
    """Show what the joints feel, live.

    Only reads: torque and goals stay as they are. Ctrl-C ends it. Angles in degrees. Exit code 1 where a servo does
    not answer (with --once).
    """
    with opened_bus(target) as bench:
        if once:
            felt = feel(bench.bus, bench.chosen(joints))
            click.echo(_json(bench, felt) if as_json else table_of(felt))
            return SUCCESS if all(each.state is not None for each in felt) else FAILURE
        _show(bench, joints, 1.0 / rate, as_json=as_json)
    return SUCCESS


def _show(bench: Bench, names: tuple[str, ...], period: float, *, as_json: bool) -> None:
    """Show round after round, until somebody interrupts."""
    chosen = bench.chosen(names)
    with Live(console=console(), auto_refresh=False) as live:
        while True:
            begun = bench.clock.now()
            felt = feel(bench.bus, chosen)
            if as_json:
                click.echo(_json(bench, felt))
            else:
                live.update(Text(table_of(felt), no_wrap=True, overflow="ellipsis"), refresh=True)
            pause(max(0.0, begun + period - bench.clock.now()))


def _json(bench: Bench, felt: list[Felt]) -> str:
    told = {
        each.joint.name: {"remark": each.remark} | ({} if each.state is None else asdict(each.state)) for each in felt
    }
    return json.dumps({"t": round(bench.clock.now(), 3), "joints": told})
