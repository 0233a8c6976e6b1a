"""Head search for people, objects and other robots, and the leaves for objects."""

import itertools
import math
from collections.abc import Iterator, Sequence

from py_trees.common import Status

from behaviours.head import DEFAULT_MAX_AGE, P, PerceptLeaf, SeenLeaf, has_arrived
from behaviours.leaf import argument
from drivers.api import HeadPose
from perception.api import Thing, ThingSpec


class HeadSearch(PerceptLeaf[P]):
    """Base class of searches with the head: first straight at the present pose, then row by row, back and forth.

    Running until a matching percept is seen; then it succeeds and the head stays on it. Fails after ``scans`` rounds.
    """

    needs = frozenset({"camera", "head"})
    drives = frozenset({"head"})
    pan: tuple[float, float] = argument(
        "angle", "range of the pan", default=(-math.radians(60), math.radians(60)), span=True
    )
    tilt: tuple[float, float] = argument(
        "angle", "range of the tilt; negative is up", default=(-math.radians(25), math.radians(5)), span=True
    )
    step: float = argument("angle", "angle from look to look", default=math.radians(30), low=math.radians(2))
    pause: float = argument("duration", "duration of each look", default=0.3, low=0.05)
    scans: int = argument("count", "number of rounds; 0 searches for ever", default=0, low=0)
    _route: Iterator[HeadPose] = iter(())
    _goal: HeadPose | None = None
    arrived_at: float | None = None  # when the head arrived where it looks now

    @property
    def age_limit(self) -> float:
        return DEFAULT_MAX_AGE

    def keeps_looking(self) -> bool:
        """Return True to stay at the present pose although it was searched for ``pause`` seconds; False by default."""
        return False

    @property
    def counted_since(self) -> float:
        """Time (s, on the run's clock) from which percepts count; older ones are ignored."""
        return self.started_at

    def initialise(self) -> None:
        # Where it looks now comes first: what we look for may be right there.
        self._goal, self.arrived_at = self.robot.head.pose().value, None
        self._route = self._rounds()

    def update(self) -> Status:
        found = self.largest_fresh(since=self.counted_since)
        if found is not None:
            return self.accept(found)
        if self._goal is None or (self._looked_long_enough() and not self.keeps_looking()):
            self._goal = next(self._route, None)
        if self._goal is None:
            return self.fail(f"no {self.noun} found in {self.scans} scan{'s' if self.scans > 1 else ''}")
        # Said at every tick: a head that was gone for a moment has forgotten where to look.
        accepted = self.robot.head.look(self._goal)
        if not has_arrived(self.robot.head.pose(), accepted):
            self.arrived_at = None
        elif self.arrived_at is None:
            self.arrived_at = self.run.now()
        return self.wait(self.absence_reason(f"no {self.noun} found"))

    def terminate(self, new_status: Status) -> None:
        del new_status  # found or not, the head stays where it looks
        self.robot.head.stop()

    def _looked_long_enough(self) -> bool:
        """Return True if the pictures of ``pause`` seconds since the head's arrival were searched.

        The pictures may come late, so their time stamps count.
        """
        looked = self.robot.sight.looked()
        return self.arrived_at is not None and looked is not None and looked - self.arrived_at >= self.pause

    def _rounds(self) -> Iterator[HeadPose]:
        for _ in range(self.scans) if self.scans else itertools.count():
            yield from serpentine(self.pan, self.tilt, self.step)


def serpentine(pan: tuple[float, float], tilt: tuple[float, float], step: float) -> Iterator[HeadPose]:
    """Yield poses row by row from the lowest: right to left, up a row, and back.

    ``pan`` and ``tilt`` are the ranges of the area, and ``step`` the largest distance of two poses, in radians.
    """
    columns = _steps(*pan, step)
    for row, down in enumerate(reversed(_steps(*tilt, step))):
        for across in columns if row % 2 == 0 else reversed(columns):
            yield HeadPose(across, down)


def _steps(low: float, high: float, step: float) -> list[float]:
    """Divide [low, high] evenly into steps of at most ``step``, including both ends."""
    count = math.ceil(abs(high - low) / step - 1e-9)
    return [low + (high - low) * place / count for place in range(count)] + [high]


# Leaves that look for coloured things: a condition, and a search with the head.

_OUTPUT_DOC = "the object: id, name, colour, shape, yaw, pitch, distance"


class ObjectSeenLeaf(SeenLeaf[Thing]):
    """Check whether a coloured object is in view.

    `object_seen: red ball`. Succeeds if one was seen within the last `within` seconds, fails if not. It answers at
    once, and is suspended while no picture is recent enough.
    """

    tag = "object_seen"
    example = "- object_seen: red ball"
    senses = frozenset({"things"})
    output_doc = _OUTPUT_DOC
    output_type = Thing
    what: ThingSpec = argument("object", "colour and shape, or the name of an object", principal=True)
    within: float = argument("duration", "maximum age of the sighting", default=DEFAULT_MAX_AGE, low=0.01)

    @property
    def age_limit(self) -> float:
        return self.within

    def percepts(self) -> Sequence[Thing]:
        return matching_things(self.robot.sight.things(), self.what)

    def absence_reason(self, so_far: str = "") -> str:
        return super().absence_reason(so_far or f"no {self.what.name} in view")


class FindObject(HeadSearch[Thing]):
    """Search for a coloured object with the head: first straight at the present pose, then row by row, back and forth.

    `find_object: red ball`. Running until one is seen; then it succeeds and the head stays on it. Fails after `scans`
    rounds without one. By default it searches for ever, so give it a `timeout`.
    """

    tag = "find_object"
    example = "- find_object: {what: big red box, scans: 2}"
    noun = "object"
    senses = frozenset({"things"})
    output_doc = _OUTPUT_DOC
    output_type = Thing
    what: ThingSpec = argument("object", "colour and shape, or the name of an object", principal=True)

    def percepts(self) -> Sequence[Thing]:
        return matching_things(self.robot.sight.things(), self.what)


def matching_things(things: Sequence[Thing], wanted: ThingSpec) -> list[Thing]:
    """Return the things that the detector found under the name of ``wanted``."""
    return [thing for thing in things if thing.name == wanted.name]
