"""Leaves that look for people: three conditions, and a search with the head.

Whom the robot has met, and where, is kept: nobody is taken for somebody new when the camera comes round again.
"""

import math
from collections.abc import Collection, Sequence
from typing import Self

from py_trees.common import Status

from behaviours.head import DEFAULT_MAX_AGE, PerceptLeaf
from behaviours.leaf import SUCCESS, argument
from behaviours.search import HeadSearch
from drivers.api import Pose2D
from drivers.api.fast_dataclass import dataclass
from perception.api import UNKNOWN, Face

SAME_PERSON_ANGLE = math.radians(15)
"""Whoever is seen this near to where somebody was met is taken for them: half a step aside at two metres."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Somebody who was met: the id of the face then, and the place (metres, odometry frame) where it was.

    ``name`` is theirs as far as the robot knew it.
    """

    id: int
    x: float
    y: float
    name: str = ""

    @classmethod
    def of(cls, face: Face, base: Pose2D) -> Self:
        """Remember ``face`` as it is seen from ``base``."""
        x, y = base.x + face.distance * math.cos(face.yaw), base.y + face.distance * math.sin(face.yaw)
        return cls(face.id, x, y, face.name)

    def is_with(self, face: Face, base: Pose2D) -> bool:
        """Say whether ``face``, seen from ``base``, is the same person's: by its id, by its name, or by where it is.

        An id is forgotten soon after its face was out of view. Two names that are known decide; else the place does,
        which lasts as far as people stay where they are.
        """
        if face.id == self.id:
            return True
        if is_known(face.name) and is_known(self.name):
            return face.name == self.name
        expected = math.atan2(self.y - base.y, self.x - base.x)
        return abs(math.remainder(face.yaw - expected, math.tau)) <= SAME_PERSON_ANGLE


def is_known(name: str) -> bool:
    """Say whether a face's name is that of somebody: neither undecided nor unknown."""
    return name not in ("", UNKNOWN)


def is_same_person(face: Face, stored_face: Face) -> bool:
    """Say whether ``face`` is that of the person whose face was ``kept``: by id, or by a name that both have.

    A name outlasts the id, which is forgotten soon after the face was out of view.
    """
    return face.id == stored_face.id or (is_known(face.name) and face.name == stored_face.name)


def may_be_same_person(face: Face, stored_face: Face) -> bool:
    """Say whether ``face`` can be that of the person whose face was ``kept``: unless it is known to be another's."""
    return not (face.name and is_known(stored_face.name)) or face.name == stored_face.name


FACE_OUTPUT_DOC = "the face: id, name where one was asked for, yaw, pitch, distance"
"""What is kept of a face."""

NAME_TIMEOUT = 2.0
"""Seconds for which a search waits for a name to be decided; most take half a second."""


class FacePerceptLeaf(PerceptLeaf[Face]):
    """Looks for faces, or for those of one name."""

    noun = "face"
    person_name: str = argument(
        "text", "only of this person; `unknown` is any stranger, without a name anybody", name="name", default=""
    )

    @classmethod
    def senses_for(cls, arguments: Collection[str]) -> frozenset[str]:
        return cls.senses | {"names"} if "name" in arguments else cls.senses

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def matches(self, percept: Face) -> bool:
        return not self.person_name or percept.name.casefold() == self.person_name.casefold()

    def absence_reason(self, so_far: str = "") -> str:
        said = super().absence_reason(so_far)
        whose = "a stranger" if self.person_name.casefold() == UNKNOWN else self.person_name
        return said.replace("no face", f"no face of {whose}") if whose else said


class FaceSeenLeaf(FacePerceptLeaf):
    """Is a face in view?

    Succeeds when one was seen lately, fails when not. It never runs; suspended while no picture is new enough to tell.
    """

    tag = "face_seen"
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    instant = True
    within: float = argument("duration", "how long ago still counts", default=DEFAULT_MAX_AGE, principal=True, low=0.01)
    nearer: float | None = argument("length", "only this near or nearer; else at any distance", default=None, low=0.1)

    @property
    def age_limit(self) -> float:
        return self.within

    def matches(self, percept: Face) -> bool:
        return super().matches(percept) and (self.nearer is None or percept.distance <= self.nearer)

    def update(self) -> Status:
        found = self.largest_fresh()
        return self.accept(found) if found is not None else self.fail_absent()


class FacesAtLeast(FacePerceptLeaf):
    """Are several faces in view?

    Succeeds when so many were seen lately, fails when not. It never runs; suspended while no picture is new enough to
    tell.
    """

    tag = "faces_at_least"
    output_doc = "the faces, as a list, the largest first"
    output_type = list[Face]
    instant = True
    number: int = argument("count", "how many", principal=True, low=1)
    within: float = argument("duration", "how long ago still counts", default=DEFAULT_MAX_AGE, low=0.01)

    @property
    def age_limit(self) -> float:
        return self.within

    def update(self) -> Status:
        faces = self.fresh_percepts()
        if len(faces) >= self.number:
            self.result = faces
            return SUCCESS
        return self.fail_absent(f"{len(faces)} of {self.number} faces in view" if faces else "")


