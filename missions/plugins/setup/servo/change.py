"""``mission servo set``: registers of servos, compared first, written, verified."""

import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress

import click

from drivers.errors import DeviceFault, NoReply
from drivers.servos.bus import At
from drivers.servos.identification import UNPLUG, ping_evidence, require_sole
from drivers.servos.models import MODELS, Model, model_of
from drivers.servos.settings import Change, apply, planned
from drivers.servos.units import baud_code
from missions.cli.commands import SharingCommand
from missions.cli.numbers import Whole
from missions.cli.root import SUCCESS
from missions.plugins.setup.servo.bench import Bench, opened_bus
from missions.plugins.setup.servo.info import meaning
from missions.plugins.setup.servo.target import Target, target_options
from missions.plugins.setup.servo.until import confirm_limp, confirm_weak

LEVEL, ANSWERS_ALL = "status_return_level", 2
"""The register that says what a servo answers, and its value for everything."""

MAX_ID = 253

yes_option = click.option(
    "--yes",
    is_flag=True,
    help="Do not ask before the EEPROM is written, or a servo holds with less force: somebody holds the arm.",
)


@click.command(
    "set",
    cls=SharingCommand,
    context_settings={"ignore_unknown_options": True},
    epilog="Example: mission servo set 3 return_delay 0 --port /dev/ttyUSB0",
)  # so that a value may be below zero
@target_options
@click.argument("servo", metavar="ID|JOINT|GROUP|all")
@click.argument("register", metavar="REGISTER")
@click.argument("value", type=Whole())
@yes_option
def set_register(target: Target, servo: str, register: str, value: int, yes: bool) -> int:
    """Set a register by its name: `mission servo info` lists them.

    `id` gives one servo another ID: new servos all have ID 1, so plug them in one by one. The value of `baud` is the
    rate, such as 1000000; --baud is the rate that the servos have now.

    Nothing is written where it holds the value already. What is kept through a power cut (EEPROM) is written with the
    torque off, and the servo is limp afterwards. Before a stiff servo is given less force (such as torque_limit,
    goal_pwm, position_p_gain), you are asked to hold the arm.
    """
    with opened_bus(target) as bench:
        if register == LEVEL and value == ANSWERS_ALL:
            _wake(bench, servo, yes=yes)
        servos = [bench.servo(servo)] if register == "id" else bench.servos(servo)
        for _, model in servos:
            model.table.named(register)  # of all first: none is changed where another cannot be
        wanted = {at: (model, {register: _coded(register, value, model)}) for at, model in servos}
        code = _set(bench, wanted, yes=yes)
    if register == "baud" and target.robot is not None:
        click.echo(f"  the robot file must say baud: {value}, once all its servos do", err=True)
    return code


def _coded(register: str, value: int, model: Model) -> int:
    """Return a value as the register holds it. Raises click.UsageError for an ID that no servo can have."""
    if register == "id" and not 0 <= value <= MAX_ID:
        raise click.UsageError(f"{value} is not an ID: they go from 0 to {MAX_ID}")
    return baud_code(value, model.protocol) if register == "baud" else value


def _wake(bench: Bench, who: str, *, yes: bool) -> None:
    """Let servos answer reads again that answer pings alone, which therefore cannot be identified before.

    In protocol 1.0 only Dynamixels are silent so, and all have the register at one place; in 2.0 a ping tells the
    model. Raises DeviceFault for one that shares its ID or has an unknown model; NoReply for one that stays silent.
    """
    for at in bench.mute(who):
        _require_one_ping(bench, at)
        model = MODELS["AX-12A"] if at.protocol != 2 else model_of(bench.bus.ping(at))
        if model is None:
            raise DeviceFault(f"servo {at.id}: its model is not known here", hint="mission servo scan")
        click.echo(f"servo {at.id}: {LEVEL}: 0 -> {ANSWERS_ALL}, EEPROM")
        if not yes:
            if not sys.stdin.isatty():
                raise click.UsageError("this writes the EEPROM: add --yes, or confirm it at a terminal")
            click.confirm("write this into the EEPROM?", abort=True, err=True)
            _require_one_ping(bench, at)  # a person may have replugged something meanwhile
        with suppress(NoReply):
            bench.bus.write(at, model.table[LEVEL], ANSWERS_ALL)
        try:
            require_sole(bench.bus, at)
        except NoReply as error:
            hint = "switch its power off and on, then try again: its EEPROM is locked while it has torque"
            raise NoReply(f"servo {at.id} still answers no reads", hint=hint) from error
        click.echo(f"servo {at.id}: answers reads again")


