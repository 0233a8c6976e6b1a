"""The robot that a mission is checked for: what it is called and has, how far its joints go, what its ears know."""

from collections.abc import Sequence
from functools import partial

from behaviours.reach import Reach
from config.robot import RobotConfig
from drivers.api.senses import MicrophoneKeys
from missions.language.claims import Target


def target_of(robot: RobotConfig) -> Target:
    """Return what the checker must know of a robot."""
    reach = None
    if robot.arm is not None:
        reach = Reach(robot.arm.limits, robot.arm.groups)
    if robot.microphone is None:
        return Target(robot.name, robot.parts, reach)
    return Target(robot.name, robot.parts, reach, partial(_unpronounceable, robot.microphone))


def _unpronounceable(config: MicrophoneKeys, words: Sequence[str]) -> Sequence[str]:
    """Return those of some words that the robot cannot listen for; for a mission that does."""
    from missions.assembly.pronouncing import unpronounceable  # noqa: PLC0415 - ears, a voice, and numpy

    return unpronounceable(config, words)
