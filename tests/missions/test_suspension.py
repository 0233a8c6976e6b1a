"""Suspended guards: a random tree does the same whether or not its sensors are silent for a while, only later."""

import json
from itertools import count
from pathlib import Path
from random import Random
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

import missions
from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf, argument
from config.diagnostics import SourceText
from config.library import find_file
from drivers.errors import SensorSilent
from missions.executive.events import NodeChanged
from missions.language.document import check_plan
from missions.language.outcomes import actions_as_guards
from missions.library.drivers import load_robot
from missions.plugins.records.replay.rerun import rerun
from missions.plugins.testing.suite import load_suite
from tests.conformance.harness import Play
from tests.conformance.probes import Bench
from tests.missions.command import Outcome, command
from tests.missions.records.replay.past import past_of_case
from tests.tries import tries

pytestmark = pytest.mark.usefixtures("here")

TREES = tries(60, most=200)
FIRST_SEED = 510_000
TICKS = 30
STEP = 0.1
LONGEST_SILENCE = 30
"""Ticks: shorter than the sensor timeout."""


class Action(Leaf):
    """Do a piece of work that takes so many ticks, and write down each start, each tick of work, and each halt."""

    tag = "action"
    drives = frozenset({"base"})
    ticks: int = argument("count", "how many ticks it takes", principal=True)
    run: Bench
    _done = 0

    def initialise(self) -> None:
        self._done = 0
        self.run.log.append(f"{self.name} starts")

    def update(self) -> Status:
        self._done += 1
        self.run.log.append(f"{self.name} works")
        return Status.SUCCESS if self._done >= self.ticks else Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID:
            self.run.log.append(f"{self.name} halts")


class Guard(Leaf):
    """Ask whether a part of the robot's state is above a number; suspended while that is silent."""

    tag = "guard"
    instant = True
    needs = frozenset({"range"})
    part: str = argument("text", "battery or head", principal=True)
    above: int = argument("count", "the number")

    def update(self) -> Status:
        state: Any = self.run.variables[self.part]
        try:
            value = state["value"] if isinstance(state, dict) else state.value
        except SensorSilent:
            return self.suspend(self.part)
        return Status.SUCCESS if value > self.above else self.fail("not above")


Capture = pytest.CaptureFixture[str]

WORDS: dict[str, type[Leaf]] = {leaf.tag: leaf for leaf in (Action, Guard)}


def guard(random: Random, names: Any) -> dict[str, Any]:
    """Draw a condition on a sensor, bare or inverted, or within a sequence of conditions."""
    drawn: dict[str, Any] = {
        "guard": {"part": random.choice(["battery", "head"]), "above": random.randint(0, 4)},
        "name": f"g{next(names)}",
    }
    if random.random() < 0.3:
        drawn["invert"] = True
    if random.random() < 0.2:
        return {"sequence": [drawn, guard(random, names)], "name": f"s{next(names)}"}
    return drawn


def guarded(random: Random, names: Any, depth: int) -> dict[str, Any]:
    """Draw a reactive composite of guards and one thing to do, which may be such a composite itself."""
    done = (
        guarded(random, names, depth - 1)
        if depth and random.random() < 0.6
        else {"action": random.randint(2, 8), "name": f"a{next(names)}"}
    )
    shape = random.random()
    name = f"c{next(names)}"
    if shape < 0.4:
        guards = [guard(random, names) for _ in range(random.randint(1, 2))]
        return {"reactive_sequence": [*guards, done], "name": name}
    if shape < 0.7:
        other = {"sequence": [guard(random, names), {"action": random.randint(1, 4), "name": f"a{next(names)}"}]}
        return {"reactive_selector": [other | {"name": f"s{next(names)}"}, done], "name": name}
    return {"reactive_selector": [guard(random, names), done], "name": name}


