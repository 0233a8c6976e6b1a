"""Signs for the kinds of nodes, in the notation of behaviour trees, and what they mean."""

from collections.abc import Mapping

from missions.language.plan import COMPOSITES, FOR_EACH, MISSION, OTHERS, REACTIVE_SWITCH, SWITCH, Step

SYMBOLS: Mapping[str, str] = {
    "sequence": "→",
    "reactive_sequence": "→↻",
    "random_sequence": "→~",
    "selector": "?",
    "reactive_selector": "?↻",
    "random_selector": "?~",
    "parallel": "⇉",
    "race": "⇉¹",
    SWITCH: "⇄",
    REACTIVE_SWITCH: "⇄↻",
    FOR_EACH: "∀",
    MISSION: "▣",
}
"""The sign of each kind of node that has others below it. All of them are in DejaVu Sans."""

CONDITION, ACTION = "◇", "■"
"""The signs of leaves: one that only asks a part of the robot, within a tick, and one that does something."""


def symbol_of(step: Step) -> str:
    """Return the sign of a step that is no modifier."""
    leaf = step.leaf
    if leaf is None:
        return SYMBOLS[step.kind]
    return CONDITION if leaf.instant and leaf.needs and not leaf.drives else ACTION


def legend() -> tuple[tuple[str, str, str], ...]:
    """Return each sign with the kind of node that it stands for, and what such a node does."""
    return (
        *((sign, kind, COMPOSITES.get(kind) or OTHERS[kind]) for kind, sign in SYMBOLS.items()),
        (CONDITION, "condition", "asks a part of the robot, and answers at once"),
        (ACTION, "action", "does something"),
    )
