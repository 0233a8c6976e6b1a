"""Missions inside missions, switches and chance: what the checker makes of them, and what they do when ticked."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from py_trees.common import Status

from behaviours.catalogue import LEAVES
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import NodeCallback, RunState
from config.diagnostics import InvalidFileError
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.language.document import load_plan
from missions.language.plan import Plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission, load_mission

SQUARE = """\
mission: square
params:
  side: 50 cm
  corners: {type: count, default: 4}
tree:
  sequence:
    - log: ${side} by ${corners}
    - set: {driven: "${side * corners}"}
returns: {length: driven, corners: corners}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "square.yaml").write_text(SQUARE)
    return tmp_path


def load(folder: Path, tree: str, *, params: Mapping[str, str] | None = None, head: str = "") -> Plan:
    """Load a mission that stands in ``folder``."""
    (folder / "main.yaml").write_text(f"mission: main\n{head}tree:\n{tree}")
    return load_plan(folder / "main.yaml", LEAVES, LOOKUPS, find_mission=find_mission, params=params)


def messages(folder: Path, tree: str, *, head: str = "") -> list[str]:
    """Return the mistakes in a mission, each with the name of its file and its line."""
    with pytest.raises(InvalidFileError) as caught:
        load(folder, tree, head=head)
    return [f"{Path(fault.source.name).name}:{fault.mark.line}: {fault.message}" for fault in caught.value.diagnostics]


def ready(plan: Plan, *, seed: int = 0) -> tuple[Node, RunState]:
    """Build a mission for a robot without parts."""
    run = RunState(ManualClock(), seed=seed)
    return build(plan, run, lambda leaf: Robot()), run  # noqa: ARG005 - a robot without parts


def named(root: Node, name: str) -> Node:
    """Return the node of this name."""
    return next(node for node in root.iterate() if isinstance(node, Node) and node.name == name)


def test_submission_takes_params_and_returns_results_under_one_name(folder: Path) -> None:
    root, run = ready(load(folder, "  mission: square.yaml\n  with: {side: 2 m, corners: 3}\n  as: done\n"))
    assert root.execute_tick() is Status.SUCCESS
    assert run.variables["done"] == {"length": 6.0, "corners": 3}
    assert "driven" not in run.variables, "its variables are its own"
    assert named(root, "log").reason == "2 m by 3"


def test_submission_results_without_as_become_variables(folder: Path) -> None:
    tree = "  sequence:\n    - mission: square.yaml\n    - log: ${length} and ${corners}\n      name: told\n"
    root, _ = ready(load(folder, tree))
    assert root.execute_tick() is Status.SUCCESS
    assert named(root, "told").reason == "2 m and 4"


def test_returns_beside_the_call_are_computed_among_the_submissions_variables(folder: Path) -> None:
    root, run = ready(load(folder, "  mission: square.yaml\n  returns: {twice: driven * 2}\n"))
    assert root.execute_tick() is Status.SUCCESS
    assert run.variables["twice"] == 4.0
    assert "length" not in run.variables


TOUR = """\
mission: tour
tree:
  sequence:
    - set: {seen: 2}
    - set: {last: hall}
      if: seen > 1
    - fail: no door
    - set: {home: true}
returns: {seen: seen, twice: seen * 2, home: home, last: last}
"""


def test_failed_submission_returns_the_results_that_are_set(folder: Path) -> None:
    (folder / "tour.yaml").write_text(TOUR)
    for beside in ("", "\n  as: done"):
        root, run = ready(load(folder, f"  mission: tour.yaml{beside}\n"))
        run.variables["home"] = "of before"
        assert root.execute_tick() is Status.FAILURE
        assert root.reason == "no door"
        kept = run.variables["done"] if beside else run.variables
        assert isinstance(kept, dict)
        assert {name: kept.get(name) for name in ("seen", "twice", "last")} == {"seen": 2, "twice": 4, "last": "hall"}
        assert run.variables["home"] == "of before"
        assert not beside or "home" not in kept


