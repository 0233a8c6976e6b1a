"""``mission servo info``: every register of a servo, and what it means."""

import json
import re
from math import degrees

import click

from drivers.errors import BadRequest
from drivers.servos.models import Model
from drivers.servos.register import Block, Register
from drivers.servos.units import baud_of, called
from missions.cli.columns import in_columns
from missions.cli.root import SUCCESS
from missions.plugins.setup.servo.bench import opened_bus
from missions.plugins.setup.servo.target import Target, target_options

HEADINGS = ("address", "register", "value", "meaning", "delivered", "kept in")

_STEP = re.compile(r"([0-9.]+) (\S+)")
"""What one step of a register is worth, as ``0.1 V``."""


@click.command(epilog="Example: mission servo info elbow")
@target_options
@click.argument("servo", metavar="ID|JOINT")
@click.option("--json", "as_json", is_flag=True, help="As one line of JSON: the registers by name.")
def info(target: Target, servo: str, as_json: bool) -> int:
    """Show every register of a servo.

    Only reads. "delivered" is what it holds as it comes from the factory, where that differs.
    """
    with opened_bus(target) as bench:
        at, model = bench.servo(servo)
        whole = Block(0, model.table.size)
        data = bench.bus.read_block(at, whole.address, whole.size)
    values = {name: register.decode(data) for name, register in model.table.registers.items()}
    if as_json:
        click.echo(json.dumps({"id": at.id, "protocol": at.protocol, "model": model.name, "registers": values}))
        return SUCCESS
    click.echo(f"servo {at.id}: {model.name}, {called(at.protocol)}\n")
    rows = [_row(model, register, values[name]) for name, register in model.table.registers.items()]
    click.echo(in_columns(HEADINGS, rows, left=frozenset({"register", "meaning", "kept in"})))
    return SUCCESS


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
