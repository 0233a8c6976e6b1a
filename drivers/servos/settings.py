"""Permanent changes of servo settings: compare, switch the torque off, write, and verify.

No other module writes the EEPROM. ID and baud rate are changed last, so that the servo stays reachable until then.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import MappingProxyType

from drivers.errors import BadRequest, DeviceFault, DriverError, NoReply
from drivers.servos import wire2
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.identification import SCAN_HINT, require_unique_id
from drivers.servos.models import find_model
from drivers.servos.register import ControlTable, Register
from drivers.servos.units import Protocol, baud_of

ADDRESS_REGISTERS = ("id", "baud")
"""Registers that decide how the servo is reached; they are written last, in this order."""

MIN_REGISTER_VALUES: Mapping[str, tuple[int, str]] = MappingProxyType(
    {
        "protocol": (2, "its control table would no longer be the one of its protocol"),
        "status_return_level": (1, "a servo that answers no reads can be neither verified nor set back"),
        "response_level": (1, "a servo that does not acknowledge writes is not driven"),
    }
)
"""Registers with a minimum value, and the reason: below it, the servo could no longer be read or verified."""


FORCE_REGISTERS = frozenset(
    {
        *("torque_enable", "max_torque", "torque_limit", "goal_torque", "pwm_limit", "goal_pwm", "current_limit"),
        *("goal_current", "punch", "position_p_gain", "position_i_gain", "velocity_p_gain", "velocity_i_gain"),
        *("protection_current", "protective_torque", "overload_torque"),
    }
)
"""Registers of the holding force: a smaller absolute value, or a change of the sign, weakens the hold."""

SOFTNESS_REGISTERS = frozenset(
    {
        *("cw_compliance_margin", "ccw_compliance_margin", "cw_compliance_slope", "ccw_compliance_slope"),
        *("cw_dead_zone", "ccw_dead_zone", "torque_mode"),
    }
)
"""Registers of the compliance: a higher value weakens the hold."""


@dataclass(frozen=True, slots=True)
class RegisterChange:
    """Change of a register's value from ``before`` to ``after``."""

    register: Register
    before: int
    after: int

    @property
    def weakens(self) -> bool:
        """True if the servo holds its joint with less force after the change."""
        if self.register.name in SOFTNESS_REGISTERS:
            return self.after > self.before
        lower = abs(self.after) < abs(self.before) or self.after * self.before < 0
        return self.register.name in FORCE_REGISTERS and lower


def plan_changes(
    bus: ServoBus, at: ServoAddress, table: ControlTable, values: Mapping[str, int]
) -> list[RegisterChange]:
    """Return the changes, in the order of writing, after which the servo holds ``values`` (by register name).

    Nothing is written. Raises BadRequest that lists all invalid values, for the speed 0 of a servo for which it means
    full speed, and for an ID that another servo has; DeviceFault unless a single servo with this table has its ID;
    NoReply, NotConnected.
    """
    who = f"{bus.name}: servo {at.id}"
    registers = _check_registers(who, table, values)
    _require_unique_servo(bus, at, table)
    if values.get(table.speed) == 0 and not _is_in_wheel_mode(bus, at, table):
        hint = f"1 is the slowest, {table[table.speed].upper} the fastest"
        raise BadRequest(f"{who}: {table.speed} 0 means full speed", hint=hint)
    held = [RegisterChange(register, bus.read(at, register), values[register.name]) for register in registers]
    changes = sorted((change for change in held if change.before != change.after), key=_write_order)
    _require_free_id(bus, at, changes)
    return changes


def apply_changes(bus: ServoBus, at: ServoAddress, table: ControlTable, changes: Sequence[RegisterChange]) -> bool:
    """Apply ``changes``, each verified before the next; return True if the servo had torque, which is off now.

    The servo is identified again first: it, or another one with its new ID, may have been plugged in since
    ``plan_changes``. After an error, ``plan_changes`` returns the remaining changes. Raises, before anything is
    written: DeviceFault unless a single servo with this table has its ID, BadRequest for an ID that another servo has,
    and NotConnected if the adapter does not support the new baud rate. Later: DeviceFault for a register that does not
    hold the written value, or an old ID that still answers; BadRequest for a refused value; NoReply if the servo is
    lost.
    """
    if not changes:
        return False
    changes = sorted(changes, key=_write_order)
    _require_unique_servo(bus, at, table)
    _require_free_id(bus, at, changes)
    lasting = any(change.register.eeprom for change in changes)
    opens = at.protocol == "STS" and lasting
    if lasting and not opens and "lock" in table and bus.read(at, table["lock"]):
        raise BadRequest(f"{bus.name}: servo {at.id}: its EEPROM is locked", hint="switch its power off and on")
    for change in changes:
        with _baud_after(bus, at, change):
            bus.require_open()  # with an adapter that lacks the new rate, the servo would be unreachable
    stiff = lasting and _relax(bus, at, table)
    if opens:
        _set_eeprom_lock(bus, at, table, 0)
    try:
        for change in changes:
            with suppress(NoReply):  # it may have been done or not: the verification finds out
                bus.write(at, change.register, change.after)
            at = _verify(bus, at, change)
    except DriverError:
        if opens:
            with suppress(DriverError):
                _set_eeprom_lock(bus, at, table, 1)
        raise
    if opens:
        with _baud_after(bus, at, changes[-1]):
            _set_eeprom_lock(bus, at, table, 1)
    return stiff


