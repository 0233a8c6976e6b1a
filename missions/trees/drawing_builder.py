"""Builder of tree drawings: from a checked mission, with statuses, and with folded sub-missions."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain, repeat
from pathlib import Path

from missions.language.inference import CONDITION_KIND
from missions.language.nodes import BRANCHES, IN_TURN, IN_TURN_SELECTOR, MISSION, MODIFIERS, RECOVER, RETRY, SWITCHES
from missions.language.plan import Plan, Step, composite_kind
from missions.trees.drawing import Badge, NodeState, TreeBox, TreeDrawing

CONDITION_SYMBOL, ACTION_SYMBOL = "◇", "■"
"""Symbols of leaves: conditions, which only read a part within a tick, and actions."""


def symbol_of(step: Step) -> str:
    """Return the character that pictures of trees show for the kind of a step; the step must not be a modifier."""
    leaf = step.leaf
    if leaf is None:
        return (composite_kind(step) or BRANCHES[step.kind]).symbol
    reads = leaf.needs or any(argument.kind == CONDITION_KIND for argument in leaf.arguments.values())
    return CONDITION_SYMBOL if leaf.instant and reads and not leaf.drives else ACTION_SYMBOL


def legend() -> tuple[tuple[str, str, str], ...]:
    """Return each symbol with its kind of node and a description."""
    return (
        *((kind.symbol, word, kind.help) for word, kind in BRANCHES.items()),
        (IN_TURN_SELECTOR.symbol, f"selector, {IN_TURN}", IN_TURN_SELECTOR.help),
        (CONDITION_SYMBOL, "condition", "checks the robot or a variable within one tick"),
        (ACTION_SYMBOL, "action", "does something"),
    )


HERE = Path(__file__).parents[1]
"""Folder of the shipped missions; drawings name mission files relative to it."""

JOINERS = "\N{ZERO WIDTH NON-JOINER}\N{ZERO WIDTH JOINER}"
"""Zero-width characters that some scripts and emoji need, so they are kept in names."""


def drawing_of(plan: Plan) -> TreeDrawing:
    """Return the drawing of a mission at rest; its nodes have the same keys as in a run."""
    return TreeDrawing(plan.mission, one_line(plan.summary), _file(plan.tree), _box(plan.tree, "1", ""))


def first_values(plan: Plan) -> Mapping[str, object]:
    """Return the initial values of variables: those of the params, and of the params of sub-missions."""
    found: dict[str, object] = dict(plan.params)
    waiting = [(plan.tree, "1")]
    while waiting:
        step, key = waiting.pop()
        waiting += [(child, f"{key}.{place}") for place, child in enumerate(step.children, start=1)]
        if step.kind == MISSION:
            fixed = {name: value.constant for name, value in step.arguments.items() if value.template is None}
            found |= {f"{key} {name}": value for name, value in fixed.items() if value is not None}
    return found


def with_states(drawing: TreeDrawing, states: Mapping[str, NodeState], time: float) -> TreeDrawing:
    """Return the drawing with the states at ``time`` seconds into a run; nodes without a state are idle."""
    return replace(drawing, root=_box_at(drawing.root, states), time=time)


def fold_missions(drawing: TreeDrawing, depth: int) -> TreeDrawing:
    """Return the drawing with each sub-mission at ``depth`` or deeper folded into one box; 0 folds all."""
    return replace(drawing, root=_fold(drawing.root, depth))


def one_line(text: str) -> str:
    """Return ``text`` on one line, with control codes replaced."""
    shown = (c if c.isprintable() or c.isspace() or c in JOINERS else "\N{REPLACEMENT CHARACTER}" for c in text)
    return " ".join("".join(shown).split())


def _box(step: Step, key: str, case: str) -> TreeBox:
    """Return the box of ``step``; a modifier becomes a badge of the box of the step that it modifies.

    ``case`` is the case of a switch under which the step stands, or empty.
    """
    badges: list[Badge] = []
    beside: list[TreeBox] = []  # the behaviours of `recover` and `finally`
    while step.kind in MODIFIERS:
        badges.append(Badge(key, step.kind, one_line(step.text), step.mark.line))
        label = RECOVER if step.kind == RETRY else step.kind
        beside += (_box(child, f"{key}.{place}", label) for place, child in enumerate(step.children[1:], start=2))
        step, key = step.children[0], f"{key}.1"
    inner = enumerate(zip(step.children, _cases(step), strict=False), start=1)
    return TreeBox(
        key,
        step.kind,
        one_line(step.name),
        symbol_of(step),
        _file(step),
        step.mark.line,
        said="" if step.kind == MISSION or len(step.arguments_as_written) != 1 else one_line(step.text),
        arguments={one_line(name): one_line(value) for name, value in step.arguments_as_written.items()},
        badges=tuple(badges),
        keep_as=one_line(step.output_variable or ""),
        case=case,
        mission=one_line(step.text) if step.kind == MISSION else "",
        children=(*(_box(child, f"{key}.{place}", label) for place, (child, label) in inner), *reversed(beside)),
    )


def _cases(step: Step) -> Iterator[str]:
    """Yield a label for each child of a step: for a switch, its case as in YAML or "default"; otherwise empty."""
    labels = (json.dumps(case) if case is None or isinstance(case, bool) else str(case) for case in step.cases)
    return chain(map(one_line, labels), repeat("default" if step.kind in SWITCHES else ""))


def _file(step: Step) -> str:
    path = Path(step.source.name)
    return one_line(path.relative_to(HERE).as_posix() if path.is_relative_to(HERE) else step.source.name)


def _box_at(box: TreeBox, now: Mapping[str, NodeState]) -> TreeBox:
    children = tuple(_box_at(child, now) for child in box.children)
    badges = tuple(_badge_at(badge, now.get(badge.key)) for badge in box.badges)
    found = now.get(box.key)
    if found is None:
        return replace(box, status="idle", reason="", since=None, badges=badges, children=children)
    reason = one_line(found.reason)
    return replace(box, status=found.status, reason=reason, since=found.since, badges=badges, children=children)


def _badge_at(badge: Badge, found: NodeState | None) -> Badge:
    if found is None:
        return replace(badge, status="idle", reason="")
    return replace(badge, status=found.status, reason=one_line(found.reason))


def _fold(box: TreeBox, depth: int) -> TreeBox:
    if not box.mission:
        return replace(box, children=tuple(_fold(child, depth) for child in box.children))
    if depth > 0:
        return replace(box, children=tuple(_fold(child, depth - 1) for child in box.children))
    return replace(box, children=(), folded=box.folded + sum(child.nodes for child in box.children))
