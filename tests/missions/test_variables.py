"""How variables are told as they change."""

import io
import json
from math import nan
from pathlib import Path

import pytest

import missions
from behaviours.node import Node
from behaviours.run import RunState
from drivers.api import HeadPose
from drivers.clock import ManualClock
from missions.executive.events import Event, JsonLinesWriter, VariableSet, json_value
from missions.executive.executive import VariableChanges
from missions.executive.stream import EventStream


class Leaf(Node):
    """A node that does nothing: the whole tree."""

    def on_tick(self) -> None:  # type: ignore[override] # is never ticked
        """Do nothing."""

    def halt(self) -> bool:
        return True

    def abandon_halt(self) -> None:
        """Do nothing."""


class Uncopied(list[int]):
    """A list of the user's own that cannot be copied."""

    def copy(self) -> "Uncopied":
        raise RuntimeError("no copy")


class Told:
    """The variables of a mission, and what is told of them."""

    def __init__(self) -> None:
        self.run = RunState(ManualClock(2.0))
        self.events: list[Event] = []
        self.changes = VariableChanges(Leaf("all"), self.run, EventStream([self.events.append]))

    def news(self) -> list[tuple[str, object]]:
        self.events.clear()
        self.changes.emit()
        return [(event.name, event.value) for event in self.events if isinstance(event, VariableSet)]


@pytest.fixture
def told() -> Told:
    return Told()


def heard(file: Path, text: str, ticks: int) -> list[tuple[int, str, str, object]]:
    """Tick a mission; return what was told of its variables: tick, scope, name and value."""
    file.write_text(text)
    mission = missions.load(file)
    events: list[Event] = []
    mission.events.listeners.append(events.append)
    for _ in range(ticks):
        mission.tick()
    return [(event.tick, event.scope, event.name, event.value) for event in events if isinstance(event, VariableSet)]


def test_uncopyable_value_is_reported_without_error(told: Told) -> None:
    told.run.variables["row"] = row = Uncopied([1])
    ((name, value),) = told.news()
    assert name == "row"
    assert value is row


def test_variable_is_reported_when_it_changes(told: Told) -> None:
    told.run.variables["count"] = 1
    assert told.news() == [("count", 1)]
    assert told.news() == []
    told.run.variables["count"] = 2
    assert told.news() == [("count", 2)]


def test_equal_value_is_reported_only_with_another_type(told: Told) -> None:
    told.run.variables["x"] = 1.5
    told.news()
    told.run.variables["x"] = 3.0 / 2.0
    assert told.news() == []
    told.run.variables["x"] = 1
    told.news()
    told.run.variables["x"] = True
    assert told.news() == [("x", True)]


def test_deleted_variable_is_reported_as_none(told: Told) -> None:
    told.run.variables["x"] = 1
    told.news()
    del told.run.variables["x"]
    assert told.news() == [("x", None)]
    assert told.news() == []


def test_reported_list_is_a_copy(told: Told) -> None:
    places = [1, 2]
    told.run.variables["places"] = places
    ((_, value),) = told.news()
    places.append(3)
    assert value == [1, 2]


def test_the_state_of_the_robot_is_no_variable(told: Told) -> None:
    told.run.variables["battery"] = object()
    assert told.news() == []


def test_variable_is_reported_only_in_the_tick_that_sets_it(tmp_path: Path) -> None:
    steps = ["pretend: [running, success]", "set: {a: '${1 + 1}'}", "wait: 1 min"]
    text = "mission: m\ntree:\n  sequence:\n" + "".join(f"    - {step}\n" for step in steps)
    assert heard(tmp_path / "m.yaml", text, 4) == [(2, "", "a", 2)]


def test_params_are_reported_once_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("mission: m\nparams: {n: 3}\ntree:\n  pretend: [running, success]\n")
    events: list[Event] = []
    missions.run(tmp_path / "m.yaml", simulate="fast", listeners=[events.append])
    assert [event.event for event in events][:3] == ["started", "variable", "node_changed"]
    assert [event for event in events if isinstance(event, VariableSet)] == [VariableSet(0.0, 0, "", "n", 3)]


def test_reported_quantity_has_its_dimension(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("mission: m\nparams: {far: 30 cm}\ntree:\n  pretend: [running, success]\n")
    events: list[Event] = []
    missions.run(tmp_path / "m.yaml", simulate="fast", listeners=[events.append])
    told = [event for event in events if isinstance(event, VariableSet)]
    assert [(event.name, event.value, event.dimension) for event in told] == [("far", 0.3, "length")]


def test_submission_variables_are_reported_with_its_node(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text(
        "mission: inner\nparams: {n: 1}\nreturns: {twice: '${m}'}\ntree:\n  set: {m: '${n * 2}'}\n"
    )
    text = "mission: m\ntree:\n  sequence:\n    - mission: inner.yaml\n      with: {n: 4}\n"
    told = heard(tmp_path / "m.yaml", text, 1)
    assert told == [(1, "", "twice", 8), (1, "1.1", "n", 4), (1, "1.1", "m", 8)]


def test_in_a_file_a_value_is_written_in_plain_terms() -> None:
    file = io.StringIO()
    write = JsonLinesWriter(file)
    write(VariableSet(1.0, 2, "", "seen", HeadPose(0.5, nan)))
    write(VariableSet(1.0, 2, "1.3", "seen", None))
    assert [json.loads(line) for line in file.getvalue().splitlines()] == [
        {"event": "variable", "t": 1.0, "tick": 2, "scope": "", "name": "seen", "value": {"pan": 0.5, "tilt": None}},
        {"event": "variable", "t": 1.0, "tick": 2, "scope": "1.3", "name": "seen"},
    ]


def test_every_value_has_a_plain_form() -> None:
    assert json_value({1: (True, "a"), "b": {2}}) == {"1": [True, "a"], "b": [2]}
    assert json_value(range(2)) == "range(0, 2)"
    assert json_value(HeadPose(0.5, 0.25)) == {"pan": 0.5, "tilt": 0.25}


def test_for_each_reports_member_and_number(tmp_path: Path) -> None:
    text = "mission: m\ntree:\n  for_each: {in: [a, b], as: x, number: n, do: {pretend: [running, success]}}\n"
    assert heard(tmp_path / "m.yaml", text, 4) == [
        (1, "", "x", "a"),
        (1, "", "n", 1),
        (3, "", "x", "b"),
        (3, "", "n", 2),
    ]
