"""Base, head, arm and range finder as a mission asks and commands them; see ``asked``.

A question without arguments is a look into the part's memo, without a call of our own: it is what a tick does most.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Generic, TypeVar

from drivers.api import (
    Base,
    BaseLimits,
    BaseState,
    Coupling,
    Device,
    Head,
    HeadLimits,
    HeadPose,
    Health,
    JointLimits,
    Joints,
    JointState,
    Lamp,
    Ranger,
    RangeScan,
    Reading,
    Source,
    Steering,
    Tune,
    Velocity,
)
from missions.executive.answers import Answers

D = TypeVar("D", bound=Device)

Permit = Callable[[Device], None]
"""Called with a device before that is set moving; raises DeviceFault where that is not to be."""

Questions = Mapping[str, Callable[[], object]]
"""How a part is asked what needs no argument, by name."""


def always(device: Device) -> None:
    """Permit everything."""
    del device


class Asked(Generic[D]):
    """What all have in common: the ``device``, and what it has answered as ``part``, by its ``questions``."""

    __slots__ = ("_device", "_do", "_known", "_permit", "health", "name")
    health: Callable[[], Health]

    def __init__(
        self,
        part: str,
        device: D,
        answers: Answers,
        permit: Permit = always,
        *,
        questions: Questions,
    ) -> None:
        self.name = device.name
        self._device = device
        self._permit = permit
        self._known = answers.memo(part, {"health": device.health, **questions})
        self._do = self._known.command
        self.health = partial(self._known.__getitem__, "health")

    def open(self) -> None:
        """See drivers.api.Device."""
        self._device.open()

    def rest(self) -> None:
        """See drivers.api.Device."""
        self._do("rest", self._device.rest)

    def close(self) -> None:
        """See drivers.api.Device."""
        self._device.close()


class AskedBase(Asked[Base]):
    """A base."""

    __slots__ = ("state", "steering")
    state: Callable[[], Reading[BaseState]]
    steering: Callable[[], Steering]

    def __init__(self, part: str, device: Base, answers: Answers, permit: Permit = always) -> None:
        questions: Questions = {
            "limits": partial(getattr, device, "limits"),
            "latched": partial(getattr, device, "latched"),
            "state": device.state,
            "steering": device.steering,
        }
        super().__init__(part, device, answers, permit, questions=questions)
        self.state = partial(self._known.__getitem__, "state")
        self.steering = partial(self._known.__getitem__, "steering")

    @property
    def limits(self) -> BaseLimits:
        """See drivers.api.Base."""
        limits: BaseLimits = self._known["limits"]
        return limits

    @property
    def latched(self) -> str:
        """See drivers.api.Base."""
        latched: str = self._known["latched"]
        return latched

    def heading_at(self, stamp: float) -> float | None:
        """See drivers.api.Base."""
        return self._known.ask("heading_at", self._device.heading_at, stamp)

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """See drivers.api.Base."""
        return self._do("drive", self._drive, velocity, source)

    def _drive(self, velocity: Velocity, source: Source) -> Velocity:
        self._permit(self._device)
        return self._device.drive(velocity, source=source)

    def stop(self, *, source: Source | None = None) -> None:
        """See drivers.api.Base."""
        self._do("stop", self._stop, source)

    def _stop(self, source: Source | None) -> None:
        self._device.stop(source=source)

    def latch(self, reason: str) -> None:
        """See drivers.api.Base."""
        self._do("latch", self._device.latch, reason)

    def enable(self) -> None:
        """See drivers.api.Base."""
        self._do("enable", self._device.enable)

    def play(self, tune: Tune) -> None:
        """See drivers.api.Base."""
        self._do("play", self._device.play, tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """See drivers.api.Base."""
        self._do("tone", self._device.tone, frequency, seconds)

    def light(self, number: int, colour: Lamp) -> None:
        """See drivers.api.Base."""
        self._do("light", self._device.light, number, colour)


class AskedHead(Asked[Head]):
    """A head."""

    __slots__ = ("pose",)
    pose: Callable[[], Reading[HeadPose]]

    def __init__(self, part: str, device: Head, answers: Answers, permit: Permit = always) -> None:
        questions: Questions = {"limits": partial(getattr, device, "limits"), "pose": device.pose}
        super().__init__(part, device, answers, permit, questions=questions)
        self.pose = partial(self._known.__getitem__, "pose")

    @property
    def limits(self) -> HeadLimits:
        """See drivers.api.Head."""
        limits: HeadLimits = self._known["limits"]
        return limits

    def pose_at(self, stamp: float) -> HeadPose | None:
        """See drivers.api.Head."""
        return self._known.ask("pose_at", self._device.pose_at, stamp)

    def look(self, target: HeadPose) -> HeadPose:
        """See drivers.api.Head."""
        return self._do("look", self._look, target)

    def _look(self, target: HeadPose) -> HeadPose:
        self._permit(self._device)
        return self._device.look(target)

    def stop(self) -> None:
        """See drivers.api.Head."""
        self._do("stop", self._device.stop)


class AskedJoints(Asked[Joints]):
    """An arm."""

    __slots__ = ("states",)
    states: Callable[[], Mapping[str, Reading[JointState]]]

    def __init__(self, part: str, device: Joints, answers: Answers, permit: Permit = always) -> None:
        questions: Questions = {"limits": partial(getattr, device, "limits"), "states": device.states}
        super().__init__(part, device, answers, permit, questions=questions)
        self.states = partial(self._known.__getitem__, "states")

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """See drivers.api.Joints."""
        limits: Mapping[str, JointLimits] = self._known["limits"]
        return limits

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """See drivers.api.Joints."""
        return self._do("move", self._move, dict(goals), None if speeds is None else dict(speeds))

    def _move(self, goals: Mapping[str, float], speeds: Mapping[str, float] | None) -> Mapping[str, float]:
        self._permit(self._device)
        return self._device.move(goals, speeds=speeds)

    def hold(self, joints: Collection[str] | None = None) -> None:
        """See drivers.api.Joints."""
        self._do("hold", self._device.hold, None if joints is None else tuple(joints))

    def relax(self, joints: Collection[str] | None = None) -> None:
        """See drivers.api.Joints."""
        self._do("relax", self._device.relax, None if joints is None else tuple(joints))

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """See drivers.api.Joints."""
        self._do("follow", self._follow, tuple(couplings))

    def _follow(self, couplings: Sequence[Coupling]) -> None:
        if couplings:
            self._permit(self._device)
        self._device.follow(couplings)

    def recover(self) -> tuple[str, ...]:
        """See drivers.api.Joints."""
        return self._do("recover", self._recover)

    def _recover(self) -> tuple[str, ...]:
        self._permit(self._device)
        return self._device.recover()


class AskedRanger(Asked[Ranger]):
    """A range finder."""

    __slots__ = ("scan",)
    scan: Callable[[], Reading[RangeScan]]

    def __init__(self, part: str, device: Ranger, answers: Answers) -> None:
        super().__init__(
            part, device, answers, questions={"place": partial(getattr, device, "place"), "scan": device.scan}
        )
        self.scan = partial(self._known.__getitem__, "scan")

    @property
    def place(self) -> tuple[float, float, float]:
        """See drivers.api.Ranger."""
        place: tuple[float, float, float] = self._known["place"]
        return place