def played(tree: dict[str, Any], values: list[dict[str, int]], silent: list[int]) -> list[str]:
    """Return what the actions did, in order.

    Before each of the ``values`` holds for a tick, all sensors are silent for so many ticks. A silent tick in which the
    tree asks nothing, and so is not suspended, takes the place of the other.
    """
    plan = check_plan(SourceText("tree", f"mission: tree\ntree: {json.dumps(tree)}\n"), WORDS, {})
    play = Play(plan, {"battery": {"value": 0}, "head": {"value": 0}})
    told: list[str] = []
    for state, quiet in zip(values, silent, strict=True):
        for part, value in state.items():
            play.change(f"{part}.value", value)
        for line in (*["battery silent, head silent"] * quiet, "battery reports, head reports"):
            happened = play.line(line, STEP).split(", ")
            told += [entry for entry in happened if entry.endswith((" starts", " works", " halts"))]
            if play.root.status is not Status.RUNNING:
                return told
            if not play.root.is_suspended:
                break
    return told


def test_the_action_behind_a_suspended_guard_never_restarts() -> None:
    tried, suspended = 0, 0
    for seed in count(FIRST_SEED):
        random = Random(seed)  # noqa: S311 - as a test draws
        tree = guarded(random, count(), 2)
        state = {part: random.randint(0, 5) for part in ("battery", "head")}
        values = []
        for _ in range(TICKS):
            state = {part: random.randint(0, 5) if random.random() < 0.08 else was for part, was in state.items()}
            values.append(state)
        silent = [random.randint(1, LONGEST_SILENCE) if random.random() < 0.4 else 0 for _ in range(TICKS)]
        expected = played(tree, values, [0] * TICKS)
        if sum(entry.endswith(" works") for entry in expected) < 3:
            continue  # nothing in it runs for long
        assert played(tree, values, silent) == expected, f"seed {seed}: {json.dumps(tree)}"
        tried, suspended = tried + 1, suspended + sum(silent)
        if tried == TREES:
            break
    assert suspended >= TREES * TICKS


# --- whole runs ------------------------------------------------------------------------------------------------------

BACK = [
    "reactive_selector: [{say: near, while: range.ahead < 5 cm}, {drive: 1.5 m}]",
    "reactive_sequence: [{fail: too near, if: range.ahead < 5 cm}, {drive: 1.5 m}]",
    "reactive_sequence: [{obstacle_within: 5 cm, invert: true}, {drive: 1.5 m}]",
    "reactive_selector: [{obstacle_within: 5 cm}, {drive: 1.5 m}]",
    "drive: 1.5 m, while: range.ahead > 5 cm",
    "reactive_switch: {on: range.ahead > 5 cm, cases: {true: {drive: 1.5 m}, false: {fail: near}}}",
]


def suite(tree: str, fault: str, expected: str, folder: Path, robot: str = "turtlebot2") -> Path:
    """Write a mission and its test: simulated time, an empty room, and something that goes wrong."""
    (folder / "trial.yaml").write_text(f"mission: trial\ntree: {{{tree}}}\n", "utf-8")
    (folder / "trial.test.yaml").write_text(
        f"tests: trial\nwith: {{robot: {robot}, world: square_arena, eyes: truth}}\n"
        f"cases:\n  - case: it\n    given: [{fault}]\n    expect: {expected}\n",
        "utf-8",
    )
    return folder / "trial.test.yaml"


def outcome(tree: str, fault: str, expected: str, folder: Path, capsys: Capture) -> Outcome:
    """Run such a test."""
    return command(capsys, "test", str(suite(tree, fault, expected, folder)))


