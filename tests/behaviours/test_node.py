"""The node between our executive and py_trees: what it tells of, and that py_trees' own tools work on it."""

import py_trees
from py_trees.common import Status

from behaviours.basics import Fail, Log, Pretend, Succeed, Wait
from behaviours.driving.motion import DriveLeaf
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from behaviours.run import NodeCallback
from missions.executive.composites import Sequence
from missions.executive.parent import set_children
from missions.plugins.testing.recorders import STOP, LeafTestBench

INVALID = Status.INVALID


class Slow(Leaf):
    """Move the base, and take for ever to stop."""

    tag = "slow"
    drives = frozenset({"base"})

    def halting(self) -> bool:
        return True


def pretend(bench: LeafTestBench, *outcomes: Status) -> Pretend:
    return bench.put(Pretend("pretend"), outcomes=outcomes)


def sequence(bench: LeafTestBench, *children: Node, name: str = "both") -> Sequence:
    composite = Sequence(name)
    composite.run, composite.kind = bench.run, "sequence"
    set_children(composite, list(children))
    return composite


def statuses(root: py_trees.behaviour.Behaviour) -> list[Status]:
    return [node.status for node in root.iterate()]


# --- news ------------------------------------------------------------------------------------------------------------


def test_observer_receives_only_status_changes() -> None:
    bench = LeafTestBench()
    leaf = pretend(bench, RUNNING, RUNNING, SUCCESS, SUCCESS, FAILURE)
    for _ in range(5):
        bench.tick(leaf)
    assert bench.status_changes == [("pretend", RUNNING), ("pretend", SUCCESS), ("pretend", FAILURE)]


def test_observer_receives_the_new_status_and_reason() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Fail("fail"), because="too dark")
    seen: list[tuple[Status, str]] = []
    bench.run.observer = NodeCallback(lambda node: seen.append((node.status, node.reason)))
    bench.tick(leaf)
    assert seen == [(FAILURE, "too dark")]


def test_node_works_without_an_observer() -> None:
    bench = LeafTestBench()
    bench.run.observer = None
    assert bench.tick(bench.put(Succeed("ok"))) is SUCCESS


def test_reset_clears_status_and_reason_and_notifies_once() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Fail("fail"), because="too dark")
    bench.tick(leaf)
    bench.status_changes.clear()
    leaf.reset()
    leaf.reset()
    assert (leaf.status, leaf.reason) == (INVALID, "")
    assert bench.status_changes == [("fail", INVALID)]


def test_a_reset_reaches_down_to_the_leaves() -> None:
    bench = LeafTestBench()
    root = sequence(bench, bench.put(Succeed("a")), bench.put(Fail("b"), because="no"))
    bench.tick(root)
    root.reset()
    assert statuses(root) == [INVALID, INVALID, INVALID]


def test_restarted_composite_resets_its_children_first() -> None:
    bench = LeafTestBench()
    root = sequence(bench, bench.put(Succeed("a")), sequence(bench, bench.put(Succeed("b")), name="inner"))
    bench.tick(root)
    bench.status_changes.clear()
    bench.tick(root)
    assert [name for name, status in bench.status_changes if status is INVALID] == ["a", "b", "inner"]
    assert bench.status_changes[:4] == [("a", INVALID), ("b", INVALID), ("inner", INVALID), ("a", SUCCESS)]


def test_composite_claims_the_claims_of_its_leaves() -> None:
    bench = LeafTestBench()
    root = sequence(bench, bench.put(DriveLeaf("drive"), distance=1.0), bench.put(Succeed("ok")))
    assert root.claims == {"base"}


# --- py_trees' own way of ticking -----------------------------------------------------------------------------------


def test_py_trees_ticks_a_leaf() -> None:
    bench = LeafTestBench()
    leaf = pretend(bench, RUNNING, SUCCESS)
    assert list(leaf.tick()) == [leaf]
    assert leaf.status is RUNNING
    leaf.tick_once()
    assert leaf.status is SUCCESS


