"""Leaves that look for people: two conditions, and a search with the head."""

import math
from collections.abc import Iterator

from py_trees.common import Status

from behaviours.head import arrived
from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import HeadPose
from perception.api import Face


class _Seeing(Leaf):
    """What all have in common: the faces that were seen lately enough to count."""

    needs = frozenset({"camera"})
    stores = "the face: id, yaw, pitch, distance"
    max_age: float

    def fresh(self) -> Face | None:
        """Return the largest face that was seen within ``max_age``."""
        oldest = self.run.now() - self.max_age
        return next((face for face in self.robot.sight.faces() if face.stamp >= oldest), None)

    def see(self, face: Face) -> Status:
        """Succeed with ``face``."""
        self.result = face
        self.feedback_message = ""
        return SUCCESS


class FaceSeen(_Seeing):
    """Is a face in view?

    Succeeds when one was seen lately, fails when not. It never runs.
    """

    word = "face_seen"
    max_age: float = argument("duration", "how long ago still counts", default=0.5, principal=True, low=0.01)

    def update(self) -> Status:
        face = self.fresh()
        return self.see(face) if face is not None else self.fail("no face in view")


class FaceCentred(_Seeing):
    """Is the face in the middle of the picture?

    Succeeds when the largest face is within that angle of the camera's axis, fails when not. It never runs.
    """

    word = "face_centred"
    within: float = argument("angle", "how far from the axis still counts", default=math.radians(5), principal=True)
    max_age: float = argument("duration", "how long ago still counts", default=0.5, low=0.01)

    def update(self) -> Status:
        face = self.fresh()
        if face is None:
            return self.fail("no face in view")
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
    max_age = 0.5
    _route: Iterator[HeadPose] = iter(())
    _goal: HeadPose | None = None
    _there_since: float | None = None
    _scan = 0

    def initialise(self) -> None:
        # Where it looks now comes first: the one we look for may be right there.
        now = self.robot.head.pose().value
        self._scan, self._goal, self._there_since = 0, now, None
        self._route = serpentine(self.pan, self.tilt, self.step)

    def update(self) -> Status:
        face = self.fresh()
        if face is not None and self._still_there(face):
            return self.see(face)
        if self._goal is not None and not self._looked_long_enough(self._goal):
            return self.wait("no face found")
        self._goal = self.robot.head.look(next(self._route, None) or self._next_scan())
        self._there_since = None
        if self.scans and self._scan >= self.scans:
            return self.fail(f"no face found in {self.scans} scans")
        return self.wait("no face found")

    def terminate(self, new_status: Status) -> None:
        del new_status  # found or not, the head stays where it looks
        self.robot.head.stop()

    def _looked_long_enough(self, goal: HeadPose) -> bool:
        now = self.run.now()
        if self._there_since is None and arrived(self.robot.head.pose().value, goal):
            self._there_since = now
        # Count from when perception has caught up: pictures taken since the head arrived, not the wall clock.
        looked = self.robot.sight.looked()
        return self._there_since is not None and looked is not None and looked - self._there_since >= self.pause

    def _still_there(self, face: Face) -> bool:
        """True for a face seen since the search began."""
        return face.stamp >= self._since

    def _next_scan(self) -> HeadPose:
        self._scan += 1
        self._route = serpentine(self.pan, self.tilt, self.step)
        return next(self._route)


def serpentine(pan: tuple[float, float], tilt: tuple[float, float], step: float) -> Iterator[HeadPose]:
    """Yield poses row by row from the lowest: from the right to the left, up a row, and back (as Rodney scans)."""
    columns = _steps(*pan, step)
    for row, down in enumerate(reversed(_steps(*tilt, step))):
        for across in columns if row % 2 == 0 else reversed(columns):
            yield HeadPose(across, down)


def _steps(low: float, high: float, step: float) -> list[float]:
    """Divide [low, high] evenly into steps of at most ``step``, both ends included."""
    count = max(1, math.ceil((high - low) / step - 1e-9))
    return [low + (high - low) * place / count for place in range(count + 1)]