def _require_one_ping(bench: Bench, at: At) -> None:
    """Raise DeviceFault if pings show that servos share an ID."""
    if evidence := ping_evidence(bench.bus, at):
        raise DeviceFault(f"two servos with ID {at.id}, or a bad cable: {evidence}", hint=UNPLUG.format(at.id))


def _set(bench: Bench, wanted: Mapping[At, tuple[Model, Mapping[str, int]]], *, yes: bool) -> int:
    """Say what is to be changed, ask before the EEPROM is written or force is taken away, change it, and say so."""
    plans = {at: planned(bench.bus, at, model.table, values) for at, (model, values) in wanted.items()}
    for at, changes in plans.items():
        model, values = wanted[at]
        for change in changes:
            click.echo(f"servo {at.id} ({model.name}): {_told(model, change)}")
        if not changes:
            click.echo(f"servo {at.id} ({model.name}): {', '.join(values)} is so already")
    _confirm(bench, plans, {at: model for at, (model, _) in wanted.items()}, yes=yes)
    for at, changes in plans.items():
        stiff = apply(bench.bus, at, wanted[at][0].table, changes)
        if stiff:
            click.echo(f"servo {at.id} was stiff, and is limp now", err=True)
        if changes:
            click.echo(f"servo {at.id}: written and verified")
    return SUCCESS


def _confirm(bench: Bench, plans: Mapping[At, Sequence[Change]], models: Mapping[At, Model], *, yes: bool) -> None:
    """Ask before the EEPROM is written, which takes the torque away, or a servo holds with less force than now."""
    lasting = [at for at, changes in plans.items() if any(change.register.eeprom for change in changes)]
    weaker = [at for at, changes in plans.items() if any(change.weakens for change in changes)]
    stiff = [at for at in {*lasting, *weaker} if bench.bus.read(at, models[at].table["torque_enable"])]
    limp = [at for at in stiff if at in lasting or any(_relaxes(change) for change in plans[at])]
    if lasting and not yes:
        if not sys.stdin.isatty():
            raise click.UsageError("this writes the EEPROM: add --yes, or confirm it at a terminal")
        moved = [at for at in lasting if any(change.register.name == "id" for change in plans[at])]
        if moved and not bench.simulated:
            click.echo(
                f"only one servo with ID {moved[0].id} may be plugged in: a second one would change too", err=True
            )
        click.confirm("write this into the EEPROM?", abort=True, err=True)
    confirm_limp([f"servo {at.id}" for at in sorted(limp)], stiff=True, simulated=bench.simulated, yes=yes)
    weakened = [f"servo {at.id}" for at in sorted(stiff) if at not in limp]
    confirm_weak(weakened, simulated=bench.simulated, yes=yes)


def _relaxes(change: Change) -> bool:
    return change.register.name == "torque_enable" and not change.after


def _told(model: Model, change: Change) -> str:
    """Return a change in words, with what the value means."""
    meant = meaning(model, change.register, change.after)
    place = "EEPROM" if change.register.eeprom else "RAM"
    return (
        f"{change.register.name}: {change.before} -> {change.after}" + (f" ({meant})" if meant else "") + f", {place}"
    )