def test_py_trees_tick_yields_the_ticked_nodes() -> None:
    bench = LeafTestBench()
    done, busy, later = bench.put(Succeed("a")), bench.put(Wait("b"), duration=1.0), bench.put(Succeed("c"))
    root = sequence(bench, done, busy, later)
    assert list(root.tick()) == [done, busy, root]
    bench.clock.advance(1.0)
    assert list(root.tick()) == [done, busy, later, root]
    assert root.status is SUCCESS


def test_py_trees_stops_a_running_leaf_once() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DriveLeaf("drive"), distance=1.0)
    leaf.tick_once()
    bench.base.commands.clear()
    leaf.stop(INVALID)
    leaf.stop(INVALID)
    assert bench.base.commands == [STOP]
    assert statuses(leaf) == [INVALID]


def test_py_trees_stop_of_an_ended_leaf_stops_nothing() -> None:
    bench = LeafTestBench()
    leaf = bench.put(DriveLeaf("drive"), distance=0.0)
    leaf.tick_once()
    assert statuses(leaf) == [SUCCESS]
    bench.base.commands.clear()
    leaf.stop(INVALID)
    assert bench.base.commands == []
    assert statuses(leaf) == [INVALID]


def test_py_trees_stop_safe_stops_slow_leaves() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Slow("slow"))
    root = sequence(bench, leaf)
    root.tick_once()
    root.stop(INVALID)
    assert set(bench.safe_stops) == {frozenset({"base"})}
    assert statuses(root) == [INVALID, INVALID]
    root.tick_once()
    assert leaf.reason == ""
    assert statuses(root) == [RUNNING, RUNNING]


def test_our_leaves_work_in_the_composites_of_py_trees() -> None:
    bench = LeafTestBench()
    drive = bench.put(DriveLeaf("drive"), distance=1.0)
    guard = pretend(bench, SUCCESS, FAILURE)
    root = py_trees.composites.Sequence("theirs", memory=False, children=[guard, drive])
    root.tick_once()
    assert root.status is RUNNING
    bench.base.commands.clear()
    root.tick_once()
    assert statuses(root)[-1] is FAILURE
    assert bench.base.commands == [STOP]
    assert drive.status is INVALID


def test_our_leaves_work_below_the_decorators_of_py_trees() -> None:
    bench = LeafTestBench()
    root = py_trees.decorators.Inverter("not", bench.put(Fail("fail"), because="no"))
    root.tick_once()
    assert root.status is SUCCESS


def test_py_trees_own_tree_ticks_visits_and_stops_our_nodes() -> None:
    bench = LeafTestBench()
    root = sequence(bench, bench.put(Succeed("ok")), bench.put(DriveLeaf("drive"), distance=1.0))
    tree = py_trees.trees.BehaviourTree(root)
    snapshot = py_trees.visitors.SnapshotVisitor()
    tree.add_visitor(snapshot)
    tree.setup()
    tree.tick()
    assert set(snapshot.visited.values()) == {SUCCESS, RUNNING}
    tree.root.stop(INVALID)
    assert bench.base.commands[-1] == STOP
    assert root.status is INVALID


# --- its pictures ----------------------------------------------------------------------------------------------------


def test_py_trees_draws_our_nodes() -> None:
    bench = LeafTestBench()
    root = sequence(bench, bench.put(Log("hello"), text="hi"), bench.put(Fail("give up"), because="too dark"))
    bench.tick(root)
    drawn = py_trees.display.ascii_tree(root, show_status=True)
    assert "{-} both [x] -- too dark" in drawn
    assert "--> hello [o] -- hi" in drawn
    assert "--> give up [x] -- too dark" in drawn
    assert "give up" in py_trees.display.unicode_tree(root)
    assert "too dark" in py_trees.display.xhtml_tree(root, show_status=True)


def test_py_trees_writes_our_nodes_as_a_graph() -> None:
    bench = LeafTestBench()
    root = sequence(bench, bench.put(Succeed("ok")), bench.put(Wait("rest"), duration=1.0))
    graph = str(py_trees.display.dot_tree(root))
    assert "both" in graph
    assert "rest" in graph
