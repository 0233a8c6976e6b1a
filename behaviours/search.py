"""The search with the head that finds people, things and other robots."""

import itertools
import math
from collections.abc import Iterator, Sequence

from py_trees.common import Status

from behaviours.head import LATELY, P, Seeing, Seen, arrived
from behaviours.leaf import argument
from drivers.api import HeadPose
from perception.api import Thing, Wanted


class Search(Seeing[P]):
    """Looks around with the head: first where it looks now, then row by row, to and fro.

    Running until something wanted is seen, then it succeeds and the head stays on it. Fails after ``scans`` rounds.
    """

    needs = frozenset({"camera", "head"})
    drives = frozenset({"head"})
    pan: tuple[float, float] = argument(
        "angle", "how far to each side", default=(-math.radians(60), math.radians(60)), span=True
    )
    tilt: tuple[float, float] = argument(
        "angle", "how far up (negative) and down", default=(-math.radians(25), math.radians(5)), span=True
    )
    step: float = argument("angle", "from look to look", default=math.radians(30), low=math.radians(2))
    pause: float = argument("duration", "how long to look each time", default=0.3, low=0.05)
    scans: int = argument("count", "how many rounds; 0 is for ever", default=0, low=0)
    _route: Iterator[HeadPose] = iter(())
    _goal: HeadPose | None = None
    there_since: float | None = None  # when the head arrived where it looks now

    @property
    def age_limit(self) -> float:
        return LATELY

    def hesitates(self) -> bool:
        """Whether it goes on looking where it looks now, though it has looked there for long enough."""
        return False

    @property
    def counts_from(self) -> float:
        """Since when (s, on the run's clock) what is seen counts."""
        return self.since

    def initialise(self) -> None:
        # Where it looks now comes first: what we look for may be right there.
        self._goal, self.there_since = self.robot.head.pose().value, None
        self._route = self._rounds()

    def update(self) -> Status:
        found = self.fresh(since=self.counts_from)
        if found is not None:
            return self.see(found)
        if self._goal is None or (self._looked_long_enough() and not self.hesitates()):
            self._goal = next(self._route, None)
        if self._goal is None:
            return self.fail(f"no {self.noun} found in {self.scans} scan{'s' if self.scans > 1 else ''}")
        # Said at every tick: a head that was gone for a moment has forgotten where to look.
        accepted = self.robot.head.look(self._goal)
        if not arrived(self.robot.head.pose(), accepted):
            self.there_since = None
        elif self.there_since is None:
            self.there_since = self.run.now()
        return self.wait(self.nobody(f"no {self.noun} found"))

    def terminate(self, new_status: Status) -> None:
        del new_status  # found or not, the head stays where it looks
        self.robot.head.stop()

    def _looked_long_enough(self) -> bool:
        """True once the pictures taken since the head arrived, and searched, span the pause: no matter what is late."""
        looked = self.robot.sight.looked()
        return self.there_since is not None and looked is not None and looked - self.there_since >= self.pause

    def _rounds(self) -> Iterator[HeadPose]:
        for _ in range(self.scans) if self.scans else itertools.count():
            yield from serpentine(self.pan, self.tilt, self.step)


def serpentine(pan: tuple[float, float], tilt: tuple[float, float], step: float) -> Iterator[HeadPose]:
    """Yield poses row by row from the lowest: from the right to the left, up a row, and back (as Rodney scans)."""
    columns = _steps(*pan, step)
    for row, down in enumerate(reversed(_steps(*tilt, step))):
        for across in columns if row % 2 == 0 else reversed(columns):
            yield HeadPose(across, down)


def _steps(low: float, high: float, step: float) -> list[float]:
    """Divide [low, high] evenly into steps of at most ``step``, both ends included."""
    count = math.ceil(abs(high - low) / step - 1e-9)
    return [low + (high - low) * place / count for place in range(count)] + [high]


# Leaves that look for coloured things: a condition, and a search with the head.

_STORED = "the object: id, name, colour, shape, yaw, pitch, distance"


class ObjectSeen(Seen[Thing]):
    """Is a coloured object in view?

    `object_seen: red ball`. Succeeds when one was seen lately, fails when not. It never runs. It is
    suspended while no picture is new enough to tell.
    """

    word = "object_seen"
    senses = frozenset({"things"})
    stores = _STORED
    keeps = Thing
    what: Wanted = argument("object", "a colour and a shape, or the name of an object", principal=True)
    within: float = argument("duration", "how long ago still counts", default=LATELY, low=0.01)

    @property
    def age_limit(self) -> float:
        return self.within

    def percepts(self) -> Sequence[Thing]:
        return named(self.robot.sight.things(), self.what)

    def nobody(self, so_far: str = "") -> str:
        return super().nobody(so_far or f"no {self.what.name} in view")


class FindObject(Search[Thing]):
    """Look around with the head for a coloured object: first where it looks now, then row by row, to and fro.

    `find_object: red ball`. Running until one is seen, then succeeds and the head stays on it. Fails after `scans`
    rounds without one; by default it goes on looking, so give it a `timeout`.
    """

    word = "find_object"
    noun = "object"
    senses = frozenset({"things"})
    stores = _STORED
    keeps = Thing
    what: Wanted = argument("object", "a colour and a shape, or the name of an object", principal=True)

    def percepts(self) -> Sequence[Thing]:
        return named(self.robot.sight.things(), self.what)


def named(things: Sequence[Thing], wanted: Wanted) -> list[Thing]:
    """Return those of ``things`` that were looked for by that name."""
    return [thing for thing in things if thing.name == wanted.name]
