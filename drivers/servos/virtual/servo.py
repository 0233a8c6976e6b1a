"""Virtual Dynamixel or Feetech servo of any model: control table, motor, and protection.

A stall of one second is an overload. In protocol 1.0 a shutdown sets the torque limit to 0, and writing a new limit
ends it. In protocol 2.0 the fault stays in the table until a reboot. An STS has no force while a fault lasts, and an
overload lasts until its torque is switched off.
"""

from math import floor, pi

from drivers.servos.virtual.settings import NO_FAULT, SensorValues, ServoMode, StateRegisters, VirtualTable
from drivers.servos.wire import ServoFault, encode_sts_faults
from drivers.servos.wire2 import decode_hardware_error
from drivers.sim.servo import FRICTION_TORQUE, Shaft

# The motor and the shaft of a virtual servo, controlled by its control table.
#
# It turns towards its goal at the set speed, at most at the motor's; a load above the torque limit stalls it.
# Gains, compliance and acceleration are stored as in the real one, but do not shape the movement.

BLOCKED_LOAD = 2.0
"""Load of a blocked shaft as a share of the stall torque: more than the motor has."""

STEPS_PER_TURN = 4096
"""Steps per turn of an STS, after which its position wraps."""


class VirtualMotor:
    """Motor that turns ``shaft``, in radians from the middle of its range, positive anticlockwise seen facing the horn.

    ``velocity`` is in rad/s; ``stalled_since`` is the time at which the current stall began, None without a stall.
    While ``is_disabled`` is True it has no torque, even if the control table enables it. ``frozen_position`` (ticks) is
    the reading of a broken sensor.
    """

    def __init__(self, memory: VirtualTable, angle: float) -> None:
        self.shaft = Shaft(position=angle, goal=angle, speed=0.0)
        self.velocity = 0.0
        self.stalled_since: float | None = None
        self.is_disabled = False
        self.frozen_position: int | None = None
        self._table = memory
        self._model = memory.model
        table = memory.model.table
        self._goal_register, self._speed_register, self._limit_register = (
            table[table.goal],
            table[table.speed],
            table[table.torque_limit],
        )
        self._enable_register = table["torque_enable"]

    @property
    def has_torque(self) -> bool:
        """True if torque is enabled with a limit above 0."""
        return not self.is_disabled and bool(
            self._table.get(self._enable_register) and self._table.get(self._limit_register)
        )

    def advance(self, now: float, load: float) -> None:
        """Advance to time ``now`` under ``load``, a share of the stall torque."""
        able = self.has_torque
        burdened = bool(load) and abs(load) > self._max_effort()
        if able and (burdened or self._blocked):
            able = not burdened
            if self.stalled_since is None:
                self.stalled_since = now
        else:
            self.stalled_since = None
        mode = self._table.settings.mode
        if mode is ServoMode.JOINT or mode is ServoMode.MULTI_TURN:
            self._approach(self._speed() if able else 0.0, now)
        else:
            self._spin(self._endless_speed(mode) if able else 0.0, now)

    def effort(self, load: float) -> float:
        """Return the motor's effort with torque on, as a share of the stall torque; positive: to higher ticks."""
        way = self.shaft.goal - self.shaft.position if self._blocked else self.velocity
        push = load + (BLOCKED_LOAD if self._blocked else FRICTION_TORQUE) * ((way > 0) - (way < 0))
        if not push:
            return 0.0
        strength = self._max_effort()
        return self.direction * max(-strength, min(push, strength))

    def ticks(self) -> int:
        """Return the position (ticks) that the motor's sensor reports.

        In protocol 1.0 it stops at the ends of the sensor's range, except in multi-turn mode.
        """
        if self.frozen_position is not None:
            return self.frozen_position
        settings = self._table.settings
        angle = settings.direction * self.shaft.position
        if self._model.protocol == "STS" and settings.mode is not ServoMode.MULTI_TURN:
            return (round(angle / self._model.tick) + self._model.centre_tick + settings.offset) % STEPS_PER_TURN
        if self._model.protocol == 2 or settings.mode is ServoMode.MULTI_TURN:
            return round(angle / self._model.tick) + self._model.centre_tick + settings.offset
        return self._model.ticks(angle)

    def clear_turns(self) -> None:
        """Clear the counted turns: the position wraps at half a turn from the middle."""
        self.shaft.position = self.shaft.goal = (self.shaft.position + pi) % (2 * pi) - pi

    @property
    def direction(self) -> int:
        """Sign of the motor's rotation: 1, or -1 if the servo is configured to count positions the other way round."""
        return self._table.settings.direction

    @property
    def _blocked(self) -> bool:
        """True if the motor pushes against a blocked shaft."""
        return not self.shaft.motion_factor and abs(self.shaft.goal - self.shaft.position) > self._model.tick

    def _max_effort(self) -> float:
        """Return the torque limit as a share of the stall torque."""
        return abs(self._table.get(self._limit_register)) / self._model.full_torque

    def _approach(self, speed: float, now: float) -> None:
        settings, shaft, before = self._table.settings, self.shaft, self.shaft.position
        goal = self._table.get(self._goal_register)
        if self._model.protocol == "STS" and settings.mode is ServoMode.JOINT:
            lowest, highest = settings.limits
            seen = shaft.position / self._model.tick + self._model.centre_tick + settings.offset
            turn = floor((seen + 0.5) / STEPS_PER_TURN)  # its current turn
            goal = min(max(goal, lowest), highest) + turn * STEPS_PER_TURN
        goal -= settings.offset
        shaft.goal, shaft.speed = settings.direction * self._model.angle(goal), speed
        shaft.advance(now)
        way = shaft.goal - shaft.position or shaft.position - before
        self.velocity = shaft.motion_factor * speed * ((way > 0) - (way < 0))

    def _spin(self, speed: float, now: float) -> None:
        self.velocity = self.direction * min(max(speed, -self._model.free_speed), self._model.free_speed)
        shaft = self.shaft
        shaft.position += self.velocity * max(0.0, now - shaft.stamp)
        shaft.goal, shaft.stamp = shaft.position, max(shaft.stamp, now)
        if self._model.protocol != 2:
            self.clear_turns()

    def _speed(self) -> float:
        """Return the speed towards a goal, in rad/s; a setting of 0 means full speed."""
        wanted = abs(self._table.get(self._speed_register)) * self._model.speed_unit
        return min(wanted or self._model.free_speed, self._model.free_speed)

    def _endless_speed(self, mode: ServoMode) -> float:
        """Return the speed of endless rotation in ``mode``, in rad/s, positive in the direction of rising ticks."""
        get = self._table.get
        if mode is ServoMode.SPEED:
            speed = "goal_velocity" if self._model.protocol == 2 else self._model.table.speed
            return get(speed) * self._model.speed_unit
        if self._model.protocol == "STS":
            return get("goal_time") / self._model.full_torque * self._model.free_speed
        if self._model.protocol == 1:
            return get("moving_speed") / self._model.full_torque * self._model.free_speed
        if get("operating_mode"):
            return get("goal_pwm") / self._model.full_torque * self._model.free_speed
        return get("goal_current") / get("current_limit") * self._model.free_speed


