"""Params: what a mission lets its caller set, and what a caller may set it to."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.catalogue import LEAVES
from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from config.units import Quantity
from missions.language.document import check_plan, unread_param_hints
from missions.language.plan import Plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import load_mission, shipped_missions
from missions.plugins.testing.mission_run import run_mission

MISSION = """\
mission: visit
params:
  greeting: Hello!
  patience: 60 s
  times: 2
  share: 0.5
  loud: false
  label: "30 deg"
  code: '007'
  guest:
tree:
  say: ${greeting}
  timeout: ${patience}
  repeat: ${times}
"""


def check(text: str, params: Mapping[str, str] | None = None, *, complete: bool = False) -> Plan:
    return check_plan(SourceText("visit.yaml", text), LEAVES, LOOKUPS, params=params, complete=complete)


def faults(text: str, params: Mapping[str, str] | None = None) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        check(text, params)
    return list(caught.value.diagnostics)


def the_fault(text: str, params: Mapping[str, str] | None = None) -> Diagnostic:
    (fault,) = faults(text, params)
    return fault


def test_params_have_the_defaults_of_the_file() -> None:
    params = check(MISSION).params
    assert params == {
        "greeting": "Hello!",
        "patience": 60.0,
        "times": 2,
        "share": 0.5,
        "loud": False,
        "label": "30 deg",
        "code": "007",
        "guest": None,
    }
    assert isinstance(params["patience"], Quantity)


@pytest.mark.parametrize("key", ["label", "code"])
def test_quoted_param_stays_a_text(key: str) -> None:
    assert type(check(MISSION).params[key]) is str


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("greeting", "Good morning", "Good morning"),
        ("greeting", "30 deg", "30 deg"),
        ("greeting", "", ""),
        ("greeting", "${battery.percent}", "${battery.percent}"),
        ("patience", "2 min", 120.0),
        ("times", "3", 3),
        ("share", "1", 1),
        ("loud", "true", True),
        ("label", "5", "5"),
        ("guest", "Anna", "Anna"),
        ("guest", "true", True),
        ("guest", "5 m", 5.0),
        ("guest", "0 s", 0.0),
    ],
)
def test_a_callers_value_is_of_the_kind_of_the_default(name: str, text: str, value: object) -> None:
    found = check(MISSION, {name: text}).params[name]
    assert found == value
    assert isinstance(found, str) is isinstance(value, str)
    assert isinstance(found, bool) is isinstance(value, bool)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("patience", "60", "'patience' needs a duration such as '2 s': '60' has no unit (units: s, ms, min, h)"),
        ("patience", "3 m", "'patience' needs a duration such as '2 s', got a length: '3 m'"),
        ("patience", "1e999 s", "'patience' needs a duration such as '2 s': '1e999 s' is too large"),
        ("patience", "", "'patience' needs a duration such as '2 s', got nothing"),
        ("times", "two", "'times' needs a number, got 'two'"),
        ("times", "true", "'times' needs a number, got 'true'"),
        ("times", "3 s", "'times' needs a number, got '3 s'"),
        ("times", "9" * 5000, f"'times' needs a number, got '{'9' * 60}...'"),
        ("share", "inf", "'share' needs a number, got 'inf'"),
        ("loud", "yes", "'loud' needs true or false, got 'yes'"),
        ("loud", "1", "'loud' needs true or false, got '1'"),
    ],
)
def test_param_value_of_a_wrong_type_is_reported_at_the_value(name: str, text: str, message: str) -> None:
    fault = the_fault(MISSION, {name: text})
    assert fault.message == message
    assert fault.place == f"--param {name}:1:{len(name) + 2}"
    assert fault.source.text == f"{name}={text}"


@pytest.mark.parametrize(
    ("text", "name", "hint"),
    [
        (MISSION, "greting", "did you mean 'greeting'?"),
        (MISSION, "xyz", "known are: code, greeting, guest, label, loud, patience, share, times"),
        ("mission: visit\ntree: succeed\n", "xyz", "it has none"),
    ],
)
def test_unknown_param_lists_the_existing_ones(text: str, name: str, hint: str) -> None:
    fault = the_fault(text, {name: "1"})
    assert (fault.message, fault.suggestion) == (f"mission 'visit' has no param '{name}'", hint)


def test_param_value_is_checked_at_its_use() -> None:
    fault = the_fault(MISSION, {"times": "2.5"})
    assert (fault.mark.line, fault.message) == (14, "'repeat' needs a count of 1 or more, or forever, got '2.5'")
    fault = the_fault(MISSION, {"patience": "0 s"})
    assert (fault.mark.line, fault.message) == (13, "'timeout' must be longer than 0 s")


def test_mistakes_in_the_file_and_in_the_callers_values_come_together() -> None:
    found = faults(MISSION + "  hold: 3\n", {"loud": "maybe", "nobody": "1"})
    assert [fault.place for fault in found] == ["--param loud:1:6", "--param nobody:1:1", "visit.yaml:15:9"]


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ("[a]", "'params' needs names and their defaults"),
        ("", "'params' needs names and their defaults"),
        ("{a b: 1}", "a param needs a plain word, got 'a b'"),
        ("{1: 1}", "a param needs a plain word, got '1'"),
        ("{battery: 1}", "a param cannot be 'battery', which is reserved in expressions"),
        ("{if: 1}", "a param cannot be 'if', which is reserved in expressions"),
        ("{max: 1}", "a param cannot be 'max', which is reserved in expressions"),
        ("{none: 1}", "a param cannot be 'none', which is reserved in expressions"),
        ("{a: [[1]]}", "param 'a' needs plain values as its members, or mappings of plain values"),
        ("{a: [1, [2]]}", "param 'a' needs plain values as its members, or mappings of plain values"),
        ("{a: ['${b}']}", "param 'a' cannot have the member '${b}': lists in a file hold plain values"),
        ("{a: []}", "param 'a': an empty list needs 'of'"),
        ("{a: [3 m, 2]}", "param 'a': the members of a list must have one type: '3 m' is a length, '2' a number"),
        ("{a: [3 m, 2 s]}", "param 'a': the members of a list must have one type: '3 m' is a length, '2 s' a duration"),
        ("{a: {type: list}}", "param 'a' needs 'of', the type of its members"),
        ("{a: {type: list, of: list}}", "param 'a': unknown type 'list'"),
        ("{a: {type: choice}}", "param 'a' needs 'choices', a list of words"),
        ("{a: {type: length, choices: [b]}}", "param 'a' is not a choice"),
        ("{a: {choices: [b, c], default: d}}", "param 'a' needs one of b, c, got 'd'"),
        (
            "{a: {type: gesture, default: wve}}",
            "param 'a' needs a gesture: unknown gesture 'wve'; did you mean 'wave'?",
        ),
        ("{a: {type: person, default: ' '}}", "param 'a' needs the name of a person"),
        ("{a: {type: length, default: [1 m]}}", "param 'a' needs one value"),
        ("{a: '${b}'}", "the default of param 'a' cannot be calculated"),
        ("{a: 1, a: 2}", "'a' is a duplicate key (first at line 2)"),
    ],
)
def test_invalid_param_declaration_gives_a_reason(params: str, message: str) -> None:
    fault = the_fault(f"mission: m\nparams: {params}\ntree: succeed\n")
    assert (fault.mark.line, fault.message) == (2, message)


def test_expression_in_a_param_value_is_not_evaluated() -> None:
    plan = check(MISSION, {"greeting": "${battery.percent}"})
    leaf = plan.tree.children[0].children[0]
    assert leaf.kind == "say"
    assert leaf.arguments["text"].resolve({}) == "${battery.percent}"


@given(st.sampled_from(["60 s", "text", "2", "0.5", "true", "null"]), st.text())
def test_any_text_is_a_value_of_the_defaults_kind_or_refused(default: str, text: str) -> None:
    mission = f"mission: any\nparams: {{p: {default}}}\ntree: succeed\n"
    kind = type(check(mission).params["p"])
    try:
        value = check(mission, {"p": text}).params["p"]
    except InvalidFileError:
        assert kind is not str
        return
    if issubclass(kind, Quantity):
        assert isinstance(value, Quantity)
        assert value.dimension == "duration"
    elif kind in (bool, str):
        assert isinstance(value, kind)
    elif default != "null":
        assert isinstance(value, int | float)
        assert not isinstance(value, bool)


def test_long_param_declaration_has_type_bounds_and_help() -> None:
    mission = """mission: long
