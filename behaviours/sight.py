"""Leaves that look for people: two conditions, and a search with the head."""

import itertools
import math
from collections.abc import Iterator

from py_trees.common import Status

from behaviours.head import arrived
from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.meeting import Meeting
from drivers.api import HeadPose, Pose2D
from perception.api import Face

BLIND = 2.0
"""Seconds without a picture searched after which a face is missed for want of pictures."""


class _Seeing(Leaf):
    """What all have in common: the faces that were seen lately enough to count."""

    needs = frozenset({"camera"})
    stores = "the face: id, yaw, pitch, distance"
    max_age: float

    def fresh(self, *, since: float = -math.inf) -> Face | None:
        """Return the largest face that was seen within ``max_age``, and not before ``since``, and that is wanted."""
        oldest = max(since, self.run.now() - self.max_age)
        faces = self.robot.sight.faces()
        return next((face for face in faces if face.stamp >= oldest and self.wanted(face)), None)

    def wanted(self, face: Face) -> bool:
        """Whether it is one of those that are looked for: anybody."""
        del face
        return True

    def nobody(self, so_far: str = "no face in view") -> str:
        """Say that no face is seen; or that nothing is, which is another trouble."""
        looked = self.robot.sight.looked()
        blind = looked is None or self.run.now() - looked > BLIND
        return "no pictures from the camera" if blind else so_far

    def see(self, face: Face) -> Status:
        """Succeed with ``face``."""
        self.result = face
        return SUCCESS


class FaceSeen(_Seeing):
    """Is a face in view?

    Succeeds when one was seen lately, fails when not. It never runs.
    """

    word = "face_seen"
    instant = True
    max_age: float = argument("duration", "how long ago still counts", default=0.5, principal=True, low=0.01)

    def update(self) -> Status:
        face = self.fresh()
        return self.see(face) if face is not None else self.fail(self.nobody())


class FaceCentred(_Seeing):
    """Is the face in the middle of the picture?

    Succeeds when the largest face, or the one that is named, is within that angle of the camera's axis, fails when
    not. It never runs.
    """

    word = "face_centred"
    instant = True
    within: float = argument("angle", "how far from the axis still counts", default=math.radians(5), principal=True)
    max_age: float = argument("duration", "how long ago still counts", default=0.5, low=0.01)
    face: object = argument("value", "whose, as `as` has kept them; else the largest", default=None)

    def wanted(self, face: Face) -> bool:
        only = chosen(self.face)
        return only is None or face.id == only.id

    def update(self) -> Status:
        face = self.fresh()
        if face is None:
            return self.fail(self.nobody())
        if max(abs(face.bearing), abs(face.drop)) <= self.within:
            return self.see(face)
        return self.fail(f"the face is {math.degrees(face.bearing):+.0f}, {math.degrees(face.drop):+.0f} deg off")


class FindFace(_Seeing):
    """Look around with the head for a face: first where it looks now, then row by row, to and fro.

    Running until a face is seen, then succeeds and the head stays on it. Fails after `scans` rounds without one; by
    default it goes on looking, so give it a `timeout`.
    """

    word = "find_face"
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
    new: bool = argument("flag", "only somebody whom it has not found before in this run", default=False)
    max_age = 0.5
    _met: tuple[Meeting, ...] = ()  # outlives a restart: that is what `new` is for
    _route: Iterator[HeadPose] = iter(())
    _goal: HeadPose | None = None
    _there_since: float | None = None

    def initialise(self) -> None:
        # Where it looks now comes first: the one we look for may be right there.
        self._goal, self._there_since = self.robot.head.pose().value, None
        self._route = self._rounds()

    def wanted(self, face: Face) -> bool:
        return not self.new or not any(meeting.was_with(face, self._stand()) for meeting in self._met)

    def update(self) -> Status:
        face = self.fresh(since=self._from)
        if face is not None:
            self._met += (Meeting.of(face, self._stand()),) if self.new else ()
            return self.see(face)
        if self._goal is None or self._looked_long_enough():
            self._goal = next(self._route, None)
        if self._goal is None:
            return self.fail(f"no face found in {self.scans} scan{'s' if self.scans > 1 else ''}")
        # Said at every tick: a head that was gone for a moment has forgotten where to look.
        accepted = self.robot.head.look(self._goal)
        if not arrived(self.robot.head.pose(), accepted):
            self._there_since = None
        elif self._there_since is None:
            self._there_since = self.run.now()
        return self.wait(self.nobody("no face found"))

    def terminate(self, new_status: Status) -> None:
        del new_status  # found or not, the head stays where it looks
        self.robot.head.stop()

    @property
    def _from(self) -> float:
        """Since when a face counts: where it is must be known to tell people apart, so then the head must stand."""
        if not self.new:
            return self.since
        return math.inf if self._there_since is None else self._there_since

    def _stand(self) -> Pose2D:
        """Return where the base is, as far as there is one that tells."""
        state = None if self.robot.base_part is None else self.robot.base.state().value
        return Pose2D(0.0, 0.0, 0.0) if state is None else state.pose

    def _looked_long_enough(self) -> bool:
        """True once the pictures taken since the head arrived, and searched, span the pause: no matter what is late."""
        looked = self.robot.sight.looked()
        return self._there_since is not None and looked is not None and looked - self._there_since >= self.pause

    def _rounds(self) -> Iterator[HeadPose]:
        for _ in range(self.scans) if self.scans else itertools.count():
            yield from serpentine(self.pan, self.tilt, self.step)


def chosen(kept: object) -> Face | None:
    """Return the face that a mission names, None where it names none. Raises ValueError for what is no face."""
    if kept is None or isinstance(kept, Face):
        return kept
    raise ValueError(f"'face' needs a face that a behaviour has found, such as ${{person}}, got {kept!r}")


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
