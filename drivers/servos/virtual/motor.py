"""The motor of a virtual servo, and the shaft that it turns as the control table asks.

Towards a goal it turns at the set speed, at most at the motor's own; a burden above the torque limit stalls it. Gains,
compliance and acceleration are stored as in the real one, but do not shape the movement.
"""

from math import floor, pi

from drivers.servos.virtual.memory import Memory
from drivers.servos.virtual.settings import Mode
from drivers.sim.servo import FRICTION, Shaft

STALL = 2.0
"""Share of the stall torque that a blocked shaft would need: more than there is."""

TURN = 4096
"""Steps of an STS in a turn, after which its position begins anew."""


class Motor:
    """Turns ``shaft``, in radians from the middle of the range, positive anticlockwise seen facing the horn.

    ``turning`` is how fast it does in rad/s; ``stalled_since`` the time since when it pushes in vain. While it is
    ``weak`` it has no force, whatever the table says. ``frozen`` is the position (ticks) that a broken sensor reports.
    """

    def __init__(self, memory: Memory, angle: float) -> None:
        self.shaft = Shaft(position=angle, goal=angle, speed=0.0)
        self.turning = 0.0
        self.stalled_since: float | None = None
        self.weak = False
        self.frozen: int | None = None
        self._memory = memory
        self._model = memory.model
        table = memory.model.table
        self._goal, self._pace, self._limit = table[table.goal], table[table.speed], table[table.torque_limit]
        self._enable = table["torque_enable"]

    @property
    def stiff(self) -> bool:
        """Whether it is given any force."""
        return not self.weak and bool(self._memory.get(self._enable) and self._memory.get(self._limit))

    def advance(self, now: float, burden: float) -> None:
        """Let time pass until ``now`` under ``burden``, a share of the stall torque."""
        able = self.stiff
        burdened = bool(burden) and abs(burden) > self._strength()
        if able and (burdened or self._blocked):
            able = not burdened
            if self.stalled_since is None:
                self.stalled_since = now
        else:
            self.stalled_since = None
        mode = self._memory.settings.mode
        if mode is Mode.JOINT or mode is Mode.TURNS:
            self._approach(self._speed() if able else 0.0, now)
        else:
            self._spin(self._endless_speed(mode) if able else 0.0, now)

    def drive(self, burden: float) -> float:
        """How hard a stiff one pushes as a share of the stall torque, positive where the ticks rise."""
        way = self.shaft.goal - self.shaft.position if self._blocked else self.turning
        push = burden + (STALL if self._blocked else FRICTION) * ((way > 0) - (way < 0))
        if not push:
            return 0.0
        strength = self._strength()
        return self.sense * max(-strength, min(push, strength))

    def ticks(self) -> int:
        """The position as its sensor sees it; in protocol 1.0 it stops at the ends, unless turns are counted."""
        if self.frozen is not None:
            return self.frozen
        settings = self._memory.settings
        angle = settings.sense * self.shaft.position
        if self._model.protocol == "STS" and settings.mode is not Mode.TURNS:
            return (round(angle / self._model.tick) + self._model.centre + settings.offset) % TURN
        if self._model.protocol == 2 or settings.mode is Mode.TURNS:
            return round(angle / self._model.tick) + self._model.centre + settings.offset
        return self._model.ticks(angle)

    def forget_turns(self) -> None:
        """Count the turns from 0 again: the position wraps at half a turn from the middle."""
        self.shaft.position = self.shaft.goal = (self.shaft.position + pi) % (2 * pi) - pi

    @property
    def sense(self) -> int:
        """1, or -1 where the servo is set to count the other way round."""
        return self._memory.settings.sense

    @property
    def _blocked(self) -> bool:
        """Whether it pushes against a shaft that does not turn."""
        return not self.shaft.grip and abs(self.shaft.goal - self.shaft.position) > self._model.tick

    def _strength(self) -> float:
        """The most that it may push, as a share of its stall torque."""
        return abs(self._memory.get(self._limit)) / self._model.full

    def _approach(self, speed: float, now: float) -> None:
        settings, shaft, before = self._memory.settings, self.shaft, self.shaft.position
        goal = self._memory.get(self._goal)
        if self._model.protocol == "STS" and settings.mode is Mode.JOINT:
            lowest, highest = settings.limits
            seen = shaft.position / self._model.tick + self._model.centre + settings.offset
            goal = min(max(goal, lowest), highest) + floor((seen + 0.5) / TURN) * TURN  # in the turn that it is in
        goal -= settings.offset
        shaft.goal, shaft.speed = settings.sense * self._model.angle(goal), speed
        shaft.advance(now)
        way = shaft.goal - shaft.position or shaft.position - before
        self.turning = shaft.grip * speed * ((way > 0) - (way < 0))

    def _spin(self, speed: float, now: float) -> None:
        self.turning = self.sense * min(max(speed, -self._model.free_speed), self._model.free_speed)
        shaft = self.shaft
        shaft.position += self.turning * max(0.0, now - shaft.stamp)
        shaft.goal, shaft.stamp = shaft.position, max(shaft.stamp, now)
        if self._model.protocol != 2:
            self.forget_turns()

    def _speed(self) -> float:
        """How fast it is to turn to a goal, in rad/s; a setting of 0 is as fast as it can."""
        wanted = abs(self._memory.get(self._pace)) * self._model.speed_unit
        return min(wanted or self._model.free_speed, self._model.free_speed)

    def _endless_speed(self, mode: Mode) -> float:
        """How fast it is to turn without a goal, in rad/s where the ticks rise."""
        get = self._memory.get
        if mode is Mode.SPEED:
            speed = "goal_velocity" if self._model.protocol == 2 else self._model.table.speed
            return get(speed) * self._model.speed_unit
        if self._model.protocol == "STS":
            return get("goal_time") / self._model.full * self._model.free_speed
        if self._model.protocol == 1:
            return get("moving_speed") / self._model.full * self._model.free_speed
        if get("operating_mode"):
            return get("goal_pwm") / self._model.full * self._model.free_speed
        return get("goal_current") / get("current_limit") * self._model.free_speed