def test_uncomputable_result_fails_the_submission_and_keeps_the_others(folder: Path) -> None:
    (folder / "half.yaml").write_text("mission: half\ntree: {set: {a: 1, b: x}}\nreturns: {c: a / (a - 1), d: a}\n")
    root, run = ready(load(folder, "  mission: half.yaml\n"))
    assert root.execute_tick() is Status.FAILURE
    assert root.reason == "returns: 'a / (a - 1)' divides by zero"
    assert run.variables["d"] == 1
    assert "c" not in run.variables


def test_halted_submission_returns_nothing(folder: Path) -> None:
    (folder / "slow.yaml").write_text(
        "mission: slow\ntree: {sequence: [{set: {a: 1}}, {wait: 9 s}]}\nreturns: {a: a}\n"
    )
    root, run = ready(load(folder, "  mission: slow.yaml\n  on_running: fail\n"))
    assert root.execute_tick() is Status.FAILURE
    assert "a" not in run.variables


def test_submission_recomputes_params_and_drops_variables_at_each_start(folder: Path) -> None:
    (folder / "count.yaml").write_text(
        "mission: count\nparams: {start: 0}\ntree:\n  set: {found: '${start + 1}'}\nreturns: {found: found}\n"
    )
    tree = "  sequence:\n    - mission: count.yaml\n      with: {start: '${n}'}\n      as: one\n"
    tree += "    - set: {n: '${one.found}'}\n  repeat: 3\n"
    root, run = ready(load(folder, "  sequence:\n    - set: {n: 10}\n    - " + tree.strip().replace("\n", "\n    ")))
    run.tick = 1
    for _ in range(5):
        if root.execute_tick() is not Status.RUNNING:
            break
    assert run.variables["n"] == 13


def test_submission_is_found_by_name_or_beside_its_caller(folder: Path) -> None:
    (folder / "inner").mkdir()
    (folder / "inner" / "a.yaml").write_text("mission: a\ntree:\n  mission: b.yaml\n")
    (folder / "inner" / "b.yaml").write_text("mission: b\ntree: succeed\n")
    plan = load(folder, "  sequence:\n    - mission: inner/a.yaml\n    - mission: greet\n      with: {patience: 5 s}\n")
    assert [step.name for step in plan.tree.walk() if step.kind == "mission"] == ["a", "b", "greet"]


def test_recursive_submission_is_a_mistake(folder: Path) -> None:
    (folder / "a.yaml").write_text("mission: a\ntree:\n  mission: b.yaml\n")
    (folder / "b.yaml").write_text("mission: b\ntree:\n  mission: main.yaml\n")
    assert messages(folder, "  mission: a.yaml\n") == [
        "b.yaml:3: a mission cannot include itself: main.yaml -> a.yaml -> b.yaml -> main.yaml"
    ]


@pytest.mark.parametrize("word", ["main", "a"])
def test_hint_never_suggests_a_recursive_submission(folder: Path, word: str) -> None:
    (folder / "a.yaml").write_text("mission: a\ntree:\n  sequence:\n    - mission: b\n")
    (folder / "b.yaml").write_text("mission: b\ntree: {mission: main}\n")
    with pytest.raises(InvalidFileError) as caught:
        load(folder, f"  {word}\n")
    assert "mission:" not in caught.value.diagnostics[0].suggestion


def test_mission_that_shadows_a_library_mission_gives_a_hint(folder: Path) -> None:
    (folder / "greet.yaml").write_text("mission: greet\ntree: {mission: greet}\n")
    with pytest.raises(InvalidFileError) as caught:
        load(folder, "  mission: greet\n")
    (fault,) = caught.value.diagnostics
    assert fault.message == "a mission cannot include itself: greet.yaml -> greet.yaml"
    assert fault.suggestion == "the library has another 'greet': rename greet.yaml to run that"


