"""``mission servo info`` and ``set``: show registers and joint states; compare, write and verify registers."""

import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from math import degrees

import click
from rich.live import Live
from rich.text import Text

from drivers.api import JointState
from drivers.errors import BadRequest, DeviceFault, NoReply
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.identification import UNPLUG_HINT, duplicate_ping_evidence, require_unique_id
from drivers.servos.joint import Joint
from drivers.servos.models import MODELS, ServoModel, find_model
from drivers.servos.register import Register, RegisterBlock
from drivers.servos.settings import RegisterChange, apply_changes, plan_changes
from drivers.servos.units import baud_code, baud_of, protocol_name
from missions.cli.commands import SharingCommand
from missions.cli.console import console
from missions.cli.numbers import QuantityInUnit, WholeNumber
from missions.cli.printable import format_columns
from missions.cli.root import FAILURE, SUCCESS
from missions.plugins.setup.servo.connections import OpenBus, confirm_limp, confirm_weak, open_bus, pause
from missions.plugins.setup.servo.target import ServoTarget, target_options

# ``mission servo info``: registers of a servo, or states of joints.

REGISTER_HEADINGS = ("address", "register", "value", "meaning", "delivered", "kept in")

DEFAULT_WATCH_RATE = "5Hz"
"""Default rate of ``--watch``."""

JOINT_HEADINGS = ("joint", "id", "position", "goal", "error", "speed", "load", "volts", "degC", "torque", "")
"""Column headings of the joint table of `mission servo info`; angles in degrees."""

_UNIT_STEP = re.compile(r"([0-9.]+) (\S+)")
"""Pattern of the unit of a register step, such as ``0.1 V``."""


@dataclass(frozen=True, slots=True)
class JointReport:
    """State of a joint; ``state`` is None if its servo does not reply, ``remark`` describes faults."""

    joint: Joint
    state: JointState | None
    remark: str = ""


class InfoCommand(SharingCommand):
    """Command `mission servo info`, whose option ``--watch`` may have a rate, such as 10Hz, or none.

    A word after ``--watch`` is the rate if it begins with a digit; otherwise it is a joint.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; an option ``--watch`` without a rate gets the default rate."""
        following = [*args[1:], ""][: len(args)]
        return super().parse_args(
            ctx,
            [
                f"{word}={DEFAULT_WATCH_RATE}" if word == "--watch" and not follows[:1].isdigit() else word
                for word, follows in zip(args, following, strict=True)
            ],
        )


@click.command(cls=InfoCommand, epilog="Example: mission servo info elbow")
@target_options
@click.argument("servos", nargs=-1, metavar="[ID|JOINT|GROUP]...")
@click.option(
    "--watch",
    "rate",
    type=QuantityInUnit("Hz", 0.1, 50.0),
    metavar="[RATE]",
    help=f"Show the joints repeatedly, at this rate; {DEFAULT_WATCH_RATE} without a rate.",
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print a line of JSON: registers by name; or joints, in SI units."
)
def info(target: ServoTarget, servos: tuple[str, ...], rate: float | None, as_json: bool) -> int:
    """Show all registers of one servo, or a table of the states of joints.

    Without a name, the table has all joints. Only reads: torque and goals stay as they are. "delivered" is the factory
    value of a register, if it differs. Angles are in degrees. Exit code 1: a servo of the table does not reply. With
    --watch, Ctrl-C ends it.
    """
    with open_bus(target) as bench:
        if rate is not None:
            _watch_joints(bench, servos, 1.0 / rate, as_json=as_json)
        elif len(servos) == 1 and servos[0] not in bench.groups:
            _show_registers(bench, servos[0], as_json=as_json)
        else:
            snapshots = _read_joints(bench.bus, bench.select_joints(servos))
            click.echo(_joints_as_json(bench, snapshots) if as_json else _joint_table(snapshots))
            return SUCCESS if all(each.state is not None for each in snapshots) else FAILURE
    return SUCCESS


