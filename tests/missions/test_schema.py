"""The JSON Schema: it accepts what the checker accepts, sees what a schema can see, and explains everything."""

import json
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from py_trees.common import Status

from behaviours.catalogue import LEAVES
from behaviours.leaf import Leaf, argument
from config.diagnostics import InvalidFileError, SourceText
from config.library import shipped_files
from config.units import UNITS, parse_quantity
from config.yaml_nodes import Listing, Node, Scalar, compose
from missions.language import for_each, mission_body, param_types, steps, switches
from missions.language.document import check_plan
from missions.language.nodes import BRANCHES, FOR_EACH, MISSION, MODIFIERS, SWITCHES
from missions.library.catalogue import bounds_text, default_text
from missions.library.catalogue import example_value as example_of
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission, shipped_missions
from missions.plugins.schema.mission import mission_schema, shipped_things
from missions.plugins.schema.values import quantity_schema as written_quantity
from tests.missions.command import Outcome, command

KNOWN = {kind: cache(find) for kind, find in LOOKUPS.items()} | {"file": Path}  # no bell.wav is here
SCHEMA = mission_schema(LEAVES, shipped_things())
VALIDATOR = jsonschema.Draft7Validator(SCHEMA)
BEHAVIOURS = SCHEMA["definitions"]["behaviours"]
NODE = SCHEMA["definitions"]["node"]


def plain(node: Node) -> Any:
    """What an editor makes of a file: plain data."""
    if isinstance(node, Scalar):
        return node.value
    if isinstance(node, Listing):
        return [plain(item) for item in node.items]
    return {key.text: plain(value) for key, value in node.entries}


def complaints(text: str) -> list[str]:
    return [error.message for error in VALIDATOR.iter_errors(plain(compose(SourceText("m.yaml", text))))]


def faults_in(text: str) -> list[str]:
    """What the checker has against it."""
    try:
        check_plan(SourceText("m.yaml", text), LEAVES, KNOWN, find_mission=find_mission)
    except InvalidFileError as error:
        return [fault.message for fault in error.diagnostics]
    return []


def accepted(text: str) -> bool:
    """Whether the checker has nothing against it."""
    return not faults_in(text)


def mission(*lines: str) -> str:
    head = "mission: m\nparams: {n: 2, x: 1.5, patience: 60 s}\ntree:\n  sequence:\n"
    return head + "".join(f"    {line}\n" for line in lines)


def test_mission_schema_is_draft_07_and_plain_json() -> None:
    jsonschema.Draft7Validator.check_schema(SCHEMA)
    assert json.loads(json.dumps(SCHEMA, allow_nan=False)) == SCHEMA


@pytest.mark.parametrize("name", list(shipped_missions()))
def test_every_shipped_mission_is_valid(name: str) -> None:
    assert complaints(shipped_missions()[name].read_text(encoding="utf-8")) == []