def test_number_of_steps_is_limited(folder: Path) -> None:
    (folder / "m0.yaml").write_text("mission: m0\ntree: succeed\n")
    for level in range(1, 12):
        twice = "".join(f"    - mission: m{level - 1}.yaml\n" for _ in range(5))
        (folder / f"m{level}.yaml").write_text(f"mission: m{level}\ntree:\n  sequence:\n{twice}")
    assert any("more than 10,000 steps" in line for line in messages(folder, "  mission: m11.yaml\n"))


@pytest.mark.parametrize(
    ("tree", "expected"),
    [
        ("  mission: sqare.yaml\n", "main.yaml:3: "),
        ("  mission: gret\n", "main.yaml:3: unknown mission 'gret'; did you mean 'greet'?"),
        ("  mission:\n", "main.yaml:3: 'mission' needs the name of a mission, or the path of its file"),
        ("  mission: square.yaml\n  with: {sied: 1 m}\n", "main.yaml:4: mission 'square' has no param 'sied'"),
        ("  mission: square.yaml\n  with: {side: 1 s}\n", "main.yaml:4: 'side' needs a length"),
        ("  mission: square.yaml\n  with: {side: 3}\n", "main.yaml:4: 'side' needs a length"),
        ("  mission: square.yaml\n  with: 3\n", "main.yaml:4: 'with' needs names and values"),
        ("  mission: square.yaml\n  returns: {a: drivn}\n", "main.yaml:4: result 'a': unknown name 'drivn'"),
        ("  wait: 1 s\n  with: {side: 1 m}\n", "main.yaml:4: 'with' stands only beside 'mission', not beside 'wait'"),
        ("  switch: {cases: {1: succeed}}\n", "main.yaml:3: 'switch' needs 'on', an expression"),
        ("  switch: {on: 1}\n", "main.yaml:3: 'switch' needs 'cases', each a value with a behaviour"),
        ("  switch: {on: 1, case: {1: succeed}}\n", "main.yaml:3: 'switch' has no key 'case'"),
        ("  switch: {on: nobody, cases: {1: succeed}}\n", "main.yaml:3: 'on': unknown name 'nobody'"),
        ("  switch: {on: 1, cases: {1: suceed}}\n", "main.yaml:3: unknown behaviour 'suceed'"),
    ],
)
def test_submission_mistakes_are_reported_at_their_place(tree: str, expected: str, folder: Path) -> None:
    assert any(line.startswith(expected) for line in messages(folder, tree)), messages(folder, tree)


def test_refused_param_causes_no_further_mistakes(folder: Path) -> None:
    (folder / "far.yaml").write_text("mission: far\nparams: {way: 1 m}\ntree: {drive: '${way * 2}'}\n")
    assert len(messages(folder, "  mission: far.yaml\n  with: {way: 3}\n")) == 1
    (folder / "far.yaml").write_text(
        "mission: far\nparams: {way: {type: length, default: 3}}\ntree: {drive: '${way * 2}'}\n"
    )
    assert len(messages(folder, "  mission: far.yaml\n")) == 1
    assert len(messages(folder, "  drive: ${way * 2}\nparams: {way: {type: length, default: 3}}\n")) == 1


def test_mistake_inside_a_submission_is_reported_in_its_file(folder: Path) -> None:
    (folder / "bad.yaml").write_text("mission: bad\ntree:\n  parallel:\n    - say: a\n    - say: b\n")
    lines = messages(folder, "  sequence:\n    - mission: bad.yaml\n    - mission: bad.yaml\n")
    assert lines == ["bad.yaml:5: 'say' and 'say' (line 4) can both drive the voice at the same time"]