params:
  side: {default: 50 cm, help: how long, low: 10 cm, high: 2 m}
  to: {type: text, help: the name of the person}
  times: {type: count, default: 2, low: 1}
tree:
  sequence:
    - say: ${to}
    - drive: ${side}
      repeat: ${times}
"""
    assert check(mission, {"to": "Ada"}).params == {"side": 0.5, "to": "Ada", "times": 2}
    assert check(mission).params == {"side": 0.5, "times": 2}, "what is missing is asked for only when it is run"
    with pytest.raises(InvalidFileError, match=r"needs 'to', a text(.|\n)*the name of the person"):
        check(mission, complete=True)
    for name, text, words in (
        ("side", "5 m", "between 0.1 m and 2 m"),
        ("side", "1 s", "a duration"),
        ("times", "0", "at least 1"),
    ):
        with pytest.raises(InvalidFileError, match=words):
            check(mission, {"to": "Ada", name: text})
    for wrong, words in (
        ("{type: lenght}", "length"),
        ("{help: what}", "a default, or a type"),
        ("{typ: text}", "type"),
    ):
        with pytest.raises(InvalidFileError, match=words):
            check(f"mission: long\nparams:\n  side: {wrong}\ntree: succeed\n")


LISTS = """\
mission: lists
params:
  places: [kitchen, hall]
  ways: {default: [1 m, 50 cm], low: 10 cm, help: how far each time}
  codes: {type: list, of: text, default: []}
  people: {type: list, of: person, help: whom to visit}
  side: {choices: [left, right], default: left}
