"""Who drives what: no two behaviours may drive one actuator at a time, and the robot must have what they need."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from behaviours.joint_ranges import JointRanges
from behaviours.leaf import Leaf
from config.faults import did_you_mean, one_of
from config.units import article
from drivers.api.kinds import KINDS
from missions.language.nodes import AT_ONCE
from missions.language.notes import Notes
from missions.language.plan import Step


def none_of(texts: Sequence[str]) -> tuple[()]:
    """Return nothing: ears that know every word, and confuse none."""
    del texts
    return ()


class Target(NamedTuple):
    """The robot that a mission is for: its name, its parts, and how far the joints of its arms reach, as far as known.

    ``reaches`` are by the name of the arm; ``others`` are the kinds of further parts, by their own names.
    ``unpronounceable`` returns those of some words that its ears cannot listen for, ``confusable`` the pairs of some
    phrases that they easily take for each other. ``necks`` are the joints of the arm of which heads are made, each with
    the name of its head.
    """

    name: str
    parts: frozenset[str]
    reaches: Mapping[str, JointRanges] = MappingProxyType({})
    others: Mapping[str, str] = MappingProxyType({})
    unpronounceable: Callable[[Sequence[str]], Sequence[str]] = none_of
    confusable: Callable[[Sequence[str]], Sequence[tuple[str, str]]] = none_of
    necks: Mapping[str, str] = MappingProxyType({})


def check_claims(notes: Notes, tree: Step) -> None:
    """Note every actuator that two children of a parallel or race can drive at the same time."""
    for step in tree.walk():
        if step.kind not in AT_ONCE:
            continue
        claimants: dict[str, list[Step]] = defaultdict(list)
        for child in step.children:
            for part in sorted(child.claims):
                claimants[part].append(_claimant(child, part))
        for part, (first, *others) in claimants.items():
            for other in others:
                notes.fault_at(
                    other,
                    f"'{other.kind}' and '{first.kind}' (line {first.mark.line}) can both drive the {part} "
                    "at the same time",
                    "put one after the other in a sequence",
                )


def _claimant(step: Step, part: str) -> Step:
    """Return the first leaf below ``step`` that drives ``part``."""
    return next(leaf for leaf in step.walk() if leaf.leaf is not None and part in leaf.leaf.drives)


def check_needs(notes: Notes, tree: Step, robot: Target) -> None:
    """Note every leaf that needs a part which the robot does not have, or names one of another kind."""
    for step in tree.walk():
        named = {**step.parts_beside, **{name: kind for kind, name in step.named_parts.items()}}
        for part in sorted((step.own_needs - robot.parts).difference(named)):
            has = ", ".join(sorted(robot.parts)) or "nothing"
            notes.fault_at(step, f"'{step.kind}' needs {article(part)}; robot '{robot.name}' has none (it has {has})")
        for part in sorted(_driven(step) - robot.parts - robot.others.keys() - KINDS.keys() - named.keys()):
            notes.fault_at(step, f"'{step.kind}' drives '{part}', which is no part of a robot", one_of(part, KINDS))
        for name, kind in named.items():
            known = [*({kind} & robot.parts), *(other for other, its in robot.others.items() if its == kind)]
            if name not in known:
                has = f"its {kind}s are {', '.join(sorted(known))}" if known else f"it has no {kind}"
                told = f"'{step.kind}' needs {article(name)}; robot '{robot.name}' has none ({has})"
                notes.fault_at(step, told, did_you_mean(name, known))


def _driven(step: Step) -> frozenset[str]:
    return frozenset() if step.leaf is None else step.leaf.drives


def check_reach(notes: Notes, tree: Step, robot: Target) -> None:
    """Note what each leaf asks of the robot's joints that they cannot do, as far as its arguments are known now."""
    for step in tree.walk():
        for misfit in _misfits(step, robot.reaches):
            notes.fault_at(step, f"'{step.kind}' cannot be done by robot '{robot.name}': {misfit}")


def check_necks(notes: Notes, tree: Step, robot: Target) -> None:
    """Note every leaf that moves a joint of which a head is made while another can turn that head."""
    reach = robot.reaches.get("arm")
    if reach is None:
        return
    for joint, head in robot.necks.items():
        fewer = replace(reach, joints={name: each for name, each in reach.joints.items() if name != joint})
        others = {**robot.reaches, "arm": fewer}
        for step in tree.walk():
            turning = [child for child in step.children if head in child.claims] if step.kind in AT_ONCE else []
            moving = [child for child in step.children if turning and "arm" in child.claims]
            for child, rival in ((child, rival) for child in moving for rival in turning if rival is not child):
                for leaf in child.walk():
                    if len(_misfits(leaf, others)) > len(_misfits(leaf, robot.reaches)):
                        by = _claimant(rival, head)
                        notes.fault_at(
                            leaf,
                            f"'{leaf.kind}' moves joint '{joint}' of the {head}, which '{by.kind}' "
                            f"(line {by.mark.line}) can turn at the same time",
                            "put one after the other in a sequence",
                        )


def _misfits(step: Step, reaches: Mapping[str, JointRanges]) -> list[str]:
    """Return what a leaf asks of the joints of these arms that they cannot do, as far as that is known now."""
    known = all(value.template is None for value in step.arguments.values())
    own = step.named_parts.get("arm", "arm")
    meant = {own, *(name for name, kind in step.parts_beside.items() if kind == "arm")}
    if step.leaf is None or step.leaf.joint_violations is Leaf.joint_violations or not known:
        return []
    if not meant <= reaches.keys():
        return []  # that it is not there is told elsewhere
    leaf = step.leaf(step.name)
    for name, value in step.arguments.items():
        setattr(leaf, name, value.constant)
    return leaf.joint_violations(replace(reaches[own], arms=reaches))
