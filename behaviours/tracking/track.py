"""The base class of leaves that follow something: the head first and the base behind it, or the base alone."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from py_trees.common import Status

from behaviours.driving.motion import disobeyed
from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.tracking.follow import Follower
from behaviours.tracking.lag import Turning
from behaviours.tracking.rules import RuleBases
from drivers.api import COMMAND_LIFE, HeadPose, Velocity
from perception.api import Percept

COAST = 0.6
"""Seconds without news of the target for which head and base go on turning after it; nothing drives on that long."""


class Track(Leaf):
    """Follows one percept. A subclass says which: ``percepts``, largest first, and ``noun``, what it calls them.

    Once it follows one it stays with that, by its id, for as long as it is in view; then with one that may be it. What
    was not seen for a moment is taken to go on as it did; then head and base wait.
    """

    ends = frozenset({"failure"})
    needs = frozenset({"camera", "head"})
    drives = frozenset({"head", "base"})
    controller: RuleBases = argument("controller", "the rules to follow by", default="face")
    patience: float = argument("duration", "how long to go on while it is not seen", default=2.0, low=0.1)
    max_turn: float = argument(
        "turn rate", "how fast the base may turn; 0 deg/s keeps it still", default=math.radians(110), low=0.0
    )
    lag: float = argument(
        "duration", "what the base takes to begin what it is told, until that is learnt", default=0.1, low=0.0, high=0.5
    )
    noun: ClassVar[str] = ""
    _follower: Follower | None = None
    _target: Percept | None = None
    _seen_at = 0.0

    def initialise(self) -> None:
        self._target = self.begins_with()
        self._seen_at = self.run.now()
        limits = None if self.robot.head_part is None else self.robot.head.limits
        base, lag, max_turn = self.robot.base_part, self.robot.lag, 0.0
        if base is not None:
            lag.acceleration, max_turn = base.limits.turn_acceleration, self.max_turn
            if not lag.learnt:
                lag.believe(self.lag, learnt=False)
        self._follower = Follower(self.controller, limits=limits, max_turn=max_turn, lag=lag)

    def update(self) -> Status:
        trouble = self._disobeyed() or self.trouble()
        if trouble:
            return self.fail(trouble)
        now = self.run.now()
        target = self._choose([percept for percept in self.percepts() if now - percept.stamp <= self.patience])
        if target is not None:
            if self._target is None or target.stamp > self._target.stamp:
                self._seen_at = now
            self._target = target
        unseen = now - self._seen_at
        if unseen > self.patience:
            return self.fail(f"no {self.noun} for {self.patience:g} s")
        if self._target is None or self._follower is None or unseen > COAST:
            self._drive(0.0, 0.0)
            return self.wait(f"no {self.noun} for {unseen:.1f} s")
        self.result = self._target
        return self._follow(now, self._target, self._follower, drives=unseen <= COMMAND_LIFE)

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            if self.robot.head_part is not None:
                self.robot.head.stop()
            if self.robot.base_part is not None:
                self.robot.base.stop()

    # --- what subclasses say ------------------------------------------------------------------------------------------

    @abstractmethod
    def percepts(self) -> Sequence[Percept]:
        """Return what it may follow, largest first."""

    def begins_with(self) -> Percept | None:
        """Return the one that it is to follow from the start; None for the largest."""
        return None

    def may_be(self, percept: Percept, target: Percept) -> bool:
        """Whether it may be followed in the place of ``target``, which is not in view: any may."""
        del percept, target
        return True

    def trouble(self) -> str:
        """Return why it cannot go on, or nothing: for those that do more than turn."""
        return ""

    def forward(self, target: Percept, pan: float) -> float:
        """Return how fast the base is to drive (m/s) with the head turned by ``pan``: not at all, on the spot."""
        del target, pan
        return 0.0

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _choose(self, percepts: Sequence[Percept]) -> Percept | None:
        """Stay with the one that is followed, else take the largest that may be it."""
        target = self._target
        if target is None:
            return next(iter(percepts), None)
        same = next((percept for percept in percepts if percept.id == target.id), None)
        if same is not None:
            return same
        return next((percept for percept in percepts if self.may_be(percept, target)), None)

    def _follow(self, now: float, target: Percept, follower: Follower, *, drives: bool) -> Status:
        head = None if self.robot.head_part is None else self.robot.head
        looks = None if head is None else head.pose().value
        command = follower.step(now, target, head=looks or HeadPose(0.0, 0.0), base=self._base(now))
        if head is not None:
            head.look(command.head)
        self._drive(self.forward(target, command.head.pan) if drives else 0.0, command.turn)
        off = math.degrees(max(abs(target.bearing), abs(target.elevation)))
        return self.wait(f"{self.noun} {target.id}, {off:.0f} deg off")

    def _disobeyed(self) -> str:
        """Say why the base was stopped because it did not do what it was told, or nothing."""
        return "" if self.robot.base_part is None else disobeyed(self.robot.base.steering())

    def _base(self, now: float) -> Turning:
        """Return how the base stands and turns; a robot without a base stands still."""
        reading = None if self.robot.base_part is None else self.robot.base.state()
        if reading is None or reading.value is None:
            return Turning(0.0, 0.0, now, reported=False)
        heading = reading.value.pose.heading
        if not reading.good:
            # Reports that fail to come say where it was; but not that it still turns, as it stops by itself.
            return Turning(heading, 0.0, now, reported=False)
        return Turning(heading, reading.value.velocity.angular, reading.stamp)

    def _drive(self, speed: float, turn: float) -> None:
        if self.robot.base_part is not None:
            self.robot.base.drive(Velocity(speed, turn))
