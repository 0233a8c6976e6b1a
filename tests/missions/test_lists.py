"""Lists of mappings: as params, in a for_each, from every caller, and with the dimension of each value."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from behaviours.robot import Robot
from behaviours.run import RunState
from config.diagnostics import InvalidFileError, SourceText
from config.units import Quantity
from drivers.clock import ManualClock
from missions.executive.build import build
from missions.language.document import check_plan
from missions.language.expressions import ExpressionError, parse
from missions.language.lists import list_text, parse_list
from missions.language.operators import MAX_LIST_TEXT, MAX_MEMBERS, MAX_TEXT, check_data_size
from missions.language.plan import Plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission
from missions.plugins.schema.mission import mission_schema, shipped_things
from missions.plugins.studio.library import params_of

POINTS = """\
mission: points
params:
  points: [{x: 1 m, y: 0 m}, {x: 2 m, y: 1 m}]
  stops:
    of:
      at: {type: length, low: 0 m, high: 5 m}
      side: {type: choice, choices: [left, right]}
      code: text
    default: []
    help: where to stop
tree:
"""
PAN = "'find_face': 'pan'"
ONE_TYPE = "param 'a': the members of a list must have one type"
ONE_TYPE_EACH = "param 'a': 'x' must have one type in all members:"
SAME_KEYS = "param 'a': the members of a list must have the same keys"
DEEP: dict[str, object] = {}
for _ in range(10):
    DEEP = {"a": DEEP}
DRIVES = POINTS + '  for_each: {in: points, as: p, do: {drive: "${p.x}"}}\n'


def check(text: str, params: Mapping[str, str] | None = None) -> Plan:
    return check_plan(SourceText("points.yaml", text), LEAVES, LOOKUPS, params=params, find_mission=find_mission)


def messages(text: str, params: Mapping[str, str] | None = None) -> list[str]:
    with pytest.raises(InvalidFileError) as caught:
        check(text, params)
    return [fault.message for fault in caught.value.diagnostics]


def test_values_of_a_mapping_keep_their_dimension() -> None:
    points = check(DRIVES).params["points"]
    assert points == [{"x": 1.0, "y": 0.0}, {"x": 2.0, "y": 1.0}]
    assert isinstance(points, list)
    assert isinstance(points[0]["x"], Quantity)
    assert points[0]["x"].dimension == "length"


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("drive: ${p.z}", "'drive': 'z' is not there"),
        ("wait: ${p.x}", "'wait' needs a duration such as '2 s', got a length"),
        ("drive: ${p.x + 1}", "'drive': cannot add a length and a number"),
        ("say: ${p.x < 2 s}", "'say': cannot compare a length and a duration"),
        ("say: ${p + 1}", "'say': cannot calculate with a mapping"),
        ("drive: ${p}", "'drive' needs a length such as '0.5 m', got a mapping"),
        ("say: ${points + [1 m]}", "'say': the members of a list must have one type: a mapping and a length"),
        ("say: ${points + p}", "'say': cannot add a list and a mapping"),
    ],
)
def test_mistake_with_a_mapping_is_found_at_check_time(step: str, message: str) -> None:
    text = POINTS + f"  for_each:\n    in: points\n    as: p\n    do:\n      {step}\n"
    assert messages(text) == [message]


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ("{a: [{x: 1 m}, {x: 2}]}", f"{ONE_TYPE_EACH} a length in the first, a number in '{{x: 2}}'"),
        ("{a: [{x: 1}, {y: 1}]}", f"{SAME_KEYS}: '{{y: 1}}' has no 'x'"),
        ("{a: [{x: 1}, {x: 1, y: 1}]}", f"{SAME_KEYS}: '{{x: 1, y: 1}}' has 'y'"),
        ("{a: [{x: 1}, 3]}", f"{ONE_TYPE}: '{{x: 1}}' is a mapping, '3' a number"),
        ("{a: [{x: [1]}]}", "param 'a' needs plain values as its members, or mappings of plain values"),
        ("{a: [{}]}", "param 'a' needs plain values as its members, or mappings of plain values"),
        ("{a: [{x: '${b}'}]}", "param 'a' cannot have the member '${b}': lists in a file hold plain values"),
        ("{a: [{x y: 1}]}", "param 'a': a key needs a plain word, got 'x y'"),
        ("{a: [{if: 1}]}", "param 'a': a key cannot be 'if', which is reserved in expressions"),
        ("{a: [{_x: 1}]}", "param 'a': a key needs a plain word, got '_x'"),
        ("{a: {of: {}}}", "param 'a': 'of' needs keys with types"),
        ("{a: {of: {x: lenght}}}", "param 'a': 'x': unknown type 'lenght'"),
        ("{a: {of: {x: list}}}", "param 'a': 'x' cannot be a list: a mapping in a list holds plain values"),
        ("{a: {of: {x: [1]}}}", "param 'a': 'x' needs a type"),
        ("{a: {of: {x: {default: 1 m}}}}", "param 'a': 'x' has no key 'default'"),
        ("{a: {type: length, of: {x: length}}}", "param 'a': only a list has members with 'of'"),
        ("{a: {of: {x: length}, low: 1 m}}", "param 'a': 'low' belongs to one value of the mappings"),
        ("{a: {default: [{x: 1 m}], high: 2 m}}", "param 'a': 'high' belongs to one value of the mappings"),
        (
            "{a: {of: {x: {type: length, low: 1 m}}, default: [{x: 1 cm}]}}",
            "param 'a' has a wrong member 1: it has a wrong 'x': it must be at least 1 m",
        ),
    ],
)
def test_invalid_list_of_mappings_gives_a_reason(params: str, message: str) -> None:
    assert messages(f"mission: m\nparams: {params}\ntree: succeed\n") == [message]


def test_caller_writes_mappings_with_commas_between_them() -> None:
    params = check(DRIVES, {"points": "{x: 3 m, y: 1 cm}", "stops": "[{at: 1 m, side: left, code: 007}]"}).params
    assert params["points"] == [{"x": 3.0, "y": 0.01}]
    assert params["stops"] == [{"at": 1.0, "side": "left", "code": "007"}]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{at: 1 m, side: up, code: a}", "it has a wrong 'side': it needs one of left, right, got 'up'"),
        ("{at: 9 m, side: left, code: a}", "it has a wrong 'at': it must be between 0 m and 5 m"),
        ("{at: 1, side: left, code: a}", "it has a wrong 'at': it needs a length such as '0.5 m': '1' has no unit"),
        ("{at: 1 m, side: left}", "it has no 'code'"),
        ("{at: 1 m, side: left, coed: a, code: b}", "it has an unknown key 'coed'; did you mean 'code'?"),
        ("kitchen", "it needs a mapping with at, side, code, got 'kitchen'"),
    ],
)
def test_caller_is_shown_the_wrong_value_of_a_mapping(text: str, message: str) -> None:
    assert messages(DRIVES, {"stops": text})[0].startswith(f"'stops' has a wrong member 1: {message}")


def test_submission_takes_a_list_of_mappings(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text(
        "mission: inner\nparams:\n  ways: {type: list, of: {x: length, y: length}}\n"
        'tree:\n  for_each: {in: ways, as: w, do: {drive: "${w.x + w.y}"}}\n'
    )
    path = tmp_path / "outer.yaml"

    def checked(given: str) -> Plan:
        text = POINTS + f"  sequence:\n    - set: {{found: []}}\n    - mission: inner\n      with: {{ways: {given}}}\n"
        return check_plan(SourceText(str(path), text), LEAVES, LOOKUPS, find_mission=find_mission)

    for given in ('"${points}"', '"${found + points}"', "[{x: 1 m, y: 2 m}]"):
        checked(given)
    for given, message in (
        ('"${[1 m]}"', "'ways' has a wrong member: it needs a mapping with x, y, got a length"),
        ('"${stops + found}"', "'ways' has a wrong member: it has no 'x'"),
        ('"${points[0].x}"', "'ways' needs a list, got a length"),
        ('"[${points[0].x}]"', "'ways' needs a list, got a text"),
        ("[{x: 1 m}]", "'ways' has a wrong member 1: it has no 'y'"),
    ):
        with pytest.raises(InvalidFileError) as caught:
            checked(given)
        assert [fault.message for fault in caught.value.diagnostics] == [message]


def test_list_param_is_taken_wherever_a_list_is() -> None:
    text = """\
