"""Small trial movements of a robot's parts, with a question to the user before and after each."""

import math
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from py_trees.common import Status

from behaviours.catalogue import LEAVES
from behaviours.joint_motion import ARM_ARGUMENT, JointMotion, JointSample, positions
from behaviours.joint_ranges import JointRanges
from behaviours.leaf import RUNNING, SUCCESS, Leaf, argument
from behaviours.node import Node
from config.diagnostics import SourceText
from config.robot import RobotConfig, Section
from drivers.api import ignore
from drivers.api.driver import Finding, failure, warning
from drivers.api.sections import ArmKeys
from missions.executive.executive import Result
from missions.language.document import check_plan
from missions.library.lookups import LOOKUPS
from missions.library.target import target_of
from missions.plugins.setup.checkup import PartFinding
from missions.plugins.setup.doctor.base_verdict import SeenMotion, TryBase, judge_base
from missions.plugins.setup.servo.leaf_run import run_plan
from missions.request import RunRequest
from perception.api import Frame

# Leaf that moves a joint a little way back and forth from its present position.

TRAVEL = math.radians(4.0)
"""Angle in radians by which a trial moves a joint."""

DURATION = 2.0
"""Duration in seconds of a joint's movement back and forth in a trial."""

SETTLING_TIME = 0.5
"""Seconds after a joint's movement until its last measurements have arrived."""


class NudgePath:
    """Path of a joint that moves by ``way`` (rad) and back smoothly, while all other joints stay at ``start``."""

    def __init__(self, start: Mapping[str, float], way: float) -> None:
        self._start, self._way = start, way

    def at(self, time: float) -> Mapping[str, float]:
        """Return the angle of each joint at ``time`` (s)."""
        share = math.sin(math.pi * min(max(time / DURATION, 0.0), 1.0)) ** 2
        return {joint: angle + self._way * share for joint, angle in self._start.items()}


class Nudge(JointMotion):
    """Move a joint by a small angle and back, as a trial.

    Running for some seconds, then succeeds. Fails before moving if the joint is outside its limits, by more than the
    tolerance for an arm that sags. Fails at the end if the joint did not move.
    """

    tag = "nudge"
    joint: str = argument("joint", "which joint", principal=True)
    on: str = ARM_ARGUMENT
    _begun: Mapping[str, float]
    _moved = 0.0

    def joint_violations(self, reach: JointRanges) -> list[str]:
        """Return an error if the arm lacks the joint that this leaf moves; otherwise an empty list."""
        return reach.missing_joints((self.joint,))

    def moved_joints(self) -> tuple[str, ...]:
        """Return the name of the joint that this leaf moves."""
        return (self.joint,)

    def update(self) -> Status:
        """Before the motion begins, fail if the joint is outside its limits; then do the work of one tick."""
        here = positions(self.robot.arm).get(self.joint)
        if self._path is None and here is not None:
            limits = self.robot.arm.limits[self.joint]
            if not limits.lower - TRAVEL <= here <= limits.upper + TRAVEL or limits.upper - limits.lower < TRAVEL:
                ends = f"{math.degrees(limits.lower):.0f} to {math.degrees(limits.upper):.0f} deg"
                return self.fail(f"it stands at {math.degrees(here):.0f} deg; its limits are {ends}")
        return super().update()

    def path(self, start: Mapping[str, float]) -> NudgePath:
        """Return the path of the joint: towards larger angles if the limits allow it."""
        self._begun, self._moved = start, 0.0
        room = self.robot.arm.limits[self.joint].upper - start[self.joint] >= TRAVEL
        return NudgePath(start, TRAVEL if room else -TRAVEL)

    def follow(self, time: float, samples: Mapping[str, JointSample]) -> Status:
        """Wait until the joint is back at its start; then succeed if it has moved."""
        if self.joint in samples:
            self._moved = max(self._moved, abs(samples[self.joint].position - self._begun[self.joint]))
        if time < DURATION + SETTLING_TIME:
            return RUNNING
        if self._moved < TRAVEL / 4:
            return self.fail(f"commanded {math.degrees(TRAVEL):.0f} deg, moved {math.degrees(self._moved):.1f}")
        return SUCCESS