def test_unreachable_steps_and_useless_modifiers_are_mistakes(folder: Path) -> None:
    tree = "  sequence:\n    - wait: 1 s\n      repeat: forever\n    - log: never\n"
    assert messages(folder, tree) == ["main.yaml:6: 'log' is never reached: 'wait' (line 4) never succeeds"]
    tree = "  selector:\n    - wait: 1 s\n    - log: never\n"
    assert messages(folder, tree) == ["main.yaml:5: 'log' is never reached: 'wait' (line 4) never fails"]
    tree = "  wait: 1 s\n  retry: 3\n"
    assert messages(folder, tree) == ["main.yaml:4: 'retry' has no effect here: 'wait' never fails"]


SWITCH = """\
  switch:
    on: ON
    cases:
      3: {log: three}
      red: {log: red}
      true: {log: yes}
      2 m: {log: far}
    default: {log: other}
"""


@pytest.mark.parametrize(
    ("on", "said"),
    [
        ("1 + 2", "three"),
        ("3.0", "three"),
        ("'3'", "three"),
        ("'red'", "red"),
        ("1 == 1", "yes"),
        ("1", "other"),
        ("'blue'", "other"),
        ("far", "far"),
    ],
)
def test_switch_runs_the_case_of_its_value(on: str, said: str, folder: Path) -> None:
    any_kind = f"  sequence:\n    - set: {{it: '${{[1]}}'}}\n    - set: {{it: \"${{{on}}}\"}}\n"
    switch = "    - " + SWITCH.replace("ON", "it").strip().replace("\n", "\n    ") + "\n"
    root, _ = ready(load(folder, any_kind + switch, head="params: {far: 2 m}\n"))
    assert root.execute_tick() is Status.SUCCESS
    assert [
        node.reason for node in root.iterate() if isinstance(node, Node) and node.kind == "log" and node.reason
    ] == [said]


def test_switch_without_a_matching_case_fails_with_the_value(folder: Path) -> None:
    tree = "  switch: {on: \"'blue'\", cases: {red: succeed, 3: succeed}}\n"
    root, _ = ready(load(folder, tree))
    assert root.execute_tick() is Status.FAILURE
    assert root.reason == "no case for blue, and no default"


def test_switch_keeps_its_case_until_it_ends(folder: Path) -> None:
    tree = "  switch:\n    on: colour\n    cases:\n      red: {pretend: [running, success]}\n      blue: fail\n"
    root, run = ready(load(folder, tree, head="params: {colour: red}\n"))
    assert root.execute_tick() is Status.RUNNING
    run.variables["colour"] = "blue"
    assert root.execute_tick() is Status.SUCCESS


def names(seen: list[str], status: Status) -> NodeCallback:
    """Return an observer that adds to ``seen`` the names of the nodes that come to have ``status``."""
    return NodeCallback(lambda node: seen.append(node.name) if node.status is status else None)


def test_random_sequence_runs_all_children_in_an_order_by_seed(folder: Path) -> None:
    leaves = "".join(f"    - pretend: [running, success]\n      name: n{number}\n" for number in range(6))
    plan = load(folder, "  random_sequence:\n" + leaves)

    def order(seed: int) -> list[str]:
        root, run = ready(plan, seed=seed)
        seen: list[str] = []
        run.observer = names(seen, Status.SUCCESS)
        for _ in range(7):
            root.execute_tick()
        assert root.status is Status.SUCCESS
        return seen[:-1]

    assert sorted(order(1)) == [f"n{number}" for number in range(6)]
    assert order(1) == order(1)
    assert len({tuple(order(seed)) for seed in range(10)}) > 5


def test_random_selector_draws_a_new_order_at_each_start(folder: Path) -> None:
    leaves = "".join(f"    - pretend: [failure]\n      name: n{number}\n" for number in range(4))
    root, run = ready(load(folder, "  random_selector:\n" + leaves))
    orders = set()
    for _ in range(8):
        seen: list[str] = []
        run.observer = names(seen, Status.FAILURE)
        assert root.execute_tick() is Status.FAILURE
        orders.add(tuple(seen))
    assert len(orders) > 3