tree:
  sequence:
    - say: ${places[0]}, then ${places[-1]}, ${len(people)} people
    - drive: ${ways[1]}
      if: "'hall' in places"
"""


def test_list_param_has_members_of_one_type() -> None:
    params = check(LISTS, {"people": "Anna, Ben"}, complete=True).params
    assert params["places"] == ["kitchen", "hall"]
    assert params["ways"] == [1.0, 0.5]
    assert params["people"] == ["Anna", "Ben"]
    assert (params["codes"], params["side"]) == ([], "left")


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("places", "study", ["study"]),
        ("places", "[a b, 'c, d']", ["a b", "c, d"]),
        ("places", "007, true", ["007", "true"]),
        ("places", "", []),
        ("ways", "2 m, 30 cm", [2.0, 0.3]),
        ("side", "right", "right"),
    ],
)
def test_a_caller_writes_a_list_with_commas(name: str, text: str, value: object) -> None:
    params = LISTS.partition("tree:")[0] + "tree: succeed\n"
    assert check(params, {name: text}).params[name] == value


def test_a_callers_list_is_checked_member_by_member() -> None:
    for name, text, message in (
        ("ways", "2 m, 3", "'ways' has a wrong member 2: it needs a length such as '0.5 m': '3' has no unit"),
        ("ways", "1 cm, 2 m", "'ways' has a wrong member 1: it must be at least 0.1 m"),
        ("places", "[a, [b]]", "'places' needs plain values as its members"),
        ("places", "a]", "'places' needs a list, such as 'kitchen, hall', got 'a]'"),
        ("side", "up", "'side' needs one of left, right, got 'up'"),
        ("places", "", "'say': 'places[0]': index 0 out of range (length 0)"),
    ):
        found = faults(LISTS, {"people": "Anna", name: text})
        assert found[0].message.startswith(message)


def test_a_mission_hands_lists_and_members_on(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text(
        "mission: inner\nparams:\n  names: {type: list, of: person}\n  to: {type: person}\n"
        'tree: {say: "${to}: ${names}"}\n'
    )
    outer = "mission: outer\nparams: {all: [Anna, Ben]}\ntree:\n  sequence:\n"
    given = ("names: '${all}', to: '${all[1]}'", "names: [Anna, '007'], to: 7")
    path = tmp_path / "outer.yaml"
    path.write_text(outer + "".join(f"    - {{mission: inner.yaml, with: {{{each}}}}}\n" for each in given))
    assert run_mission(path).said == ["Ben: Anna, Ben", "7: Anna, 007"]
    for wrong, message in (("names: Anna, to: Ben", "'names' needs a list"), ("names: [A], to: [B]", "'to' needs one")):
        path.write_text(f"{outer}    - {{mission: inner.yaml, with: {{{wrong}}}}}\n")
        with pytest.raises(InvalidFileError, match=message):
            load_mission(str(path))


def test_param_of_a_named_type_is_looked_up() -> None:
    text = "mission: m\nparams: {how: {type: gesture, default: wave}}\ntree:\n  gesture: ${how}\n"
    assert check(text).params == {"how": "wave"}
    assert the_fault(text, {"how": "wvae"}).message.startswith("'how' needs a gesture: ")


def test_misspelt_unit_in_a_default_is_an_error() -> None:
    fault = the_fault("mission: nap\nparams:\n  patience: 10 sec\ntree: {wait: 1 s}\n")
    assert (fault.mark.line, fault.mark.column) == (3, 13)
    assert fault.message == "param 'patience': unknown unit in '10 sec'"
    assert fault.suggestion == "write '10 s', or put it in quotes for a text"
    assert check("mission: nap\nparams:\n  label: '10 sec'\n  many: 10 apples\ntree: {wait: 1 s}\n").params


def test_a_param_with_a_dollar_but_no_braces_is_an_error() -> None:
    fault = the_fault("mission: talk\nparams: {word: hello}\ntree: {say: $word}\n")
    assert (fault.message, fault.suggestion) == (
        "'say': '$word' is not an expression",
        "write ${word} for its value",
    )
    assert check("mission: talk\nparams: {word: hello}\ntree: {say: That is $5 or $other}\n").params


READ_PARAMS = [
    "{say: '${a}'}",
    "{say: 'Good ${a}'}",
    "{wait: 1 s, if: a == 1}",
    "{wait: 1 s, repeat: '${a}'}",
    "{wait: 1 s, until: b > 1 and a > 1}",
    "{for_each: {in: '[a, 2]', as: m, do: {say: '${m}'}}}",
    "{switch: {on: a, cases: {1: {wait: 1 s}}, default: {wait: 2 s}}}",
    "{set: {b: '${a}'}}",
    "{parallel: [{say: Hi}, {wait: 1 s}], success_count: '${a}'}",
]


@pytest.mark.parametrize("declared", ["a: 1", "a: {type: number}"])
@pytest.mark.parametrize("node", READ_PARAMS)
def test_read_param_gets_no_hint(node: str, declared: str) -> None:
    text = f"mission: m\nparams: {{{declared}, b: 2}}\ntree: {{sequence: [{{set: {{b: '${{b}}'}}}}, {node}]}}\n"
    assert unread_param_hints(check(text)) == []


@pytest.mark.parametrize("declared", ["a: 1", "a: {default: 1, help: how many}", "a: {type: number}"])
def test_unread_param_gets_a_hint(declared: str) -> None:
    tree = "tree: {sequence: [{say: a}, {set: {a: 1}}]}\nreturns: {b: b}\n"
    text = f"mission: m\nparams:\n  b: 2\n  {declared}\n{tree}"
    (hint,) = unread_param_hints(check(text))
    assert (hint.mark.line, hint.mark.column) == (4, 3)
    assert hint.message == "nothing reads the param 'a'"
    assert hint.suggestion == "write ${a} where its value belongs, or remove it"


def test_param_of_the_same_name_in_a_submission_does_not_count_as_read(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text("mission: inner\nparams: {a: 1}\ntree: {wait: '${a * 1 s}'}\n")
    outer = tmp_path / "outer.yaml"
    outer.write_text("mission: outer\nparams: {a: 1}\ntree: {mission: inner}\n")
    assert list(load_mission(str(outer)).unread_params) == ["a"]
    outer.write_text("mission: outer\nparams: {a: 1}\ntree: {mission: inner, with: {a: '${a}'}}\n")
    assert list(load_mission(str(outer)).unread_params) == []


def test_shipped_missions_read_all_their_params() -> None:
    assert {name: found for name in shipped_missions() if (found := load_mission(name).unread_params)} == {}


def test_param_without_a_default_can_be_read_where_it_is_set() -> None:
    plan = check('mission: t\nparams:\n  n: {type: value}\ntree:\n  set: {n: "${n + 1}"}\n', {"n": "3"})
    assert plan.params == {"n": 3}
    check('mission: t\nparams:\n  n: {type: value}\ntree:\n  set: {n: "${n + 1}"}\n')
