"""``mission servo info``: every register of a servo with its meaning; or the state of joints, again and again."""

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from math import degrees

import click
from rich.live import Live
from rich.text import Text

from drivers.api import JointState
from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import Bus
from drivers.servos.joint import Joint
from drivers.servos.models import Model
from drivers.servos.register import Block, Register
from drivers.servos.units import baud_of, called
from missions.cli.columns import in_columns
from missions.cli.commands import SharingCommand
from missions.cli.console import console
from missions.cli.numbers import InUnit
from missions.cli.root import FAILURE, SUCCESS
from missions.plugins.setup.servo.bench import Bench, opened_bus, pause
from missions.plugins.setup.servo.target import Target, target_options

HEADINGS = ("address", "register", "value", "meaning", "delivered", "kept in")

USUAL_RATE = "5Hz"
"""How often joints are shown with ``--watch``, unless a rate is given."""

JOINT_HEADINGS = ("joint", "id", "position", "goal", "error", "speed", "load", "volts", "degC", "torque", "")
"""What the table of joints shows; angles in degrees."""

_STEP = re.compile(r"([0-9.]+) (\S+)")
"""What one step of a register is worth, as ``0.1 V``."""


@dataclass(frozen=True, slots=True)
class Felt:
    """What one joint felt a moment ago; None where its servo did not answer. ``remark`` is what is the matter."""

    joint: Joint
    state: JointState | None
    remark: str = ""


class InfoCommand(SharingCommand):
    """A command whose ``--watch`` takes the next word only if that is a rate, and no joint."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments."""
        following = [*args[1:], ""][: len(args)]
        return super().parse_args(
            ctx,
            [
                f"{word}={USUAL_RATE}" if word == "--watch" and not follows[:1].isdigit() else word
                for word, follows in zip(args, following, strict=True)
            ],
        )


@click.command(cls=InfoCommand, epilog="Example: mission servo info elbow")
@target_options
@click.argument("servos", nargs=-1, metavar="[ID|JOINT|GROUP]...")
@click.option(
    "--watch",
    "rate",
    type=InUnit("Hz", 0.1, 50.0),
    metavar="[RATE]",
    help=f"Show the joints again and again, so often: {USUAL_RATE}, if no rate is given.",
)
@click.option("--json", "as_json", is_flag=True, help="As a line of JSON: registers by name; or joints, in SI units.")
def info(target: Target, servos: tuple[str, ...], rate: float | None, as_json: bool) -> int:
    """Show every register of one servo; or position, load and temperature of several joints, in a table.

    Without a name, of all joints. Only reads: torque and goals stay as they are. A register's "delivered" is the value
    from the factory, if it differs. Angles in degrees. Exit code 1 where a servo of the table does not answer. With
    --watch, Ctrl-C ends it.
    """
    with opened_bus(target) as bench:
        if rate is not None:
            _watch(bench, servos, 1.0 / rate, as_json=as_json)
        elif len(servos) == 1 and servos[0] not in bench.groups:
            _show_registers(bench, servos[0], as_json=as_json)
        else:
            felt = _read_joints(bench.bus, bench.chosen(servos))
            click.echo(_joints_as_json(bench, felt) if as_json else _table_of(felt))
            return SUCCESS if all(each.state is not None for each in felt) else FAILURE
    return SUCCESS


def _watch(bench: Bench, names: Sequence[str], period: float, *, as_json: bool) -> None:
    """Show round after round, until somebody interrupts."""
    chosen = bench.chosen(names)
    with Live(console=console(), auto_refresh=False) as live:
        while True:
            begun = bench.clock.now()
            felt = _read_joints(bench.bus, chosen)
            if as_json:
                click.echo(_joints_as_json(bench, felt))
            else:
                live.update(Text(_table_of(felt), no_wrap=True, overflow="ellipsis"), refresh=True)
            pause(max(0.0, begun + period - bench.clock.now()))


def _joints_as_json(bench: Bench, felt: Sequence[Felt]) -> str:
    joints = {
        each.joint.name: {"remark": each.remark} | ({} if each.state is None else asdict(each.state)) for each in felt
    }
    return json.dumps({"t": round(bench.clock.now(), 3), "joints": joints})


def _show_registers(bench: Bench, servo: str, *, as_json: bool) -> None:
    at, model = bench.servo(servo)
    data = bench.bus.read_block(at, 0, model.table.size)
    values = {name: register.decode(data) for name, register in model.table.registers.items()}
    if as_json:
        click.echo(json.dumps({"id": at.id, "protocol": at.protocol, "model": model.name, "registers": values}))
        return
    click.echo(f"servo {at.id}: {model.name}, {called(at.protocol)}\n")
    rows = [_row(model, register, values[name]) for name, register in model.table.registers.items()]
    click.echo(in_columns(HEADINGS, rows, left=frozenset({"register", "meaning", "kept in"})))


def _row(model: Model, register: Register, value: int) -> list[str]:
    delivered = model.default(register)
    differs = register.writable and register.eeprom and value != delivered
    return [
        str(register.address),
        register.name,
        str(value),
        meaning(model, register, value),
        str(delivered) if differs else "",
        "EEPROM" if register.eeprom else "RAM",
    ]


def meaning(model: Model, register: Register, value: int) -> str:
    """Return what a value of a register is in the units of people; empty for a plain number or a mask."""
    if register.name == "model_number":
        return model.name
    if register.name == "firmware" and register.size == 2:
        return f"{value & 0xFF}.{value >> 8}"
    if register.name == "baud":
        try:
            return f"{baud_of(value, model.protocol)} baud"
        except BadRequest:
            return "no rate"
    if register.unit == "ticks":
        # Places are measured from the middle of the range; all else that is in ticks is the width of something.
        place = any(word in register.name for word in ("position", "angle_limit")) and "offset" not in register.name
        return f"{degrees(model.angle(value)):+.1f} deg" if place else f"{degrees(value * model.tick):.1f} deg wide"
    if register.unit == "1/1023":
        return f"{value / 1023:.0%}"
    if step := _STEP.fullmatch(register.unit):
        return f"{value * float(step[1]):.4g} {step[2]}"
    return f"{value} {register.unit}" if register.unit.isalpha() else ""


def _read_joints(bus: Bus, joints: Iterable[Joint]) -> list[Felt]:
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


def _table_of(felt: Iterable[Felt]) -> str:
    """Return the joints as a table."""
    return in_columns(JOINT_HEADINGS, [_joint_row(each) for each in felt], left=frozenset({"joint", "torque", ""}))


def _joint_row(felt: Felt) -> list[str]:
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