mission: lists
params: {words: [go, come back], limits: [-20 deg, 20 deg], joints: [left_arm, neck_pan], ends: [running, success]}
tree:
  sequence:
    - listen: {for: "${words}"}
    - listen: {for: ["${words}", halt]}
    - find_face: {pan: "${limits}"}
    - joint_hot: {joints: "${joints}"}
    - pretend: ${ends}
    - navigate_through: ${words}
"""
    steps = check(text).tree.children
    found = [next(iter(step.arguments.values())).constant for step in steps]
    assert found[0] == {"go": "go", "come back": "come back"}
    assert found[1] == {"go": "go", "come back": "come back", "halt": "halt"}
    assert found[2] == pytest.approx((-0.349, 0.349), abs=1e-3)
    assert found[3] == ("left_arm", "neck_pan")
    assert found[5] == ["go", "come back"]


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (
            "find_face: {pan: '${points}'}",
            f"{PAN} has a wrong member: it needs an angle such as '30 deg', got a mapping",
        ),
        (
            "find_face: {pan: '${turned}'}",
            f"{PAN}: the two values must be known before the mission starts: numbers or params",
        ),
        ("find_face: {pan: '${back}'}", f"{PAN}: the first value must be below the second"),
        ("find_face: {pan: '${one}'}", f"{PAN} needs two values, such as [0 deg, 30 deg], got a list"),
        ("listen: {for: '${points}'}", "'listen': 'for' needs a phrase, got a mapping"),
        ("listen: {for: '${nobody}'}", "'listen': 'for' needs at least one phrase, got an empty list"),
    ],
)
def test_list_param_that_does_not_fit_is_found_at_check_time(step: str, message: str) -> None:
    params = "{points: [{x: 1 deg}, {x: 2 deg}], back: [2 deg, 1 deg], one: [1 deg], nobody: {of: text, default: []}}"
    text = f"mission: m\nparams: {params}\ntree:\n  sequence:\n    - set: {{turned: [1 deg, 2 deg]}}\n    - {step}\n"
    with pytest.raises(InvalidFileError) as caught:
        check(text)
    assert [fault.message for fault in caught.value.diagnostics] == [message]


def test_form_of_the_studio_has_the_values_of_a_mapping_with_their_bounds(tmp_path: Path) -> None:
    path = tmp_path / "points.yaml"
    path.write_text(DRIVES)
    fields = {each["name"]: each for each in params_of(str(path))}
    assert fields["points"]["default"] == "{x: 1 m, y: 0 m}, {x: 2 m, y: 1 m}"
    assert fields["points"]["of"] == "{x: length, y: length}"
    assert fields["stops"]["of"] == "{at: length from 0 m to 5 m, side: one of left, right, code: text}"


@pytest.mark.parametrize("members", [["a b", "c, d"], [{"x": True, "to": '"quoted" {}'}], ["- a", "", "ä-1.5"]])
def test_text_of_a_list_is_read_as_the_same_list(members: list[object]) -> None:
    assert parse_list(list_text(members), lambda _, scalar: scalar.value) == members


def test_schema_knows_mappings_in_lists() -> None:
    schema = mission_schema(LEAVES, shipped_things())
    param = schema["else"]["properties"]["params"]["additionalProperties"]
    assert param["items"]["type"] == ["string", "number", "boolean", "object"]
    assert param["properties"]["of"]["anyOf"][1]["additionalProperties"]["properties"].keys() == {
        "type", "choices", "low", "high",
    }  # fmt: skip


def test_param_of_a_list_of_mappings_has_its_kind_without_a_value() -> None:
    params = "params: {points: {of: {x: length}, help: where}}"
    text = f"mission: m\n{params}\ntree:\n  for_each: {{in: points, as: p, do: {{wait: '${{p.x}}'}}}}\n"
    assert messages(text) == ["'wait' needs a duration such as '2 s', got a length"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("many + many", f"a list of more than {MAX_MEMBERS:,} members"),
        ("long + long", f"a list with texts of more than {MAX_LIST_TEXT:,} characters"),
        ("[many]", "a list cannot contain a list"),
        ("[deep]", "a list cannot contain a list"),
        ("many + 1", "cannot calculate with a list"),
        ("[1 m] + [2 s]", "the members of a list must have one type: a length and a duration"),
    ],
)
def test_list_cannot_grow_without_bound(text: str, message: str) -> None:
    many = [1] * (MAX_MEMBERS // 2 + 1)
    scope = {"many": many, "long": ["x" * MAX_TEXT] * 6, "deep": {"a": many}}
    with pytest.raises(ExpressionError, match=message.replace("(", "\\(")):
        parse(text).evaluate(scope)


def test_appending_makes_another_list() -> None:
    scope: dict[str, object] = {"found": [1], "item": {"x": 2}}
    assert parse("found + [item.x, 3]").evaluate(scope) == [1, 2, 3]
    assert parse("[] + [item]").evaluate(scope) == [{"x": 2}]
    assert scope["found"] == [1]


PLACE = """\
mission: places
params: {far: 1 m}
tree:
  sequence:
    - set: {wait: 2 s}
    - set: {place: {x: "${far * 2}", after: "${wait}", name: "at ${far}", list: [1, "${far}"]}}