def _watch_joints(bench: OpenBus, names: Sequence[str], interval: float, *, as_json: bool) -> None:
    """Print the joints repeatedly until Ctrl-C."""
    chosen = bench.select_joints(names)
    with Live(console=console(), auto_refresh=False) as live:
        while True:
            begun = bench.clock.now()
            snapshots = _read_joints(bench.bus, chosen)
            if as_json:
                click.echo(_joints_as_json(bench, snapshots))
            else:
                live.update(Text(_joint_table(snapshots), no_wrap=True, overflow="ellipsis"), refresh=True)
            pause(max(0.0, begun + interval - bench.clock.now()))


def _joints_as_json(bench: OpenBus, snapshots: Sequence[JointReport]) -> str:
    joints = {
        each.joint.name: {"remark": each.remark} | ({} if each.state is None else asdict(each.state))
        for each in snapshots
    }
    return json.dumps({"t": round(bench.clock.now(), 3), "joints": joints})


def _show_registers(bench: OpenBus, servo: str, *, as_json: bool) -> None:
    at, model = bench.servo(servo)
    data = bench.bus.read_block(at, 0, model.table.size)
    values = {name: register.decode(data) for name, register in model.table.registers.items()}
    if as_json:
        click.echo(json.dumps({"id": at.id, "protocol": at.protocol, "model": model.name, "registers": values}))
        return
    click.echo(f"servo {at.id}: {model.name}, {protocol_name(at.protocol)}\n")
    rows = [_register_row(model, register, values[name]) for name, register in model.table.registers.items()]
    click.echo(format_columns(REGISTER_HEADINGS, rows, left=frozenset({"register", "meaning", "kept in"})))


def _register_row(model: ServoModel, register: Register, value: int) -> list[str]:
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


def meaning(model: ServoModel, register: Register, value: int) -> str:
    """Return the meaning of a register's value, such as "12.1 V"; empty if it is a plain number or a bit mask."""
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
        # Positions count from the middle of the range; other values in ticks are widths.
        place = any(word in register.name for word in ("position", "angle_limit")) and "offset" not in register.name
        return f"{degrees(model.angle(value)):+.1f} deg" if place else f"{degrees(value * model.tick):.1f} deg wide"
    if register.unit == "1/1023":
        return f"{value / 1023:.0%}"
    if step := _UNIT_STEP.fullmatch(register.unit):
        return f"{value * float(step[1]):.4g} {step[2]}"
    return f"{value} {register.unit}" if register.unit.isalpha() else ""


def _read_joints(bus: ServoBus, joints: Iterable[Joint]) -> list[JointReport]:
    """Return the states of joints, read one by one. Raises NotConnected."""
    return [_read_joint(bus, joint) for joint in joints]


def _read_joint(bus: ServoBus, joint: Joint) -> JointReport:
    """Return the state of a joint.

    One request reads all registers from the shutdown mask to the last measured value.
    """
    table = joint.model.table
    start = table["shutdown"].address
    whole = RegisterBlock(start, max(table[name].end for name in ("present_temperature", "moving")) - start)
    try:
        joint.store(whole, bus.read_block(joint.address, whole.address, whole.size, tries=2))
    except (NoReply, BadRequest):
        return JointReport(joint, None, "no reply")
    joint.torque = bool(joint.value("torque_enable"))
    joint.goal = joint.angle(joint.value(table.goal)) if joint.torque else None
    remarks = [bus.faults(joint.spec.id).description, "has shut down" if joint.reports_shutdown else ""]
    return JointReport(joint, joint.state(), ", ".join(word for word in remarks if word))


def _joint_table(snapshots: Iterable[JointReport]) -> str:
    return format_columns(
        JOINT_HEADINGS, [_joint_row(each) for each in snapshots], left=frozenset({"joint", "torque", ""})
    )


