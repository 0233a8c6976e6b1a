"""What a tick costs, against py_trees' own on trees of the same shape."""

from collections.abc import Iterator

import py_trees
from py_trees.behaviour import Behaviour

from behaviours.catalogue import LEAVES
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import SourceText
from drivers.clock import SystemClock
from missions.executive.build import build
from missions.executive.events import STATUS_WORDS, Event, NodeChanged
from missions.executive.executive import Executive
from missions.executive.stream import EventStream
from missions.language.document import check_plan
from tests.benchmarks.table import Row, compare

Shape = list["Shape"] | str
"""A leaf by its outcome, or a composite: its word, then its children."""

LEAF_WORDS = {"success": "succeed", "failure": "fail", "running": "pretend: running"}


def shapes(size: int) -> dict[str, Shape]:
    """Return trees of about ``size`` nodes."""
    branch: Shape = ["selector", *["failure"] * 3, "success"]
    branches = max(1, size // 5)
    return {
        "sequence": ["sequence", *["success"] * (size - 1)],
        "selector": ["selector", *["failure"] * (size - 1)],
        "mixed": ["sequence", *[branch] * branches],
        "mostly idle": ["sequence", "running", *[branch] * branches],
    }


def ours(shape: Shape) -> Node:
    """Build a shape from a mission."""
    text = "mission: bench\ntree:\n" + "\n".join(_lines(shape, "  "))
    plan = check_plan(SourceText("bench.yaml", text), LEAVES, {})
    return build(plan, RunState(SystemClock()), lambda leaf: Robot())  # noqa: ARG005 - a leaf here needs no robot


def _lines(shape: Shape, indent: str) -> Iterator[str]:
    if isinstance(shape, str):
        yield indent + LEAF_WORDS[shape]
        return
    yield f"{indent}{shape[0]}:"
    for child in shape[1:]:
        first, *rest = _lines(child, indent + "    ")
        yield f"{indent}  - {first.strip()}"
        yield from rest


def theirs(shape: Shape) -> Behaviour:
    """Build a shape from py_trees' own classes."""
    if isinstance(shape, str):
        kinds = {
            "success": py_trees.behaviours.Success,
            "failure": py_trees.behaviours.Failure,
            "running": py_trees.behaviours.Running,
        }
        return kinds[shape](shape)
    kind = py_trees.composites.Sequence if shape[0] == "sequence" else py_trees.composites.Selector
    return kind(str(shape[0]), memory=True, children=[theirs(child) for child in shape[1:]])


def rows() -> Iterator[Row]:
    """Yield a row for each size and shape, with events off and with events recorded.

    Recorded as in a run: the tick keeps every change, and the thread of the stream, which has the time between two
    ticks for it, tells the listener. Here that comes after the measurement, and every node's last change must be there.
    """
    for size in (10, 50, 500):
        for name, shape in shapes(size).items():
            ticked = 2 if name == "mostly idle" else size
            calls = max(3, 3000 // ticked)
            other = theirs(shape)
            yield compare(
                f"tick, {size} nodes, {name}", ours(shape).execute_tick, other.tick_once, calls=calls, bound=0.2
            )
            told = ours(shape)
            heard: list[Event] = []
            stream = EventStream([heard.append])
            Executive(told, told.run, stream)
            stream.open()
            yield compare(
                f"tick with events, {size} nodes, {name}", told.execute_tick, other.tick_once, calls=calls, bound=0.3
            )
            stream.close()
            last = {event.node: event.status for event in heard if isinstance(event, NodeChanged)}
            nodes = [node for node in told.iterate() if isinstance(node, Node)]
            assert all(last.get(node.key, "idle") == STATUS_WORDS[node.status] for node in nodes)
            assert not stream.dropped_count
