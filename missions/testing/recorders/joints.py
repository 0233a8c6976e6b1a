"""Joints that keep what they were told, and a head."""

from collections.abc import Collection, Mapping, Sequence

from drivers.api import (
    Coupling,
    Head,
    HeadLimits,
    HeadPose,
    JointLimits,
    Joints,
    JointState,
    Quality,
    Reading,
)
from drivers.clock import ManualClock
from missions.testing.recorders.spy import HOLD, RECOVER, RELAX, STOP, Spy, good


class RecordedHead(Spy):
    """A ``drivers.api.Head``; the test sets ``reading`` and ``limits``."""

    protocol = Head

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("head", clock)
        self.limits = HeadLimits(pan=(-1.4, 1.4), tilt=(-1.0, 0.35), speed=2.0)
        self.reading: Reading[HeadPose] = good(HeadPose(0.0, 0.0))

    def look(self, target: HeadPose) -> HeadPose:
        """Keep the pose as clamped."""
        return self.keep(self.limits.clamp(target))

    def pose(self) -> Reading[HeadPose]:
        """Return what the test has set."""
        return self.reading

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Return the pose now, for want of a past."""
        del stamp
        return self.reading.value

    def stop(self) -> None:
        """Keep that it was told to stop."""
        self.keep_anyway(STOP)


class RecordedJoints(Spy):
    """A ``drivers.api.Joints``; the test sets ``limits``, the ``readings`` by name, and which joints are ``shut``.

    It keeps moves as mappings of goals, whose speeds are in ``speeds``, and couplings as tuples.
    """

    protocol = Joints

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("arm", clock)
        self.limits: dict[str, JointLimits] = {
            "shoulder": JointLimits(-1.0, 2.0, speed=2.0),
            "elbow": JointLimits(0.0, 2.2, speed=3.0),
        }
        self.readings: dict[str, Reading[JointState]] = {}
        self.speeds: list[Mapping[str, float]] = []
        self.shut: tuple[str, ...] = ()
        self.place({"shoulder": 0.0, "elbow": 0.0})

    def place(self, positions: Mapping[str, float], *, stiff: bool = True) -> None:
        """Put joints where they are to be, in radians, and let that be measured now."""
        for joint, position in positions.items():
            self.feel(joint, JointState(position, 0.0, None, 0.0, 12.0, 30.0, moving=False, torque=stiff))

    def feel(self, joint: str, state: JointState) -> None:
        """Let a joint feel this, and let that be measured now."""
        self.readings[joint] = Reading(state, self.clock.now(), Quality.GOOD)

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Keep the goals, and the speeds."""
        kept = self.keep(dict(goals))
        self.speeds.append(dict(speeds or {}))
        return kept

    def states(self) -> Mapping[str, Reading[JointState]]:
        """Return what the test has set."""
        return self.readings

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Keep that it, or these joints, were told to hold."""
        self.keep_anyway(HOLD if joints is None else (HOLD, *joints))

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Keep that it, or these joints, were told to relax."""
        self.keep_anyway(RELAX if joints is None else (RELAX, *joints))

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Keep the couplings."""
        self.keep(tuple(couplings))

    def recover(self) -> tuple[str, ...]:
        """Keep that it was told to recover; return those that were shut."""
        self.keep(RECOVER)
        recovered, self.shut = self.shut, ()
        return recovered