def _joint_row(snapshot: JointReport) -> list[str]:
    state, name, servo = snapshot.state, snapshot.joint.name, str(snapshot.joint.spec.id)
    if state is None:
        return [name, servo, *["-"] * 8, snapshot.remark]
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
        "on" if state.torque else "off",
        snapshot.remark,
    ]


STATUS_RETURN_LEVEL, ANSWER_EVERYTHING = "status_return_level", 2
"""Value of the register ``STATUS_RETURN_LEVEL`` with which a servo replies to every instruction."""

MAX_ID = 253

yes_option = click.option(
    "--yes",
    is_flag=True,
    help="Do not ask before the EEPROM is written, or a servo holds with less force: a person holds the arm.",
)


@click.command(
    "set",
    cls=SharingCommand,
    context_settings={"ignore_unknown_options": True},
    epilog="Example: mission servo set 3 return_delay 0 --port /dev/ttyUSB0",
)  # allows negative values
@target_options
@click.argument("servo", metavar="ID|JOINT|GROUP|all")
@click.argument("register", metavar="REGISTER")
@click.argument("value", type=WholeNumber())
@yes_option
def set_register(target: ServoTarget, servo: str, register: str, value: int, yes: bool) -> int:
    """Set a register by its name: `mission servo info` lists them.

    `id` changes the ID of one servo: new servos all have ID 1, so connect them one by one. The value of `baud` is the
    rate, such as 1000000; --baud is the rate that the servos have now.

    A register that has the value already is not written. EEPROM is written with the torque off, and the torque stays
    off. Before a servo with torque gets less force (such as torque_limit, goal_pwm, position_p_gain), you are asked to
    hold the arm.
    """
    with open_bus(target) as bench:
        if register == STATUS_RETURN_LEVEL and value == ANSWER_EVERYTHING:
            _enable_replies(bench, servo, yes=yes)
        servos = [bench.servo(servo)] if register == "id" else bench.servos(servo)
        for _, model in servos:
            model.table.find_register(register)  # check all before any is changed
        values = {at: (model, {register: _encode_value(register, value, model)}) for at, model in servos}
        code = _write_registers(bench, values, yes=yes)
    if register == "baud" and target.robot is not None:
        click.echo(f"  set baud: {value} in the robot file once all its servos have it", err=True)
    return code


def _encode_value(register: str, value: int, model: ServoModel) -> int:
    """Return the raw value of a register for a typed ``value``, which is a rate for ``baud``.

    Raises click.UsageError for an invalid ID.
    """
    if register == "id" and not 0 <= value <= MAX_ID:
        raise click.UsageError(f"{value} is not an ID: they go from 0 to {MAX_ID}")
    return baud_code(value, model.protocol) if register == "baud" else value


def _enable_replies(bench: OpenBus, selector: str, *, yes: bool) -> None:
    """Let servos that reply only to pings reply to reads again, by writing their register for replies.

    In protocol 1.0 only Dynamixels can be in this state, and all models have the register at the same address. In
    protocol 2.0 a ping reports the model. Raises DeviceFault for a shared ID or an unknown model, NoReply for a servo
    that still does not reply.
    """
    for at in bench.find_ping_only(selector):
        _require_one_ping(bench, at)
        model = MODELS["AX-12A"] if at.protocol != 2 else find_model(bench.bus.ping(at))
        if model is None:
            raise DeviceFault(f"servo {at.id}: unknown model", hint="mission servo scan")
        click.echo(f"servo {at.id}: {STATUS_RETURN_LEVEL}: 0 -> {ANSWER_EVERYTHING}, EEPROM")
        if not yes:
            if not sys.stdin.isatty():
                raise click.UsageError("this writes the EEPROM: add --yes, or confirm it at a terminal")
            click.confirm("write this into the EEPROM?", abort=True, err=True)
            _require_one_ping(bench, at)  # the user may have replugged a servo
        with suppress(NoReply):
            bench.bus.write(at, model.table[STATUS_RETURN_LEVEL], ANSWER_EVERYTHING)
        try:
            require_unique_id(bench.bus, at)
        except NoReply as error:
            hint = "switch its power off and on, then try again: its EEPROM is locked while it has torque"
            raise NoReply(f"servo {at.id} still does not reply to reads", hint=hint) from error
        click.echo(f"servo {at.id} replies again")


