"""Base, head, joints, range finder and screen that answer out of a record: no device is behind them; nothing moves."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from drivers.api import (
    BaseLimits,
    BaseState,
    Coupling,
    HeadLimits,
    HeadPose,
    Health,
    JointLimits,
    JointState,
    Lamp,
    Mood,
    RangeScan,
    Reading,
    Shown,
    Source,
    Steering,
    Tune,
    Velocity,
)
from missions.replay.memory import Memory


class Answering:
    """What all parts have in common. ``part`` is what the executive calls it, where that is not its name."""

    def __init__(self, name: str, memory: Memory, part: str = "") -> None:
        self.name = name
        self._part = part or name
        self._memory = memory

    def open(self) -> None:
        """See drivers.api.Device: there is nothing to open."""

    def close(self) -> None:
        """See drivers.api.Device: there is nothing to close."""

    def rest(self) -> None:
        """See drivers.api.Device."""
        self._do("rest", nothing)

    def health(self) -> Health:
        """See drivers.api.Device."""
        found: Health = self._ask("health")
        return found

    def _ask(self, what: str, *arguments: float) -> Any:
        return self._memory.ask(self._part, what, *arguments)

    def _do(self, what: str, accept: Callable[[], object], *arguments: object) -> Any:
        return self._memory.command(self._part, what, accept, *arguments)


class AnsweringBase(Answering):
    """A base: see drivers.api.Base for what its methods do."""

    @property
    def limits(self) -> BaseLimits:
        """As they were then."""
        found: BaseLimits = self._ask("limits")
        return found

    @property
    def latched(self) -> str:
        """As it was then."""
        return str(self._ask("latched"))

    def state(self) -> Reading[BaseState]:
        """As it was then."""
        found: Reading[BaseState] = self._ask("state")
        return found

    def steering(self) -> Steering:
        """As it was then."""
        found: Steering = self._ask("steering")
        return found

    def heading_at(self, stamp: float) -> float | None:
        """As it was then."""
        found: float | None = self._ask("heading_at", stamp)
        return found

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Return what was accepted then; of another velocity, what is within the limits."""
        found: Velocity = self._do("drive", lambda: self._within(velocity), velocity, source)
        return found

    def _within(self, velocity: Velocity) -> Velocity:
        limits = self.limits
        return Velocity(_clamped(velocity.linear, limits.speed), _clamped(velocity.angular, limits.turn))

    def stop(self, *, source: Source | None = None) -> None:
        """Stop nothing."""
        self._do("stop", nothing, source)

    def latch(self, reason: str) -> None:
        """Latch nothing."""
        self._do("latch", nothing, reason)

    def enable(self) -> None:
        """Enable nothing."""
        self._do("enable", nothing)

    def play(self, tune: Tune) -> None:
        """Play nothing."""
        self._do("play", nothing, tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """Play nothing."""
        self._do("tone", nothing, frequency, seconds)

    def light(self, number: int, colour: Lamp) -> None:
        """Switch nothing."""
        self._do("light", nothing, number, colour)


class AnsweringHead(Answering):
    """A head: see drivers.api.Head for what its methods do."""

    @property
    def limits(self) -> HeadLimits:
        """As they were then."""
        found: HeadLimits = self._ask("limits")
        return found

    def pose(self) -> Reading[HeadPose]:
        """As it was then."""
        found: Reading[HeadPose] = self._ask("pose")
        return found

    def pose_at(self, stamp: float) -> HeadPose | None:
        """As it was then."""
        found: HeadPose | None = self._ask("pose_at", stamp)
        return found

    def look(self, target: HeadPose) -> HeadPose:
        """Return what was accepted then; of another target, what is within the limits."""
        found: HeadPose = self._do("look", lambda: self.limits.clamp(target), target)
        return found

    def stop(self) -> None:
        """Stop nothing."""
        self._do("stop", nothing)


class AnsweringJoints(Answering):
    """Joints: see drivers.api.Joints for what their methods do."""

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """As they were then."""
        found: Mapping[str, JointLimits] = self._ask("limits")
        return found

    def states(self) -> Mapping[str, Reading[JointState]]:
        """As they were then."""
        found: Mapping[str, Reading[JointState]] = self._ask("states")
        return found

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Return what was accepted then; of other goals, what is within the limits."""
        found: Mapping[str, float] = self._do("move", lambda: self._within(goals), goals, speeds)
        return found

    def _within(self, goals: Mapping[str, float]) -> Mapping[str, float]:
        limits = self.limits
        return {name: min(max(goal, limits[name].lower), limits[name].upper) for name, goal in goals.items()}

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Hold nothing."""
        self._do("hold", nothing, joints)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Relax nothing."""
        self._do("relax", nothing, joints)

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Let nothing follow."""
        self._do("follow", nothing, couplings)

    def recover(self) -> tuple[str, ...]:
        """Return what was recovered then."""
        found: tuple[str, ...] = self._do("recover", tuple)
        return found


class AnsweringRanger(Answering):
    """A range finder: see drivers.api.Ranger for what its methods do."""

    @property
    def place(self) -> tuple[float, float, float]:
        """As it was then."""
        found: tuple[float, float, float] = self._ask("place")
        return found

    def scan(self) -> Reading[RangeScan]:
        """As it was then."""
        found: Reading[RangeScan] = self._ask("scan")
        return found


class AnsweringScreen(Answering):
    """A screen: see drivers.api.Screen for what its methods do."""

    def shown(self) -> Shown:
        """What was to be seen then."""
        found: Shown = self._ask("shown")
        return found

    def mood(self, mood: Mood) -> None:
        """Look like nothing."""
        self._do("mood", nothing, mood)

    def show(self, text: str) -> None:
        """Show nothing."""
        self._do("show", nothing, text)

    def mouth(self, opening: float) -> None:
        """Move nothing."""
        self._do("mouth", nothing, opening)


def nothing() -> None:
    """Do nothing."""


def _clamped(value: float, most: float) -> float:
    return min(max(value, -most), most)
