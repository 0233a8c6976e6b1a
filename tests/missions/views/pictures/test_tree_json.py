"""Drawings as JSON: there and back, and as its schema says."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings

from missions.library.shipped import load_mission, shipped_missions
from missions.trees.drawing import FORMAT, TreeDrawing, from_json, schema, to_json
from missions.trees.drawing_builder import drawing_of
from tests.cases import each
from tests.missions.command import command
from tests.missions.views.pictures.drawn import DRAWINGS, plan_of

VALIDATOR = jsonschema.Draft202012Validator(schema())


def dump() -> dict[str, Any]:
    data: dict[str, Any] = to_json(drawing_of(plan_of("  drive: 1 m\n  retry: 2\n")))
    return data


@settings(deadline=None, max_examples=40)
@given(DRAWINGS)
def test_tree_json_round_trips(drawing: TreeDrawing) -> None:
    data = json.loads(json.dumps(to_json(drawing)))
    VALIDATOR.validate(data)
    assert from_json(data) == drawing


@each("name", shipped_missions())
def test_shipped_missions_match_the_tree_schema(name: str) -> None:
    drawing = drawing_of(load_mission(name))
    VALIDATOR.validate(to_json(drawing))
    assert from_json(to_json(drawing)) == drawing


def test_the_schema_is_one_and_explains_every_member() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())
    definitions: Any = schema()["$defs"]
    for definition in definitions.values():
        assert all("description" in member for member in definition["properties"].values())


def test_tree_schema_refuses_unknown_members() -> None:
    data = dump()
    data["tree"]["colour"] = "red"
    assert not VALIDATOR.is_valid(data)
    assert not VALIDATOR.is_valid(dump() | {"format": "missiontree-tree/0"})


@each(
    ("where", "value", "words"),
    [
        (("format",), "missiontree-tree/9", f"its format is 'missiontree-tree/9', not '{FORMAT}'"),
        (("tree",), None, "'tree' must be an object (TreeBox), got None"),
        (("tree", "line"), "3", "'tree.line' must be a whole number within 1 and "),
        (
            ("tree", "status"),
            "done",
            "'tree.status' must be one of idle, running, suspended, success, skipped, failure, got 'done'",
        ),
        (("tree", "since"), "now", "'tree.since' must be a number, got 'now'"),
        (("tree", "modifiers"), [1], "'tree.modifiers' must be an object (Badge), got 1"),
        (("tree", "arguments"), {"distance": 1}, "'tree.arguments.distance' must be a text, got 1"),
    ],
)
def test_invalid_tree_dump_is_refused_with_the_fault(where: tuple[str, ...], value: object, words: str) -> None:
    data = part = dump()
    for name in where[:-1]:
        part = part[name]
    part[where[-1]] = value
    with pytest.raises(ValueError, match="tree dump") as caught:
        from_json(data)
    assert words in str(caught.value)


def test_the_command_writes_the_schema_of_dumps(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert json.loads(command(capsys, "schema", "tree").out) == schema()
    assert command(capsys, "schema", "tree", "-o", "tree.json").code == 0
    assert json.loads(Path("tree.json").read_text(encoding="utf-8")) == schema()
