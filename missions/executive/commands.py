"""The parts of the robot as one leaf sees them: every command that it gives is told, with the leaf's name on it."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Generic, TypeVar

from behaviours.node import Node
from behaviours.robot import Robot
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
    Reading,
    Source,
    Steering,
    Tune,
    Utterance,
    Velocity,
    Voice,
)
from drivers.errors import BadRequest

Tell = Callable[[str, str, Mapping[str, object]], None]
"""Told of a command: to which part, from which source, with which values."""

Permit = Callable[[], None]
"""Called before an actuator is set moving; raises where that is not to be."""


def always() -> None:
    """Permit everything."""


def robot_for(node: Node, robot: Robot, tell: Tell, permit: Permit = always) -> Robot:
    """Return ``robot`` as ``node`` sees it."""
    source = f"{node.name} ({node.key})" if node.name != node.kind else f"{node.kind} ({node.key})"
    return Robot(
        base_part=None if robot.base_part is None else ToldBase(robot.base_part, source, tell, permit),
        head_part=None if robot.head_part is None else ToldHead(robot.head_part, source, tell, permit),
        arm_part=None if robot.arm_part is None else ToldJoints(robot.arm_part, source, tell, permit),
        ranger_part=robot.ranger_part,
        voice_part=None if robot.voice_part is None else ToldVoice(robot.voice_part, source, tell, permit),
        sight_part=robot.sight_part,
        eye=robot.eye,
        groups=robot.groups,
    )


D = TypeVar("D", bound=Device)


class _Told(Generic[D]):
    """What all have in common: the device, a source, and a command that is told only when it differs from the last."""

    def __init__(self, device: D, source: str, tell: Tell, permit: Permit) -> None:
        self.name = device.name
        self._device = device
        self._source = source
        self._tell = tell
        self._permit = permit
        self._last: Mapping[str, object] | None = None

    def open(self) -> None:
        """See drivers.api.Device."""
        self._device.open()

    def rest(self) -> None:
        """See drivers.api.Device."""
        self._told(rest=True)
        self._device.rest()

    def close(self) -> None:
        """See drivers.api.Device."""
        self._device.close()

    def health(self) -> Health:
        """See drivers.api.Device."""
        return self._device.health()

    def _told(self, **values: object) -> None:
        if values != self._last:
            self._last = values
            self._tell(self.name, self._source, values)


class ToldBase(_Told[Base]):
    """A base whose commands are told."""

    @property
    def limits(self) -> BaseLimits:
        """See drivers.api.Base."""
        return self._device.limits

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """See drivers.api.Base. Where not all of it is in force, what was wanted is told too."""
        self._permit()
        if source is not Source.MISSION:
            raise BadRequest(f"base: a mission's behaviour cannot drive as '{source}'", hint="leave the source out")
        given = self._device.drive(velocity)
        told: dict[str, object] = {"linear": round(given.linear, 4), "angular": round(given.angular, 4)}
        if given != velocity:
            told |= {"wanted_linear": round(velocity.linear, 4), "wanted_angular": round(velocity.angular, 4)}
        self._told(**told)
        return given

    def latch(self, reason: str) -> None:
        """See drivers.api.Base."""
        self._told(latch=reason)
        self._device.latch(reason)

    def enable(self) -> None:
        """See drivers.api.Base."""
        self._told(enable=True)
        self._device.enable()

    @property
    def latched(self) -> str:
        """See drivers.api.Base."""
        return self._device.latched

    def steering(self) -> Steering:
        """See drivers.api.Base."""
        return self._device.steering()

    def play(self, tune: Tune) -> None:
        """See drivers.api.Base."""
        self._device.play(tune)
        self._told(tune=str(tune))

    def tone(self, frequency: float, seconds: float) -> None:
        """See drivers.api.Base."""
        self._device.tone(frequency, seconds)
        self._told(tone=frequency, seconds=seconds)

    def light(self, number: int, colour: Lamp) -> None:
        """See drivers.api.Base."""
        self._device.light(number, colour)
        self._told(light=number, colour=str(colour))

    def stop(self, *, source: Source | None = None) -> None:
        """See drivers.api.Base; a leaf that stops the base does not stop it for others."""
        del source
        self._told(linear=0.0, angular=0.0)
        self._device.stop(source=Source.MISSION)

    def state(self) -> Reading[BaseState]:
        """See drivers.api.Base."""
        return self._device.state()

    def heading_at(self, stamp: float) -> float | None:
        """See drivers.api.Base."""
        return self._device.heading_at(stamp)


class ToldHead(_Told[Head]):
    """A head whose commands are told."""

    @property
    def limits(self) -> HeadLimits:
        """See drivers.api.Head."""
        return self._device.limits

    def look(self, target: HeadPose) -> HeadPose:
        """See drivers.api.Head."""
        self._permit()
        accepted = self._device.look(target)
        self._told(pan=round(accepted.pan, 4), tilt=round(accepted.tilt, 4))
        return accepted

    def pose(self) -> Reading[HeadPose]:
        """See drivers.api.Head."""
        return self._device.pose()

    def pose_at(self, stamp: float) -> HeadPose | None:
        """See drivers.api.Head."""
        return self._device.pose_at(stamp)

    def stop(self) -> None:
        """See drivers.api.Head."""
        self._told(stop=True)
        self._device.stop()


class ToldJoints(_Told[Joints]):
    """Joints whose commands are told."""

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """See drivers.api.Joints."""
        return self._device.limits

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """See drivers.api.Joints."""
        self._permit()
        accepted = self._device.move(goals, speeds=speeds)
        self._told(**{joint: round(goal, 4) for joint, goal in accepted.items()})
        return accepted

    def states(self) -> Mapping[str, Reading[JointState]]:
        """See drivers.api.Joints."""
        return self._device.states()

    def hold(self, joints: Collection[str] | None = None) -> None:
        """See drivers.api.Joints."""
        self._told(hold=_which(joints))
        self._device.hold(joints)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """See drivers.api.Joints."""
        self._told(relax=_which(joints))
        self._device.relax(joints)

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """See drivers.api.Joints."""
        if couplings:
            self._permit()
        self._device.follow(couplings)
        self._told(follow={coupling.follower: coupling.leader for coupling in couplings})

    def recover(self) -> tuple[str, ...]:
        """See drivers.api.Joints."""
        self._permit()
        recovered = self._device.recover()
        self._told(recover=list(recovered))
        return recovered


class ToldVoice(_Told[Voice]):
    """A voice whose words are told."""

    def say(self, text: str) -> Utterance:
        """See drivers.api.Voice."""
        self._tell(self.name, self._source, {"say": text})
        return self._device.say(text)


def _which(joints: Collection[str] | None) -> bool | list[str]:
    """Return the joints that a command is for; True for all of them."""
    return True if joints is None else list(joints)
