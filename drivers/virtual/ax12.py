"""A virtual AX-12A as a machine: its control table in memory, and a shaft that turns by it.

In radians from the middle of its range the shaft turns towards its goal at the set speed, at most at the motor's own.
A ``burden`` above the torque limit stalls it, and a stall of a second is an overload. Compliance, punch and LED are
stored as in the real one, but do not shape the movement.
"""

from math import pi

from drivers.dynamixel import models as m
from drivers.dynamixel.wire import Fault
from drivers.sim.servo import Shaft

TABLE_SIZE = 50
STALL_TIME = 1.0
"""Seconds of stalling after which a servo reports an overload."""

FRICTION = 0.05
"""Share of the stall torque that it takes to turn an unburdened shaft."""


class VirtualAX12:
    """One servo, with attributes that a test or a world may set at any time.

    ``present``: False while it has no cable; ``voltage`` in volts; ``temperature`` in degrees Celsius; ``burden``, the
    torque that it must hold against, as a share of its stall torque, positive when it must push anticlockwise.
    """

    def __init__(self, servo: int = 1, *, angle: float = 0.0, model: str = "AX-12A") -> None:
        self.model = m.MODELS[model]
        self.present = True
        self.voltage = 12.0
        self.temperature = 35.0
        self.burden = 0.0
        self.shaft = Shaft(position=angle, goal=angle, speed=0.0)
        self.table = bytearray(TABLE_SIZE)
        self.faults = Fault(0)
        self._turning = 0.0
        self._stalled_since: float | None = None
        self._overloaded = False
        for register in self.model.registers:
            self.set(register, self.model.default(register))
        self.set(m.ID, servo)
        self.power_cycle()

    def get(self, register: m.Register) -> int:
        """Return what the table holds."""
        return register.decode(self.table)

    def set(self, register: m.Register, value: int) -> None:
        """Change the table from inside: no access rule holds."""
        self.table[register.address : register.end] = register.encode(value)

    @property
    def angle(self) -> float:
        """Where the shaft is: radians from the middle of its range, positive anticlockwise seen facing the horn."""
        return self.shaft.position

    @property
    def limp(self) -> bool:
        """True while it exerts no torque, so that a hand can turn it."""
        return not self.get(m.TORQUE_ENABLE) or not self.get(m.TORQUE_LIMIT)

    @property
    def alarm(self) -> bool:
        """True while the LED blinks for a fault."""
        return bool(self.faults & Fault(self.get(m.ALARM_LED)))

    @property
    def wheel(self) -> bool:
        """True in wheel mode: it turns endlessly, and has no goal."""
        return self.get(m.CW_ANGLE_LIMIT) == self.get(m.CCW_ANGLE_LIMIT) == 0

    def turn_by_hand(self, angle: float) -> None:
        """Turn the shaft to ``angle``; a stiff one stays where it is."""
        if self.limp:
            self.shaft.position = self.shaft.goal = angle

    def overload(self) -> None:
        """Make it report an overload, until its torque limit is set anew."""
        self._overloaded = True

    def power_cycle(self) -> None:
        """Cut the power and give it back: what is not in the EEPROM starts from its default."""
        for register in self.model.registers:
            if not register.eeprom:
                self.set(register, self.model.default(register))
        self.set(m.TORQUE_LIMIT, self.get(m.MAX_TORQUE))
        self.set(m.GOAL_POSITION, self._ticks())
        self.rearm()

    def rearm(self) -> None:
        """Forget an overload, as setting the torque limit does; one whose cause remains comes back."""
        self._overloaded = False
        self._stalled_since = None

    def advance(self, now: float) -> None:
        """Let time pass until ``now``, and bring the live registers up to date."""
        if self.wheel:
            self._spin(now)
        else:
            self.shaft.goal = self.model.angle(self.get(m.GOAL_POSITION))
            self.shaft.speed = self._speed()
            before = self.shaft.position
            self.shaft.advance(now)
            self._turning = self._heading(before)
        self._watch_load(now)
        self._protect()
        self._measure()

    def _speed(self) -> float:
        """How fast the shaft turns by itself in rad/s, whatever the direction; 0 when limp or stalled."""
        if self.limp or self._stalled:
            return 0.0
        wanted = self.get(m.MOVING_SPEED)
        if self.wheel:  # there the register is a share of the power
            return (wanted & m.FULL) / m.FULL * self.model.free_speed
        return min((wanted & m.FULL) * self.model.speed_unit or self.model.free_speed, self.model.free_speed)

    def _heading(self, before: float) -> float:
        """The speed it turns at, signed: while on its way, or if it turned since ``before``."""
        way = self.shaft.goal - self.shaft.position or self.shaft.position - before
        return self._speed() * ((way > 0) - (way < 0))

    def _spin(self, now: float) -> None:
        """Turn endlessly; the position wraps at half a turn from the middle."""
        direction = -1 if self.get(m.MOVING_SPEED) & m.CLOCKWISE else 1
        self._turning = direction * self._speed()
        turned = self._turning * max(0.0, now - self.shaft.stamp)
        self.shaft.stamp = max(self.shaft.stamp, now)
        self.shaft.position = self.shaft.goal = (self.shaft.position + turned + pi) % (2 * pi) - pi

    @property
    def _stalled(self) -> bool:
        return not self.limp and abs(self.burden) > self.get(m.TORQUE_LIMIT) / m.FULL

    def _watch_load(self, now: float) -> None:
        if not self._stalled:
            self._stalled_since = None
        elif self._stalled_since is None:
            self._stalled_since = now
        elif now - self._stalled_since >= STALL_TIME:
            self._overloaded = True

    def _protect(self) -> None:
        """Find the faults, and switch the motor off for those that the shutdown mask names."""
        tenths = round(self.voltage * 10)
        well_fed = self.get(m.LOWEST_VOLTAGE) <= tenths <= self.get(m.HIGHEST_VOLTAGE)
        hot = self.temperature > self.get(m.TEMPERATURE_LIMIT)
        self.faults = (
            (Fault(0) if well_fed else Fault.VOLTAGE)
            | (Fault.OVERHEATING if hot else Fault(0))
            | (Fault.OVERLOAD if self._overloaded else Fault(0))
        )
        if self.faults & Fault(self.get(m.SHUTDOWN)):
            self.set(m.TORQUE_LIMIT, 0)
            self.set(m.TORQUE_ENABLE, 0)
            self._turning = 0.0

    def _measure(self) -> None:
        limit = self.get(m.TORQUE_LIMIT)
        drive = self.burden * m.FULL + FRICTION * m.FULL * ((self._turning > 0) - (self._turning < 0))
        self.set(m.PRESENT_POSITION, self._ticks())
        self.set(m.PRESENT_SPEED, m.unsigned(self._turning / self.model.speed_unit))
        self.set(m.PRESENT_LOAD, 0 if self.limp else m.unsigned(max(-limit, min(drive, limit))))
        self.set(m.PRESENT_VOLTAGE, min(max(round(self.voltage * 10), 0), 255))
        self.set(m.PRESENT_TEMPERATURE, min(max(round(self.temperature), 0), 255))
        self.set(m.MOVING, int(self._turning != 0))

    def _ticks(self) -> int:
        """The position as its sensor sees it: stuck at an end in the dead zone beyond the 300 degrees."""
        return self.model.ticks(self.shaft.position)