@pytest.mark.parametrize("tree", BACK)
def test_a_silent_range_finder_does_not_restart_a_drive(
    tree: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = "{result: success, pose: {near: [0 m, -1.5 m]}}"
    found = outcome(tree, "range unplugged from 3 s to 5 s", expected, tmp_path, capsys)
    assert found.code == 0, found.out


def test_silent_range_finder_fails_the_reactive_selector(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tree = "reactive_selector: [{say: near, while: range.ahead < 5 cm}, {drive: 1.5 m}, {drive: -1 m}]"
    expected = "{result: failure, reason: the range finder has not reported for 5 s, within: 9 s, base: stopped}"
    found = outcome(tree, "range unplugged at 3 s", expected, tmp_path, capsys)
    assert found.code == 0, found.out


@pytest.mark.parametrize(
    "tree",
    [
        "reactive_selector: [bumped, {wait: 1 h}], on_failure: succeed",
        "wait: 1 h, until: base.x > 9 m, on_failure: succeed",
        "selector: [{wait_for: bumped}, {say: no base}]",
    ],
)
def test_failure_by_a_silent_sensor_is_caught(tree: str, tmp_path: Path, capsys: Capture) -> None:
    found = outcome(tree, "base unplugged at 2 s", "{result: success, after: 7 s, within: 9 s}", tmp_path, capsys)
    assert found.code == 0, found.out


def test_timeout_on_the_condition_lets_the_mission_continue_without_the_sensor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tree = "reactive_selector: [{face_seen: 1 s, timeout: 1 s}, {drive: 1.5 m}]"
    expected = "{result: success, pose: {near: [0 m, -1.5 m]}}"
    found = outcome(tree, "camera unplugged at 3 s", expected, tmp_path, capsys)
    assert found.code == 0, found.out


def test_a_timeout_inside_a_suspended_node_fires(tmp_path: Path, capsys: Capture) -> None:
    tree = "selector: [{drive: 1.5 m, timeout: 4 s, while: range.ahead > 5 cm}, {say: gave up}]"
    expected = "{result: success, said: gave up, within: 6 s}"
    found = outcome(tree, "range unplugged at 2 s", expected, tmp_path, capsys)
    assert found.code == 0, found.out


def test_base_stops_while_its_action_is_suspended(tmp_path: Path, capsys: Capture) -> None:
    tree = "reactive_selector: [{face_seen: 1 s}, {drive: 1.5 m}]"
    expected = "{result: failure, reason: the camera has not reported for 5 s, pose: {near: [-0.9 m, -1.5 m]}}"
    found = outcome(tree, "camera unplugged at 2 s", expected, tmp_path, capsys)
    assert found.code == 0, found.out


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("range unplugged from 1 s to 4 s", "{result: success, said: done}"),
        ("range unplugged at 1 s", "{result: failure, reason: the range finder has not reported for 5 s}"),
    ],
)
def test_submission_waits_for_the_sensors_of_its_params(
    fault: str, expected: str, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "inner.yaml").write_text(
        "mission: inner\nparams: {far: {type: length}}\ntree: {say: done, if: far > 1 cm}\n", "utf-8"
    )
    tree = "sequence: [{wait: 2 s}, {mission: ./inner.yaml, with: {far: '${range.ahead}'}}]"
    found = outcome(tree, fault, expected, tmp_path, capsys)
    assert found.code == 0, found.out


def test_sensor_timeout_is_set_in_the_robot_file(tmp_path: Path, capsys: Capture) -> None:
    robot = tmp_path / "patient.yaml"
    robot.write_text("sensor_timeout: 2 s\n" + find_file("robots", "turtlebot2").read_text("utf-8"), "utf-8")
    tree = "reactive_selector: [{face_seen: 1 s}, {wait: 20 s}]"
    expected = "{result: failure, reason: the camera has not reported for 2 s, within: 6 s}"
    path = suite(tree, "camera unplugged at 2 s", expected, tmp_path, robot=str(robot))
    found = command(capsys, "test", str(path))
    assert found.code == 0, found.out


