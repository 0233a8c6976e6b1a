"""Who drives what: no two behaviours may drive one actuator at a time, and the robot must have what they need."""

from collections import defaultdict

from config.units import article
from missions.language.notes import Notes
from missions.language.plan import Step


def check_claims(notes: Notes, tree: Step) -> None:
    """Note every actuator that two children of a parallel or race can drive at the same time."""
    for step in tree.walk():
        if step.kind not in ("parallel", "race"):
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


def check_needs(notes: Notes, tree: Step, robot: str, parts: frozenset[str]) -> None:
    """Note every leaf that needs a part which the robot does not have."""
    for step in tree.walk():
        for part in sorted(step.own_needs - parts):
            has = ", ".join(sorted(parts)) or "nothing"
            notes.fault_at(step, f"'{step.kind}' needs {article(part)}; robot '{robot}' has none (it has {has})")
