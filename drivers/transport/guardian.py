"""The keeper's end of the line, whatever is in its hands: on a Raspberry Pi a process, in a simulation a device."""

from collections.abc import Callable
from typing import Protocol

from drivers.transport import guardian_wire
from drivers.transport.lines import LineFinder

SERVO_SPEED = 300.0
"""Degrees per second at which a keeper lets a servo go at most, whatever it is sent."""


class Hands(Protocol):
    """What a keeper holds. Raises OSError where the hardware has gone."""

    def aim(self, first: int, second: int, now: float) -> None:
        """Go there."""
        ...

    def rest(self, now: float) -> None:
        """Go nowhere any more: wheels stand, servos stay where they are."""
        ...

    def step(self, now: float) -> None:
        """Let the time pass."""
        ...

    def present(self) -> tuple[int, int]:
        """Return where both are."""
        ...


class Keeper:
    """Obeys lines, and lets what is in its ``hands`` rest after ``wire.WATCHDOG`` seconds without one."""

    def __init__(self, hands: Hands, boot: int, now: float) -> None:
        self.boot = boot
        self.heard_at = now
        self._hands = hands
        self._lines = LineFinder(guardian_wire.LONGEST)
        self._resting = True

    def feed(self, data: bytes, now: float) -> bytes:
        """Take what has come at time ``now``; return the answers."""
        self.poll(now)
        return b"".join(self._obey(line, now) for line in self._lines.feed(data))

    def poll(self, now: float) -> None:
        """Let the time pass until ``now``."""
        if not self._resting and now - self.heard_at > guardian_wire.WATCHDOG:
            self.rest(now)
        self._hands.step(now)

    def rest(self, now: float) -> None:
        """Let all rest."""
        self._resting = True
        self._hands.rest(now)

    def _obey(self, line: bytes, now: float) -> bytes:
        try:
            found = guardian_wire.read(line)
        except ValueError:
            return b""
        self.heard_at = now
        if isinstance(found, guardian_wire.Go) and found.boot == self.boot:
            self._resting = False
            self._hands.aim(found.first, found.second, now)
        return guardian_wire.report(self.boot, *self._hands.present()) if isinstance(found, guardian_wire.Ask) else b""


class Wheels:
    """Two motors: ``turn`` sets them to shares of full power, -1..1."""

    def __init__(self, turn: Callable[[float, float], None]) -> None:
        self._turn = turn
        self._told = (0, 0)
        turn(0.0, 0.0)

    def aim(self, first: int, second: int, now: float) -> None:  # noqa: ARG002 - motors obey at once
        """Turn so."""
        wanted = (
            min(max(first, -guardian_wire.FULL), guardian_wire.FULL),
            min(max(second, -guardian_wire.FULL), guardian_wire.FULL),
        )
        if wanted != self._told:
            self._told = wanted
            self._turn(wanted[0] / guardian_wire.FULL, wanted[1] / guardian_wire.FULL)

    def rest(self, now: float) -> None:  # noqa: ARG002
        """Stand, also where they are believed to stand."""
        self._told = (0, 0)
        self._turn(0.0, 0.0)

    def step(self, now: float) -> None:
        """Do nothing: they turn by themselves."""

    def present(self) -> tuple[int, int]:
        """Return what they were told."""
        return self._told


class Servos:
    """Two hobby servos, led no faster than ``SERVO_SPEED``: ``pulse`` sends a servo (0, 1) to a degree.

    ``standing`` is where they have been sent already by who has gone; None for one that has got no pulse yet.
    """

    def __init__(self, pulse: Callable[[int, int], None], standing: tuple[int | None, int | None]) -> None:
        self._pulse = pulse
        self._sent = list(standing)
        self._exact: list[float | None] = [None if each is None else float(each) for each in standing]
        self._goals: list[float | None] = list(self._exact)
        self._stamp: float | None = None

    def aim(self, first: int, second: int, now: float) -> None:
        """Lead both there; one that has got no pulse yet goes at once, for nobody knows from where."""
        self.step(now)
        for number, goal in enumerate((first, second)):
            if 0 <= goal <= 180:
                self._goals[number] = float(goal)
                if self._exact[number] is None:
                    self._exact[number] = float(goal)
                    self._send(number)

    def rest(self, now: float) -> None:
        """Stay where they are."""
        self.step(now)
        self._goals = [None if each is None else float(each) for each in self._sent]
        self._exact = list(self._goals)

    def step(self, now: float) -> None:
        """Go on."""
        reach = SERVO_SPEED * (0.0 if self._stamp is None else min(max(now - self._stamp, 0.0), 0.1))
        self._stamp = now
        for number, (exact, goal) in enumerate(zip(self._exact, self._goals, strict=True)):
            if exact is not None and goal is not None and exact != goal:
                self._exact[number] = exact + min(max(goal - exact, -reach), reach)
                self._send(number)

    def present(self) -> tuple[int, int]:
        """Return where they have been sent."""
        first, second = (guardian_wire.UNKNOWN if each is None else each for each in self._sent)
        return first, second

    def _send(self, number: int) -> None:
        exact = self._exact[number]
        degree = None if exact is None else round(exact)
        if degree is not None and degree != self._sent[number]:
            self._sent[number] = degree
            self._pulse(number, degree)
