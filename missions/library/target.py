"""Description of the robot that a mission is checked for: parts, joint ranges, pronunciation."""

from collections.abc import Sequence
from functools import partial

from behaviours.joint_ranges import JointRanges
from behaviours.robot import Robot
from config.robot import RobotConfig
from drivers.api.sections import ArmKeys, BaseKeys, HeadKeys
from drivers.api.sensor_sections import MicrophoneKeys
from missions.language.claims import TargetRobot


def target_of(robot: RobotConfig) -> TargetRobot:
    """Return the robot of a robot file as the mission checker describes it."""
    keys = {part: section.keys for part, section in robot.sections.items()}
    reaches = {part: JointRanges(it.limits, it.groups) for part, it in keys.items() if isinstance(it, ArmKeys)}
    necks = {joint: part for part, it in keys.items() if isinstance(it, HeadKeys) for joint in it.led_joints}
    bases = [it for it in keys.values() if isinstance(it, BaseKeys)]
    capabilities = frozenset[str]().union(*(it.capabilities for it in bases))
    target = TargetRobot(
        robot.name, robot.parts, reaches, robot.extra_parts, head_joints=necks, capabilities=capabilities
    )
    if robot.microphone is None:
        return target
    ears = robot.microphone
    return target._replace(unpronounceable=partial(_unpronounceable, ears), confusable=partial(_confusable, ears))


def target_of_parts(robot: Robot) -> TargetRobot:
    """Return a connected robot as the mission checker describes it."""
    others = {name: other.kind for name, other in robot.extra_parts.items()}
    arms = {"arm": robot} if robot.arm_part is not None else {}
    arms |= {name: robot.with_named_parts({kind: name}) for name, kind in others.items() if kind == "arm"}
    reaches = {name: arm.joint_ranges for name, arm in arms.items()}
    return TargetRobot("this robot", robot.parts, reaches, others, capabilities=robot.capabilities)


def _unpronounceable(config: MicrophoneKeys, words: Sequence[str]) -> Sequence[str]:
    from missions.library.pronunciation import find_unpronounceable  # noqa: PLC0415 - ears, a voice, and numpy

    return find_unpronounceable(config, words)


def _confusable(config: MicrophoneKeys, phrases: Sequence[str]) -> Sequence[tuple[str, str]]:
    from missions.library.pronunciation import find_confusable_phrases  # noqa: PLC0415 - ears, a voice, and numpy

    return find_confusable_phrases(config, phrases)