def _set_eeprom_lock(bus: ServoBus, at: ServoAddress, table: ControlTable, value: int) -> None:
    """Open (0) or close (1) the EEPROM of an STS: values written while it is closed are lost with the power."""
    with suppress(NoReply):
        bus.write(at, table["lock"], value)
    if (held := bus.read(at, table["lock"])) != value:
        raise DeviceFault(f"{bus.name}: servo {at.id}: lock holds {held} after {value} was written to it")


def _write_order(change: RegisterChange) -> int:
    """Return the sort key of a change: ID and baud rate last."""
    name = change.register.name
    return ADDRESS_REGISTERS.index(name) + 1 if name in ADDRESS_REGISTERS else 0


def _check_registers(subject: str, table: ControlTable, values: Mapping[str, int]) -> list[Register]:
    """Return the registers in ``values``. Raises BadRequest that lists all invalid ones."""
    registers, faults, hints = [], [], []
    for name, value in values.items():
        try:
            register = table.find_register(name)
        except BadRequest as error:
            faults.append(str(error))
            hints.append(error.hint)
            continue
        registers.append(register)
        least, why = MIN_REGISTER_VALUES.get(name, (value, ""))
        if not register.writable:
            faults.append(f"{name} cannot be written")
        elif not register.lower <= value <= register.upper:
            faults.append(f"{name} takes {register.lower}..{register.upper}, not {value}")
        elif value < least:
            faults.append(f"{name} must stay at {least} or above, not {value}: {why}")
        elif name == "torque_enable" and value:
            faults.append(f"{name} {value} could make it leap to its old goal")
            hints.append("mission servo torque on --robot FILE  (makes joints stiff where they stand)")
        elif name == table.goal:
            faults.append(f"{name} {value} would move it all the way, and could not be stopped")
            hints.append("mission servo move JOINT ANGLE --robot FILE  (moves it in short steps)")
    if faults:
        raise BadRequest(f"{subject}: {'; '.join(faults)}", hint="; ".join(hints))
    return registers


def _is_in_wheel_mode(bus: ServoBus, at: ServoAddress, table: ControlTable) -> bool:
    """True if the servo rotates endlessly and speed 0 means stop: in protocol 1.0, if both angle limits are 0."""
    if "mode" in table:
        return bool(bus.read(at, table["mode"]))
    return at.protocol != 2 and not any(bus.read(at, table[limit]) for limit in table.limit_registers)


def _require_unique_servo(bus: ServoBus, at: ServoAddress, table: ControlTable) -> None:
    """Raise DeviceFault unless a single servo with this table is at ``at``; NoReply, NotConnected."""
    number = require_unique_id(bus, at).number
    known = find_model(number)
    if known is None or known.table is not table:
        raise DeviceFault(
            f"{bus.name}: servo {at.id} is model {number}, which has another control table", hint=SCAN_HINT
        )


def _require_free_id(bus: ServoBus, at: ServoAddress, changes: Sequence[RegisterChange]) -> None:
    """Raise BadRequest if a change uses an ID at which another servo answers."""
    for change in changes:
        if change.register.name == "id" and _is_id_taken(bus, change.after):
            raise BadRequest(
                f"{bus.name}: servo {at.id} cannot become {change.after}: that ID is already taken",
                hint="mission servo scan  (with the same --robot FILE or --port PORT) lists the IDs that are taken",
            )


def _is_id_taken(bus: ServoBus, servo: int) -> bool:
    """True if any servo answers at an ID, in either protocol.

    Damaged replies count as well, because two servos with this ID would send them.
    """
    protocols: tuple[Protocol, ...] = (1,) if servo > wire2.LAST_ID else (1, 2)
    return any(bus.answers_ping(ServoAddress(servo, protocol)) for protocol in protocols)


def _relax(bus: ServoBus, at: ServoAddress, table: ControlTable) -> bool:
    """Switch the torque of a servo off; return True if it was on. Raises DeviceFault if it stays on."""
    torque = table["torque_enable"]
    if not bus.read(at, torque):
        return False
    with suppress(NoReply):
        bus.write(at, torque, 0)
    if bus.read(at, torque):
        raise DeviceFault(
            f"{bus.name}: servo {at.id}: torque could not be switched off; no setting was written",
            hint=f"hold the arm, then: mission servo torque off {at.id} --port {bus.name}",
        )
    return True


def _verify(bus: ServoBus, at: ServoAddress, change: RegisterChange) -> ServoAddress:
    """Read a change back; return the address of the servo afterwards. Raises DeviceFault, NoReply, NotConnected."""
    name, old = change.register.name, at
    if name == "id":
        at = at._replace(id=change.after)
    with _baud_after(bus, at, change):
        held = bus.read(at, change.register)
    if held != change.after:
        raise DeviceFault(f"{bus.name}: servo {at.id}: {name} holds {held} after {change.after} was written to it")
    if name == "id" and bus.answers_ping(old):
        raise DeviceFault(
            f"{bus.name}: servo {at.id} has its new ID, and another servo still answers at {old.id}",
            hint=f"unplug one of the two, then: mission servo set {old.id} id NEW",
        )
    return at


@contextmanager
def _baud_after(bus: ServoBus, at: ServoAddress, change: RegisterChange) -> Iterator[None]:
    """Context in which the bus has the baud rate that the servo has after ``change``.

    At its end the bus gets its previous rate again.
    """
    before = bus.baud
    if change.register.name != "baud":
        yield
        return
    try:
        bus.baud = baud_of(change.after, at.protocol)
        yield
    finally:
        bus.baud = before