def _require_one_ping(bench: OpenBus, at: ServoAddress) -> None:
    """Raise DeviceFault if the replies to pings show that two servos share the ID."""
    if evidence := duplicate_ping_evidence(bench.bus, at):
        raise DeviceFault(f"two servos with ID {at.id}, or a bad cable: {evidence}", hint=UNPLUG_HINT.format(at.id))


def _write_registers(
    bench: OpenBus, wanted: Mapping[ServoAddress, tuple[ServoModel, Mapping[str, int]]], *, yes: bool
) -> int:
    """Print the register changes, ask the user to confirm them if necessary, and write them; return the exit code.

    ``wanted`` has the raw values by servo and register name.
    """
    plans = {at: plan_changes(bench.bus, at, model.table, values) for at, (model, values) in wanted.items()}
    for at, changes in plans.items():
        model, values = wanted[at]
        for change in changes:
            click.echo(f"servo {at.id} ({model.name}): {_change_text(model, change)}")
        if not changes:
            click.echo(f"servo {at.id} ({model.name}): {', '.join(values)} has the value already")
    _confirm_changes(bench, plans, {at: model for at, (model, _) in wanted.items()}, yes=yes)
    for at, changes in plans.items():
        stiff = apply_changes(bench.bus, at, wanted[at][0].table, changes)
        if stiff:
            click.echo(f"servo {at.id}: torque was on, and is off now", err=True)
        if changes:
            click.echo(f"servo {at.id}: written and verified")
    return SUCCESS


def _confirm_changes(
    bench: OpenBus,
    plans: Mapping[ServoAddress, Sequence[RegisterChange]],
    models: Mapping[ServoAddress, ServoModel],
    *,
    yes: bool,
) -> None:
    """Ask before the EEPROM is written, which switches torque off, or before a servo gets less force."""
    lasting = [at for at, changes in plans.items() if any(change.register.eeprom for change in changes)]
    weaker = [at for at, changes in plans.items() if any(change.weakens for change in changes)]
    stiff = [at for at in {*lasting, *weaker} if bench.bus.read(at, models[at].table["torque_enable"])]
    limp = [at for at in stiff if at in lasting or any(_turns_torque_off(change) for change in plans[at])]
    if lasting and not yes:
        if not sys.stdin.isatty():
            raise click.UsageError("this writes the EEPROM: add --yes, or confirm it at a terminal")
        moved = [at for at in lasting if any(change.register.name == "id" for change in plans[at])]
        if moved and not bench.simulated:
            click.echo(f"connect only one servo with ID {moved[0].id}: a second one would change too", err=True)
        click.confirm("write this into the EEPROM?", abort=True, err=True)
    confirm_limp([f"servo {at.id}" for at in sorted(limp)], stiff=True, simulated=bench.simulated, yes=yes)
    weakened = [f"servo {at.id}" for at in sorted(stiff) if at not in limp]
    confirm_weak(weakened, simulated=bench.simulated, yes=yes)


def _turns_torque_off(change: RegisterChange) -> bool:
    return change.register.name == "torque_enable" and not change.after


def _change_text(model: ServoModel, change: RegisterChange) -> str:
    """Return a register change as text: old and new value, the meaning of the new value, and EEPROM or RAM."""
    meant = meaning(model, change.register, change.after)
    place = "EEPROM" if change.register.eeprom else "RAM"
    return (
        f"{change.register.name}: {change.before} -> {change.after}" + (f" ({meant})" if meant else "") + f", {place}"
    )
