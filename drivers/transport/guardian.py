"""The keeper's end of the line, whatever is in its hands: on a Raspberry Pi a process, in a simulation a device."""

from collections.abc import Callable
from typing import Protocol

from drivers.transport import guardian_wire
from drivers.transport.lines import LineFinder

SERVO_SPEED = 300.0
"""Degrees per second at which a keeper lets a servo go at most, whatever it is sent."""


class Actuators(Protocol):
    """What a keeper holds. Raises OSError where the hardware has gone."""

    def set_goals(self, first: int, second: int, now: float) -> None:
        """Go there."""
        ...

    def rest(self, now: float) -> None:
        """Go nowhere any more: wheels stand, servos stay where they are."""
        ...

    def advance(self, now: float) -> None:
        """Let the time pass."""
        ...

    def positions(self) -> tuple[int, int]:
        """Return where both are."""
        ...


class ActuatorGuardian:
    """Obeys lines, and lets what is in its ``hands`` rest after ``wire.WATCHDOG_TIMEOUT`` seconds without one."""

    def __init__(self, actuators: Actuators, boot: int, now: float) -> None:
        self.boot = boot
        self.received_at = now
        self._actuators = actuators
        self._lines = LineFinder(guardian_wire.MAX_LINE_LENGTH)
        self._resting = True

    def feed(self, data: bytes, now: float) -> bytes:
        """Take what has come at time ``now``; return the answers."""
        self.poll(now)
        return b"".join(self._execute(line, now) for line in self._lines.feed(data))

    def poll(self, now: float) -> None:
        """Let the time pass until ``now``."""
        if not self._resting and now - self.received_at > guardian_wire.WATCHDOG_TIMEOUT:
            self.rest(now)
        self._actuators.advance(now)

    def rest(self, now: float) -> None:
        """Let all rest."""
        self._resting = True
        self._actuators.rest(now)

    def _execute(self, line: bytes, now: float) -> bytes:
        try:
            found = guardian_wire.parse_line(line)
        except ValueError:
            return b""
        self.received_at = now
        if isinstance(found, guardian_wire.GuardianCommand) and found.boot == self.boot:
            self._resting = False
            self._actuators.set_goals(found.first, found.second, now)
        return (
            guardian_wire.pack_report(self.boot, *self._actuators.positions())
            if isinstance(found, guardian_wire.ReportRequest)
            else b""
        )


class GuardianWheels:
    """Two motors: ``turn`` sets them to shares of full power, -1..1."""

    def __init__(self, turn: Callable[[float, float], None]) -> None:
        self._turn = turn
        self._setpoint = (0, 0)
        turn(0.0, 0.0)

    def set_goals(self, first: int, second: int, now: float) -> None:  # noqa: ARG002 - motors obey at once
        """Turn so."""
        wanted = (
            min(max(first, -guardian_wire.FULL_POWER), guardian_wire.FULL_POWER),
            min(max(second, -guardian_wire.FULL_POWER), guardian_wire.FULL_POWER),
        )
        if wanted != self._setpoint:
            self._setpoint = wanted
            self._turn(wanted[0] / guardian_wire.FULL_POWER, wanted[1] / guardian_wire.FULL_POWER)

    def rest(self, now: float) -> None:  # noqa: ARG002
        """Stand, also where they are believed to stand."""
        self._setpoint = (0, 0)
        self._turn(0.0, 0.0)

    def advance(self, now: float) -> None:
        """Do nothing: they turn by themselves."""

    def positions(self) -> tuple[int, int]:
        """Return what they were told."""
        return self._setpoint


class GuardianServos:
    """Two hobby servos, led no faster than ``SERVO_SPEED``: ``pulse`` sends a servo (0, 1) to a degree.

    ``standing`` is where they have been sent already by who has gone; None for one that has got no pulse yet.
    """

    def __init__(self, pulse: Callable[[int, int], None], angles: tuple[int | None, int | None]) -> None:
        self._pulse = pulse
        self._sent = list(angles)
        self._exact: list[float | None] = [None if each is None else float(each) for each in angles]
        self._goals: list[float | None] = list(self._exact)
        self._stamp: float | None = None

    def set_goals(self, first: int, second: int, now: float) -> None:
        """Lead both there; one that has got no pulse yet goes at once, for nobody knows from where."""
        self.advance(now)
        for number, goal in enumerate((first, second)):
            if 0 <= goal <= 180:
                self._goals[number] = float(goal)
                if self._exact[number] is None:
                    self._exact[number] = float(goal)
                    self._send(number)

    def rest(self, now: float) -> None:
        """Stay where they are."""
        self.advance(now)
        self._goals = [None if each is None else float(each) for each in self._sent]
        self._exact = list(self._goals)

    def advance(self, now: float) -> None:
        """Go on."""
        reach = SERVO_SPEED * (0.0 if self._stamp is None else min(max(now - self._stamp, 0.0), 0.1))
        self._stamp = now
        for number, (exact, goal) in enumerate(zip(self._exact, self._goals, strict=True)):
            if exact is not None and goal is not None and exact != goal:
                self._exact[number] = exact + min(max(goal - exact, -reach), reach)
                self._send(number)

    def positions(self) -> tuple[int, int]:
        """Return where they have been sent."""
        first, second = (guardian_wire.UNKNOWN_ANGLE if each is None else each for each in self._sent)
        return first, second

    def _send(self, number: int) -> None:
        exact = self._exact[number]
        degree = None if exact is None else round(exact)
        if degree is not None and degree != self._sent[number]:
            self._sent[number] = degree
            self._pulse(number, degree)
