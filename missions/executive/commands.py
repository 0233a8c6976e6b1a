"""The parts of the robot as one leaf sees them: every command that it gives is told, with the leaf's name on it."""

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from behaviours.node import Node
from behaviours.robot import Robot
from drivers.api import (
    Base,
    BaseState,
    Device,
    Head,
    HeadLimits,
    HeadPose,
    Health,
    JointLimits,
    Joints,
    JointState,
    Reading,
    Utterance,
    Velocity,
    Voice,
)

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
        voice_part=None if robot.voice_part is None else ToldVoice(robot.voice_part, source, tell, permit),
        sight_part=robot.sight_part,
        eye=robot.eye,
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

    def drive(self, velocity: Velocity) -> Velocity:
        """See drivers.api.Base."""
        self._permit()
        accepted = self._device.drive(velocity)
        self._told(linear=round(accepted.linear, 4), angular=round(accepted.angular, 4))
        return accepted

    def stop(self) -> None:
        """See drivers.api.Base."""
        self._told(linear=0.0, angular=0.0)
        self._device.stop()

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

    def hold(self) -> None:
        """See drivers.api.Joints."""
        self._told(hold=True)
        self._device.hold()

    def relax(self) -> None:
        """See drivers.api.Joints."""
        self._told(relax=True)
        self._device.relax()


class ToldVoice(_Told[Voice]):
    """A voice whose words are told."""

    def say(self, text: str) -> Utterance:
        """See drivers.api.Voice."""
        self._tell(self.name, self._source, {"say": text})
        return self._device.say(text)