GOOD = [
    ["- say: Hi"],
    ["- say: {text: 007}"],
    ["- say: ${n} and ${x}"],
    ["- stop"],
    ["- face_seen:"],
    ["- face_seen: {}"],
    ["- look: {pan: -30 deg, tilt: '0.1 rad'}"],
    ["- drive: -20 cm"],
    ["- drive: {distance: '${base.x / 2}', speed: 0.1 m/s}"],
    ["- find_face: {pan: [-60 deg, 60 deg], scans: 3}", "  as: visitor", "  timeout: ${patience}"],
    ["- set: {count: 1, who: [a, b], far: 3 m}"],
    ["- gesture: hello", "  name: 3"],
    ["- gesture: {gesture: hello, speed: '${n / 2}'}"],
    ["- move_joints: {to: {elbow: 30 deg}, speed: 20 deg/s}"],
    ["- set: {pose: {elbow: 30 deg}}", "- move_joints: {to: '${pose}'}"],
    ["- play: wave"],
    ["- play: {move: gait, speed: 0.5}"],
    ["- torque: off"],
    ["- torque: {stiff: true, joints: [left_arm, 7]}"],
    ["- mirror: {leader: left_arm, follower: right_arm, scale: -1, scales: {elbow: 0.5}, offsets: {elbow: 3 deg}}"],
    ["- sweep: {joints: elbow, between: [0 deg, 9 deg], sine: on}"],
    ["- joint_at: {joint: elbow, angle: 3 deg}"],
    ["- joint_hot"],
    ["- joint_hot: {joints: elbow, over: 55 degC}"],
    ["- record_move: mine"],
    ["- pretend: [running, success]"],
    ["- pretend: failure", "  on_failure: succeed"],
    ["- wait: 1 s", "  if: n > 1", "  while: ${battery.percent > 20}", "  until: false"],
    ["- face_seen: .5 s", "  retry: 3", "  repeat: 2.0", "  invert: true"],
    ["- drive: 0 m", "  retry: ${n}", "  delay: 1e3 ms"],
    ["- random_selector: [stop, {say: Hi}]", "  cooldown: 1 min"],
    ["- switch: {on: n, cases: {1: stop, 2: {say: Hi}}, default: {fail: no}}"],
    ["- reactive_switch: {on: n, cases: {1: stop}}", "  on_running: fail", "  once: n + 1", "  name: x"],
    ["- parallel: [stop, {say: Hi}, {wait: 1 s}]", "  success_count: ${n}", "  wait_for_all: true"],
    ["- parallel: [{drive: 1 m}, {say: Hi}, {wait: 1 s}]", "  success_count: 1", "  failure_count: all"],
    ["- for_each: {in: [a, b c], as: place, number: k, do: {say: '${place}'}}"],
    ["- for_each: {in: '[n, 3]', as: place, do: stop}", "  repeat: 2"],
    ["- mission: greet", "  with: {patience: 5 s, greeting: Good day}"],
    ["- for_each: {in: [{x: 1 m, to: a}, {x: 2 m, to: b}], as: p, do: {drive: '${p.x}'}}"],
    ["- selector: [stop, {say: Hi}]", "  in_turn: true"],
    ["- wait: '${random(1 s, 3 s)}'", "  if: random(0, 1) < 0.5"],
    ["- random_selector: [stop, {say: Hi}]", "  weights: [2, 0.5]"],
    ["- random_selector: [stop, {say: Hi}]", "  weights: [20 %, 80 %]"],
    ["- random_selector: [stop, {say: Hi}]", "  weights: '${[n, x]}'"],
    ["- drive: 1 m", "  retry: 3", "  recover: {sequence: [stop, {say: '${failure}'}]}"],
    ["- drive: 1 m", "  finally: {show: ''}", "  halt_limit: 2 s", "  timeout: 3 s"],
]


@pytest.mark.parametrize("lines", GOOD)
def test_correct_mission_matches_the_schema(lines: list[str]) -> None:
    text = mission(*lines)
    assert accepted(text)
    assert complaints(text) == []


