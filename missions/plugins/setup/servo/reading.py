"""What servos feel, read from them and from nowhere else: nothing is written, so nothing about them changes."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import degrees

from drivers.api import JointState
from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import Bus
from drivers.servos.joint import Joint
from drivers.servos.register import Block
from missions.cli.columns import in_columns

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
