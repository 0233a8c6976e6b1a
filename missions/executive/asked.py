"""A robot as a mission asks and commands it: within a moment each question has one answer, and a part is asked once.

That is so whether a run is recorded or not, and it is what makes a record enough to decide everything over again:
whatever a tree is told from outside comes through here. A command that is not permitted is refused here too, as a
driver would. In answers the parts go by the names that they have in ``behaviours.robot.Robot``: base, head, arm,
ranger, voice, sight, hearing, screen. Arguments are those of the protocol in its order, with what may be left out.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

from behaviours.robot import Robot
from missions.executive.answers import Answers
from missions.executive.asked_parts import AskedBase, AskedHead, AskedJoints, AskedRanger, Permit, always
from missions.executive.asked_sight import AskedHearing, AskedScreen, AskedSight, AskedVoice


def asked(robot: Robot, answers: Answers, permit: Permit = always) -> Robot:
    """Return ``robot`` so that its parts answer through ``answers``; ``permit`` is asked before anything moves."""
    base, head, arm, ranger = robot.base_part, robot.head_part, robot.arm_part, robot.ranger_part
    voice, sight, hearing, screen = robot.voice_part, robot.sight_part, robot.hearing_part, robot.screen_part
    found = replace(
        robot,
        base_part=None if base is None else AskedBase("base", base, answers, permit),
        head_part=None if head is None else AskedHead("head", head, answers, permit),
        arm_part=None if arm is None else AskedJoints("arm", arm, answers, permit),
        ranger_part=None if ranger is None else AskedRanger("ranger", ranger, answers),
        voice_part=None if voice is None else AskedVoice("voice", voice, answers),
        sight_part=None if sight is None else AskedSight("sight", sight, answers),
        hearing_part=None if hearing is None else AskedHearing("hearing", hearing, answers),
        screen_part=None if screen is None else AskedScreen("screen", screen, answers),
    )
    answers.watch(tuple(_states(found)), tuple(_properties(found)))
    return found


def _states(robot: Robot) -> Iterator[Callable[[], object]]:
    """Yield what is worth knowing of a robot at any time."""
    if robot.base_part is not None:
        yield from (robot.base_part.state, robot.base_part.steering)
    if robot.head_part is not None:
        yield robot.head_part.pose
    if robot.arm_part is not None:
        yield robot.arm_part.states
    if robot.ranger_part is not None:
        yield robot.ranger_part.scan
    if robot.sight_part is not None:
        sight = robot.sight_part
        yield from (sight.looked, sight.faces, sight.things, sight.markers, sight.scene)
    if robot.hearing_part is not None:
        yield from (robot.hearing_part.listened, robot.hearing_part.words, robot.hearing_part.refused)
    if robot.screen_part is not None:
        yield robot.screen_part.shown


def _properties(robot: Robot) -> Iterator[Callable[[], object]]:
    """Yield what does not change."""
    base, head, arm, ranger = robot.base_part, robot.head_part, robot.arm_part, robot.ranger_part
    if base is not None:
        yield lambda: base.limits
    if head is not None:
        yield lambda: head.limits
    if arm is not None:
        yield lambda: arm.limits
    if ranger is not None:
        yield lambda: ranger.place
