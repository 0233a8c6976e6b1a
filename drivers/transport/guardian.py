"""Actuator guardian: executes commands, and stops its actuators when the driver is silent."""

from collections.abc import Callable
from typing import Protocol

from drivers.transport import guardian_wire
from drivers.transport.lines import LineFinder

SERVO_SPEED = 300.0
"""Maximum speed in degrees per second at which a guardian moves a servo towards its goal."""


class Actuators(Protocol):
    """Two actuators of a guardian. Methods raise OSError if the hardware is gone."""

    def set_goals(self, first: int, second: int, now: float) -> None:
        """Set the goals of both actuators: power in thousandths, or angles in degrees."""
        ...

    def rest(self, now: float) -> None:
        """Stop both actuators: wheels stand, servos stay at their angles."""
        ...

    def advance(self, now: float) -> None:
        """Advance both actuators to time ``now``."""
        ...

    def positions(self) -> tuple[int, int]:
        """Return the current power (thousandths) or angles (degrees) of both actuators, as in a report."""
        ...


class ActuatorGuardian:
    """Executes the commands of a driver on ``actuators``, and stops them when the driver is silent.

    They stop after ``WATCHDOG_TIMEOUT`` seconds without a line. ``boot`` is the number of this start, which commands
    must have.
    """

    def __init__(self, actuators: Actuators, boot: int, now: float) -> None:
        self.boot = boot
        self.received_at = now
        self._actuators = actuators
        self._lines = LineFinder(guardian_wire.MAX_LINE_LENGTH)
        self._resting = True

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle bytes received at time ``now``; return the replies."""
        self.poll(now)
        return b"".join(self._execute(line, now) for line in self._lines.feed(data))

    def poll(self, now: float) -> None:
        """Advance to time ``now``, and stop the actuators if the watchdog has expired."""
        if not self._resting and now - self.received_at > guardian_wire.WATCHDOG_TIMEOUT:
            self.rest(now)
        self._actuators.advance(now)

    def rest(self, now: float) -> None:
        """Stop the actuators."""
        self._resting = True
        self._actuators.rest(now)

    def _execute(self, line: bytes, now: float) -> bytes:
        try:
            message = guardian_wire.parse_line(line)
        except ValueError:
            return b""
        self.received_at = now
        if isinstance(message, guardian_wire.GuardianCommand) and message.boot == self.boot:
            self._resting = False
            self._actuators.set_goals(message.first, message.second, now)
        return (
            guardian_wire.pack_report(self.boot, *self._actuators.positions())
            if isinstance(message, guardian_wire.ReportRequest)
            else b""
        )


class GuardianWheels:
    """Two motors of a guardian. ``turn`` sets the power of both, as shares of full power, -1..1."""

    def __init__(self, turn: Callable[[float, float], None]) -> None:
        self._turn = turn
        self._setpoint = (0, 0)
        turn(0.0, 0.0)

    def set_goals(self, first: int, second: int, now: float) -> None:  # noqa: ARG002 - motors obey at once
        """Set the power of both motors, clamped to full power."""
        setpoint = (
            min(max(first, -guardian_wire.FULL_POWER), guardian_wire.FULL_POWER),
            min(max(second, -guardian_wire.FULL_POWER), guardian_wire.FULL_POWER),
        )
        if setpoint != self._setpoint:
            self._setpoint = setpoint
            self._turn(setpoint[0] / guardian_wire.FULL_POWER, setpoint[1] / guardian_wire.FULL_POWER)

    def rest(self, now: float) -> None:  # noqa: ARG002
        """Stop the motors. The command is sent even if they are stopped already."""
        self._setpoint = (0, 0)
        self._turn(0.0, 0.0)

    def advance(self, now: float) -> None:
        """Do nothing: motors keep their speed."""

    def positions(self) -> tuple[int, int]:
        """Return the setpoints of both motors in thousandths of full power."""
        return self._setpoint


class GuardianServos:
    """Two hobby servos of a guardian, moved at ``SERVO_SPEED`` at most.

    ``pulse`` sets a servo (0 or 1) to an angle in whole degrees. ``angles`` are the angles set by an earlier program;
    None if unknown, as for a servo that has had no pulse.
    """

    def __init__(self, pulse: Callable[[int, int], None], angles: tuple[int | None, int | None]) -> None:
        self._pulse = pulse
        self._sent = list(angles)
        self._exact: list[float | None] = [None if each is None else float(each) for each in angles]
        self._goals: list[float | None] = list(self._exact)
        self._stamp: float | None = None

    def set_goals(self, first: int, second: int, now: float) -> None:
        """Set the goals of both servos. A servo whose angle is unknown moves to its goal at once."""
        self.advance(now)
        for number, goal in enumerate((first, second)):
            if 0 <= goal <= 180:
                self._goals[number] = float(goal)
                if self._exact[number] is None:
                    self._exact[number] = float(goal)
                    self._send(number)

    def rest(self, now: float) -> None:
        """Stop both servos at their current setpoints."""
        self.advance(now)
        self._goals = [None if each is None else float(each) for each in self._sent]
        self._exact = list(self._goals)

    def advance(self, now: float) -> None:
        """Move the servos towards their goals."""
        reach = SERVO_SPEED * (0.0 if self._stamp is None else min(max(now - self._stamp, 0.0), 0.1))
        self._stamp = now
        for number, (exact, goal) in enumerate(zip(self._exact, self._goals, strict=True)):
            if exact is not None and goal is not None and exact != goal:
                self._exact[number] = exact + min(max(goal - exact, -reach), reach)
                self._send(number)

    def positions(self) -> tuple[int, int]:
        """Return the current setpoints of both servos in degrees.

        A servo that has had no pulse so far has ``guardian_wire.UNKNOWN_ANGLE``.
        """
        first, second = (guardian_wire.UNKNOWN_ANGLE if each is None else each for each in self._sent)
        return first, second

    def _send(self, number: int) -> None:
        exact = self._exact[number]
        degree = None if exact is None else round(exact)
        if degree is not None and degree != self._sent[number]:
            self._sent[number] = degree
            self._pulse(number, degree)
