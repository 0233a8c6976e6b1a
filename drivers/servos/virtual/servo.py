"""A virtual Dynamixel or Feetech of any model as a machine: its control table, its motor, and how it protects itself.

A stall of a second is an overload. In protocol 1.0 a servo that shuts down sets its torque limit to 0, and recovers
when that is set anew; in protocol 2.0 it keeps the fault in its table, and recovers by a reboot. An STS has no force
while a fault lasts, and an overload lasts until its torque is switched off.
"""

from math import floor, pi

from drivers.servos.virtual.settings import NO_FAULT, SensorValues, ServoMode, StateRegisters, VirtualTable
from drivers.servos.wire import ServoFault, encode_sts_faults
from drivers.servos.wire2 import decode_hardware_error
from drivers.sim.servo import FRICTION_TORQUE, Shaft

# The motor of a virtual servo, and the shaft that it turns as the control table asks.
#
# Towards a goal it turns at the set speed, at most at the motor's own; a burden above the torque limit stalls it.
# Gains, compliance and acceleration are stored as in the real one, but do not shape the movement.

BLOCKED_LOAD = 2.0
"""Share of the stall torque that a blocked shaft would need: more than there is."""

STEPS_PER_TURN = 4096
"""Steps of an STS in a turn, after which its position begins anew."""


class VirtualMotor:
    """Turns ``shaft``, in radians from the middle of the range, positive anticlockwise seen facing the horn.

    ``turning`` is how fast it does in rad/s; ``stalled_since`` the time since when it pushes in vain. While it is
    ``is_disabled`` it has no force, whatever the table says. ``frozen_position`` is the position (ticks) that a broken sensor reports.
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
        """Whether it is given any force."""
        return not self.is_disabled and bool(
            self._table.get(self._enable_register) and self._table.get(self._limit_register)
        )

    def advance(self, now: float, load: float) -> None:
        """Let time pass until ``now`` under ``load``, a share of the stall torque."""
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
        """How hard a stiff one pushes as a share of the stall torque, positive where the ticks rise."""
        way = self.shaft.goal - self.shaft.position if self._blocked else self.velocity
        push = load + (BLOCKED_LOAD if self._blocked else FRICTION_TORQUE) * ((way > 0) - (way < 0))
        if not push:
            return 0.0
        strength = self._max_effort()
        return self.direction * max(-strength, min(push, strength))

    def ticks(self) -> int:
        """The position as its sensor sees it; in protocol 1.0 it stops at the ends, unless turns are counted."""
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
        """Count the turns from 0 again: the position wraps at half a turn from the middle."""
        self.shaft.position = self.shaft.goal = (self.shaft.position + pi) % (2 * pi) - pi

    @property
    def direction(self) -> int:
        """1, or -1 where the servo is set to count the other way round."""
        return self._table.settings.direction

    @property
    def _blocked(self) -> bool:
        """Whether it pushes against a shaft that does not turn."""
        return not self.shaft.motion_factor and abs(self.shaft.goal - self.shaft.position) > self._model.tick

    def _max_effort(self) -> float:
        """The most that it may push, as a share of its stall torque."""
        return abs(self._table.get(self._limit_register)) / self._model.full_torque

    def _approach(self, speed: float, now: float) -> None:
        settings, shaft, before = self._table.settings, self.shaft, self.shaft.position
        goal = self._table.get(self._goal_register)
        if self._model.protocol == "STS" and settings.mode is ServoMode.JOINT:
            lowest, highest = settings.limits
            seen = shaft.position / self._model.tick + self._model.centre_tick + settings.offset
            goal = (
                min(max(goal, lowest), highest) + floor((seen + 0.5) / STEPS_PER_TURN) * STEPS_PER_TURN
            )  # in the turn that it is in
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
        """How fast it is to turn to a goal, in rad/s; a setting of 0 is as fast as it can."""
        wanted = abs(self._table.get(self._speed_register)) * self._model.speed_unit
        return min(wanted or self._model.free_speed, self._model.free_speed)

    def _endless_speed(self, mode: ServoMode) -> float:
        """How fast it is to turn without a goal, in rad/s where the ticks rise."""
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
"""What ``torque_enable`` takes to make where the servo stands its middle."""


def apply_write_rules(memory: VirtualTable, address: int, data: bytes) -> bytes:
    """Return what ``memory`` holds at ``address`` once ``data`` was written there; the maker is silent on the rest.

    Read-only registers stay, values come within their bounds, and a place that was made the middle moves the offset.
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
"""Seconds for which a servo that starts anew is silent."""

WATCHDOG_STEP = 0.02
"""Seconds that one step of the bus watchdog is worth."""

MAX_LAG = 0.005
"""Seconds that a shaft may lag behind while nobody looks."""


