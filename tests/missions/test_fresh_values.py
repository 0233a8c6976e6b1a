"""An expression that reads what is not reported just now waits for it, as a behaviour does that needs it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from behaviours.catalogue import LEAVES
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.api import BaseState, Pose2D, Quality, Reading, Velocity
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.executive.state import state_of
from missions.language.document import load_plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission


class Gaps:
    """A base that reports, or does not."""

    def __init__(self) -> None:
        self.reading = Reading(BaseState(Pose2D(1.0, 0.0, 0.5), Velocity(0.0, 0.0)), 0.0, Quality.GOOD)

    def state(self) -> Reading[BaseState]:
        return self.reading

    def report(self, *, good: bool) -> None:
        self.reading = replace(self.reading, quality=Quality.GOOD if good else Quality.STALE)


class Ticked:
    """A mission on such a base, ticked by hand each 50 ms."""

    def __init__(self, folder: Path, tree: str, **others: str) -> None:
        for name, text in others.items():
            (folder / f"{name}.yaml").write_text(f"mission: {name}\n{text}")
        path = folder / "m.yaml"
        path.write_text(f"mission: m\ntree:\n  sequence:\n{tree}")
        self.base, self.clock = Gaps(), ManualClock()
        base: Any = self.base
        self.run = RunState(self.clock)
        robot = Robot(base_part=base)
        self.run.variables.update(state_of(robot, self.run))
        plan = load_plan(path, LEAVES, LOOKUPS, find_mission=find_mission)
        self.root: Node = build(plan, self.run, lambda leaf: robot)  # noqa: ARG005 - every leaf sees the same

    def tick(self, times: int = 1) -> Status:
        """Tick so often, or until it has ended."""
        for _ in range(times):
            self.clock.advance(0.05)
            self.run.tick += 1
            if self.root.execute_tick() is not Status.RUNNING:
                break
        return self.root.status


WAITING = [
    ("    - set: {course: '${base.heading}'}\n", "waiting: the base does not report"),
    ("    - say: Hi\n      if: base.x > 2 m\n", "waiting: the base does not report"),
    ("    - switch: {on: base.bumper, cases: {true: {fail: bumped}, false: succeed}}\n", "the base does not report"),
    ("    - mission: inner.yaml\n      with: {x: '${base.x}'}\n", "waiting: the base does not report"),
    ("    - for_each: {in: '${[base.x]}', as: x, do: {log: '${x}'}}\n", "waiting: the base does not report"),
    ("    - succeed:\n      timeout: ${base.x / 1 m/s}\n      repeat: 2\n", "waiting: the base does not report"),
]


@pytest.mark.parametrize(("tree", "reason"), WAITING)
def test_expression_waits_while_the_base_does_not_report(tmp_path: Path, tree: str, reason: str) -> None:
    inner = "params: {x: {type: length}}\ntree: {log: '${x}'}\n"
    mission = Ticked(tmp_path, tree, inner=inner)
    mission.base.report(good=False)
    assert mission.tick(20) is Status.RUNNING
    assert any(reason in node.feedback_message for node in mission.root.iterate())
    mission.base.report(good=True)
    assert mission.tick(5) is Status.SUCCESS


def test_waiting_expression_times_out(tmp_path: Path) -> None:
    mission = Ticked(tmp_path, "    - set: {course: '${base.heading}'}\n      delay: 100 ms\n      timeout: 1 s\n")
    mission.base.report(good=False)
    assert mission.tick(19) is Status.RUNNING
    assert mission.tick(3) is Status.FAILURE
    assert mission.root.feedback_message == "waiting: the base does not report (timed out after 1 s)"


def test_node_is_not_ticked_while_its_condition_is_unknown(tmp_path: Path) -> None:
    mission = Ticked(tmp_path, "    - pretend: [running, running, success]\n      while: base.x < 2 m\n")
    assert mission.tick() is Status.RUNNING
    mission.base.report(good=False)
    assert mission.tick(10) is Status.RUNNING
    mission.base.report(good=True)
    assert mission.tick() is Status.RUNNING, "its second tick"
    assert mission.tick() is Status.SUCCESS


def test_ended_submission_does_not_run_again_for_its_returns(tmp_path: Path) -> None:
    inner = "tree: {set: {n: '${1 + 1}'}}\nreturns: {x: base.x, n: n}\n"
    mission = Ticked(tmp_path, "    - mission: inner.yaml\n    - log: ${x} ${n}\n", inner=inner)
    child = next(node for node in mission.root.iterate() if getattr(node, "kind", "") == "set")
    mission.base.report(good=False)
    assert mission.tick(3) is Status.RUNNING
    assert child.status is Status.SUCCESS
    mission.base.report(good=True)
    assert mission.tick(2) is Status.SUCCESS
    assert mission.run.variables["x"] == pytest.approx(1.0)


def test_state_of_a_missing_part_is_none() -> None:
    assert state_of(Robot(), ManualClock())["base"].x is None  # which the checker has told
