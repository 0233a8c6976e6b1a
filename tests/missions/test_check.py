"""The checker: every class of mistake, at its place, in words that say what to write."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from behaviours.catalogue import LEAVES
from behaviours.robot import Robot
from config.diagnostics import MAX_DIAGNOSTICS, InvalidFileError, SourceText
from drivers.clock import ManualClock
from missions.executive.build import NODES as NODE_CLASSES
from missions.executive.state import state_of
from missions.language.check_context import FAILURE_HINT, MAX_DEPTH
from missions.language.document import check_plan, load_plan
from missions.language.expressions import Value
from missions.language.kinds import STATE_KINDS
from missions.language.nodes import COMPOSITES, MODIFIERS, NODES
from missions.language.plan import Plan, Step
from missions.language.steps import LIST_HINT
from missions.library.lookups import LOOKUPS
from missions.library.shipped import load_mission
from perception.api import Thing

GREET = (Path(__file__).parents[2] / "missions" / "greet.yaml").read_text(encoding="utf-8")

KNOWN = {kind: cache(find) for kind, find in LOOKUPS.items()}
"""Gestures and controllers, each read once for all these tests."""

Mistake = tuple[int, str, str, str]
"""Its line, what the carets are under, the message and the suggestion."""


def check(text: str, params: Mapping[str, str] | None = None) -> Plan:
    return check_plan(SourceText("m.yaml", text), LEAVES, KNOWN, params=params)


def mistakes(text: str, params: Mapping[str, str] | None = None) -> list[Mistake]:
    with pytest.raises(InvalidFileError) as caught:
        check(text, params)
    found = []
    for fault in caught.value.diagnostics:
        begin = fault.mark.column - 1
        under = fault.source.line(fault.mark.line)[begin : begin + fault.mark.length]
        found.append((fault.mark.line, under, fault.message, fault.suggestion))
    return found


def steps(*lines: str) -> str:
    """A mission whose tree is a sequence of these lines; the first is line 5."""
    return "mission: m\nparams: {n: 2, x: 1.5, patience: 60 s}\ntree:\n  sequence:\n" + "".join(
        f"    {line}\n" for line in lines
    )


def only(*lines: str) -> Step:
    """The one step of a mission that is right."""
    (step,) = check(steps(*lines)).tree.children
    return step


def value_of(step: Step, name: str) -> object:
    value = step.arguments[name]
    assert value.template is None
    return value.constant


# What is right


def test_variable_that_finally_certainly_sets_can_be_read_after_it() -> None:
    check(steps("- find_face:", "  finally: {set: {far: 1}}", "- log: ${far}"))


def test_a_whole_mission_becomes_a_plan() -> None:
    plan = check(GREET)
    assert (plan.mission, plan.params["greeting"]) == ("greet", "Hello!")
    assert [step.kind for step in plan.tree.walk()] == [
        "sequence",
        "timeout",
        "find_face",
        "race",
        "track_face",
        "hold",
        "face_centred",
        "timeout",
        "parallel",
        "selector",
        "race",
        "track_face",
        "gesture",
        "nod",
        "say",
    ]
    assert plan.tree.claims == {"head", "base", "arm", "voice"}
    assert plan.tree.needs == {"camera", "head", "arm", "voice"}
    named = [step for step in plan.tree.walk() if step.name == "greet the person"]  # and what wraps it
    assert [(step.kind, step.mark.line) for step in named] == [("timeout", 27), ("parallel", 19)]


@pytest.mark.parametrize("form", ["- say: Hi", "- say: {text: Hi}", "- {say: Hi}", "- {say: {text: 'Hi'}}"])
def test_leaf_argument_may_be_named_or_not(form: str) -> None:
    assert value_of(only(form), "text") == "Hi"


@pytest.mark.parametrize("form", ["- face_seen", "- face_seen:", "- face_seen: {}", "- {face_seen: null}"])
def test_leaf_without_arguments_has_defaults(form: str) -> None:
    assert only(form).arguments == {}


def test_modifiers_wrap_from_the_first_inwards_to_the_last_outwards() -> None:
    step = only("- wait: 1 s", "  timeout: 20 s", "  name: pause", "  retry: forever")
    inner, leaf = step.children[0], step.children[0].children[0]
    assert [each.kind for each in (step, inner, leaf)] == ["retry", "timeout", "wait"]
    assert [each.name for each in (step, inner, leaf)] == ["pause"] * 3
    assert [each.mark.line for each in (step, inner, leaf)] == [8, 6, 5]
    assert (value_of(step, "value"), value_of(inner, "value")) == (None, 20.0)


def test_expressions_over_params_are_known_at_once_and_the_rest_waits() -> None:
    known = only("- wait: ${patience / 2}", "  if: n > 1")
    assert value_of(known, "value") is True
    assert value_of(known.children[0], "duration") == 30.0
    waiting = only("- say: It is ${battery.percent} %", "  while: ${battery.percent > 20}")
    for value in (waiting.arguments["value"], waiting.children[0].arguments["text"]):
        assert isinstance(value, Value)
        assert value.template is not None


def test_unset_variable_is_reported_also_in_the_first_round_of_a_loop() -> None:
    lines = ("- say: ${visitor.id} ${count}", "- find_face:", "  as: visitor", "- set: {count: 1}")
    with pytest.raises(InvalidFileError) as caught:
        check(steps(*lines))
    assert [fault.message for fault in caught.value.diagnostics] == [
        "'visitor' is read here, but nothing before this sets it",
        "'count' is read here, but nothing before this sets it",
    ]
    with pytest.raises(InvalidFileError) as caught:
        check(steps(*lines) + "  repeat: 2\n")
    assert [fault.message for fault in caught.value.diagnostics] == [
        "'count' is read here, but it is set only after this",
        "'visitor' is read here, but it is set only after this",
    ]
    assert check(steps(lines[0], "  on_failure: succeed", *lines[1:]) + "  repeat: 2\n").tree.kind == "repeat"


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("007", "007"),
        ("1_000", "1_000"),
        ("1.50", "1.50"),
        ("true", "true"),
        ("30 deg", "30 deg"),
        ("''", ""),
        ("12:30",) * 2,
    ],
)
def test_text_is_spoken_as_written(written: str, said: str) -> None:
    assert value_of(only(f"- say: {written}"), "text") == said


@pytest.mark.parametrize(
    ("written", "stored"),
    [
        ("1", 1),
        ("1.5", 1.5),
        ("90 deg", pytest.approx(1.5708, abs=1e-4)),
        ("'90 deg'", "90 deg"),
        ("true", True),
        ("null", None),
        ("[1, 2 m, {a: b}]", [1, 2.0, {"a": "b"}]),
        ("${n + 1}", 3),
    ],
)
def test_a_variable_takes_anything(written: str, stored: object) -> None:
    assert (
        value_of(only(f"- set: {{it: {written}}}" if "$" not in written else f"- set: {{it: '{written}'}}"), "it")
        == stored
    )


@pytest.mark.parametrize("count", ["3", "3.0", "${n + 1}", "${6 / n}"])
def test_count_is_converted_to_int(count: str) -> None:
    found = value_of(only("- wait: 1 s", f"  repeat: {count}"), "value")
    assert (found, type(found)) == (3, int)


def test_checker_and_executive_have_the_same_nodes_and_state() -> None:
    assert NODES.keys() == NODE_CLASSES.keys()
    state = state_of(Robot(None, None, None, None, None), ManualClock())
    assert state.keys() == STATE_KINDS.keys()
    for name, members in STATE_KINDS.items():
        assert {*members} == {*vars(state[name])["_values"]}


# What is wrong

NAMES = "known are: n, patience, x, base, battery, face, head, range"
WITHOUT_DASH = "write it below the behaviour that it is for, without a dash"
INDENT = "indent it, to stand beside the behaviour above"
TWICE = "to do both, write a 'sequence' with '- say: ...' on each line"
ANGLE = "'turn' needs an angle such as '30 deg'"
UNITS = "(units: deg, rad)"


@pytest.mark.parametrize(
    ("lines", "under", "message", "suggestion"),
    [
        # words
        (["- trak_face"], "trak_face", "unknown behaviour 'trak_face'", "did you mean 'track_face'?"),
        (["- sya: Hello"], "sya", "unknown behaviour 'sya'", "did you mean 'say'?"),
        (["- wiat: 3 s"], "wiat", "unknown behaviour 'wiat'", "did you mean 'wait'?"),
        (["- Say: Hello"], "Say", "unknown behaviour 'Say'", "did you mean 'say'?"),
        (["- xyzzy: 3"], "xyzzy", "unknown behaviour 'xyzzy'", LIST_HINT),
        (["- say Hello"], "say Hello", "unknown behaviour 'say Hello'", "write 'say: Hello', with a colon and a space"),
        (["- say:Hello"], "say:Hello", "unknown behaviour 'say:Hello'", "write 'say: Hello', with a colon and a space"),
        (["- say: Hi", "  tiemout: 3 s"], "tiemout", "unknown modifier 'tiemout'", "did you mean 'timeout'?"),
        (["- say: Hi", "  xyzzy: 3 s"], "xyzzy", "unknown modifier 'xyzzy'", LIST_HINT),
        # the form of a node
        (["- timeout: 3 s"], "t", "no behaviour here, only keys that stand beside one", WITHOUT_DASH),
        (
            ["- delay: 3 s"],
            "d",
            "no behaviour here, only keys that stand beside one",
            "write 'wait' for a step that waits",
        ),
        (["- {}"], "{", "a behaviour is missing here", ""),
        (["-"], "", "a behaviour is missing here", ""),
        (["- [say: Hi]"], "[", "a list needs a composite before it", "write 'sequence:' or 'parallel:' above it"),
        (
            ["- say: Hi", "  drive: 1 m"],
            "drive",
            "a second behaviour, 'drive', beside 'say'",
            "begin it with '- ' in a sequence, or indent it",
        ),
        (["- say: Hi", "  say: Ho"], "say", "'say' is a duplicate key (first at line 5)", TWICE),
        (
            ["- sequence: []"],
            "sequence",
            "'sequence' needs a list of at least one behaviour, each on a line with '- '",
            "",
        ),
        (["- race:"], "race", "'race' needs a list of at least one behaviour, each on a line with '- '", ""),
        (["- parallel"], "parallel", "'parallel' needs a list of at least one behaviour, each on a line with '- '", ""),
        (
            ["- selector: {say: Hi}"],
            "selector",
            "'selector' needs a list of at least one behaviour, each on a line with '- '",
            "",
        ),
        # faces
        (
            ["- identify: person"],
            "person",
            "'identify' needs a face stored by 'as', got the text 'person'",
            'store one with as: person, beside find_face, and write "${person}"',
        ),
        (
            ["- find_face:", "  as: person", "- identify: person"],
            "person",
            "'identify' needs a face stored by 'as', got the text 'person'",
            'write "${person}"',
        ),
        (
            ["- find_face:", "  as: person", "- face_centred: {face: perso}"],
            "perso",
            "'face_centred': 'face' needs a face stored by 'as', got the text 'perso'",
            'write "${person}"',
        ),
        (
            ["- find_object: red ball", "  as: ball", "- track_face: {face: '${ball}'}"],
            "'${ball}'",
            "'track_face': 'face' needs a face stored by 'as', got the result of 'find_object'",
            'store one with as: person, beside find_face, and write "${person}"',
        ),
        (["- identify: ${n}"], "${n}", "'identify' needs a face stored by 'as', got 2", ""),
        # what a variable holds
        (
            ["- find_face:", "  as: p", '- say: "So ${p.nam}"'],
            "p.nam",
            "'say': a face has no 'nam'",
            "did you mean 'name'?",
        ),
        (
            ["- say: x", "  if: b.mood == 3", "- find_object: red ball", "  as: b"],
            "b.mood",
            "'if': an object has no 'mood'",
            f"known are: {', '.join(sorted(Thing.__dataclass_fields__))}",
        ),
        (["- say: '${q.name}'"], "q.name", "'say': unknown name 'q.name'", NAMES),
        (["- say: '${patienc.x}'"], "patienc.x", "'say': unknown name 'patienc.x'", "did you mean 'patience.x'?"),
        (
            ["- say: x", "  if: n == yes"],
            "yes",
            "'if': unknown name 'yes'",
            "write 'true', or 'yes' in quotes for the text",
        ),
        (
            ["- say: x", "  if: n in [1, yes]"],
            "yes",
            "'if': unknown name 'yes'",
            "write 'true', or 'yes' in quotes for the text",
        ),
        (["- say: x", "  if: yes < 3"], "yes", "'if': unknown name 'yes'", "write 'true'"),
        (
            ["- face:"],
            "face",
            "'face' needs 'mood': mood of the face, one of neutral, happy, sad, surprised, asleep, listening, speaking",
            "",
        ),
        (["- dance"], "dance", "unknown behaviour 'dance'", LIST_HINT),
        # values that are no conditions
        (
            ["- say: a", "  until: 5 s"],
            "5 s",
            "'until' needs a condition that is true or false, got a duration",
            "for a time, write 'for', 'timeout' or 'wait'",
        ),
        (
            ["- check: battery.percent"],
            "battery.percent",
            "'check' needs a condition that is true or false, got a percent",
            "compare it, as in: battery.percent > 20",
        ),
        # conditions without an expression, and what can never be waited for
        (["- check:"], "check", "'check' needs 'condition': an expression that is true or false", ""),
        (["- check: [n]"], "[", "'check' needs one value, not a list", ""),
        (
            ["- wait_for:"],
            "wait_for",
            "'wait_for' needs a behaviour to tick until it succeeds",
            "write wait_for: face_seen",
        ),
        (
            ["- wait_for: {wait: 1 s}"],
            "wait_for",
            "'wait_for' has no effect here: 'wait' never fails",
            "",
        ),
        (["- wait_for: track_face"], "wait_for", "'wait_for' is never over: 'track_face' never succeeds", ""),
        (
            ["- wait_for: battery.low"],
            "battery.low",
            "'wait_for' needs a behaviour, got 'battery.low'",
            "write wait_until: battery.low",
        ),
        (["- wait_for: 5 s"], "5 s", "'wait_for' needs a behaviour, got '5 s'", "write wait: 5 s"),
        (
            ["- check: {face_seen: 1 s}"],
            "face_seen",
            "'face_seen' is a condition already",
            "write - face_seen: 1 s",
        ),
        (
            ["- wait_until: {face_seen: 1 s}"],
            "face_seen",
            "'face_seen' is a condition already",
            "write - wait_for: {face_seen: 1 s}",
        ),
        # values in flow style that YAML splits at a comma
        (
            ["- switch: {on: min(n, 2), cases: {0: succeed, 1: succeed, 2: succeed}}"],
            "min(n",
            "'min(n, 2)' is split at its comma in {...} or [...]",
            'put quotes around it: "min(n, 2)"',
        ),
        (
            ["- sequence: [check: max(1, 2, 3) == n, succeed]"],
            "max(1",
            "'max(1, 2, 3) == n' is split at its comma in {...} or [...]",
            'put quotes around it: "max(1, 2, 3) == n"',
        ),
        (
            ["- {log: hall, shelf 1 or office, name: where}"],
            "hall",
            "'hall, shelf 1 or office' is split at its comma in {...} or [...]",
            'put quotes around it: "hall, shelf 1 or office"',
        ),
        # what stands beside
        (
            ["- wait_for: face_seen", "  as: it"],
            "it",
            "'wait_for' has no result that 'as' could store",
            "put 'as' inside, such as wait_for: {face_seen: , as: it}",
        ),
        (["- sequence: [succeed]", "  as: it"], "it", "'sequence' has no result that 'as' could store", INDENT),
        (["- say: Hi", "  as: it"], "it", "'say' has no result that 'as' could store", ""),
        (["- find_face:", "  as: my face"], "my face", "'as' needs a plain word, got 'my face'", "such as 'last_seen'"),
        (
            ["- find_face:", "  as: face"],
            "face",
            "'as' cannot be 'face', which is reserved in expressions",
            "",
        ),
        (["- find_face:", "  as:"], "", "'as' needs a word", ""),
        (["- find_face:", "  as: [a]"], "[", "'as' needs a word", ""),
        (["- wait: 1 s", "  name:"], "", "'name' needs a text", ""),
        # arguments
        (["- drive"], "drive", "'drive' needs 'distance': distance; negative is backwards", ""),
        (["- drive: {distance: 1 m, sped: 1 m/s}"], "sped", "'drive' has no argument 'sped'", "did you mean 'speed'?"),
        (["- drive: [1 m]"], "[", "'drive' needs one value, not a list", ""),
        (["- drive: {distance: {a: b}}"], "{", "'drive': 'distance' needs one value, not a mapping", ""),
        (["- succeed: 3"], "3", "'succeed' takes no argument", ""),
        (["- succeed: {a: 1}"], "a", "'succeed' has no argument 'a'", ""),
        (
            ["- find_face: [-9 deg, 9 deg]"],
            "[",
            "'find_face' needs its arguments by name",
            f"write find_face: {{pan: ...}}; it has {', '.join(LEAVES['find_face'].arguments)}",
        ),
        (["- set: 3"], "set", "'set' needs names and values", "write set: {count: 1}"),
        (["- set: {}"], "set", "'set' needs names and values", "write set: {count: 1}"),
        (["- set: {a b: 1}"], "a b", "a variable needs a plain word, got 'a b'", "such as 'last_seen'"),
        (["- set: {true: 1}"], "true", "a variable cannot be 'true', which is reserved in expressions", ""),
        (
            ["- set: {b: ['${m}']}"],
            "m",
            "'b': unknown name 'm'",
            "known are: b, n, patience, x, base, battery, face, head, range",
        ),
        # quantities
        (["- turn: 90"], "90", f"{ANGLE}: '90' has no unit {UNITS}", ""),
        (["- turn: 1.5"], "1.5", f"{ANGLE}: '1.5' has no unit {UNITS}", ""),
        (["- turn: '1.5'"], "'1.5'", f"{ANGLE}: '1.5' has no unit {UNITS}", ""),
        (["- turn: ${x}"], "x", f"{ANGLE}, got a number", "param 'x' (line 2): write '1.5 deg'"),
        (["- turn: n"], "n", f"{ANGLE}, got 'n'", "did you mean ${n}?"),
        (["- nod:", "  timeout: {patience}"], "{", "'timeout' needs a duration", "write ${patience} for its value"),
        (
            ["- nod:", "  repeat: 4 times"],
            "4 times",
            "'repeat' needs a count of 1 or more, or forever, got '4 times': write 4",
            "",
        ),
        (["- turn: ${n * 30.0}"], "n * 30.0", f"{ANGLE}, got a number", "multiply it by 1 deg or 1 rad"),
        (["- turn: ${patience}"], "patience", f"{ANGLE}, got a duration", ""),
        (["- turn: 30°"], "30°", f"{ANGLE}: unknown unit '°' (write '30 deg')", ""),
        (["- turn: 3 m"], "3 m", f"{ANGLE}, got a length: '3 m'", ""),
        (["- turn: left"], "left", f"{ANGLE}, got 'left'", ""),
        (["- turn: $side"], "$side", f"{ANGLE}, got '$side'", "write ${side} for its value"),
        (["- turn: '{side}'"], "'{side}'", f"{ANGLE}, got '{{side}}'", "write ${side} for its value"),
        (["- turn: '{{ side }}'"], "'{{ side }}'", f"{ANGLE}, got '{{{{ side }}}}'", "write ${side} for its value"),
        (["- turn: {angle: }"], "}", "'turn': 'angle' needs an angle such as '30 deg', got nothing", ""),
        (
            ["- drive: {distance: 1 m, speed: 3 m/s}"],
            "3 m/s",
            "'drive': 'speed' must be between 0.01 m/s and 0.7 m/s",
            "",
        ),
        (["- wait: -1 s"], "-1 s", "'wait' must be at least 0 s", ""),
        (["- wait: 1e999 s"], "1e999 s", "'wait' needs a duration such as '2 s': '1e999 s' is too large", ""),
        (
            ["- find_face: {pan: 60 deg}"],
            "60 deg",
            "'find_face': 'pan' needs two values, such as [0 deg, 30 deg]",
            "",
        ),
        (
            ["- find_face: {pan: [9 deg, 9 deg]}"],
            "[",
            "'find_face': 'pan': the first value must be below the second",
            "",
        ),
        (["- find_face: {pan: [[1 deg], 9 deg]}"], "[", "'find_face': 'pan' needs one value, not a list", ""),
        (
            ["- find_face: {pan: [1, 9 deg]}"],
            "1",
            "'find_face': 'pan' needs an angle such as '30 deg': '1' has no unit (units: deg, rad)",
            "",
        ),
        (
            ["- find_face: {pan: ['${head.pan}', 90 deg]}"],
            "[",
            "'find_face': 'pan': the two values must be known before the mission starts: numbers or params",
            "",
        ),
        # other kinds
        (["- find_face: {scans: 2.5}"], "2.5", "'find_face': 'scans' needs a whole number, got '2.5'", ""),
        (["- gesture: {gesture: hello, speed: fast}"], "fast", "'gesture': 'speed' needs a number, got 'fast'", ""),
        (
            ["- gesture: {gesture: hello, speed: '${patience}'}"],
            "patience",
            "'gesture': 'speed' needs a number, got a duration",
            "divide it by 1 s",
        ),
        (["- gesture: {gesture: hello, speed: 9}"], "9", "'gesture': 'speed' must be between 0.1 and 2", ""),
        (["- gesture: helo"], "helo", "'gesture' needs a gesture: unknown gesture 'helo'; did you mean 'hello'?", ""),
        (
            ["- track_face: fce"],
            "fce",
            "'track_face' needs a controller: unknown controller 'fce'; did you mean 'face'?",
            "",
        ),
        (["- say: {text: }"], "}", "'say': 'text' needs a text, got nothing", ""),
        (["- say: ['Hi']"], "[", "'say' needs one value, not a list", ""),
        (["- pretend: [runing]"], "[", "'pretend' takes a list of running, success and failure, got 'runing'", ""),
        (["- pretend: [[a]]"], "[", "'pretend' takes a list of running, success and failure, got a list", ""),
        (["- pretend: []"], "[", "'pretend' needs at least one of running, success and failure", ""),
        # modifiers
        (["- wait: 1 s", "  timeout: 0 s"], "0 s", "'timeout' must be longer than 0 s", ""),
        (
            ["- wait: 1 s", "  hold: 2"],
            "2",
            "'hold' needs a duration such as '2 s': '2' has no unit (units: s, ms, min, h)",
            "",
        ),
        (
            ["- wait: 1 s", "  delay: 1.5"],
            "1.5",
            "'delay' needs a duration such as '2 s': '1.5' has no unit (units: s, ms, min, h)",
            "",
        ),
        (["- wait: 1 s", "  cooldown: [1 s]"], "[", "'cooldown' needs a duration", ""),
        (["- wait: 1 s", "  retry: 0"], "0", "'retry' needs a count of 1 or more, or forever, got '0'", ""),
        (["- wait: 1 s", "  retry: 2.5"], "2.5", "'retry' needs a count of 1 or more, or forever, got '2.5'", ""),
        (["- wait: 1 s", "  repeat: true"], "true", "'repeat' needs a count of 1 or more, or forever, got 'true'", ""),
        (
            ["- wait: 1 s", "  repeat: 1e999"],
            "1e999",
            "'repeat' needs a count of 1 or more, or forever, got '1e999'",
            "",
        ),
        (
            ["- wait: 1 s", "  repeat: ${patience}"],
            "patience",
            "'repeat' needs a number, got a duration",
            "divide it by 1 s",
        ),
        (["- wait: 1 s", "  repeat:"], "", "'repeat' needs a count of 1 or more, or forever, got nothing", ""),
        (["- wait: 1 s", "  invert: 1"], "1", "'invert' takes only true, got '1'", ""),
        (["- wait: 1 s", "  once: yes"], "yes", "'once' takes only true or an expression, got 'yes'", ""),
        (["- wait: 1 s", "  on_failure: fail"], "fail", "'on_failure' takes only succeed, got 'fail'", ""),
        (["- wait: 1 s", "  on_success: true"], "true", "'on_success' takes only fail, got 'true'", ""),
        # recovery and cleanup
        (
            ["- find_face:", "  as: who", "  finally: {log: '${who.name}'}"],
            "log",
            "'who' is read here, but it is not set where 'find_face' (line 5) is halted",
            "set it before, such as set: {who: null}, and test it here with if: who != null",
        ),
        (
            ["- find_face:", "  finally: {sequence: [{set: {far: 1}}, {log: a}]}", "- say: ${far}"],
            "say",
            "'far' is read here, but it is not set where 'finally' (line 6) does not succeed",
            "set it before, such as set: {far: null}, and test it here with if: far != null",
        ),
        (
            ["- find_face:", "  as: who", "  retry: 2", "  recover: {log: '${who.name}'}"],
            "log",
            "'who' is read here, but it is not set where 'find_face' (line 5) fails",
            "set it before, such as set: {who: null}, and test it here with if: who != null",
        ),
        (
            ["- selector: [{fail: no}, {drive: '${failure}'}]"],
            "failure",
            "'drive' needs a length such as '0.5 m', got a text",
            "",
        ),
        (
            ["- fail: no", "- log: ${last_error}"],
            "last_error",
            "'log': unknown name 'last_error'",
            f"'failure' is the reason of the last failure: {FAILURE_HINT}",
        ),
        # expressions
        (["- wait: 1 s", "  if:"], "", "'if': an empty expression", ""),
        (["- wait: 1 s", "  if: m > 1"], "m", "'if': unknown name 'm'", NAMES),
        (
            ["- wait: 1 s", "  if: n > 1 and  patiense > 3"],
            "patiense",
            "'if': unknown name 'patiense'",
            "did you mean 'patience'?",
        ),
        (
            ["- wait: 1 s", "  while: face.sen"],
            "face.sen",
            "'while': unknown name 'face.sen'",
            "did you mean 'face.seen'?",
        ),
        (
            ["- wait: 1 s", "  until: head"],
            "head",
            "'until': unknown name 'head'",
            "add a member; known are: head.pan, head.tilt",
        ),
        (["- wait: 1 s", "  if: n = 2"], "=", "'if': 'n = 2' is not an expression; compare with '=='", ""),
        (
            ["- wait: 1 s", "  if: ${ open(n) }"],
            "open",
            "'if': 'open' cannot be called; the functions are min, max, abs, round, len, random",
            "",
        ),
        (["- wait: 1 s", '  if: "face.__class__"'], "face.__class__", "'if': '__class__' is private", ""),
        (
            ["- wait: 1 s", "  if: n > 'a'"],
            "n > 'a'",
            "'if': cannot compare a number and a text",
            "a text stands in quotes, a number does not",
        ),
        (["- wait: 1 s", "  if: n / 0"], "n / 0", "'if': 'n / 0' divides by zero", ""),
        (["- say: a ${m} n"], "m", "'say': unknown name 'm'", NAMES),
        (["- say: mist ${n} ${ mist }"], "mist", "'say': unknown name 'mist'", NAMES),
        (
            ['- say: "é ${batery.percent}"'],
            "batery.percent",
            "'say': unknown name 'batery.percent'",
            "did you mean 'battery.percent'?",
        ),
        (["- say: it's ${n"], "${", "'say': '${' has no '}'", ""),
        (["- say: ${n's}"], "${", "'say': '${' holds a quote that is not closed", ""),
        (["- say: ${n.x}"], "${n.x}", "'say': 'x' is not there", ""),
        # a text that the file writes in another way than it reads is underlined as a whole
        (['- say: "\\u0041 ${m}"'], '"\\u0041 ${m}"', "'say': unknown name 'm'", NAMES),
        (["- say: 'it''s ${m}'"], "'it''s ${m}'", "'say': unknown name 'm'", NAMES),
        (["- say: |", "    so ${m}"], "|", "'say': unknown name 'm'", NAMES),
    ],
)
def test_mistake_is_reported_at_its_word(lines: list[str], under: str, message: str, suggestion: str) -> None:
    ((line, found, said, hint),) = mistakes(steps(*lines))
    assert (found, said, hint) == (under, message, suggestion)
    assert 5 <= line < 5 + len(lines)


@pytest.mark.parametrize(
    "lines",
    [
        ["- find_face:", "  as: p", "- say: '${p.name} ${p.distance} ${p.bearing}'", "- identify: ${p}"],
        ["- find_face:", "  as: p", "- set: {p: {nam: 3}}", "- say: '${p.nam}'"],
        ["- find_face:", "  as: p", "- find_object: red ball", "  as: p", "- say: '${p.colour}'"],
        ["- identify:", "- face_centred: {face: null}"],
        ["- selector:", "    - say: a", "    - say: b", "      if: n > 1"],
        ["- selector:", "    - say: a", "      if: n > 1", "      on_success: fail", "    - say: b"],
        ["- selector:", "    - say: a", "      if: n > 1", "      invert: true", "    - say: b"],
    ],
)
def test_valid_steps_pass_the_check(lines: list[str]) -> None:
    assert check(steps(*lines)).mission == "m"


@pytest.mark.parametrize(
    ("default", "use", "hint"),
    [
        ("30", "drive", "write '30 cm' or '30 m'"),
        ("0,3 m", "drive", "write '0.3 m'"),
        ("\u201c30 cm\u201d", "drive", "write '30 cm'"),
        ("far", "drive", "write a value such as '0.5 m'"),
        ("5", "wait", "write '5 s' or '5 min'"),
        ("helo", "gesture", "write 'hello'"),
    ],
)
def test_unsuitable_param_is_named_with_its_line_and_value_to_write(default: str, use: str, hint: str) -> None:
    text = f"mission: m\nparams:\n  step: {default}\ntree:\n  {use}: ${{step}}\n"
    assert [each[-1] for each in mistakes(text)] == [f"param 'step' (line 3): {hint}"]


def test_variable_that_a_submission_may_set_has_any_type(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text(
        "mission: inner\ntree:\n  find_object: red ball\n  as: b\nreturns: {p: b}\n", encoding="utf-8"
    )
    (tmp_path / "m.yaml").write_text(
        "mission: m\ntree:\n  sequence:\n    - find_face:\n      as: p\n    - mission: inner.yaml\n"
        "    - say: '${p.colour}'\n",
        encoding="utf-8",
    )
    assert load_mission(str(tmp_path / "m.yaml")).mission == "m"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("- a\n", [(1, "-", "a mission begins with keys", "write 'mission: NAME', then 'tree:'")]),
        ("just text", [(1, "just text", "a mission begins with keys", "write 'mission: NAME', then 'tree:'")]),
        ("", [(1, "", "the file is empty", "write 'mission: NAME', then 'tree:'")]),
        ("tree: succeed", [(1, "t", "the mission needs 'mission: ...'", "")]),
        ("mission: m", [(1, "m", "the mission needs 'tree:' with its first behaviour under it", "")]),
        ("mission: m\ntree:\n", [(2, "", "a behaviour is missing here", "")]),
        ("mission:\ntree: succeed", [(1, "", "'mission' needs a text", "")]),
        ("mission: m\nsummary: [a]\ntree: succeed", [(2, "[", "'summary' needs a text", "")]),
        (
            "mission: m\nif_interrupted: give up\ntree: succeed",
            [(2, "give up", "'if_interrupted' cannot be 'give up'", "did you mean 'give_up'?")],
        ),
        ("mission: m\ntre: succeed\ntree: succeed", [(2, "tre", "a mission has no key 'tre'", "did you mean 'tree'?")]),
        (
            "mission: m\ntree:\n  - say: Hi\n",
            [(3, "-", "a list needs a composite before it", "write 'sequence:' or 'parallel:' above it")],
        ),
        ("mission: m\ntree:\n\t- say: Hi\n", [(3, "\t", "a tab in the indentation", "indent with spaces")]),
        ("mission: m\ntree:\n  say: \0\n", [(3, "\0", "a character that YAML does not allow: U+0000", "")]),
    ],
)
def test_a_mission_needs_a_name_and_a_tree(text: str, expected: list[Mistake]) -> None:
    assert mistakes(text) == expected


def test_all_mistakes_come_at_once_in_the_order_of_the_file() -> None:
    text = steps(
        "- say: ${nobody}",
        "- sequnce:",
        "    - turn: 90",
        "    - say: {txt: Hi}",
        "  timeout: 0 s",
        "- drive: 1 m",
        "  drive: 2 m",
        "  retry: 0",
        "- trak_face",
    )
    assert [(line, under) for line, under, _, _ in mistakes(text)] == [
        (5, "nobody"),
        (6, "sequnce"),
        (7, "90"),
        (8, "say"),
        (8, "txt"),
        (9, "0 s"),
        (11, "drive"),
        (12, "0"),
        (13, "trak_face"),
    ]


def test_mistake_repeated_by_a_yaml_alias_is_reported_once() -> None:
    assert len(mistakes(steps("- &it {turn: 90}", "- *it"))) == 1


def test_number_of_diagnostics_is_limited() -> None:
    assert len(mistakes(steps(*["- nonsense"] * 10_000))) == MAX_DIAGNOSTICS


TOO_DEEP = f"nested too deeply: at most {MAX_DEPTH} steps, modifiers and sub-missions counted"


def test_too_deep_tree_is_refused() -> None:
    beside = "timeout: 1 s, retry: 1, repeat: 1, invert: true, hold: 1 s"
    deep = "{sequence: [" * 20 + "{say: Hi}" + f"], {beside}}}" * 20
    ((line, _, message, _),) = mistakes(steps(f"- {deep}"))
    assert (line, message) == (5, TOO_DEEP)


@pytest.mark.parametrize("within", [1, 20])
def test_too_deep_chain_of_submissions_is_refused(tmp_path: Path, within: int) -> None:
    for place in range(500 // within):
        tree = "{sequence: [" * within + f"{{mission: m{place + 1}.yaml}}" + "]}" * within
        (tmp_path / f"m{place}.yaml").write_text(f"mission: m\ntree: {tree}\n", encoding="utf-8")
    with pytest.raises(InvalidFileError) as caught:
        load_plan(tmp_path / "m0.yaml", LEAVES, {}, find_mission=lambda name, folder: folder / name)
    assert TOO_DEEP in [fault.message for fault in caught.value.diagnostics]


def test_mission_file_with_bom_and_crlf_is_read(tmp_path: Path) -> None:
    file = tmp_path / "wait.yaml"
    file.write_bytes(b"\xef\xbb\xbfmission: wait a moment\r\ntree:\r\n  wait: 1 s\r\n")
    plan = load_plan(file, LEAVES, LOOKUPS)
    assert (plan.mission, plan.tree.kind, plan.source.name) == ("wait a moment", "wait", str(file))


# Whatever a file holds


def checks_or_says_why(text: str) -> None:
    try:
        plan = check(text)
    except InvalidFileError as error:
        for fault in error.diagnostics:
            assert fault.message
            assert str(fault).startswith(fault.place)
    else:
        assert plan.tree.mark.line >= 1


@given(st.text(max_size=100))
@example("mission: m\ntree: ~")
@example("mission: m\ntree: {say: {? [a] : b}}")
def test_no_text_does_more_than_be_refused(text: str) -> None:
    checks_or_says_why(text)


VALUES = st.sampled_from(
    [
        *["", "~", "true", "3", "0", "-1", "1.5", "1e999", "9" * 400, "forever", "succeed", "fail"],
        *["1 s", "30 deg", "1 m", "0 s", "1e999 s", "hello", "face", "'x'", "${n}", "${x}", "'${n'", "${face.id}"],
        *[
            "[]",
            "[1 s]",
            "[1 deg, 2 deg]",
            "[success, failure]",
            "[[1]]",
            "{}",
            "{a: 1}",
            "{text: a, speed: 1}",
            "!x y",
        ],
    ]
)
KEYS = st.sampled_from([*LEAVES, *COMPOSITES, *MODIFIERS, "as", "name", "nonsense", "3", "~"])


@given(st.lists(st.lists(st.tuples(KEYS, VALUES), min_size=1, max_size=4), min_size=1, max_size=4))
def test_random_nodes_are_valid_or_give_diagnostics(nodes: list[list[tuple[str, str]]]) -> None:
    lines = []
    for node in nodes:
        lines += [("- " if place == 0 else "  ") + f"{key}: {value}" for place, (key, value) in enumerate(node)]
    checks_or_says_why(steps(*lines))


LINES = GREET.splitlines()


@given(
    st.lists(
        st.tuples(st.integers(0, len(LINES) - 1), st.sampled_from(["delete", "double", "swap", "indent"])), max_size=4
    )
)
def test_shuffled_mission_is_valid_or_gives_diagnostics(edits: list[tuple[int, str]]) -> None:
    lines = list(LINES)
    for place, edit in edits:
        at = place % len(lines)
        if edit == "delete":
            del lines[at]
        elif edit == "double":
            lines.insert(at, lines[at])
        elif edit == "indent":
            lines[at] = "  " + lines[at]
        else:
            lines[at - 1], lines[at] = lines[at], lines[at - 1]
    checks_or_says_why("\n".join(lines))


@given(
    st.lists(
        st.tuples(st.integers(0, len(GREET)), st.integers(0, 3), st.sampled_from([*" :-[]{}'\"$&*!#\n\t0a\0é", ""])),
        min_size=1,
        max_size=3,
    )
)
def test_mission_with_replaced_characters_is_valid_or_gives_diagnostics(edits: list[tuple[int, int, str]]) -> None:
    text = GREET
    for at, length, instead in edits:
        text = text[:at] + instead + text[at + length :]
    checks_or_says_why(text)