class VirtualServo(VirtualTable):
    """One servo, with attributes that a test or a world may set at any time.

    ``present``: False while it has no cable; ``voltage`` in volts; ``temperature`` in degrees Celsius; ``load``, the
    torque that it must hold against, as a share of its stall torque, positive when it must push anticlockwise;
    ``damage``, faults of its hardware (ENCODER, SHOCK) that protocol 2.0 can tell. ``registered_write`` is a registered write.
    ``reply_skew``, the seconds by which it replies later than its return delay says; ``booted_at``, when its clock was 0.
    ``shaft.grip`` is 0 while the shaft is blocked, and -1 while it turns the wrong way.
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
        """The shaft, in radians from the middle of the range, positive anticlockwise seen facing the horn."""
        return self._motor.shaft

    @property
    def angle(self) -> float:
        """Where the shaft is, in radians."""
        return self._motor.shaft.position

    @property
    def is_moving(self) -> bool:
        """Whether the shaft moves."""
        return self._motor.velocity != 0

    @property
    def limp(self) -> bool:
        """True while it exerts no torque, so that a hand can turn it."""
        return self._starts_at is not None or not self._motor.has_torque

    @property
    def is_awake(self) -> bool:
        """False while its supply is too low to run at all, or it starts anew."""
        return self._starts_at is None

    @property
    def is_listening(self) -> bool:
        """Whether it can hear the bus, at the right rate."""
        return self.present and self._starts_at is None

    def turn_by_hand(self, angle: float) -> None:
        """Turn the shaft to ``angle``; a stiff one stays where it is."""
        if self.limp:
            self.shaft.position = self.shaft.goal = angle

    def freeze(self, *, on: bool = True) -> None:
        """Let its sensor report where it is now, wherever it turns."""
        self._motor.frozen_position = None
        self._motor.frozen_position = self._motor.ticks() if on else None

    def overload(self) -> None:
        """Make it report an overload, until it is cured: by a new torque limit, a reboot (2.0), torque off (STS)."""
        self._is_overloaded = True

    def brown_out(self, seconds: float = REBOOT_TIME) -> None:
        """Let the supply dip: it is limp and silent for so long, then starts anew. A reboot is the same to it."""
        self._starts_at = self.shaft.stamp + seconds

    def power_cycle(self) -> None:
        """Cut the power and give it back: what is not in the EEPROM starts from its default."""
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
        """Take every setting back to what it was as delivered but those named, and start anew."""
        for register in self.model.table.registers.values():
            if register.name not in keep:
                self.set(register, self.model.default(register))
        self.power_cycle()

    def clear_turns(self) -> None:
        """Count the turns from 0 again."""
        self._motor.clear_turns()

    def write(self, address: int, data: bytes, *, clamp: bool = False) -> ServoFault:
        """Take a write from the bus; return why it was refused. ``clamp`` brings a goal within the limits instead."""
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
        """End an overload; one whose cause remains comes back."""
        self._is_overloaded = False
        self._motor.stalled_since = None

    def read(self, address: int, size: int) -> bytes:
        """Return what the bus reads of the table, as it is by the time that was let pass; nothing beyond its end."""
        if not size or address + size > len(self.table):
            return b""
        if address + size > self._volatile:
            self._readings.update(self.table, self._sense())
            if self.has("status"):
                self.set("status", encode_sts_faults(self.faults))
        return bytes(self.table[address : address + size])

    def register_write(self, address: int, data: bytes) -> ServoFault:
        """Take a write that is to be carried out later; return why it was refused."""
        reason = self.refusal(address, data)
        if not reason:
            self.registered_write = (address, data)
            self.set("registered", 1)
        return reason

    def run_registered_write(self) -> ServoFault:
        """Carry out what is held; return why that was refused after all."""
        held, self.registered_write = self.registered_write, None
        self.set("registered", 0)
        return self.write(*held) if held else NO_FAULT

    def on_bus_activity(self, now: float) -> None:
        """Take note that the bus is alive."""
        self._bus_active_at = now

    def advance(self, now: float) -> None:
        """Let time pass until ``now``."""
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
        """Let time pass if enough has to matter to a goal; cheaper than ``advance`` where many are written at once."""
        if now - self.shaft.stamp >= MAX_LAG:
            self.advance(now)

    def _watch_bus(self, now: float) -> None:
        """Stop if the bus has been silent for longer than the bus watchdog allows."""
        if 0 < self.get("bus_watchdog") * WATCHDOG_STEP < now - self._bus_active_at:
            self.set("bus_watchdog", -1)
            self.set("goal_velocity", 0)
            self.set("goal_position", self._motor.ticks())

    def _protect(self) -> None:
        """Find the faults, and switch the motor off for those that the shutdown mask names."""
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
            return  # its torque stays switched on: force returns with the end of the fault
        else:
            self.faults = found
            shut = bool(found) and bool(found & settings.shutdown)
            if shut:
                self.set("torque_limit", 0)
        if shut:
            self.set("torque_enable", 0)
            self._motor.velocity = 0.0

    def _latch(self, faults: ServoFault) -> bool:
        """Keep the faults that shut it down until it is rebooted, while the others pass; return whether it is shut."""
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
    """Return what register ``hardware_error`` says of ``faults``."""
    return sum(1 << bit for bit in range(6) if faults & decode_hardware_error(1 << bit)) if faults else 0