def test_cleanup_in_another_file_is_named_with_its_file(tmp_path: Path) -> None:
    (tmp_path / "mover.yaml").write_text("mission: mover\ntree: {drive: 1 m}\n", encoding="utf-8")
    path = tmp_path / "m.yaml"
    path.write_text("mission: m\ntree:\n  wait: 1 s\n  finally: {mission: mover}\n", encoding="utf-8")
    with pytest.raises(InvalidFileError) as caught:
        load_mission(str(path))
    (fault,) = caught.value.diagnostics
    assert fault.source.name == str(tmp_path / "mover.yaml")
    where = f"'finally' (line 4 of {path})"
    assert fault.message == f"'drive' drives the base, and {where} must not move anything"


def test_open_bracket_in_a_text_is_no_split_value(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("mission: m\ntree:\n  sequence: [log: a (b, succeed, {log: 'c (d', timeout: 1 s}]\n", "utf-8")
    with pytest.raises(InvalidFileError) as caught:
        load_mission(str(path))
    assert [fault.message for fault in caught.value.diagnostics] == ["'timeout' has no effect here: 'log' ends at once"]


EARLY = "'value' must be known before the mission starts"


@pytest.mark.parametrize(
    ("leaf", "inner"),
    [
        ("move_joints", "{move_joints: {to: {elbow: '${value}'}}}"),
        ("find_face", "{find_face: {pan: ['${value}', 90 deg]}}"),
        ("listen", "{listen: {for: [\"${'left' if value > 0 deg else 'right'}\"]}}"),
    ],
)
def test_late_value_of_a_param_is_reported_where_it_is_passed(leaf: str, inner: str, folder: Path) -> None:
    (folder / "inner.yaml").write_text(f"mission: inner\nparams: {{value: 20 deg}}\ntree: {inner}\n")
    (folder / "middle.yaml").write_text(
        "mission: middle\nparams: {value: 20 deg}\ntree:\n  mission: inner\n  with: {value: '${value}'}\n"
    )
    for name in ("inner", "middle"):
        tree = "  sequence:\n    - set: {a: '${random(1 deg, 2 deg)}'}\n"
        tree += f"    - mission: {name}\n      with: {{value: '${{a}}'}}\n"
        assert messages(folder, tree) == [f"main.yaml:6: {EARLY}: '{leaf}' needs it ({folder / 'inner.yaml'}:3)"]
        passed = f"  mission: {name}\n  with: {{value: '${{start * 2}}'}}\n"
        assert load(folder, passed, head="params: {start: 9 deg}\n").tree.kind == "mission"


def test_late_value_that_the_mission_sets_itself_is_reported_in_its_file(folder: Path) -> None:
    (folder / "inner.yaml").write_text(
        "mission: inner\nparams: {value: 20 deg}\ntree:\n  sequence:\n    - set: {value: 3 deg}\n"
        "    - move_joints: {to: {elbow: '${value}'}}\n"
    )
    tree = "  sequence:\n    - set: {a: '${random(1 deg, 2 deg)}'}\n    - mission: inner\n      with: {value: '${a}'}\n"
    (found,) = messages(folder, tree)
    assert found.startswith("inner.yaml:6: 'move_joints': 'to': the values must be known")


def test_error_of_a_null_param_names_the_place_of_the_null(folder: Path) -> None:
    (folder / "inner.yaml").write_text(
        "mission: inner\nparams: {count: null}\ntree: {say: Hi, repeat: '${count}', if: count > 1}\n"
    )
    for tree, place in (
        ("  mission: inner\n  with: {count: null}\n", folder / "main.yaml"),
        ("  mission: inner\n", folder / "inner.yaml"),
    ):
        with pytest.raises(InvalidFileError) as caught:
            load(folder, tree)
        line = 4 if place.name == "main.yaml" else 2
        hints = {fault.suggestion for fault in caught.value.diagnostics}
        assert hints == {f"'count' is null ({place}:{line}); write a value there"}