BROKEN = [
    ["- trak_face"],
    ["- trak_face: 3"],
    ["- say Hello"],
    ["- say:Hello"],
    ["- say: Hi", "  tiemout: 3 s"],
    ["- timeout: 3 s"],
    ["- {}"],
    ["-"],
    ["- [say: Hi]"],
    ["- say: Hi", "  drive: 1 m"],
    ["- drive: 1 m", "  sequence: [stop]"],
    ["- sequence: []"],
    ["- selector: [stop]", "  in_turn: yes"],
    ["- sequence: [stop]", "  in_turn: true"],
    ["- random_selector: [stop]", "  weights: 3"],
    ["- random_selector: [stop]", "  weights: [-1]"],
    ["- selector: [stop]", "  weights: [1]"],
    ["- for_each: {in: [{x: [1]}], as: p, do: stop}"],
    ["- race:"],
    ["- parallel"],
    ["- selector: {say: Hi}"],
    ["- sequence: [succeed]", "  as: it"],
    ["- say: Hi", "  as: it"],
    ["- find_face:", "  as: my face"],
    ["- find_face:", "  as: face"],
    ["- find_face:", "  as: [a]"],
    ["- wait: 1 s", "  name:"],
    ["- drive"],
    ["- drive: {distance: 1 m, sped: 1 m/s}"],
    ["- drive: {speed: 0.1 m/s}"],
    ["- drive: [1 m]"],
    ["- succeed: 3"],
    ["- succeed: {a: 1}"],
    ["- find_face: [-9 deg, 9 deg]"],
    ["- move_joints: {to: {}}"],
    ["- move_joints: {to: {elbow: 30}}"],
    ["- move_joints: {to: 30 deg}"],
    ["- move_joints: {to: [elbow]}"],
    ["- torque: stiff"],
    ["- joint_hot: []"],
    ["- joint_hot: {joints: elbow, over: 55}"],
    ["- play: wav"],
    ["- record_move: ''"],
    ["- set: 3"],
    ["- set: {}"],
    ["- set: {a b: 1}"],
    ["- set: {true: 1}"],
    ["- turn: 90"],
    ["- turn: 30°"],
    ["- turn: 3 m"],
    ["- turn: left"],
    ["- turn: {angle: }"],
    ["- drive: {distance: 1 m, speed: -1 m/s}"],
    ["- drive: {distance: 1 m, speed: 0 m/s}"],
    ["- wait: -1 s"],
    ["- find_face: {pan: 60 deg}"],
    ["- find_face: {pan: [1, 9 deg]}"],
    ["- find_face: {pan: [1 deg, 2 deg, 3 deg]}"],
    ["- find_face: {scans: 2.5}"],
    ["- gesture: {gesture: hello, speed: fast}"],
    ["- gesture: {gesture: hello, speed: 9}"],
    ["- gesture: helo"],
    ["- track_face: fce"],
    ["- say: {text: }"],
    ["- say: ['Hi']"],
    ["- pretend: [runing]"],
    ["- pretend: []"],
    ["- wait: 1 s", "  timeout: 0 s"],
    ["- wait: 1 s", "  hold: 2"],
    ["- wait: 1 s", "  retry: 0"],
    ["- wait: 1 s", "  repeat: often"],
    ["- wait: 1 s", "  invert: 1"],
    ["- wait: 1 s", "  once: yes"],
    ["- wait: 1 s", "  on_failure: fail"],
    ["- wait: 1 s", "  on_running: success"],
    ["- drive: 1 m", "  recover: stop"],
    ["- drive: 1 m", "  retry: 2", "  recover: {stpo: 1}"],
    ["- drive: 1 m", "  finally:"],
    ["- drive: 1 m", "  finally: [succeed]"],
    ["- drive: 1 m", "  halt_limit: 2 s"],
    ["- drive: 1 m", "  finally: succeed", "  halt_limit: 2"],
    ["- for_each: {in: [a], do: stop}"],
    ["- for_each: {in: [a], as: x}"],
    ["- for_each: {in: {a: 1}, as: x, do: stop}"],
    ["- for_each: [a, b]"],
    ["- race: [stop]", "  success_count: 1"],
    ["- parallel: [stop]", "  success_count: 0"],
    ["- parallel: [stop]", "  wait_for_all: false"],
    ["- wait: 1 s", "  if:"],
    ["- wait: 1 s", "  with: {a: 1}"],
    ["- mission: gret"],
    ["- mission: greet", "  with: 3"],
    ["- switch: {cases: {1: stop}}"],
    ["- switch: {on: n, cases: {}}"],
    ["- switch: {on: n, cases: {1: stpo}}"],
    ["- switch: {on: n, cases: {1: stop}, otherwise: stop}"],
]


@pytest.mark.parametrize("lines", BROKEN)
def test_wrong_mission_violates_the_schema(lines: list[str]) -> None:
    text = mission(*lines)
    assert not accepted(text)
    assert complaints(text)


@pytest.mark.parametrize(
    "text",
    [
        "- a",
        "just text",
        "tree: stop",
        "mission: m",
        "mission: m\ntree:",
        "mission:\ntree: stop",
        "mission: m\nsummary: [a]\ntree: stop",
        "mission: m\ntre: stop\ntree: stop",
        "mission: m\ntree:\n  - stop",
        "mission: m\nparams: 3\ntree: stop",
        "mission: m\nparams: {a: [[1]]}\ntree: stop",
        "mission: m\nparams: {a: '${b}'}\ntree: stop",
        "mission: m\nparams: {if: 3}\ntree: stop",
        "mission: m\nparams: {a: {}}\ntree: stop",
        "mission: m\nparams: {a: {type: lenght}}\ntree: stop",
        "mission: m\nparams: {a: {default: 1, hlep: x}}\ntree: stop",
        "mission: m\ntree: stop\nreturns: {a: [1]}",
    ],
)
def test_a_wrong_frame_of_a_mission_is_not_valid(text: str) -> None:
    assert not accepted(text)
    assert complaints(text)


