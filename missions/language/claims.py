"""Checks that a robot can do a mission, and that no two leaves drive one actuator at the same time.

The robot must have the parts that the mission uses, and its joints must reach the goals.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from behaviours.joint_ranges import JointRanges
from behaviours.leaf import Leaf
from config.defaults import user_files
from config.diagnostics import Diagnostic, did_you_mean, suggest_from
from config.library import shipped_files
from config.units import with_article
from drivers.api.kinds import CAPABILITIES, KINDS
from missions.language.check_context import CheckContext, Lookup
from missions.language.expressions import Value
from missions.language.nodes import AT_ONCE, CLEANUP_CLAIMS, FAILURE, FINALLY, MODIFIERS
from missions.language.parallel_counts import decide_parallel
from missions.language.plan import Step, composite_kind


def no_words(texts: Sequence[str]) -> tuple[()]:
    """Return an empty tuple: default for robots without limits on spoken words."""
    del texts
    return ()


class TargetRobot(NamedTuple):
    """The robot that a mission is checked for: name, parts, and joint ranges of its arms, as far as known.

    ``reaches`` are joint ranges by arm. ``further_parts`` are the kinds of additional parts (such as a second arm) by
    name. ``unpronounceable`` returns the words that the robot cannot listen for, ``confusable`` the pairs of phrases
    that it confuses. ``head_joints`` are the joints of the arm that also move a head, each with the name of the head.
    ``capabilities`` are optional abilities of the parts.
    """

    name: str
    parts: frozenset[str]
    reaches: Mapping[str, JointRanges] = MappingProxyType({})
    further_parts: Mapping[str, str] = MappingProxyType({})
    unpronounceable: Callable[[Sequence[str]], Sequence[str]] = no_words
    confusable: Callable[[Sequence[str]], Sequence[tuple[str, str]]] = no_words
    head_joints: Mapping[str, str] = MappingProxyType({})
    capabilities: frozenset[str] = frozenset(CAPABILITIES)


def check_claims(context: CheckContext, tree: Step) -> None:
    """Report each actuator that two children of a parallel or race can drive at the same time."""
    for step in tree.walk():
        if step.kind not in AT_ONCE:
            continue
        claimants: dict[str, list[Step]] = defaultdict(list)
        for child in step.children:
            for part in sorted(child.claims):
                claimants[part].append(_claimant(child, part))
        for part, (first, *others) in claimants.items():
            for other in others:
                context.fault_at(
                    other,
                    f"'{other.kind}' and '{first.kind}' (line {first.mark.line}) can both drive the {part} "
                    "at the same time",
                    "put one after the other in a sequence",
                )


def check_cleanups(context: CheckContext, tree: Step) -> None:
    """Report each leaf within a ``finally`` that could move something: it may run after a stop or the end of a run."""
    reported = set[int]()  # a step may be within several of them
    for step in tree.walk():
        for leaf in step.children[1].walk() if step.kind == FINALLY else ():
            if id(leaf) in reported or leaf.leaf is None:
                continue
            reported.add(id(leaf))
            moved = sorted(leaf.leaf.drives - CLEANUP_CLAIMS)
            what = f"drives the {moved[0]}" if moved else "sends a message of ROS 2" if _sends(leaf.leaf) else ""
            if what:
                hint = "only leaves for light, screen and voice, or without actuators, may run there"
                file = "" if step.source is leaf.source else f" of {step.source.name}"
                where = f"'finally' (line {step.mark.line}{file})"
                context.fault_at(leaf, f"'{leaf.kind}' {what}, and {where} must not move anything", hint)


def _sends(leaf: type[Leaf]) -> bool:
    """Return whether a leaf sends messages to ROS 2 nodes, which may move the robot. Conditions never do."""
    return "ros2" in leaf.needs and not leaf.instant


def _claimant(step: Step, part: str) -> Step:
    """Return the first leaf below ``step`` that drives ``part``."""
    return next(leaf for leaf in step.walk() if leaf.leaf is not None and part in leaf.leaf.drives)


def check_needs(context: CheckContext, tree: Step, robot: TargetRobot) -> None:
    """Report each leaf that needs a part which the robot does not have, or names a part of another kind.

    A selector may have alternatives for actuators that the robot lacks. These are not reported if another alternative
    follows.
    """
    excused = set(map(id, _first_leaves_of_alternatives(tree)))
    for step in tree.walk():
        part_kinds = {**step.parts_beside, **{name: kind for kind, name in step.named_parts.items()}}
        spared = _claimed_parts(step) if id(step) in excused else frozenset()
        for part in () if id(step) in excused else _missing_capabilities(step, robot):
            context.fault_at(step, f"'{step.kind}' needs {part}: robot '{robot.name}' has no {part}")
        for part in sorted((step.direct_needs - robot.parts).difference(part_kinds, CAPABILITIES) - spared):
            has = ", ".join(sorted(robot.parts)) or "nothing"
            context.fault_at(
                step, f"'{step.kind}' needs {with_article(part)}; robot '{robot.name}' has none (it has {has})"
            )
        for part in sorted(
            _claimed_parts(step) - robot.parts - robot.further_parts.keys() - KINDS.keys() - part_kinds.keys()
        ):
            context.fault_at(
                step, f"'{step.kind}' drives '{part}', which is not a part of a robot", suggest_from(part, KINDS)
            )
        for name, kind in part_kinds.items():
            known = [
                *({kind} & robot.parts),
                *(other for other, other_kind in robot.further_parts.items() if other_kind == kind),
            ]
            if name not in known:
                has = f"its {kind}s are {', '.join(sorted(known))}" if known else f"it has no {kind}"
                message = f"'{step.kind}' needs {with_article(name)}; robot '{robot.name}' has none ({has})"
                context.fault_at(step, message, did_you_mean(name, known))


def _missing_capabilities(step: Step, robot: TargetRobot) -> list[str]:
    """Return the capabilities that a leaf requires and the robot's part does not have."""
    needed = step.direct_needs & CAPABILITIES.keys() - robot.capabilities
    return sorted(name for name in needed if CAPABILITIES[name] in robot.parts)