"""


def test_mapping_with_expressions_has_their_kinds() -> None:
    check(PLACE + "    - drive: ${place.x}\n    - wait: ${place.after}\n    - drive: ${place.list[1] + 1 m}\n")
    for step, message in (
        ("wait: ${place.x}", "'wait' needs a duration such as '2 s', got a length"),
        ("say: ${place.y}", "'say': 'y' is not there"),
        ("set: {p: {x: '${wait + far}'}}", "'p': cannot add a duration and a length"),
        ("set: {p: {x: '${nowhere}'}}", "'p': unknown name 'nowhere'"),
        ("set: {p: {x: '${1 +}'}}", "'p': '1 +' is not an expression; something is missing at its end"),
    ):
        assert messages(PLACE + f"    - {step}\n") == [message]


def test_mapping_of_params_alone_is_known_before_the_run() -> None:
    step = check("mission: m\nparams: {far: 1 m}\ntree: {set: {p: {x: '${far}', y: 2 m}}}\n").tree
    assert step.arguments["p"].constant == {"x": 1.0, "y": 2.0}


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ({"a": DEEP, "b": 1}, "more than 10 lists and mappings inside one another"),
        ([["x" * MAX_TEXT] * 11], f"texts of more than {MAX_LIST_TEXT:,} characters"),
        ([[1] * 1000] * 11, "more than 10,000 values"),
    ],
)
def test_mapping_cannot_grow_without_bound(value: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        check_data_size(value)


def test_mapping_that_holds_itself_twice_ends_the_mission_early() -> None:
    grows = 'set: {d: {a: "${d}", b: "${d}"}}'
    text = f"mission: m\ntree:\n  sequence:\n    - set: {{d: {{x: 1}}}}\n    - {grows}\n      repeat: forever\n"
    run = RunState(ManualClock())
    root = build(check(text), run, lambda _: Robot())
    for _ in range(20):
        run.tick += 1
        root.execute_tick()
    assert root.feedback_message.endswith("more than 10 lists and mappings inside one another")