def test_schema_accepts_short_and_long_params() -> None:
    text = (
        "mission: m\nparams:\n  a: 60 s\n  b: {default: 1 m, low: 0 m, high: 2 m, help: how far}\n  c: {type: text}\n"
        "tree: stop\nreturns: {far: b}\n"
    )
    assert accepted(text)
    assert complaints(text) == []


VALUES = st.sampled_from(
    [
        *["", "~", "true", "3", "0", "-1", "1.5", "9" * 400, "forever", "succeed", "fail", "stop", "greet"],
        *["1 s", "30 deg", "1 m", "0 s", "-2 cm", "hello", "face", "./a.yaml", "'x'", "${n}", "'${x} m'", "${face.id}"],
        *["[]", "[1 s]", "[1 deg, 2 deg]", "[success, failure]", "[stop, {say: Hi}]", "{}", "{a: 1}", "{a: n}"],
        *["{text: a, speed: 1}", "{pan: 3 deg}", "{on: n, cases: {1: stop, x: {wait: 1 s}}}"],
    ]
)
KEYS = st.sampled_from([*LEAVES, *BRANCHES, *MODIFIERS, *steps.BESIDE_KEYS, "nonsense", "3"])


@given(st.lists(st.dictionaries(KEYS, VALUES, min_size=1, max_size=3), min_size=1, max_size=3))
@example([{"retry": "3", "say": "Hi"}])
def test_whatever_the_checker_accepts_is_valid(nodes: list[dict[str, str]]) -> None:
    lines = []
    for node in nodes:
        lines += [("- " if place == 0 else "  ") + f"{key}: {value}" for place, (key, value) in enumerate(node.items())]
    text = mission(*lines)
    if accepted(text):
        assert complaints(text) == []


def numbers() -> st.SearchStrategy[str]:
    pieces = st.lists(st.sampled_from([*"0123456789.eE+- ", "00", "12"]), max_size=6).map("".join)
    units = [unit for named in UNITS.values() for unit in named]
    return st.tuples(pieces, st.sampled_from(["", " "]), st.sampled_from([*units, "", "furlong", "S"])).map("".join)


@given(numbers(), st.sampled_from(list(UNITS)))
def test_schema_pattern_agrees_with_the_quantity_parser(text: str, dimension: str) -> None:
    assume(not re.search(r"[eE]\+?\d{3}", text))  # what is too large to be a number, a pattern cannot tell
    found = parse_quantity(text)
    good = found is not None and found.dimension == dimension
    assert bool(re.search(written_quantity(dimension, negative=True)["pattern"], text)) is good
    assert bool(re.search(written_quantity(dimension)["pattern"], text)) is (good and "-" not in text.strip()[:1])
    above = good and found is not None and "-" not in text.strip()[:1] and any(c in "123456789" for c in mantissa(text))
    assert bool(re.search(written_quantity(dimension, zero=False)["pattern"], text)) is above


def mantissa(text: str) -> str:
    return re.split("[A-Za-z]", text)[0]


# Help and completion


def test_every_leaf_argument_composite_and_modifier_is_explained() -> None:
    assert BEHAVIOURS.keys() == {*LEAVES, *BRANCHES}
    for word, leaf in LEAVES.items():
        assert BEHAVIOURS[word]["description"]
        assert all(name in BEHAVIOURS[word]["markdownDescription"] for name in leaf.arguments)
        for name, declared in leaf.arguments.items():
            assert declared.help[1:] in BEHAVIOURS[word]["then"]["properties"][name]["description"]
    for word in BRANCHES:
        assert BEHAVIOURS[word]["description"]
    for branch in ("then", "else"):
        for word in (*MODIFIERS, *steps.BESIDE_KEYS, "as"):
            assert NODE[branch]["properties"][word]["description"]