def _claimed_parts(step: Step) -> frozenset[str]:
    return frozenset() if step.leaf is None else step.leaf.drives


def check_reach(context: CheckContext, tree: Step, robot: TargetRobot) -> None:
    """Report goals of leaves that the robot's joints cannot reach, as far as the arguments are known.

    If a selector has another alternative, ``impossible_alternatives`` gives a hint instead.
    """
    excused = set(map(id, _first_leaves_of_alternatives(tree)))
    for step in tree.walk():
        if id(step) not in excused and (misfits := _joint_violations(step, robot.reaches)):
            context.fault_at(
                step, _impossible_message(step, robot, misfits), _possible_gestures(step, robot, context.things)
            )


def impossible_alternatives(tree: Step, robot: TargetRobot, things: Mapping[str, Lookup]) -> list[Diagnostic]:
    """Return a hint for each alternative of a selector that always fails on this robot.

    It fails because a part is missing, or because a joint cannot reach the goal.
    """
    hints = []
    for step in _first_leaves_of_alternatives(tree):
        missing = _missing_parts(step, robot)
        if why := missing or _joint_violations(step, robot.reaches):
            able = "" if missing else _possible_gestures(step, robot, things)
            hint = "the next alternative of the selector is tried then" + (f"; {able}" if able else "")
            hints.append(Diagnostic(step.source, step.mark, _impossible_message(step, robot, why), hint))
    return list(dict.fromkeys(hints))  # nested selectors report it twice


def _first_leaves_of_alternatives(tree: Step) -> Iterator[Step]:
    """Yield the leaves with which the alternatives of each selector start, except those of its last alternative."""
    for step in tree.walk():
        if step.kind == "selector":
            for child in step.children[:-1]:
                yield from _first_leaves(child)


def _first_leaves(step: Step) -> Iterator[Step]:
    """Yield the leaves that are ticked first when ``step`` starts.

    Leaves whose failure would not make ``step`` fail are left out.
    """
    if step.leaf is not None:
        yield step
    elif step.kind in AT_ONCE or step.kind in MODIFIERS:
        if not _fails_with_child(step):
            return
        for child in step.children if step.kind in AT_ONCE else step.children[:1]:
            yield from _first_leaves(child)
    elif (kind := composite_kind(step)) is not None and kind.order == "in order":
        yield from _first_leaves(step.children[0])