SET_MIDDLE = 128
"""Value of ``torque_enable`` that makes the current position the middle."""


def apply_write_rules(memory: VirtualTable, address: int, data: bytes) -> bytes:
    """Return the bytes of the table in ``memory`` from ``address`` on, after an STS has accepted a write of ``data``.

    Read-only registers keep their value, other values are clamped to the bounds of their register, and ``SET_MIDDLE``
    changes the offset. The maker documents no other rules.
    """
    end = address + len(data)
    held = bytearray(memory.table[address:end].ljust(len(data), b"\0"))
    for row in memory.span(address, len(data)).rows:
        first = row.address - address
        if not row.writable or first < 0 or row.end > end:
            continue
        value = row.decode(data, address)
        if row.name == "torque_enable" and value == SET_MIDDLE:
            offset = memory.get("position_offset") + memory.get("present_position") - memory.model.centre_tick
            memory.set("position_offset", (offset + 2048) % 4096 - 2048 or 0)
            value = memory.get(row)
        held[first : first + row.size] = row.encode(min(max(value, row.lower), row.upper))
    return bytes(held)[: max(0, len(memory.table) - address)]


STALL_TIME = 1.0
"""Seconds of stalling after which a servo reports an overload."""

REBOOT_TIME = 0.2
"""Seconds for which a rebooting servo is silent."""

WATCHDOG_STEP = 0.02
"""Seconds per step of the bus watchdog."""

MAX_LAG = 0.005
"""Maximum seconds by which the simulated shaft may be behind the bus time when its servo is written to."""


