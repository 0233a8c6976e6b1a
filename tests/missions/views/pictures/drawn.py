"""Missions and drawings to picture, for several tests of pictures."""

from collections.abc import Mapping

from hypothesis import strategies as st

from behaviours.catalogue import LEAVES
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import SourceText
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.language.document import check_plan
from missions.language.plan import Plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission
from missions.trees.drawing import SIGNS, Badge, Status, TreeBox, TreeDrawing
from missions.trees.drawing_builder import one_line

HOSTILE = """"';</script><img src=x onerror=alert(1)> \\n \\ | # `[{(&amp;%%"""
"""What a name, an argument or a reason may hold, and a picture must not take for anything but text."""


def plan_of(tree: str, head: str = "") -> Plan:
    """Check a mission whose tree is ``tree``, in YAML; it stands in a file "m.yaml"."""
    return check_plan(
        SourceText("m.yaml", f"mission: m\n{head}tree:\n{tree}"), LEAVES, LOOKUPS, find_mission=find_mission
    )


def ready(plan: Plan, clock: ManualClock) -> tuple[Node, RunState]:
    """Build a mission for a robot without parts."""
    run = RunState(clock)
    return build(plan, run, lambda leaf: Robot()), run  # noqa: ARG005 - a robot without parts


def downwards(node: Node) -> list[Node]:
    """Return a node and all below it, in the order of the file."""
    return [node, *(each for child in node.children if isinstance(child, Node) for each in downwards(child))]


TEXTS = st.text(max_size=8).map(one_line) | st.just(HOSTILE)
STATUSES: st.SearchStrategy[Status] = st.sampled_from(list(SIGNS))
KINDS = st.sampled_from(["sequence", "selector", "parallel", "race", "switch", "mission"])


@st.composite
def boxes(draw: st.DrawFn, key: str = "1", depth: int = 2) -> TreeBox:
    """Draw a box with everything that one can have, and others below it."""
    badges: list[Badge] = []
    for _ in range(draw(st.integers(0, 2))):
        badges.append(Badge(key, "timeout", draw(TEXTS), draw(st.integers(1, 99)), draw(STATUSES), draw(TEXTS)))
        key += ".1"
    count = draw(st.integers(0, 3)) if depth else 0
    kind = draw(KINDS) if count else "say"
    count = min(count, 1) if kind == "mission" else count
    return TreeBox(
        key,
        kind,
        draw(st.just(kind) | TEXTS),
        "■",
        "m.yaml",
        draw(st.integers(1, 999)),
        arguments=draw(st.dictionaries(TEXTS, TEXTS, max_size=3)),
        badges=tuple(badges),
        keep_as=draw(TEXTS),
        case=draw(TEXTS),
        mission=draw(TEXTS) if kind == "mission" else "",
        status=draw(STATUSES),
        reason=draw(TEXTS),
        since=draw(st.none() | st.floats(0, 1e6)),
        children=tuple(draw(boxes(f"{key}.{place}", depth - 1)) for place in range(1, count + 1)),
        folded=draw(st.integers(0, 5)),
    )


DRAWINGS: st.SearchStrategy[TreeDrawing] = st.builds(
    TreeDrawing, TEXTS, TEXTS, st.just("m.yaml"), boxes(), st.none() | st.floats(0, 1e6)
)


def keys_and_lines(drawing: TreeDrawing) -> Mapping[str, int]:
    """Return the line of every box and badge by its key."""
    found = {box.key: box.line for box in drawing.root.walk()}
    return found | {badge.key: badge.line for box in drawing.root.walk() for badge in box.badges}