def test_rerun_of_a_suspended_run_is_identical(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tree = "reactive_selector: [{say: near, while: range.ahead < 5 cm}, {drive: 50 cm}]"
    (case,) = load_suite(suite(tree, "range unplugged from 2 s to 3 s", "{result: success}", tmp_path))
    verdict, past = past_of_case(case, monkeypatch)
    assert verdict.passed
    told = {
        event.node: event.reason
        for event in past.events
        if isinstance(event, NodeChanged) and event.status == "suspended"
    }
    assert told == dict.fromkeys(("1", "1.1"), "waiting: the range finder does not report")
    assert rerun(past, past.runner.plan, load_robot(find_file("robots", "turtlebot2"))).is_identical


# --- leaves of other distributions ------------------------------------------------------------------------------------


def test_py_trees_behaviour_can_be_suspended() -> None:
    class Warm(Behaviour):
        """Is it warm?"""

        asked = 0

        def update(self) -> Status:
            self.asked += 1
            if self.asked < 3:
                raise SensorSilent("the thermometer does not report")
            return Status.SUCCESS

    mission = missions.wrap(Warm("warm"))
    assert mission.tick() is Status.RUNNING
    assert mission.root.is_suspended
    assert mission.reason == "waiting: the thermometer does not report"
    assert mission.tick() is Status.RUNNING
    assert mission.tick() is Status.SUCCESS
    assert not mission.root.is_suspended


# --- what the checker says -------------------------------------------------------------------------------------------

ACTIONS = [
    "{find_face: {scans: 1}}",
    "{race: [{wait: 1 s}, face_seen]}",
    "{face_seen: 1 s, retry: 3}",
    "{sequence: [{find_face: {scans: 1}}, face_seen]}",
]
CONDITIONS = [
    "face_seen",
    "{face_seen: 1 s, invert: true}",
    "{face_seen: 1 s, timeout: 1 s}",
    "{say: Hi, while: range.ahead < 1 m}",
    "{sequence: [face_seen, {say: Hi}]}",
    "{fail: near, while: range.ahead < 1 m}",
]


@pytest.mark.parametrize("composite", ["reactive_sequence", "reactive_selector"])
@pytest.mark.parametrize(("child", "hints"), [*((each, 1) for each in ACTIONS), *((each, 0) for each in CONDITIONS)])
def test_an_action_used_as_a_guard_gets_a_hint(composite: str, child: str, hints: int) -> None:
    tree = f"{composite}: [{child}, {{drive: 1 m}}]"
    plan = check_plan(SourceText("m.yaml", f"mission: m\ntree: {{{tree}}}\n"), LEAVES, {})
    found = actions_as_guards(plan.tree)
    assert len(found) == hints
    assert all("used as a guard" in hint.message for hint in found)


@pytest.mark.parametrize(
    ("composite", "child", "again", "instead"),
    [
        ("reactive_sequence", "{wait_until: face.seen}", ", and starts them again after that", "use 'check'"),
        ("reactive_selector", "{wait_until: face.seen, timeout: 5 s}", "", "use 'check'"),
        ("reactive_sequence", "{wait_for: face_seen}", ", and starts them again after that", "leave out 'wait_for'"),
    ],
)
def test_hint_about_a_wait_in_a_reactive_composite_states_its_effect(
    composite: str, child: str, again: str, instead: str
) -> None:
    tree = f"{composite}: [{child}, {{drive: 1 m}}]"
    plan = check_plan(SourceText("m.yaml", f"mission: m\ntree: {{{tree}}}\n"), LEAVES, {})
    (hint,) = actions_as_guards(plan.tree)
    word = child[1:].partition(":")[0]
    assert hint.message == f"while '{word}' waits, the {composite} halts the children after it{again}"
    assert hint.suggestion == f"{instead} to fail at once, or wait before the {composite}"


def test_action_in_a_wait_is_an_action_used_as_a_guard() -> None:
    tree = "reactive_sequence: [{wait_for: {find_face: {scans: 1}}}, {drive: 1 m}]"
    plan = check_plan(SourceText("m.yaml", f"mission: m\ntree: {{{tree}}}\n"), LEAVES, {})
    (hint,) = actions_as_guards(plan.tree)
    assert "used as a guard" in hint.message


@pytest.mark.parametrize(
    ("child", "hints"),
    [
        ("{find_face: {scans: 1}, on_running: fail}", 1),
        ("{sequence: [{find_face: {scans: 1}, on_running: fail}, {say: hello}]}", 1),
        ("{find_face: {scans: 1}, retry: 2, on_running: fail}", 1),
        ("{say: Hi, on_running: succeed}", 1),
        ("{find_face: {scans: 1}, if: face.seen, on_running: fail}", 0),
        ("{face_seen: 1 s, hold: 1 s, on_running: fail}", 0),
        ("{wait_until: face.seen, on_running: fail}", 0),
        ("{wait: 1 s, on_running: fail}", 0),
    ],
)
def test_action_with_one_tick_is_an_action_used_as_a_guard(child: str, hints: int) -> None:
    tree = f"reactive_selector: [{child}, {{drive: 1 m}}]"
    plan = check_plan(SourceText("m.yaml", f"mission: m\ntree: {{{tree}}}\n"), LEAVES, {})
    found = actions_as_guards(plan.tree)
    assert ["used as a guard" in hint.message for hint in found] == [True] * hints
