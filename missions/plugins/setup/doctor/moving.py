"""Trying what moves, a little, with a question before and after each: what a robot is told, and what a person saw."""

import math
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from py_trees.common import Status

from behaviours.catalogue import LEAVES
from behaviours.joint_motion import ON_ARM, JointMotion, Sample, positions
from behaviours.joint_ranges import JointRanges
from behaviours.leaf import RUNNING, SUCCESS, Leaf, argument
from behaviours.node import Node
from config.faults import Source
from config.robot import RobotConfig, Section
from drivers.api import ignore
from drivers.api.driver import Finding, warning, wrong
from drivers.api.sections import ArmKeys
from missions.executive.executive import Result
from missions.language.document import check_plan
from missions.library.target import target_of
from missions.library.things import THINGS
from missions.plugins.setup.checkup import Checked
from missions.plugins.setup.doctor.base_verdict import SeenMotion, TryBase, judge
from missions.plugins.setup.servo.running import run_plan
from missions.request import RunRequest
from perception.api import Frame

# The leaf that tries a joint: a little way to and fro, gently, from where it stands.

WAY = math.radians(4.0)
"""How far a joint goes."""

DURATION = 2.0
"""Seconds for to and fro."""

SETTLING = 0.5
"""Seconds after which what it did is known."""


class There:
    """A little way and back, without a jerk."""

    def __init__(self, start: Mapping[str, float], way: float) -> None:
        self._start, self._way = start, way

    def at(self, time: float) -> Mapping[str, float]:
        """Return where the joint is to be."""
        share = math.sin(math.pi * min(max(time / DURATION, 0.0), 1.0)) ** 2
        return {joint: angle + self._way * share for joint, angle in self._start.items()}


class Nudge(JointMotion):
    """Move a joint a little way and back.

    Running for some seconds, then succeeds. Fails where the joint stands outside its limits, by more than it sags,
    before it moves; and where it was not felt to move.
    """

    word = "nudge"
    joint: str = argument("joint", "which joint", principal=True)
    on: str = ON_ARM
    _begun: Mapping[str, float]
    _moved = 0.0

    def joint_violations(self, reach: JointRanges) -> list[str]:
        """Return that the arm has no such joint."""
        return reach.lacking((self.joint,))

    def moved(self) -> tuple[str, ...]:
        """Return the one joint."""
        return (self.joint,)

    def update(self) -> Status:
        """Look first whether the joint stands where it may."""
        here = positions(self.robot.arm).get(self.joint)
        if self._path is None and here is not None:
            limits = self.robot.arm.limits[self.joint]
            if not limits.lower - WAY <= here <= limits.upper + WAY or limits.upper - limits.lower < WAY:
                ends = f"{math.degrees(limits.lower):.0f} to {math.degrees(limits.upper):.0f} deg"
                return self.fail(f"it stands at {math.degrees(here):.0f} deg; its limits are {ends}")
        return super().update()

    def path(self, start: Mapping[str, float]) -> There:
        """Return the way to and fro: upwards, where there is room."""
        self._begun, self._moved = start, 0.0
        room = self.robot.arm.limits[self.joint].upper - start[self.joint] >= WAY
        return There(start, WAY if room else -WAY)

    def follow(self, time: float, samples: Mapping[str, Sample]) -> Status:
        """Go on until it is back; then say whether it was felt to move."""
        if self.joint in samples:
            self._moved = max(self._moved, abs(samples[self.joint].position - self._begun[self.joint]))
        if time < DURATION + SETTLING:
            return RUNNING
        if self._moved < WAY / 4:
            return self.fail(f"it was sent {math.degrees(WAY):.0f} deg, and went {math.degrees(self._moved):.1f}")
        return SUCCESS


Ask = Callable[[str], bool]
"""Asks a person a question."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A movement: what it is ``about``, what it ``does``, the steps, whether that was seen, and the ``cure`` if not."""

    about: str
    does: str
    steps: tuple[str, ...]
    question: str
    cure: str

    @property
    def source(self) -> Source:
        """The mission."""
        steps = "".join(f"    - {step}\n" for step in self.steps)
        return Source("doctor", f"mission: doctor\ntree:\n  sequence:\n{steps}")


def tried(
    config: RobotConfig, called: str, ports: Mapping[str, str], *, unwell: frozenset[str], ask: Ask
) -> Iterator[Checked]:
    """Yield what came of each movement; parts that are ``unwell`` are not tried."""
    order = RunRequest("doctor", robot=called, ports=ports)
    for part, section in config.sections.items():
        for trial in trials(part, section):
            if part in unwell:
                cure = "mend what is wrong first"
                yield Checked(part, warning(trial.about, "not tried, for something is wrong with it", cure))
            elif not ask(f"{part}: {trial.does}. May it?"):
                yield Checked(part, Finding(trial.about, "not tried"))
            elif part == "head" and config.camera is not None and "camera" not in unwell:
                lens = config.camera.upright().field_of_view
                yield from (Checked(part, finding) for finding in _head_tried(trial, config, order, ask, lens))
            elif section.driver.kind == "base":
                yield from (Checked(part, finding) for finding in _base_tried(trial, config, order, ask))
            else:
                yield Checked(part, _tried(trial, config, order, ask))