def test_the_schema_and_the_checker_know_the_same_keys() -> None:
    assert SCHEMA["else"]["properties"].keys() == set(mission_body.MISSION_KEYS)
    assert SCHEMA["else"]["properties"]["params"]["additionalProperties"]["properties"].keys() == set(
        param_types.PARAM_KEYS
    )
    assert all(BEHAVIOURS[word]["properties"].keys() == set(switches.SWITCH_KEYS) for word in SWITCHES)
    assert BEHAVIOURS[FOR_EACH]["properties"].keys() == set(for_each.FOR_EACH_KEYS)
    expected = {*LEAVES, *BRANCHES, *MODIFIERS, *steps.BESIDE_KEYS}
    assert NODE["then"]["properties"].keys() == expected
    assert NODE["else"]["properties"].keys() == expected


def test_gestures_controllers_and_missions_are_proposed_with_their_summaries() -> None:
    gestures = {each["label"]: each["description"] for each in BEHAVIOURS["gesture"]["defaultSnippets"]}
    assert gestures.keys() == shipped_files("gestures").keys()
    assert all(gestures.values())
    missions = {each["label"]: each["description"] for each in BEHAVIOURS[MISSION]["defaultSnippets"]}
    assert sorted(find_mission(name) for name in missions) == sorted(shipped_missions().values())
    assert all(missions.values())


def snippets() -> Iterator[tuple[str, str]]:
    """Every form that is proposed: what it is for, and a mission with it."""
    for snippet in NODE["else"]["defaultSnippets"]:
        yield (
            snippet["label"],
            mission("- " + re.sub(r"\$\{\d:([^}]*)\}", r"\1", snippet["bodyText"]).replace("\n", "\n    ")),
        )
    for word, schema in BEHAVIOURS.items():
        for snippet in schema.get("defaultSnippets", []):
            yield f"{word} {snippet['label']}", mission(f"- {json.dumps({word: snippet['body']})}")
    (whole,) = SCHEMA["defaultSnippets"]
    yield "whole", re.sub(r"\$\{\d:([^}]*)\}", r"\1", json.dumps(whole["body"]))


@pytest.mark.parametrize(("label", "text"), [pytest.param(*each, id=each[0]) for each in snippets()])
def test_every_proposed_form_is_a_mission(label: str, text: str) -> None:
    # A mission that needs params is proposed too; which, the checker says.
    assert [fault for fault in faults_in(text) if not (label.startswith("mission ") and " needs '" in fault)] == []
    assert complaints(text) == []


NAMED = {"gesture": "hello", "move": "hello", "gait": "stroll"}
"""A name for what has no example: it is one of those that are there."""


def test_defaults_and_examples_of_arguments_are_valid_themselves() -> None:
    for leaf in LEAVES.values():
        arguments = leaf.arguments.values()
        given_values = {
            each.name: NAMED[each.kind] if each.kind in NAMED else example_of(each)
            for each in arguments
            if each.required or default_text(each) != "nothing"  # which is written by leaving it out
        }
        if not leaf.open_ended:
            text = mission(f"- {json.dumps({leaf.tag: given_values})}")
            assert accepted(text), text
            assert complaints(text) == []


class Blink(Leaf):
    """Blink.

    Succeeds at once.
    """

    tag = "blink"
    span: tuple[float, float] = argument("share", "how bright", span=True)
    times: int = argument("count", "how often", default=2, low=1, high=9)
    loud: bool = argument("flag", "with a click", default=False)
    scale: float = argument("number", "how fast", default=1.0, high=2.0)
    longest: float = argument("number", "how long at most", default=float("inf"))
    what: object = argument("value", "anything", default=Status.SUCCESS)


def test_own_leaf_is_in_the_schema_by_its_declaration() -> None:
    schema = mission_schema({**LEAVES, "blink": Blink}, shipped_things())
    validator = jsonschema.Draft7Validator(json.loads(json.dumps(schema, allow_nan=False)))

    def good(value: object) -> bool:
        return bool(validator.is_valid({"mission": "m", "tree": {"blink": value}}))

    assert good({"span": ["0 %", "50 %"], "times": 3, "loud": True, "scale": -1})
    assert good({"span": ["0 %", "50 %"], "times": "${n}", "loud": "${quiet}"})
    assert not good({"times": 3})
    assert not good({"span": ["0 %", "50 %"], "times": 10})
    assert not good({"span": ["0 %", "50 %"], "loud": "no"})
    assert not good({"span": ["0 %", "50 %"], "scale": 3})
    assert not good("50 %")
    assert not validator.is_valid({"mission": "m", "tree": "blink"})


