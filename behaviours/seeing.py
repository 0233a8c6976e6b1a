"""What all leaves have in common that ask whether something is in view: people, things, other robots."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Generic, TypeVar

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf
from perception.api import Percept

P = TypeVar("P", bound=Percept)

BLIND = 2.0
"""Seconds without a picture searched after which something is missed for want of pictures."""

LATELY = 0.5
"""Seconds for which what was seen counts as in view, where nothing else is said."""


class Seeing(Leaf, Generic[P]):
    """Looks for one sort of percept. A subclass says which: ``percepts``, largest first, and ``noun``, its name."""

    needs = frozenset({"camera"})
    noun: ClassVar[str] = ""

    @property
    @abstractmethod
    def age_limit(self) -> float:
        """How long ago (s) still counts."""

    @abstractmethod
    def percepts(self) -> Sequence[P]:
        """Return all that the eyes follow now of this sort, largest first."""

    def wanted(self, percept: P) -> bool:
        """Whether it is one of those that are looked for: any."""
        del percept
        return True

    def all_fresh(self, *, since: float = -math.inf) -> list[P]:
        """Return those wanted that were seen lately enough to count, and not before ``since``, largest first."""
        oldest = max(since, self.run.now() - self.age_limit)
        return [percept for percept in self.percepts() if percept.stamp >= oldest and self.wanted(percept)]

    def fresh(self, *, since: float = -math.inf) -> P | None:
        """Return the largest of those."""
        return next(iter(self.all_fresh(since=since)), None)

    def nobody(self, so_far: str = "") -> str:
        """Say that none is seen; or that nothing is, which is another trouble."""
        looked = self.robot.sight.looked()
        blind = looked is None or self.run.now() - looked > BLIND
        return "no pictures from the camera" if blind else so_far or f"no {self.noun} in view"

    def absent(self, reason: str = "") -> Status:
        """Fail because none is in view; suspended instead where no picture is new enough to tell."""
        looked = self.robot.sight.looked()
        if looked is None or self.run.now() - looked > max(self.age_limit, LATELY):
            return self.suspend("camera")
        return self.fail(reason or self.nobody())

    def see(self, percept: P) -> Status:
        """Succeed with ``percept``."""
        self.result = percept
        return SUCCESS


class Seen(Seeing[P]):
    """Succeeds with the largest that was seen lately, fails when there is none; suspended without pictures."""

    instant = True

    def update(self) -> Status:
        found = self.fresh()
        return self.see(found) if found is not None else self.absent()