def _fails_with_child(step: Step) -> bool:
    """Return True if ``step``, a modifier, a parallel or a race, fails at the first failure of a child."""
    if step.kind in MODIFIERS:
        return FAILURE in MODIFIERS[step.kind].failure
    decided = decide_parallel(len(step.children), {word: value.constant for word, value in step.arguments.items()})
    known = all(value.template is None for value in step.arguments.values())
    return known and decided.failures == 1 and not decided.waits_for_all


def _missing_parts(step: Step, robot: TargetRobot) -> list[str]:
    """Return the actuators of a leaf that the robot does not have, as text."""
    parts = sorted(step.direct_needs & _claimed_parts(step) - robot.parts - robot.further_parts.keys())
    return [f"it has no {part}" for part in (*parts, *_missing_capabilities(step, robot))]


def _impossible_message(step: Step, robot: TargetRobot, reasons: Sequence[str]) -> str:
    return f"'{step.kind}' cannot be done by robot '{robot.name}': {'; '.join(reasons)}"


def _possible_gestures(step: Step, robot: TargetRobot, things: Mapping[str, Lookup]) -> str:
    """Return a hint with the gestures that the robot can do, if the step plays one; empty otherwise."""
    declared = {} if step.leaf is None else step.leaf.arguments
    played = next((name for name, each in declared.items() if each.kind in ("gesture", "move")), "")
    if not played or "gesture" not in things:
        return ""
    able = []
    for name in {**user_files("gestures"), **shipped_files("gestures")}:
        try:
            instead = Value(things["gesture"](name))
        except LookupError:  # a file with errors; `mission list gestures` reports them
            continue
        other = replace(step, arguments={**step.arguments, played: instead})
        if not _joint_violations(other, robot.reaches):
            able.append(name)
    return (
        f"it can do: {', '.join(able)}"
        if able
        else "it can do no known gesture: record one with `mission servo record`"
    )


def check_necks(context: CheckContext, tree: Step, robot: TargetRobot) -> None:
    """Report each leaf that moves a joint of a head while another leaf can turn that head."""
    reach = robot.reaches.get("arm")
    if reach is None:
        return
    for joint, head in robot.head_joints.items():
        fewer = replace(reach, joints={name: each for name, each in reach.joints.items() if name != joint})
        others = {**robot.reaches, "arm": fewer}
        for step in tree.walk():
            turning = [child for child in step.children if head in child.claims] if step.kind in AT_ONCE else []
            moving = [child for child in step.children if turning and "arm" in child.claims]
            for child in moving:
                rivals = [rival for rival in turning if rival is not child]
                for leaf in child.walk() if rivals else ():
                    if len(_joint_violations(leaf, others)) <= len(_joint_violations(leaf, robot.reaches)):
                        continue
                    for by in (_claimant(rival, head) for rival in rivals):
                        context.fault_at(
                            leaf,
                            f"'{leaf.kind}' moves joint '{joint}' of the {head}, which '{by.kind}' "
                            f"(line {by.mark.line}) can turn at the same time",
                            "put one after the other in a sequence",
                        )


def _joint_violations(step: Step, reaches: Mapping[str, JointRanges]) -> list[str]:
    """Return as text the goals of a leaf that are beyond the joint ranges in ``reaches`` (by arm).

    Empty if the arguments of the leaf are only known in a run.
    """
    known = all(value.template is None for value in step.arguments.values())
    own_arm = step.named_parts.get("arm", "arm")
    arms = {own_arm, *(name for name, kind in step.parts_beside.items() if kind == "arm")}
    if step.leaf is None or step.leaf.joint_violations is Leaf.joint_violations or not known:
        return []
    if not arms <= reaches.keys():
        return []  # another check reports that it is missing
    leaf = step.leaf(step.name)
    for name, value in step.arguments.items():
        setattr(leaf, name, value.constant)
    return leaf.joint_violations(replace(reaches[own_arm], arms=reaches))