def test_bounds_and_defaults_are_shown_in_mission_syntax() -> None:
    assert [bounds_text(each) for each in list(Blink.arguments.values())[:4]] == ["", "1 to 9", "", "at most 2"]
    assert [default_text(each) for each in list(Blink.arguments.values())[1:3]] == ["2", "false"]
    assert default_text(LEAVES["find_face"].arguments["pan"]) == "[-60 deg, 60 deg]"
    assert bounds_text(LEAVES["wait"].arguments["duration"]) == "at least 0 s"


# The commands


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: command(capsys, *arguments)


def test_schema_command_prints_the_schema_or_writes_a_file(run: Callable[..., Outcome]) -> None:
    printed = run("schema")
    assert printed.code == 0
    assert json.loads(printed.out) == SCHEMA
    assert run("schema", "-o", "mission.schema.json").code == 0
    assert Path("mission.schema.json").read_text(encoding="utf-8") == printed.out


def test_the_command_takes_behaviours_of_ones_own(run: Callable[..., Outcome]) -> None:
    Path("blink.py").write_text(
        "from behaviours.leaf import Leaf\n\n\nclass Blink(Leaf):\n    'Blink.'\n\n    tag = 'blink'\n",
        encoding="utf-8",
    )
    outcome = run("schema", "--behaviours", "blink.py")
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out)["definitions"]["behaviours"]["blink"]["description"] == "Blink."


def test_unwritable_schema_file_is_a_usage_error(run: Callable[..., Outcome]) -> None:
    outcome = run("schema", "-o", "no/such/folder/s.json")
    assert outcome.code == 2
    assert "there is no folder" in outcome.err


def test_check_json_has_every_mistake_with_its_place(run: Callable[..., Outcome]) -> None:
    Path("bad.yaml").write_text("mission: m\ntree:\n  sequence:\n    - trak_face\n    - wait: 3\n", encoding="utf-8")
    outcome = run("check", "--json", "bad.yaml", "greet")
    assert outcome.code == 2
    assert outcome.err == ""
    assert json.loads(outcome.out) == [
        {
            "file": "bad.yaml",
            "line": 4,
            "column": 7,
            "length": 9,
            "message": "unknown behaviour 'trak_face'",
            "suggestion": "did you mean 'track_face'?",
            "severity": "error",
        },
        {
            "file": "bad.yaml",
            "line": 5,
            "column": 13,
            "length": 1,
            "message": "'wait' needs a duration such as '2 s': '3' has no unit (units: s, ms, min, h)",
            "suggestion": "",
            "severity": "error",
        },
    ]


def test_check_json_of_valid_missions_is_empty(run: Callable[..., Outcome]) -> None:
    outcome = run("check", "--json")
    assert (outcome.code, json.loads(outcome.out)) == (0, [])


CONFUSABLE = """mission: ask
tree:
  sequence:
    - listen: {for: [go, "yes", hello robot], timeout: 3 s}
    - listen: {for: ["No!", hello, GO], timeout: 3 s}
"""


def test_check_hints_at_easily_confused_phrases(run: Callable[..., Outcome]) -> None:
    pytest.importorskip("pocketsphinx")
    Path("ask.yaml").write_text(CONFUSABLE, encoding="utf-8")
    outcome = run("check", "ask.yaml")
    assert (outcome.code, outcome.out) == (0, "ask.yaml: good (ask, 3 nodes)\n")
    first, *_, last = outcome.err.splitlines()
    assert first == "hint: ask.yaml:5:7: 'No!' is easily confused with 'go' (line 4)"
    assert last == "  try another or a longer phrase (docs/speech.md)"
    (hint,) = json.loads(run("check", "--json", "ask.yaml").out)
    assert (hint["line"], hint["severity"]) == (5, "hint")


def test_check_gives_no_confusion_hints_for_other_recognisers(
    run: Callable[..., Outcome],
) -> None:
    Path("ask.yaml").write_text(CONFUSABLE, encoding="utf-8")
    for ears in ("recogniser: vosk, model: m", "pronunciations: {go: K AE T}"):
        Path("r.yaml").write_text(f"robot: r\nmicrophone: {{{ears}}}\n", encoding="utf-8")
        assert run("check", "ask.yaml", "--robot", "r.yaml") == Outcome(0, "ask.yaml: good (ask, 3 nodes)\n", "")
