"""The parts of the robot as one leaf sees them: every command that it gives is told, with the leaf's name on it."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Generic, TypeVar

from behaviours.node import Node
from behaviours.robot import Robot
from drivers.api import (
    AS_USUAL,
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
    Manner,
    Mood,
    Priority,
    Reading,
    Screen,
    Shown,
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


def robot_for(node: Node, robot: Robot, tell: Tell) -> Robot:
    """Return ``robot`` as ``node`` sees it."""
    source = f"{node.name} ({node.key})" if node.name != node.kind else f"{node.kind} ({node.key})"
    return Robot(
        base_part=None if robot.base_part is None else ToldBase(robot.base_part, source, tell),
        head_part=None if robot.head_part is None else ToldHead(robot.head_part, source, tell),
        arm_part=None if robot.arm_part is None else ToldJoints(robot.arm_part, source, tell),
        ranger_part=robot.ranger_part,
        voice_part=None if robot.voice_part is None else ToldVoice(robot.voice_part, source, tell),
        sight_part=robot.sight_part,
        hearing_part=robot.hearing_part,
        screen_part=None if robot.screen_part is None else ToldScreen(robot.screen_part, source, tell),
        eye=robot.eye,
        groups=robot.groups,
        lag=robot.lag,
    )


D = TypeVar("D", bound=Device)


class _Told(Generic[D]):
    """What all have in common: the device, a source, and whom to tell of each command.

    What is only asked, the device itself is asked: ``state`` and its like are its own.
    """

    health: Callable[[], Health]

    def __init__(self, device: D, source: str, tell: Tell) -> None:
        self.health = device.health
        self.name = device.name
        self._device = device
        self._source = source
        self._tell = tell

    def open(self) -> None:
        """See drivers.api.Device."""
        self._device.open()

    def rest(self) -> None:
        """See drivers.api.Device."""
        self._told({"rest": True})
        self._device.rest()

    def close(self) -> None:
        """See drivers.api.Device."""
        self._device.close()

    def _told(self, values: Mapping[str, object]) -> None:
        self._tell(self.name, self._source, values)


class ToldBase(_Told[Base]):
    """A base whose commands are told."""

    state: Callable[[], Reading[BaseState]]
    steering: Callable[[], Steering]

    def __init__(self, device: Base, source: str, tell: Tell) -> None:
        super().__init__(device, source, tell)
        self.state, self.steering = device.state, device.steering

    @property
    def limits(self) -> BaseLimits:
        """See drivers.api.Base."""
        return self._device.limits

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """See drivers.api.Base. Where not all of it is in force, what was wanted is told too."""
        if source is not Source.MISSION:
            raise BadRequest(f"base: a mission's behaviour cannot drive as '{source}'", hint="leave the source out")
        given = self._device.drive(velocity)
        told: dict[str, object] = {"linear": round(given.linear, 4), "angular": round(given.angular, 4)}
        if given != velocity:
            told |= {"wanted_linear": round(velocity.linear, 4), "wanted_angular": round(velocity.angular, 4)}
        self._told(told)
        return given

    def latch(self, reason: str) -> None:
        """See drivers.api.Base."""
        self._told({"latch": reason})
        self._device.latch(reason)

    def enable(self) -> None:
        """See drivers.api.Base."""
        self._told({"enable": True})
        self._device.enable()

    @property
    def latched(self) -> str:
        """See drivers.api.Base."""
        return self._device.latched

    def play(self, tune: Tune) -> None:
        """See drivers.api.Base."""
        self._device.play(tune)
        self._told({"tune": str(tune)})

    def tone(self, frequency: float, seconds: float) -> None:
        """See drivers.api.Base."""
        self._device.tone(frequency, seconds)
        self._told({"tone": frequency, "seconds": seconds})

    def light(self, number: int, colour: Lamp) -> None:
        """See drivers.api.Base."""
        self._device.light(number, colour)
        self._told({"light": number, "colour": str(colour)})

    def stop(self, *, source: Source | None = None) -> None:
        """See drivers.api.Base; a leaf that stops the base does not stop it for others."""
        del source
        self._told({"linear": 0.0, "angular": 0.0})
        self._device.stop(source=Source.MISSION)

    def heading_at(self, stamp: float) -> float | None:
        """See drivers.api.Base."""
        return self._device.heading_at(stamp)


class ToldHead(_Told[Head]):
    """A head whose commands are told."""

    pose: Callable[[], Reading[HeadPose]]

    def __init__(self, device: Head, source: str, tell: Tell) -> None:
        super().__init__(device, source, tell)
        self.pose = device.pose

    @property
    def limits(self) -> HeadLimits:
        """See drivers.api.Head."""
        return self._device.limits

    def look(self, target: HeadPose) -> HeadPose:
        """See drivers.api.Head."""
        accepted = self._device.look(target)
        self._told({"pan": round(accepted.pan, 4), "tilt": round(accepted.tilt, 4)})
        return accepted

    def pose_at(self, stamp: float) -> HeadPose | None:
        """See drivers.api.Head."""
        return self._device.pose_at(stamp)

    def stop(self) -> None:
        """See drivers.api.Head."""
        self._told({"stop": True})
        self._device.stop()


class ToldJoints(_Told[Joints]):
    """Joints whose commands are told."""

    states: Callable[[], Mapping[str, Reading[JointState]]]

    def __init__(self, device: Joints, source: str, tell: Tell) -> None:
        super().__init__(device, source, tell)
        self.states = device.states

    @property
    def limits(self) -> Mapping[str, JointLimits]:
        """See drivers.api.Joints."""
        return self._device.limits

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """See drivers.api.Joints."""
        accepted = self._device.move(goals, speeds=speeds)
        self._told({joint: round(goal, 4) for joint, goal in accepted.items()})
        return accepted

    def hold(self, joints: Collection[str] | None = None) -> None:
        """See drivers.api.Joints."""
        self._told({"hold": _which(joints)})
        self._device.hold(joints)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """See drivers.api.Joints."""
        self._told({"relax": _which(joints)})
        self._device.relax(joints)

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """See drivers.api.Joints."""
        self._device.follow(couplings)
        self._told({"follow": {coupling.follower: coupling.leader for coupling in couplings}})

    def recover(self) -> tuple[str, ...]:
        """See drivers.api.Joints."""
        recovered = self._device.recover()
        self._told({"recover": list(recovered)})
        return recovered


class ToldVoice(_Told[Voice]):
    """A voice whose words are told, with how they are said where that is not as usual."""

    speaking: Callable[[], Utterance | None]

    def __init__(self, device: Voice, source: str, tell: Tell) -> None:
        super().__init__(device, source, tell)
        self.speaking = device.speaking

    def say(self, text: str, manner: Manner = AS_USUAL, priority: Priority = Priority.NORMAL) -> Utterance:
        """See drivers.api.Voice."""
        told = {name: value for name, value in asdict(manner).items() if value}
        self._tell(self.name, self._source, {"say": text, **told, **_raised(priority)})
        return self._device.say(text, manner, priority)

    def play(self, path: Path, priority: Priority = Priority.NORMAL) -> Utterance:
        """See drivers.api.Voice."""
        self._tell(self.name, self._source, {"play": str(path), **_raised(priority)})
        return self._device.play(path, priority)


class ToldScreen(_Told[Screen]):
    """A screen whose moods and words are told; what the mouth does is not."""

    shown: Callable[[], Shown]

    def __init__(self, device: Screen, source: str, tell: Tell) -> None:
        super().__init__(device, source, tell)
        self.shown, self.mouth = device.shown, device.mouth

    def mood(self, mood: Mood) -> None:
        """See drivers.api.Screen."""
        self._tell(self.name, self._source, {"mood": str(mood)})
        self._device.mood(mood)

    def show(self, text: str) -> None:
        """See drivers.api.Screen."""
        self._tell(self.name, self._source, {"show": text})
        self._device.show(text)


def _raised(priority: Priority) -> dict[str, str]:
    return {} if priority is Priority.NORMAL else {"priority": priority.name.lower()}


def _which(joints: Collection[str] | None) -> bool | list[str]:
    """Return the joints that a command is for; True for all of them."""
    return True if joints is None else list(joints)
