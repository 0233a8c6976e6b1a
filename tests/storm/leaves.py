"""A leaf that misbehaves as leaves of users may: it raises, lies, never stops, or asks for what cannot be."""

from contextlib import suppress
from math import inf, isfinite, nan
from typing import Any

from py_trees.common import Status

from behaviours.leaf import RUNNING, SUCCESS, Leaf, argument
from drivers.api import HeadPose, Velocity
from drivers.errors import DeviceFault, DriverError, NotConnected

LEFT, STOPS_NOT, RAISES_LAST = "leaves", "never stops", "raises at end"

WAYS = (
    "raises",
    "raises at start",
    RAISES_LAST,
    "lies",
    "never halts",
    STOPS_NOT,
    "comes late",
    LEFT,
    "is offline",
    "faults",
)
"""What it does, beside moving what it claims. One that ``never stops`` leaves it to others to stop what it moves; one
that ``comes late`` fails until it is ticked for the last time of some; one that ``leaves`` succeeds, and what it moves
goes on."""

ENDLESS = ("never halts", STOPS_NOT)
"""The ways of those that go on for ever, and say after a halt that they still stop."""

DOOMED = ("raises", "raises at start", "lies", "faults")
"""The ways of those that cannot succeed."""

CARELESS = ("raises", "lies", "never halts", STOPS_NOT, "faults")
"""The ways of those that have no ``terminate``: were they to succeed, what they move would rightly go on."""

GOALS = {"fast": 99.0, "nan": nan, "endless": inf, "mild": 0.2}
"""What it asks of what it claims."""

ERRORS: dict[str, tuple[type[Exception], str]] = {
    "raises": (RuntimeError, "out of luck"),
    "is offline": (NotConnected, "the cable is out"),
    "faults": (DeviceFault, "it is overloaded"),
}


def _error(way: str) -> Exception:
    kind, words = ERRORS[way]
    return kind(words)


class Rogue(Leaf):
    """Move what it claims towards a ``goal`` for some ticks, then misbehave in one of its ways."""

    tag = "rogue"
    way: str = argument("text", f"how it misbehaves: {', '.join(WAYS)}", principal=True, default="raises")
    goal: str = argument("text", f"what it asks for: {', '.join(GOALS)}", default="mild")
    after: int = argument("count", "after so many ticks", default=2)
    overdue = 0
    """How often it was asked, after one halt, whether it still stops, though its time for that was over."""
    _ticks = 0
    _missed = 0
    _halted_at: float | None = None
    _late = 0

    @property
    def hopeless(self) -> bool:
        """True where every part refuses what it asks for, so that it moves nothing."""
        return not isfinite(GOALS[self.goal])

    def initialise(self) -> None:
        """Begin, or raise."""
        self._ticks = self._late = 0
        self._halted_at = None
        if self.way == "raises at start":
            raise _error("raises")

    def update(self) -> Any:
        """Ask for something; misbehave once the time has come."""
        if self.way == "comes late" and self._missed < self.after:
            self._missed += 1
            return self.fail("it is not time yet")
        self._ticks += 1
        self._ask(GOALS[self.goal])
        if self._ticks <= self.after:
            return RUNNING
        if self.way in ERRORS:
            raise _error(self.way)
        return "nonsense" if self.way == "lies" else RUNNING if self.way in ENDLESS else SUCCESS

    def terminate(self, new_status: Status) -> None:
        """Stop what moves, or leave the base to itself, or raise before that."""
        if self.way == RAISES_LAST:
            raise _error("raises")
        left = self.way == LEFT and (new_status is SUCCESS or "base" in self.drives)  # whose velocity expires
        if not left and self.way != STOPS_NOT:
            self._still()

    def halting(self) -> bool:
        """Take for ever, if that is its way."""
        now = self.run.now()
        self._halted_at = now if self._halted_at is None else self._halted_at
        self._late += now > self._halted_at + self.halt_limit
        self.overdue = max(self.overdue, self._late)
        return self.way in ENDLESS

    def _ask(self, goal: float) -> None:
        """Command what it claims; one that claims nothing asks for nothing."""

    def _still(self) -> None:
        """Stop it."""


class RogueCleanup(Rogue):
    """One that claims nothing, and moves all parts that the robot has: for ``finally``, where it must move none."""

    tag = "rogue_cleanup"

    def _ask(self, goal: float) -> None:
        robot = self.robot
        with suppress(DriverError):
            if robot.base_part is not None:
                robot.base.drive(Velocity(goal, -goal))
        with suppress(DriverError):
            if robot.head_part is not None:
                robot.head.look(HeadPose(goal, -goal))
        with suppress(DriverError):
            if robot.arm_part is not None:
                robot.arm.relax()


class RogueBase(Rogue):
    """One that drives the base."""

    tag = "rogue_base"
    needs = drives = frozenset({"base"})

    def _ask(self, goal: float) -> None:
        self.robot.base.drive(Velocity(goal, -goal))

    def _still(self) -> None:
        self.robot.base.stop()


class RogueHead(Rogue):
    """One that turns a head."""

    tag = "rogue_head"
    needs = drives = frozenset({"head"})
    on: str = argument("head", "which head", default="head")

    def _ask(self, goal: float) -> None:
        self.robot.head.look(HeadPose(goal, -goal))

    def _still(self) -> None:
        self.robot.head.stop()


class RogueArm(Rogue):
    """One that moves all joints of an arm."""

    tag = "rogue_arm"
    needs = drives = frozenset({"arm"})
    on: str = argument("arm", "which arm", default="arm")

    def _ask(self, goal: float) -> None:
        self.robot.arm.move(dict.fromkeys(self.robot.arm.limits, goal))

    def _still(self) -> None:
        self.robot.arm.hold()


class CarelessBase(RogueBase):
    """One that drives the base, and says nothing of how it stops."""

    tag = "careless_base"
    terminate = Leaf.terminate


class CarelessHead(RogueHead):
    """One that turns a head, and says nothing of how it stops."""

    tag = "careless_head"
    terminate = Leaf.terminate


class CarelessArm(RogueArm):
    """One that moves an arm, and says nothing of how it stops."""

    tag = "careless_arm"
    terminate = Leaf.terminate