def trials(part: str, section: Section) -> Iterator[Trial]:
    """Yield what there is to try of a part."""
    kind = section.driver.kind
    of, which = ("", "") if part == kind else (f", on: {part}", f" --{kind} {part}")
    if kind == "base":
        does = "it turns by 10 degrees to its left and back, then goes 5 cm ahead and back; the floor around it is free"
        yield Trial("moving", does, (TryBase.word,), "Did it turn to its left first?", "")
    elif kind == "head":
        poses = ((0, 0), (8, 0), (0, 0), (0, -8), (0, 0))
        steps = tuple(f"look: {{pan: {pan} deg, tilt: {tilt} deg{of}}}" for pan, tilt in poses)
        does = "it looks straight ahead, a little to its left, and a little up"
        cure = "in the robot file, turn the axis round that went wrong; askew: mission head trim --robot ROBOT"
        cure = cure.replace("ROBOT", f"ROBOT{which}")
        yield Trial("looking", does, steps, "Did it look ahead, then to its left, then up?", cure)
    elif kind == "arm" and isinstance(section.keys, ArmKeys):
        cure = "mission servo scan --robot ROBOT  (has it the ID of another joint?)"
        cure = cure.replace("ROBOT", f"ROBOT{which}")
        for joint in section.keys.limits:
            does = f"{joint} goes 4 degrees to one side, and back; the {part} becomes stiff"
            yield Trial(joint, does, (f"nudge: {{joint: {joint}{of}}}",), f"Did {joint} move, and nothing else?", cure)
    elif kind == "voice":
        cure = "speaker-test -t wav -c 1 -l 1  (do you hear that? else: alsamixer)"
        yield Trial("speaking", "it says a few words", ("say: one, two, three",), "Did you hear it?", cure)


def _run(
    trial: Trial,
    config: RobotConfig,
    order: RunRequest,
    on_frame: Callable[[Frame, object], None] = ignore,
    more: Mapping[str, type[Leaf]] = MappingProxyType({}),
) -> tuple[Result, Node]:
    """Have a robot do something; return how that ended, and its tree. Raises KeyboardInterrupt."""
    own: dict[str, type[Leaf]] = {Nudge.word: Nudge, TryBase.word: TryBase, **more}
    plan = check_plan(trial.source, {**LEAVES, **own}, THINGS, robot=target_of(config))
    result, root = run_plan(plan, order, out=sys.stderr, on_frame=on_frame)
    if result.result == "interrupted":
        raise KeyboardInterrupt
    return result, root


def _base_tried(trial: Trial, config: RobotConfig, order: RunRequest, ask: Ask) -> Iterator[Finding]:
    """Move a base a little, and judge its motors, encoders and gyro by what a person saw."""
    result, root = _run(trial, config, order)
    leaf = next(node for node in root.iterate() if isinstance(node, TryBase))
    if result.result != "success":
        yield wrong(trial.about, result.reason, f"mend that, then: mission doctor --move --robot {order.robot}")
        return
    turn = _seen(ask, trial.question, SeenMotion.LEFT)
    ahead = _seen(ask, "Then, did it go ahead first?", SeenMotion.AHEAD)
    yield from judge(leaf.trial, turn, ahead)


def _head_tried(
    trial: Trial, config: RobotConfig, order: RunRequest, ask: Ask, field_of_view: float
) -> Iterator[Finding]:
    """Turn a head that carries a camera, and judge its axes by the pictures as well as by what a person saw."""
    from missions.plugins.setup.doctor.head_trial import PictureLog, TryHead  # noqa: PLC0415 - OpenCV is imported for this alone
    from missions.plugins.setup.doctor.head_verdict import judge as judge_pictures  # noqa: PLC0415

    log = PictureLog()
    by_camera = replace(trial, steps=(TryHead.word,))
    result, root = _run(by_camera, config, order, log, {TryHead.word: TryHead})
    if result.result != "success":
        yield wrong(trial.about, result.reason, f"mend that, then: mission doctor --move --robot {order.robot}")
        return
    leaf = next(node for node in root.iterate() if isinstance(node, TryHead))
    yield from judge_pictures(lambda pose: log.within(*leaf.stills[pose]), field_of_view)
    if ask(trial.question):
        yield Finding(trial.about, "done, and seen")
    else:
        cure = trial.cure.replace("ROBOT", str(order.robot))
        yield wrong(trial.about, "it has done something else than it was told", cure)


def _seen(ask: Ask, question: str, expected: SeenMotion) -> SeenMotion:
    """Ask what a movement was: the expected one first, then the opposite, then all others."""
    if ask(question):
        return expected
    return next((each for each in _INSTEAD[expected] if ask(f"Did it {_DO[each]} instead?")), SeenMotion.NONE)


_INSTEAD = {
    SeenMotion.LEFT: (SeenMotion.RIGHT, SeenMotion.AHEAD, SeenMotion.BACK),
    SeenMotion.AHEAD: (SeenMotion.BACK, SeenMotion.LEFT, SeenMotion.RIGHT),
}
_DO = {
    SeenMotion.LEFT: "turn to its left",
    SeenMotion.RIGHT: "turn to its right",
    SeenMotion.AHEAD: "go ahead",
    SeenMotion.BACK: "go back",
}


def _tried(trial: Trial, config: RobotConfig, order: RunRequest, ask: Ask) -> Finding:
    """Have a robot do something, and say what came of it."""
    cure = trial.cure.replace("ROBOT", str(order.robot))
    result, _ = _run(trial, config, order)
    if result.result != "success":
        return wrong(trial.about, result.reason, f"mend that, then: mission doctor --move --robot {order.robot}")
    if not ask(trial.question):
        return wrong(trial.about, "it has done something else than it was told", cure)
    return Finding(trial.about, "done, and seen")
