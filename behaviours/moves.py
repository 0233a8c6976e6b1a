"""Leaves that play recorded movements and record them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from py_trees.common import Status

from behaviours.joint_motion import ON_ARM, RUN_IN
from behaviours.joint_ranges import JointRanges
from behaviours.leaf import IDLE, SUCCESS, Leaf, argument, log
from behaviours.playing import Played, Playing
from behaviours.tracking_error import JointError, Sample, Tracking
from drivers.api import Gesture as Movement
from drivers.api import JointState, Reading
from drivers.errors import BadRequest


class Play(Played):
    """Play a movement that was recorded, or that a spreadsheet holds.

    Running while it comes to the first pose, slowly, and then until the last one is reached, then succeeds. A movement
    that the joints cannot follow is slowed down. Fails before anything moves when the arm lacks a joint or a pose lies
    outside its limits, and in the end when a joint did not arrive.
    """

    word = "play"
    stores = "how well it was followed, by joint: rms, worst (radians), at (seconds), readings"
    keeps = Mapping[str, JointError]
    move: Movement = argument("move", "which one: a name, or a file: .yaml, .csv, .xls, .xlsx or .ods", principal=True)
    speed: float = argument("number", "1 plays it as recorded, 0.5 at half the speed", default=1.0, low=0.05, high=2.0)
    on: str = ON_ARM
    run_in = RUN_IN
    tracking: Tracking
    _begins = 0.0

    @property
    def movement(self) -> Movement:
        return self.move

    def path(self, start: Mapping[str, float]) -> Playing:
        playing = super().path(start)
        self.tracking, self._begins = Tracking(), playing.times[1]
        return playing

    def follow(self, time: float, samples: Mapping[str, Sample]) -> Status:
        self.tracking.take(each for each in samples.values() if self._begins <= each.time <= self._duration)
        status = super().follow(time, samples)
        if status is SUCCESS:
            self.result = self.tracking.errors()
        return status


class Recording(Protocol):
    """A movement while it is made."""

    @property
    def seconds(self) -> float:
        """How long it is by now."""
        ...

    def add(self, states: Mapping[str, Reading[JointState]], now: float) -> None:
        """Take the newest readings. Raises drivers.errors.NoReply once they have stayed away for too long."""
        ...

    def write(self) -> None:
        """Write it to its file. Raises drivers.errors.BadRequest where that cannot be, or nothing has moved."""
        ...


class NewMove(Protocol):
    """A file that a movement is recorded into, by the name that the mission gives it."""

    @property
    def path(self) -> Path:
        """Where it will be."""
        ...

    def begin(self, joints: Sequence[str]) -> Recording:
        """Return an empty recording of these joints."""
        ...


class RecordMove(Leaf):
    """Record what joints do, to be played again, into a file that must not be there yet.

    Running until it is halted, or for that long; then the file is written. It drives nothing: let `torque: off` make
    the joints limp before, to be moved by hand, or another behaviour move them meanwhile. Fails when the file is there
    already or cannot be written, when joints fall silent, and when nothing has moved.
    """

    word = "record_move"
    needs = frozenset({"arm"})
    stores = "the path of the file"
    keeps = str
    move: NewMove = argument("new move", "a name, for NAME.yaml in the current folder, or a path", principal=True)
    joints: tuple[str, ...] = argument("joints", "which; else all", default=())
    duration: float | None = argument("duration", "how long; else until it is halted", default=None, low=0.1)
    on: str = ON_ARM
    _recording: Recording

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.unknown(self.joints)

    def initialise(self) -> None:
        if self.move.path.exists():
            raise BadRequest(f"{self.move.path} is there already: remove it, or choose another name")
        self._recording = self.move.begin(self.robot.reach.named(self.joints))

    def update(self) -> Status:
        recording = self._recording
        recording.add(self.robot.arm.states(), self.run.now())
        # A duration that is a whole number of ticks is over with the last of them, in spite of rounding.
        if self.duration is None or recording.seconds < self.duration - 1e-6:
            return self.wait(f"recording for {recording.seconds:.1f} s")
        recording.write()
        self.result = str(self.move.path)
        return SUCCESS

    def terminate(self, new_status: Status) -> None:
        if new_status is not IDLE:
            return
        try:
            self._recording.write()
        except BadRequest as error:  # nobody waits for its result any more
            log.error("%s: %s", self.place, error)
