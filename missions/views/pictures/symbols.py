"""Signs for the kinds of nodes, in the notation of behaviour trees, and what they mean."""

from missions.language.nodes import BRANCHES
from missions.language.plan import Step

CONDITION, ACTION = "◇", "■"
"""The signs of leaves: one that only asks a part of the robot, within a tick, and one that does something."""


def symbol_of(step: Step) -> str:
    """Return the sign of a step that is no modifier."""
    leaf = step.leaf
    if leaf is None:
        return BRANCHES[step.kind].symbol
    return CONDITION if leaf.instant and leaf.needs and not leaf.drives else ACTION


def legend() -> tuple[tuple[str, str, str], ...]:
    """Return each sign with the kind of node that it stands for, and what such a node does."""
    return (
        *((kind.symbol, word, kind.help) for word, kind in BRANCHES.items()),
        (CONDITION, "condition", "asks a part of the robot, and answers at once"),
        (ACTION, "action", "does something"),
    )