class VirtualServo(VirtualTable):
    """A virtual servo, with attributes that a test or a simulated world may set at any time.

    - ``present``: False without a cable.
    - ``voltage`` in volts, ``temperature`` in degrees Celsius.
    - ``load``: torque on the shaft, as a share of its stall torque; positive if the servo must push anticlockwise.
    - ``damage``: hardware faults (ENCODER, SHOCK) of protocol 2.0.
    - ``registered_write``: a write that waits for ACTION.
    - ``reply_skew``: seconds added to the return delay.
    - ``booted_at``: the time at which the servo's clock was 0.
    - ``shaft.motion_factor``: 0 while the shaft is blocked, -1 while it turns the wrong way.
    """

    def __init__(self, servo: int = 1, *, model: str = "AX-12A", angle: float = 0.0) -> None:
        super().__init__(model)
        self.present = True
        self.voltage = self.model.nominal_voltage
        self.temperature = 35.0
        self.load = 0.0
        self.damage = NO_FAULT
        self.faults = NO_FAULT
        self.registered_write: tuple[int, bytes] | None = None
        self.reply_skew = 0.0
        self.booted_at = 0.0
        self._motor = VirtualMotor(self, angle)
        self._readings = StateRegisters(self.model)
        self._watches_bus = self.has("bus_watchdog")
        self._is_overloaded = False
        self._starts_at: float | None = None
        self._bus_active_at = self._now = 0.0
        self.set("id", servo)
        self.power_cycle()

    @property
    def shaft(self) -> Shaft:
        """Shaft of the servo, in radians from the middle of its range, positive anticlockwise facing the horn."""
        return self._motor.shaft

    @property
    def angle(self) -> float:
        """Angle of the shaft in radians."""
        return self._motor.shaft.position

    @property
    def is_moving(self) -> bool:
        """True while the shaft moves."""
        return self._motor.velocity != 0

    @property
    def limp(self) -> bool:
        """True while the servo exerts no torque, so that a hand can turn it."""
        return self._starts_at is not None or not self._motor.has_torque

    @property
    def is_awake(self) -> bool:
        """False while the servo reboots, or its supply is too low to run."""
        return self._starts_at is None

    @property
    def is_listening(self) -> bool:
        """True if the servo is connected and awake."""
        return self.present and self._starts_at is None

    def turn_by_hand(self, angle: float) -> None:
        """Turn the shaft by hand to ``angle`` (radians); it does not turn while the servo has torque."""
        if self.limp:
            self.shaft.position = self.shaft.goal = angle

    def freeze(self, *, on: bool = True) -> None:
        """Freeze the sensor at its current position, or release it."""
        self._motor.frozen_position = None
        self._motor.frozen_position = self._motor.ticks() if on else None

    def overload(self) -> None:
        """Set an overload until it is reset: by a new torque limit (1.0), a reboot (2.0), or torque off (STS)."""
        self._is_overloaded = True

    def brown_out(self, seconds: float = REBOOT_TIME) -> None:
        """Dip the supply: no torque and no replies for ``seconds``, then a restart. A reboot has the same effect."""
        self._starts_at = self.shaft.stamp + seconds

    def power_cycle(self) -> None:
        """Switch the power off and on: the RAM starts from its defaults."""
        self._starts_at = self.registered_write = None
        self._is_overloaded = False
        self.restore_eeprom()
        for register in self.model.table.registers.values():
            if not register.eeprom:
                self.set(register, self.model.default(register))
        self.set(self.model.table.torque_limit, self.get(self.model.table.torque_ceiling))
        if abs(self.angle) > pi:
            self._motor.clear_turns()
        self.set(self.model.table.goal, self._motor.ticks())

    def factory_reset(self, *keep: str) -> None:
        """Reset all settings except registers ``keep`` to factory defaults, and restart."""
        for register in self.model.table.registers.values():
            if register.name not in keep:
                self.set(register, self.model.default(register))
        self.power_cycle()

    def clear_turns(self) -> None:
        """Clear the counted turns."""
        self._motor.clear_turns()

    def write(self, address: int, data: bytes, *, clamp: bool = False) -> ServoFault:
        """Execute a write; return the fault of a refused one. ``clamp`` limits a goal instead of refusing it."""
        fitting = self.clamp_goal(address, data) if clamp else data
        if self.model.protocol == "STS":
            fitting = apply_write_rules(self, address, data)
        elif reason := self.refusal(address, fitting):
            return reason
        self.table[address : address + len(data)] = fitting
        self.save_eeprom()
        touched = self.span(address, len(data)).names
        if self.model.table.goal in touched and self.settings.goal_enables_torque:
            self.set("torque_enable", 1)
        renewed = self.model.protocol == 1 and "torque_limit" in touched and self.get("torque_limit")
        if renewed or (self.model.protocol == "STS" and "torque_enable" in touched and not self.get("torque_enable")):
            self._clear_overload()
        self._protect()
        return NO_FAULT

    def _clear_overload(self) -> None:
        """End the reported overload.

        If the shaft is still blocked, the servo reports an overload again after ``STALL_TIME``.
        """
        self._is_overloaded = False
        self._motor.stalled_since = None

    def read(self, address: int, size: int) -> bytes:
        """Return ``size`` bytes of the control table, with current readings; empty if they would exceed the table."""
        if not size or address + size > len(self.table):
            return b""
        if address + size > self._volatile:
            self._readings.update(self.table, self._sense())
            if self.has("status"):
                self.set("status", encode_sts_faults(self.faults))
        return bytes(self.table[address : address + size])

    def register_write(self, address: int, data: bytes) -> ServoFault:
        """Store a write until the instruction ACTION executes it; return the fault for which it is refused, if any."""
        reason = self.refusal(address, data)
        if not reason:
            self.registered_write = (address, data)
            self.set("registered", 1)
        return reason

    def run_registered_write(self) -> ServoFault:
        """Execute the registered write; return the fault of a refused one."""
        held, self.registered_write = self.registered_write, None
        self.set("registered", 0)
        return self.write(*held) if held else NO_FAULT

    def on_bus_activity(self, now: float) -> None:
        """Record bus activity, for the bus watchdog."""
        self._bus_active_at = now

    def advance(self, now: float) -> None:
        """Advance the simulation to time ``now``."""
        self._now = now
        if self._starts_at is not None:
            self.shaft.stamp = max(self.shaft.stamp, now)
            if now < self._starts_at:
                return
            self.power_cycle()
        if self._watches_bus:
            self._watch_bus(now)
        self._motor.advance(now, self.load)
        since = self._motor.stalled_since
        if since is not None and now - since >= STALL_TIME:
            self._is_overloaded = True
        self._protect()

    def catch_up(self, now: float) -> None:
        """Advance if the lag exceeds ``MAX_LAG``; cheaper than ``advance`` when many servos are written at once."""
        if now - self.shaft.stamp >= MAX_LAG:
            self.advance(now)

    def _watch_bus(self, now: float) -> None:
        """Stop if the bus watchdog has expired."""
        if 0 < self.get("bus_watchdog") * WATCHDOG_STEP < now - self._bus_active_at:
            self.set("bus_watchdog", -1)
            self.set("goal_velocity", 0)
            self.set("goal_position", self._motor.ticks())

    def _protect(self) -> None:
        """Update the faults of the servo, and switch its motor off for those in the register ``shutdown``."""
        settings = self.settings
        found = ServoFault.OVERLOAD if self._is_overloaded else NO_FAULT
        if not settings.voltage_limits[0] <= round(self.voltage * 10) <= settings.voltage_limits[1]:
            found |= ServoFault.VOLTAGE
        if self.temperature > settings.max_temperature:
            found |= ServoFault.OVERHEATING
        if self.model.protocol == 2:
            shut = self._latch(found | self.damage)
        elif self.model.protocol == "STS":
            self.faults = found
            self._motor.is_disabled = bool(found) and bool(encode_sts_faults(found) & settings.shutdown)
            return  # its torque stays enabled: it returns with the end of the fault
        else:
            self.faults = found
            shut = bool(found) and bool(found & settings.shutdown)
            if shut:
                self.set("torque_limit", 0)
        if shut:
            self.set("torque_enable", 0)
            self._motor.velocity = 0.0

    def _latch(self, faults: ServoFault) -> bool:
        """Update the hardware errors of protocol 2.0 with ``faults``; return True if the servo is shut down.

        A fault that causes a shutdown is kept until a reboot. All other faults are cleared once they have ended.
        """
        mask = self.settings.shutdown
        error = self.get("hardware_error")
        if not (error or faults):
            self.faults = NO_FAULT
            return False
        error = error & mask | _encode_hardware_error(faults)
        self.set("hardware_error", error)
        self.faults = decode_hardware_error(error)
        return bool(error & mask)

    def _sense(self) -> SensorValues:
        motor = self._motor
        return SensorValues(
            position=motor.ticks(),
            velocity=motor.direction * motor.velocity,
            drive=0.0 if self.limp else motor.effort(self.load),
            arrived=motor.shaft.position == motor.shaft.goal,
            voltage=self.voltage,
            temperature=self.temperature,
            now=self._now - self.booted_at,
        )


def _encode_hardware_error(faults: ServoFault) -> int:
    """Return the value of register ``hardware_error`` for ``faults``."""
    return sum(1 << bit for bit in range(6) if faults & decode_hardware_error(1 << bit)) if faults else 0