class FaceCentred(FacePerceptLeaf):
    """Is the face in the middle of the picture?

    Succeeds when the largest face, or the one that is named, is within that angle of the camera's axis, fails when
    not. It never runs; suspended while no picture is new enough to tell.
    """

    tag = "face_centred"
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    instant = True
    within: float = argument("angle", "how far from the axis still counts", default=math.radians(5), principal=True)
    max_age: float = argument("duration", "how long ago still counts", default=DEFAULT_MAX_AGE, low=0.01)
    face: Face | None = argument("face", "whose, as `as` has kept them; else the largest", default=None)

    @property
    def age_limit(self) -> float:
        return self.max_age

    def matches(self, percept: Face) -> bool:
        only = face_argument(self.face)
        return super().matches(percept) and (only is None or is_same_person(percept, only))

    def update(self) -> Status:
        face = self.largest_fresh()
        if face is None:
            return self.fail_absent()
        if max(abs(face.bearing), abs(face.elevation)) <= self.within:
            return self.accept(face)
        return self.fail(f"the face is {math.degrees(face.bearing):+.0f}, {math.degrees(face.elevation):+.0f} deg off")


class FindFace(FacePerceptLeaf, HeadSearch[Face]):
    """Look around with the head for a face: first where it looks now, then row by row, to and fro.

    Running until a face is seen, then succeeds and the head stays on it. Where a name is asked for, it stays on each
    face until it is decided whose that is. Fails after `scans` rounds without one; by default it goes on looking, so
    give it a `timeout`.
    """

    tag = "find_face"
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    new: bool = argument("flag", "only somebody whom it has not found before in this run", default=False)
    _meetings: tuple[Meeting, ...] = ()  # outlives a restart: that is what `new` is for

    def matches(self, percept: Face) -> bool:
        return super().matches(percept) and not (self.new and self._was_met_before(percept))

    def accept(self, percept: Face) -> Status:
        self._meetings += (Meeting.of(percept, self._base_pose()),) if self.new else ()
        return super().accept(percept)

    def keeps_looking(self) -> bool:
        if not self.person_name or self.arrived_at is None or self.run.now() - self.arrived_at > NAME_TIMEOUT:
            return False
        return any(not face.name and face.stamp >= self.arrived_at for face in self.percepts())

    @property
    def counted_since(self) -> float:
        """Since when a face counts: where it is must be known to tell people apart, so then the head must stand."""
        if not self.new:
            return self.started_at
        return math.inf if self.arrived_at is None else self.arrived_at

    def _was_met_before(self, percept: Face) -> bool:
        stand = self._base_pose()
        return any(meeting.is_with(percept, stand) for meeting in self._meetings)

    def _base_pose(self) -> Pose2D:
        """Return where the base is, as far as there is one that tells."""
        state = None if self.robot.base_part is None else self.robot.base.state().value
        return Pose2D(0.0, 0.0, 0.0) if state is None else state.pose


def face_argument(value: object) -> Face | None:
    """Return the face that a mission names, None where it names none. Raises ValueError for what is no face."""
    if value is None or isinstance(value, Face):
        return value
    raise ValueError(f"'face' needs a face that a behaviour has found, such as ${{person}}, got {value!r}")


# The leaf that makes out who somebody is.

FACE_TIMEOUT = 1.0
"""Seconds without the face after which it gives up: as long as a face keeps its id out of view."""


class Identify(PerceptLeaf[Face]):
    """Make out who somebody is, by their face.

    Running until that is decided, then succeeds; `name` of what it keeps is a name that the robot knows, or `unknown`.
    Fails once no such face was in view for a second.
    """

    tag = "identify"
    noun = "face"
    senses = frozenset({"faces", "names"})
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    face: Face | None = argument("face", "whose, as `as` has kept them; else the largest", default=None, principal=True)
    _seen_at = 0.0

    @property
    def age_limit(self) -> float:
        return DEFAULT_MAX_AGE

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def matches(self, percept: Face) -> bool:
        only = face_argument(self.face)
        return only is None or is_same_person(percept, only)

    def initialise(self) -> None:
        self._seen_at = self.run.now()

    def update(self) -> Status:
        face = self.largest_fresh()
        now = self.run.now()
        if face is None:
            gone = now - self._seen_at > FACE_TIMEOUT
            return self.fail(self.absence_reason()) if gone else self.wait(self.absence_reason())
        if face.name:
            return self.accept(face)
        self._seen_at = now
        return self.wait("not decided yet who that is")
