"""The leaf that keeps a face in the middle of the picture, with the head first and the base behind it."""

import math
from collections.abc import Sequence

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.sight import chosen
from behaviours.tracking.follow import Follower, RuleBases
from drivers.api import COMMAND_LIFE, HeadPose, Velocity
from perception.api import Face


class TrackFace(Leaf):
    """Follow a face with the head, and turn the base when the head nears its limit.

    Running while there is a face to follow; it never succeeds. Fails once none was seen for `patience`.
    Once it follows somebody it stays with them, whoever else comes into view, until that face is lost.
    """

    word = "track_face"
    ends = frozenset({"failure"})
    needs = frozenset({"camera", "head"})
    drives = frozenset({"head", "base"})
    stores = "the face: id, yaw, pitch, distance"
    controller: RuleBases = argument("controller", "the rules to follow by", default="face", principal=True)
    patience: float = argument("duration", "how long to go on without a face", default=2.0, low=0.1)
    max_turn: float = argument(
        "turn rate", "how fast the base may turn; 0 deg/s keeps it still", default=math.radians(110), low=0.0
    )
    face: object = argument("value", "whom to begin with, as `as` has kept them; else the largest face", default=None)
    _follower: Follower | None = None
    _face: Face | None = None
    _seen_at = 0.0

    def initialise(self) -> None:
        self._face = chosen(self.face)
        self._seen_at = self.run.now()
        self._follower = Follower(self.controller, limits=self.robot.head.limits, max_turn=self.max_turn)

    def update(self) -> Status:
        trouble = self.trouble()
        if trouble:
            return self.fail(trouble)
        now = self.run.now()
        face = self._choose([face for face in self.robot.sight.faces() if now - face.stamp <= self.patience])
        if face is not None:
            self._face, self._seen_at = face, max(self._seen_at, face.stamp)
        unseen = now - self._seen_at
        if unseen > self.patience:
            return self.fail(f"no face for {self.patience:g} s")
        # A face that was not seen for a moment goes on as it did, for as long as a command is good; then all waits.
        if self._face is None or self._follower is None or unseen > COMMAND_LIFE:
            self._drive(0.0, 0.0)
            return self.wait(f"no face for {unseen:.1f} s")
        self.result = self._face
        return self._follow(now, self._face, self._follower)

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()
            if self.robot.base_part is not None:
                self.robot.base.stop()

    def trouble(self) -> str:
        """Return why it cannot go on, or nothing: for those that do more than turn."""
        return ""

    def forward(self, face: Face, pan: float) -> float:
        """Return how fast the base is to drive (m/s) with the head turned by ``pan``: not at all, on the spot."""
        del face, pan
        return 0.0

    def _choose(self, faces: Sequence[Face]) -> Face | None:
        """Stay with the face that is followed, else take the largest."""
        if self._face is not None:
            same = next((face for face in faces if face.id == self._face.id), None)
            if same is not None:
                return same
        return faces[0] if faces else None

    def _follow(self, now: float, face: Face, follower: Follower) -> Status:
        heading, turning = self._motion()
        pose = self.robot.head.pose().value
        command = follower.step(now, face, head=pose or HeadPose(0.0, 0.0), heading=heading, turning=turning)
        self.robot.head.look(command.head)
        self._drive(self.forward(face, command.head.pan), command.turn)
        off = math.degrees(max(abs(face.bearing), abs(face.drop)))
        return self.wait(f"face {face.id}, {off:.0f} deg off")

    def _motion(self) -> tuple[float, float]:
        """Return the base's heading (rad) and turn rate (rad/s); a robot without a base stands still."""
        if self.robot.base_part is None:
            return 0.0, 0.0
        reading = self.robot.base.state()
        if reading.value is None:
            return 0.0, 0.0
        # Reports that fail to come say where it was; but not that it still turns, as it stops by itself.
        return reading.value.pose.heading, reading.value.velocity.angular if reading.good else 0.0

    def _drive(self, speed: float, turn: float) -> None:
        if self.robot.base_part is not None:
            self.robot.base.drive(Velocity(speed, turn))
