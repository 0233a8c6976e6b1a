"""Leaves that look for people: conditions on faces, a search with the head, and recognition.

A search for new people remembers the people whom the robot has met, with their positions, and so recognises them when
they come into view again.
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
"""Angle in radians between a face and the place of a person met before, within which both count as one person.

At a distance of two metres it is half a step to the side.
"""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Record of a person met: id of the face, position (metres, odometry frame), and ``name`` if known."""

    id: int
    x: float
    y: float
    name: str = ""

    @classmethod
    def of(cls, face: Face, base: Pose2D) -> Self:
        """Return the record of meeting the person of ``face``, seen from a base at the pose ``base``."""
        x, y = base.x + face.distance * math.cos(face.yaw), base.y + face.distance * math.sin(face.yaw)
        return cls(face.id, x, y, face.name)

    def is_with(self, face: Face, base: Pose2D) -> bool:
        """Return True if ``face``, seen from ``base``, belongs to the same person, by id, name or position.

        Ids are lost soon after a face is out of view. If both names are known, they decide. Otherwise the position
        decides, so people must have stayed where they were.
        """
        if face.id == self.id:
            return True
        if is_known(face.name) and is_known(self.name):
            return face.name == self.name
        expected = math.atan2(self.y - base.y, self.x - base.x)
        return abs(math.remainder(face.yaw - expected, math.tau)) <= SAME_PERSON_ANGLE


def is_known(name: str) -> bool:
    """Return True if a face has the name of a known person: not undecided and not unknown."""
    return name not in ("", UNKNOWN)


def is_same_person(face: Face, stored_face: Face) -> bool:
    """Return True if ``face`` belongs to the person of ``stored_face``, by id or by a known name.

    A name outlasts the id, which is lost soon after the face is out of view.
    """
    return face.id == stored_face.id or (is_known(face.name) and face.name == stored_face.name)


def may_be_same_person(face: Face, stored_face: Face) -> bool:
    """Return False if ``face`` is known to belong to another person than ``stored_face``."""
    return not (face.name and is_known(stored_face.name)) or face.name == stored_face.name


FACE_OUTPUT_DOC = "the face: id, name (if names are used), yaw, pitch, distance"
"""Text that describes the output of leaves that store a face."""

NAME_TIMEOUT = 2.0
"""Seconds for which a search waits until the name of a face is decided; most take half a second."""


class FacePerceptLeaf(PerceptLeaf[Face]):
    """Base class of leaves that look for faces, or for the faces of one person."""

    noun = "face"
    person_name: str = argument(
        "text", "name of the person; `unknown` is any stranger, and by default anybody counts", name="name", default=""
    )

    @classmethod
    def senses_for(cls, arguments: Collection[str]) -> frozenset[str]:
        return cls.senses | {"names"} if "name" in arguments else cls.senses

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def matches(self, percept: Face) -> bool:
        return not self.person_name or percept.name.casefold() == self.person_name.casefold()

    def absence_reason(self, so_far: str = "") -> str:
        reason = super().absence_reason(so_far)
        person = "a stranger" if self.person_name.casefold() == UNKNOWN else self.person_name
        return reason.replace("no face", f"no face of {person}") if person else reason


class FaceSeenLeaf(FacePerceptLeaf):
    """Check whether a face is in view.

    Succeeds if a face was seen within the last `within` seconds, fails if not. It answers at once, and is suspended
    while no picture is recent enough.
    """

    tag = "face_seen"
    example = "- face_seen: 1 s"
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    instant = True
    within: float = argument(
        "duration", "maximum age of the sighting", default=DEFAULT_MAX_AGE, principal=True, low=0.01
    )
    nearer: float | None = argument("length", "maximum distance; any distance by default", default=None, low=0.1)

    @property
    def age_limit(self) -> float:
        return self.within

    def matches(self, percept: Face) -> bool:
        return super().matches(percept) and (self.nearer is None or percept.distance <= self.nearer)

    def update(self) -> Status:
        found = self.largest_fresh()
        return self.accept(found) if found is not None else self.fail_absent()


class FacesAtLeast(FacePerceptLeaf):
    """Check whether several faces are in view.

    Succeeds if at least `number` faces were seen within the last `within` seconds, fails if not. It answers at once,
    and is suspended while no picture is recent enough.
    """

    tag = "faces_at_least"
    example = "- faces_at_least: 2"
    output_doc = "the faces, as a list, the largest first"
    output_type = list[Face]
    instant = True
    number: int = argument("count", "minimum number of faces", principal=True, low=1)
    within: float = argument("duration", "maximum age of the sightings", default=DEFAULT_MAX_AGE, low=0.01)

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
    """Check whether a face is in the middle of the picture.

    Succeeds if the largest face, or the given one, is within `within` of the camera's axis, fails if not. It answers at
    once, and is suspended while no picture is recent enough.
    """

    tag = "face_centred"
    example = "- face_centred: 8 deg"
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    instant = True
    within: float = argument("angle", "maximum angle from the axis", default=math.radians(5), principal=True)
    max_age: float = argument("duration", "maximum age of the sighting", default=DEFAULT_MAX_AGE, low=0.01)
    face: Face | None = argument(
        "face", "face from the output of another behaviour; the largest by default", default=None
    )

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
    """Search for a face with the head: first straight at the present pose, then row by row, back and forth.

    Running until a face is seen; then it succeeds and the head stays on it. With a name, the head stays on each face
    until its name is decided. Fails after `scans` rounds without a match. By default it searches for ever, so give it a
    `timeout`.
    """

    tag = "find_face"
    example = "- find_face: {scans: 2}\n  as: person"
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    new: bool = argument("flag", "only people whom this step has not found before in this run", default=False)
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
        """Time from which a face counts: the start of the leaf, or with ``new`` the head's last arrival.

        With ``new``, people are distinguished by their positions, which are not exact while the head moves.
        """
        if not self.new:
            return self.started_at
        return math.inf if self.arrived_at is None else self.arrived_at

    def _was_met_before(self, percept: Face) -> bool:
        stand = self._base_pose()
        return any(meeting.is_with(percept, stand) for meeting in self._meetings)

    def _base_pose(self) -> Pose2D:
        """Return the pose of the base, or the origin if there is none."""
        state = None if self.robot.base_part is None else self.robot.base.state().value
        return Pose2D(0.0, 0.0, 0.0) if state is None else state.pose


def face_argument(value: object) -> Face | None:
    """Return the value of a leaf's argument ``face``: a face, or None if there is none.

    Raises ValueError for any other value.
    """
    if value is None or isinstance(value, Face):
        return value
    raise ValueError(f"'face' needs a face that a behaviour has found, such as ${{person}}, got {value!r}")


# The leaf that makes out who somebody is.

FACE_TIMEOUT = 1.0
"""Seconds without the face in view after which the leaf fails; a face out of view keeps its id as long."""


class Identify(PerceptLeaf[Face]):
    """Identify a person by their face.

    Running until the identity is decided, then succeeds; the `name` of its output is that of a known person, or
    `unknown`. Fails if no matching face was in view for a second.
    """

    tag = "identify"
    example = "- find_face:\n  as: person\n- identify: ${person}\n  as: known"
    noun = "face"
    senses = frozenset({"faces", "names"})
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    face: Face | None = argument(
        "face", "face from the output of another behaviour; the largest by default", default=None, principal=True
    )
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
            is_gone = now - self._seen_at > FACE_TIMEOUT
            return self.fail(self.absence_reason()) if is_gone else self.wait(self.absence_reason())
        if face.name:
            return self.accept(face)
        self._seen_at = now
        return self.wait("not decided yet who that is")
