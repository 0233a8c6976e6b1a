"""``mission import MODULE:FUNCTION``: trees of py_trees from Python become missions, with a list of what did not."""

import operator
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from py_trees import behaviours, common, composites, decorators, timers
from py_trees.behaviour import Behaviour

from behaviours.catalogue import LEAVES
from missions.plugins.interchange import importer
from missions.plugins.interchange.importer import ImportedProject, import_python_tree
from tests.cases import each
from tests.missions.command import Outcome, command
from tests.missions.interchange.round_trips import plan_of
from tests.missions.interchange.trees import remarks, tree_lines

Mission = Callable[..., Outcome]
SUCCESS, RUNNING = common.Status.SUCCESS, common.Status.RUNNING


class Grasp(Behaviour):
    """Action with arguments, one of which is not a plain value."""

    def __init__(self, name: str, force: float, hand: object = None) -> None:
        super().__init__(name)
        self.force, self.hand = force, hand

    def update(self) -> common.Status:
        raise AssertionError("an import ticks nothing")


def comparison(value: Any) -> common.ComparisonExpression:
    return common.ComparisonExpression("n", value, operator.lt)


def node() -> Behaviour:
    return Grasp("Grasp", 2)


def imported_tree(tree: Behaviour, folder: Path, monkeypatch: pytest.MonkeyPatch) -> ImportedProject:
    """Import a tree, and check the mission that it becomes."""
    monkeypatch.setattr(importer, "load_tree", lambda _: tree)
    imported = import_python_tree("trees:patrol", LEAVES)
    for name, text in imported.files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    plan_of(folder / "patrol.yaml")
    return imported


@each(
    ("make", "lines"),
    [
        (
            lambda: composites.Sequence("Sequence", memory=True, children=[node()]),
            ["sequence:", "  - grasp: {force: 2}"],
        ),
        (
            lambda: composites.Selector("try", memory=False, children=[node()]),
            ["reactive_selector:", "  - grasp: {force: 2}", "name: try"],
        ),
        (lambda: decorators.Timeout("t", node(), duration=2.5), ["grasp: {force: 2}", "timeout: 2.5 s  # t"]),
        (lambda: decorators.Retry("r", node(), 3), ["grasp: {force: 2}", "retry: 3  # r"]),
        (lambda: decorators.Repeat("r", node(), -1), ["grasp: {force: 2}", "repeat: forever  # r"]),
        (lambda: decorators.Inverter("i", node()), ["grasp: {force: 2}", "invert: true  # i"]),
        (lambda: decorators.RunningIsFailure("i", node()), ["grasp: {force: 2}", "on_running: fail  # i"]),
        (lambda: decorators.FailureIsSuccess("i", node()), ["grasp: {force: 2}", "on_failure: succeed  # i"]),
        (lambda: decorators.Condition("c", node(), SUCCESS), ["grasp: {force: 2}", "retry: forever  # c"]),
        (lambda: timers.Timer("Timer", 0.5), ["wait: 500 ms"]),
        (lambda: behaviours.Running("Running"), ["wait_until: false"]),
        (
            lambda: behaviours.SetBlackboardVariable("SetBlackboardVariable", "/a/b", True, True),
            ["set: {a_b: true}"],
        ),
    ],
)
def test_a_node_of_python_becomes_the_step_of_a_mission(
    make: Callable[[], Behaviour], lines: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert tree_lines(imported_tree(make(), tmp_path, monkeypatch)) == lines


def test_checks_of_constants_become_conditions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tree = composites.Sequence("patrol", memory=True)
    tree.add_children(
        [
            behaviours.SetBlackboardVariable("start", "n", 0, True),
            behaviours.CheckBlackboardVariableValue("few", comparison(3)),
            behaviours.WaitForBlackboardVariableValue("later", comparison(2.5)),
            behaviours.CompareBlackboardVariables("same", "n", "n", operator.eq),
        ]
    )
    lines = tree_lines(imported_tree(tree, tmp_path, monkeypatch))
    assert [line for line in lines if "- " in line or "name" not in line] == [
        "sequence:",
        "  - set: {n: 0}",
        "  - check: n < 3",
        "  - wait_until: n < 2.5",
        "  - check: n == n",
    ]


def test_everything_that_was_not_carried_over_is_listed_with_its_node(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def battery_is_low() -> bool:
        raise AssertionError("an import calls no function of a node")

    tree = composites.Selector("all", memory=True)
    tree.add_children(
        [
            decorators.StatusToBlackboard("status", node(), "found"),
            decorators.EternalGuard("guard", node(), battery_is_low),
            behaviours.SetBlackboardVariable("later", "n", battery_is_low, True),
            behaviours.CheckBlackboardVariableValue("dynamic", comparison(battery_is_low)),
            decorators.OneShot("once", node(), common.OneShotPolicy.ON_SUCCESSFUL_COMPLETION),
            decorators.Condition("running", node(), RUNNING),
        ]
    )
    imported = imported_tree(tree, tmp_path, monkeypatch)
    found = remarks(imported, "not carried over") + remarks(imported, "differs")
    for words in (
        "trees:patrol:2: StatusToBlackboard 'status': the status is not stored in 'found'",
        "trees:patrol:6: SetBlackboardVariable 'later': the value of 'n' is computed in Python",
        "trees:patrol:7: CheckBlackboardVariableValue 'dynamic': the check of 'n' is computed in Python",
        "trees:patrol:8: RunOnce 'once': a failure counts as an end, too",
    ):
        assert words in found
    assert any(remark.startswith("trees:patrol:10: PassThrough 'running'") for remark in found)
    assert "the stub leaf 'battery_is_low'" in imported.files["IMPORTED.md"]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    monkeypatch.chdir(tmp_path)
    return lambda *words: command(capsys, *words)


TREES = """from py_trees.behaviours import Failure
from py_trees.composites import Sequence


def patrol():
    return Sequence("patrol", memory=True, children=[Failure("no")])


def number():
    return 3


def broken():
    raise SystemExit(3)
"""


def test_a_file_is_only_imported_if_it_is_named_with_a_function(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "made_trees.py").write_text(TREES)
    assert mission("import", "made_trees.py:patrol", "-o", "made").code == 0
    assert "name: no" in (tmp_path / "made" / "patrol.yaml").read_text()
    assert mission("check", "made/patrol.yaml").code == 0
    assert mission("import", "made_trees.py", "-o", "other").code == 2


@each(
    ("target", "words"),
    [
        ("made_trees.py:number", "returned an int"),
        ("made_trees.py:broken", "SystemExit: 3"),
        ("made_trees.py:other", "has no attribute 'other'"),
        ("no_module_of_this_name:patrol", "No module named 'no_module_of_this_name'"),
        ("missing.py:patrol", "missing.py does not exist"),
        ("missing.xml", "'missing.xml' does not exist"),
    ],
)
def test_a_mistake_in_the_target_is_named(mission: Mission, tmp_path: Path, target: str, words: str) -> None:
    (tmp_path / "made_trees.py").write_text(TREES)
    refused = mission("import", target, "-o", "made")
    assert refused.code == 2
    assert words in refused.err
    assert "MODULE:FUNCTION" in refused.err