Ask = Callable[[str], bool]
"""Function that asks the user a yes/no question."""


@dataclass(frozen=True, slots=True)
class MovementTrial:
    """Trial movement of a part of the robot.

    ``about`` names the moving thing, ``steps`` are the lines of the mission that moves it. The user reads the
    ``description`` before, and answers the ``question`` after it, whether the movement was seen. If not, ``fix`` is
    suggested.
    """

    about: str
    description: str
    steps: tuple[str, ...]
    question: str
    fix: str

    @property
    def source(self) -> SourceText:
        """Mission file that runs the steps of the trial."""
        steps = "".join(f"    - {step}\n" for step in self.steps)
        return SourceText("doctor", f"mission: doctor\ntree:\n  sequence:\n{steps}")


def try_movements(
    config: RobotConfig, robot_name: str, ports: Mapping[str, str], *, faulty_parts: frozenset[str], ask: Ask
) -> Iterator[PartFinding]:
    """Yield the findings of each trial movement of a robot; ``faulty_parts`` are not tried."""
    request = RunRequest("doctor", robot=robot_name, ports=ports)
    for part, section in config.sections.items():
        for trial in movement_trials(part, section):
            if part in faulty_parts:
                fix = "fix the fault first"
                yield PartFinding(part, warning(trial.about, "not tried, because of its fault", fix))
            elif not ask(f"{part}: {trial.description}. Continue?"):
                yield PartFinding(part, Finding(trial.about, "not tried"))
            elif part == "head" and config.camera is not None and "camera" not in faulty_parts:
                lens = config.camera.upright().field_of_view
                yield from (PartFinding(part, finding) for finding in _try_head(trial, config, request, ask, lens))
            elif section.driver.kind == "base":
                yield from (PartFinding(part, finding) for finding in _try_base(trial, config, request, ask))
            else:
                yield PartFinding(part, _try_part(trial, config, request, ask))


def movement_trials(part: str, section: Section) -> Iterator[MovementTrial]:
    """Yield the trial movements for a part of a robot."""
    kind = section.driver.kind
    of, which = ("", "") if part == kind else (f", on: {part}", f" --{kind} {part}")
    if kind == "base":
        does = (
            "it turns by 10 degrees to its left and back, then goes 5 cm ahead and back; keep the floor around it free"
        )
        yield MovementTrial("moving", does, (TryBase.tag,), "Did it turn to its left first?", "")
    elif kind == "head":
        poses = ((0, 0), (8, 0), (0, 0), (0, -8), (0, 0))
        steps = tuple(f"look: {{pan: {pan} deg, tilt: {tilt} deg{of}}}" for pan, tilt in poses)
        does = "it looks straight ahead, a little to its left, and a little up"
        fix = "in the robot file, reverse the axis that went wrong; if it is askew: mission head trim --robot ROBOT"
        fix = fix.replace("ROBOT", f"ROBOT{which}")
        yield MovementTrial("looking", does, steps, "Did it look ahead, then to its left, then up?", fix)
    elif kind == "arm" and isinstance(section.keys, ArmKeys):
        fix = "mission servo scan --robot ROBOT  (do two joints have one ID?)"
        fix = fix.replace("ROBOT", f"ROBOT{which}")
        for joint in section.keys.limits:
            does = f"{joint} goes 4 degrees to one side, and back; the {part} is switched on"
            yield MovementTrial(
                joint, does, (f"nudge: {{joint: {joint}{of}}}",), f"Did {joint} move, and nothing else?", fix
            )
    elif kind == "voice":
        fix = "speaker-test -t wav -c 1 -l 1  (do you hear that? else: alsamixer)"
        yield MovementTrial("speaking", "it says a few words", ("say: one, two, three",), "Did you hear it?", fix)


