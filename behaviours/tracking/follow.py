"""Following a face with head and base: from where it will be to the next commands, by fuzzy rules. Pure arithmetic.

The head is told positions. The rules say how fast its aim should turn, and the follower adds that up into a goal; it
aims at where the face will be when the command acts, so neither a walking person nor a turning base makes the head lag.
The base turns by the head's pan: the head leads, the base follows.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from behaviours.tracking.fuzzy import Controller
from drivers.api import HeadLimits, HeadPose
from perception.api import Face

Surface = Callable[..., float]
"""A controller or its table: one number out of one for each input."""

LONGEST_STEP = 0.1
"""Seconds: a step counts for no longer, so that a late tick makes no leap."""

PAUSE = 0.5
"""Seconds without a step after which the follower starts afresh: someone else may have moved the head."""


@dataclass(frozen=True, slots=True)
class RuleBases:
    """The rules to follow by, each worked out to a surface.

    ``pan`` and ``tilt`` give the aim's rate (rad/s) from its error (radians) and the face's rate (rad/s), both in the
    robot's frame; ``base`` gives the base's turn (rad/s) from the head's pan (radians).
    """

    pan: Surface
    tilt: Surface
    base: Surface

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "RuleBases":
        """Make them of plain SI values: ``pan`` and ``tilt`` with inputs error and rate, ``base`` with input pan.

        Raises ValueError for what ``Controller.from_mapping`` refuses, other inputs, or a rule base of another name.
        """
        if unknown := mapping.keys() - {"pan", "tilt", "base"}:
            raise ValueError(f"'{min(unknown)}' is none of the rule bases pan, tilt and base")
        return cls(
            pan=_surface(mapping, "pan", ("error", "rate")),
            tilt=_surface(mapping, "tilt", ("error", "rate")),
            base=_surface(mapping, "base", ("pan",)),
        )


@dataclass(frozen=True, slots=True)
class Command:
    """Where the head should look (radians), and how fast the base should turn (rad/s)."""

    head: HeadPose
    turn: float


class Follower:
    """Follows one face. Call ``step`` at every tick for as long as there is one.

    ``max_turn`` in rad/s, 0 for a robot without a base; ``latency`` in seconds from giving a command to its effect.
    """

    def __init__(self, rules: RuleBases, *, limits: HeadLimits, max_turn: float, latency: float = 0.0) -> None:
        self._rules = rules
        self._limits = limits
        self._max_turn = max_turn
        self._latency = latency
        self._goal = HeadPose(0.0, 0.0)
        self._last = -math.inf

    def step(self, now: float, face: Face, *, head: HeadPose, heading: float, turning: float) -> Command:
        """Return what to command now, to follow ``face``.

        ``head`` is the pose last commanded, and matters for a first step, or one after a pause; ``heading`` (radians)
        and ``turning`` (rad/s) are the base's, in the odometry frame of the face. Raises ValueError for a face or a
        base with a value that is not finite; the goal stays as it was.
        """
        yaw, pitch = face.predict(now + self._latency)
        if not all(map(math.isfinite, (yaw, pitch, heading, turning))):
            raise ValueError(f"follow: not finite: face at {yaw}, {pitch}; base at {heading}, turning {turning}")
        elapsed = now - self._last
        if elapsed > PAUSE:
            self._goal = self._limits.clamp(head)
        span = min(max(elapsed, 0.0), LONGEST_STEP)
        self._last = max(now, self._last)
        # The remainder takes the shorter way round to a face behind.
        bearing = math.remainder(yaw - heading - turning * self._latency, math.tau)
        goal = HeadPose(
            pan=self._goal.pan + self._stride(self._rules.pan, bearing - self._goal.pan, face.yaw_rate - turning, span),
            tilt=self._goal.tilt + self._stride(self._rules.tilt, pitch - self._goal.tilt, face.pitch_rate, span),
        )
        self._goal = self._limits.clamp(goal)
        turn = self._rules.base(self._goal.pan)
        return Command(self._goal, min(max(turn, -self._max_turn), self._max_turn))

    def _stride(self, surface: Surface, error: float, rate: float, span: float) -> float:
        """Return how far the aim moves in ``span`` seconds: never past where the face will be at their end.

        That keeps any rules from swinging about the face, however steep they are and however slow the ticks.
        """
        speed = self._limits.speed
        stride = min(max(surface(error, rate), -speed), speed) * span
        reach = error + rate * span
        return min(max(stride, min(reach, 0.0)), max(reach, 0.0))


def _surface(mapping: Mapping[str, Any], name: str, inputs: tuple[str, ...]) -> Surface:
    found = mapping.get(name)
    controller = Controller.from_mapping(name, found if isinstance(found, Mapping) else {})
    names = tuple(variable.name for variable in controller.inputs)
    if names != inputs:
        raise ValueError(f"{name}: its inputs must be {', '.join(inputs)}, not {', '.join(names)}")
    return controller.tabulate()
