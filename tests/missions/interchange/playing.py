"""Plays imported missions with scripted leaves, tick by tick, as BehaviorTree.CPP played the originals."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from py_trees.common import Status

from behaviours.catalogue import LEAVES
from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.executive.executive import Executive
from missions.executive.stream import EventStream
from missions.language.document import declared_params, load_plan
from missions.language.nodes import MODIFIERS
from missions.language.plan import Plan, Step
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission
from missions.library.vocabulary import load_leaves
from missions.plugins.interchange.importer import import_trees

STATUSES: Mapping[str, Status] = {"RUNNING": RUNNING, "SUCCESS": SUCCESS, "FAILURE": FAILURE}
TICK = 0.1
MAX_TICKS = 200


@dataclass
class LeafScript:
    """Statuses that a leaf returns, one a tick over the whole run, and the outputs of its successes.

    The last status and the last output are repeated for ever.
    """

    answers: Sequence[str]
    writes: Sequence[Mapping[str, object]] = ()
    ticks: int = 0
    successes: int = 0


class ScriptedLeaf(Leaf):
    """Leaf that follows a script."""

    script: LeafScript
    outputs: tuple[str, ...] = ()

    def update(self) -> Status:
        script = self.script
        answer = script.answers[min(script.ticks, len(script.answers) - 1)]
        script.ticks += 1
        if answer == "SUCCESS" and script.writes:
            written = script.writes[min(script.successes, len(script.writes) - 1)]
            script.successes += 1
            self.result = written if len(self.outputs) > 1 else next(iter(written.values()))
        return self.fail("as scripted") if answer == "FAILURE" else STATUSES[answer]


@dataclass
class Played:
    """Course of a run: result, variables of the main tree, and for each tick the statuses of the leaves."""

    result: str
    variables: Mapping[str, object]
    ticks: list[list[tuple[str, str]]] = field(default_factory=list)

    @property
    def order(self) -> list[tuple[str, str]]:
        """Leaves in the order in which they ended or were halted."""
        return [entry for tick in self.ticks for entry in tick]


def _watch(node: Node, events: list[tuple[str, str]]) -> None:
    """Note each status of a node, and each halt while it runs."""
    on_tick, halt = node.on_tick, node.halt

    def watched_tick() -> Status:
        status = on_tick()
        events.append((node.name, status.value))
        return status

    def watched_halt() -> bool:
        if node.status is RUNNING:
            events.append((node.name, "HALTED"))
        return halt()

    node.on_tick = watched_tick  # type: ignore[method-assign]
    node.halt = watched_halt  # type: ignore[method-assign]


def play_import(
    xml: Path, folder: Path, main: str, scripts: Mapping[str, LeafScript], max_ticks: int = MAX_TICKS
) -> Played:
    """Import a file, and run the mission ``main`` with scripted leaves."""
    for name, text in import_trees(xml, LEAVES).files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    leaves = load_leaves(sorted((folder / "behaviours").glob("*.py")))
    plan = load_plan(folder / f"{main}.yaml", leaves, LOOKUPS, find_mission=find_mission)
    params = declared_params(folder / f"{main}.yaml", leaves, LOOKUPS)
    return play(plan, scripts, max_ticks, params)


def play(
    plan: Plan, scripts: Mapping[str, LeafScript], max_ticks: int = MAX_TICKS, unset: Iterable[str] = ()
) -> Played:
    """Run a mission; scripts replace its stub leaves, by their names. ``unset`` are variables that begin as null."""

    def substitute(step: Step, leaf: Leaf | None) -> Leaf | None:
        if leaf is None or not leaf.stub:
            return leaf
        own: dict[str, Any] = {
            "tag": leaf.tag,
            "arguments": leaf.arguments,
            "output_doc": leaf.output_doc,
            "script": scripts.get(step.name, LeafScript(["SUCCESS"])),
        }
        scripted: type[ScriptedLeaf] = type("Scripted", (ScriptedLeaf,), own)
        return scripted(leaf.name)

    clock = ManualClock()
    run = RunState(clock)
    run.variables.update(dict.fromkeys(unset))  # an entry that nobody sets is unset there, and null here
    events: list[tuple[str, str]] = []
    root = build(plan, run, lambda _: Robot(), substitute=substitute)
    for node in root.iterate():
        if isinstance(node, Node) and node.kind not in MODIFIERS:
            _watch(node, events)
    executive = Executive(root, run, EventStream([]))
    ticks: list[list[tuple[str, str]]] = []
    status = RUNNING
    while status is RUNNING and len(ticks) < max_ticks:
        if ticks:
            clock.advance(TICK)
        events.clear()
        status = executive.tick()
        ticks.append(list(events))
    return Played(status.value, dict(run.variables), ticks)