def _run_trial(
    trial: MovementTrial,
    config: RobotConfig,
    request: RunRequest,
    on_frame: Callable[[Frame, object], None] = ignore,
    extra_leaves: Mapping[str, type[Leaf]] = MappingProxyType({}),
) -> tuple[Result, Node]:
    """Run the mission of a trial movement; return its result, and the root node of its tree.

    ``on_frame`` is called with each camera picture. ``extra_leaves`` are leaves by tag that the mission may use in
    addition. Raises KeyboardInterrupt if the run was interrupted.
    """
    own: dict[str, type[Leaf]] = {Nudge.tag: Nudge, TryBase.tag: TryBase, **extra_leaves}
    plan = check_plan(trial.source, {**LEAVES, **own}, LOOKUPS, robot=target_of(config))
    result, root = run_plan(plan, request, out=sys.stderr, on_frame=on_frame)
    if result.result == "interrupted":
        raise KeyboardInterrupt
    return result, root


def _try_base(trial: MovementTrial, config: RobotConfig, request: RunRequest, ask: Ask) -> Iterator[Finding]:
    """Move a base a little, and judge motors, encoders and gyro by the motion that the user saw."""
    result, root = _run_trial(trial, config, request)
    leaf = next(node for node in root.iterate() if isinstance(node, TryBase))
    if result.result != "success":
        yield failure(trial.about, result.reason, f"fix that, then: mission doctor --move --robot {request.robot}")
        return
    turn = _ask_motion(ask, trial.question, SeenMotion.LEFT)
    ahead = _ask_motion(ask, "Then, did it go ahead first?", SeenMotion.AHEAD)
    yield from judge_base(leaf.trial, turn, ahead)


def _try_head(
    trial: MovementTrial, config: RobotConfig, request: RunRequest, ask: Ask, field_of_view: float
) -> Iterator[Finding]:
    """Turn a head with a camera, and judge its axes by the pictures and by the motion that the user saw."""
    from missions.plugins.setup.doctor.head_trial import PictureLog, TryHead  # noqa: PLC0415 - OpenCV is imported for this alone
    from missions.plugins.setup.doctor.head_verdict import judge_head as judge_pictures  # noqa: PLC0415

    log = PictureLog()
    by_camera = replace(trial, steps=(TryHead.tag,))
    result, root = _run_trial(by_camera, config, request, log, {TryHead.tag: TryHead})
    if result.result != "success":
        yield failure(trial.about, result.reason, f"fix that, then: mission doctor --move --robot {request.robot}")
        return
    leaf = next(node for node in root.iterate() if isinstance(node, TryHead))
    yield from judge_pictures(lambda pose: log.within(*leaf.still_times[pose]), field_of_view)
    if ask(trial.question):
        yield Finding(trial.about, "done, and confirmed")
    else:
        fix = trial.fix.replace("ROBOT", str(request.robot))
        yield failure(trial.about, "the motion did not match the command", fix)


def _ask_motion(ask: Ask, question: str, expected: SeenMotion) -> SeenMotion:
    """Return the motion that the user saw: asks for the expected one first, then the opposite, then others."""
    if ask(question):
        return expected
    return next(
        (each for each in _ALTERNATIVES[expected] if ask(f"Did it {_MOTION_TEXTS[each]} instead?")), SeenMotion.NONE
    )


_ALTERNATIVES = {
    SeenMotion.LEFT: (SeenMotion.RIGHT, SeenMotion.AHEAD, SeenMotion.BACK),
    SeenMotion.AHEAD: (SeenMotion.BACK, SeenMotion.LEFT, SeenMotion.RIGHT),
}
_MOTION_TEXTS = {
    SeenMotion.LEFT: "turn to its left",
    SeenMotion.RIGHT: "turn to its right",
    SeenMotion.AHEAD: "go ahead",
    SeenMotion.BACK: "go back",
}


def _try_part(trial: MovementTrial, config: RobotConfig, request: RunRequest, ask: Ask) -> Finding:
    """Run the trial movement of a part, and return the finding from the user's answer."""
    fix = trial.fix.replace("ROBOT", str(request.robot))
    result, _ = _run_trial(trial, config, request)
    if result.result != "success":
        return failure(trial.about, result.reason, f"fix that, then: mission doctor --move --robot {request.robot}")
    if not ask(trial.question):
        return failure(trial.about, "the motion did not match the command", fix)
    return Finding(trial.about, "done, and confirmed")
