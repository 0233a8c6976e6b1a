"""Results of mocks: their types are those of the mocked outputs, and one may follow another."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from config.diagnostics import InvalidFileError
from drivers.api import Duration, HeadPose, Length
from drivers.api.fast_dataclass import dataclass
from missions.language.kinds import ListKind, RecordKind, kind_of_type
from missions.plugins.testing.mock_results import make_result
from missions.plugins.testing.mocks import DEFAULT_REASON, MockTurn
from perception.api import Box, Face, Marker, Thing
from tests.missions.testing.playing import cases, played, seen, write

INNER = """mission: inner
params: {far: 2 m}
tree:
  sequence:
    - find_face:
      as: found
    - set: {n: 3, text: "${far}"}
returns: {way: far * 2, n: n, where: found, enough: n > 2, rounds: "[n, 2]"}
"""
MISSION = """mission: m
tree:
  sequence:
    - find_face:
      as: person
    - faces_at_least: 1
      as: faces
    - find_object: red ball
      as: ball
    - drive: 1 m
      as: driven
    - listen: {for: [again, stop]}
      as: answer
    - mission: inner.yaml
    - sequence: [{find_robot: , as: robot}]
      name: seek
    - say: "${person.name} ${len(faces)} ${ball.colour} ${driven} ${answer} ${way} ${n} ${where.yaw}"
    - say: "${enough} ${rounds[0]}"
"""


@pytest.mark.parametrize(
    ("mock", "column", "told"),
    [
        ("find_face: {result: {id: 1, yaw: 10}}", "10", "'yaw' needs an angle such as '30 deg': '10' has no unit"),
        ("find_face: {result: {yaw: 1 m}}", "1 m", "'yaw' needs an angle such as '30 deg', got a length: '1 m'"),
        ("find_face: {result: {yall: 1 deg}}", "yall", "'result' has no 'yall' (known are: bearing"),
        ("find_face: {result: {stamp: 1 s}}", "stamp", "'result' has no 'stamp'"),
        ("find_face: {result: Anna}", "Anna", "'result' needs names and values, such as {id: ...}, got 'Anna'"),
        ("find_face: {result: [{id: 1}]}", "[", "'result' needs a Face, got a list (for one after another, write"),
        ("find_face: {result: {id: one}}", "one", "'id' needs a number, got 'one'"),
        ("find_face: {result: {id: true}}", "true", "'id' needs a number, got 'true'"),
        ("find_face: {result: {name: [a]}}", "[", "'name' needs a text, got a list"),
        ("find_face: {result: }", "}", "'result' is empty (leave it out"),
        ("find_face: {does: fails, result: {id: 1}}", "{id", "'find_face' never succeeds, so it never has this"),
        ("find_face: {does: runs, result: {id: 1}}", "{id", "'find_face' never succeeds, so it never has this"),
        ("find_face: {then: {id: 1}}", "{then", "a mock needs the outcome of its first start (write find_face:"),
        ("find_face: {does: fails, then: []}", "[]", "'then' has no results"),
        ("find_face: {does: fails, then: }", "}", "'then' is empty"),
        ("find_face: {does: fails, then: [{id: 1}, {idd: 2}]}", "idd", "entry 2 of 'then' has no 'idd' (did you"),
        ("find_face: {does: fails, then: {does: fails, till: 1}}", "till", "'then' has no key 'till'"),
        ("find_face: {does: fails, then: {does: fals}}", "fals", "the script of a mock"),
        ("find_face: {does: fails, then: {result: {idd: 1}}}", "idd", "'result' has no 'idd'"),
        ("faces_at_least: {result: {id: 1}}", "{id", "'result' needs a list, got a mapping (put it in brackets"),
        ("faces_at_least: {result: [{id: 1}, {id: x}]}", "x}", "'id' needs a number, got 'x'"),
        ("faces_at_least: {result: [1]}", "1]", "member 1 of 'result' needs names and values"),
        ("faces_at_least: {result: [], then: [{id: 1}]}", "{id", "'then' needs a list, got a mapping"),
        ("find_object: {result: {size: 3}}", "3", "'size' needs a length such as '0.5 m': '3' has no unit"),
        ("drive: {result: 50 deg}", "50 deg", "'result' needs a length such as '0.5 m', got an angle: '50 deg'"),
        ("drive: {result: 1 m, then: [1 m, 2]}", "2]", "entry 2 of 'then' needs a length such as '0.5 m': '2'"),
        ("drive: {result: [1 m]}", "[", "'result' needs a length, got a list (for one after another, write"),
        ("listen: {result: again, then: stopp}", "stopp", "'listen' cannot hear 'stopp' (did you mean 'stop'?)"),
        ("listen: {result: again, then: fails}", "fails", "'listen' cannot hear 'fails' (write {does: fails})"),
        ("listen: {result: [again, stop]}", "[", "'result' needs a text, got a list (for one after another"),
        ("listen: again", "again", "'again' is not the script of a mock (write listen: {result: again}"),
        ("listen: fals", "fals", "the script of a mock (such as 'fails twice, then succeeds') cannot be 'fals'"),
        ("say: {result: 3}", "3", "'say' has no result (leave the result out)"),
        ("say: {does: fails, then: succeeds}", "succeeds", "'say' has no result (write {does: succeeds})"),
        ("seek: {result: {robot: 3}}", "{robot", "'seek' has no result (mock the behaviour in it that has one: find_r"),
        ("inner: {result: {way: 3}}", "3", "'way' needs a length such as '0.5 m': '3' has no unit"),
        ("inner: {result: {enough: perhaps}}", "perhaps", "'enough' needs true or false, got 'perhaps'"),
        ("inner: {result: {rounds: [1, 2 m]}}", "2 m", "member 2 of 'rounds' needs a number, got '2 m'"),
        ("inner: {result: {where: {yaw: 2}}}", "2}", "'yaw' needs an angle such as '30 deg': '2' has no unit"),
        ("inner: {result: {ways: 3 m}}", "ways", "'result' has no 'ways' (did you mean 'way'?)"),
        ("inner: {result: 3}", "3", "'result' needs names and values"),
        ("'find_*': {result: {id: 3}}", "'find_*'", "'find_*' has different results: find_face, find_object, find"),
    ],
)
def test_result_of_another_type_is_reported_at_its_place(mock: str, column: str, told: str, tmp_path: Path) -> None:
    write(tmp_path, {"inner.yaml": INNER})
    with pytest.raises(InvalidFileError) as caught:
        cases(tmp_path, MISSION, f"given: [{{{mock}}}], expect: {{result: success}}")
    (fault,) = caught.value.diagnostics
    assert f"{fault.message} ({fault.suggestion})".startswith(told)
    line = fault.source.line(fault.mark.line)
    assert line[fault.mark.column - 1 :].startswith(column)


def test_results_of_all_types_reach_the_mission(tmp_path: Path) -> None:
    write(tmp_path, {"inner.yaml": INNER})
    mocks = [
        "find_face: {result: {name: Anna}}",
        "faces_at_least: {result: [{id: 1}, {id: 2}]}",
        "find_object: {result: {colour: red}}",
        "drive: {result: 70 cm}",
        "listen: {result: stop}",
        "inner: {result: {way: 3 m, n: 5, where: {yaw: 90 deg}, enough: true, rounds: [4, 5]}}",
        "find_robot: succeeds",
    ]
    verdict = played(
        tmp_path,
        MISSION,
        f"given: [{', '.join(f'{{{mock}}}' for mock in mocks)}], "
        "expect: {result: success, said: [Anna 2 red 0.7 m stop 3 m 5 90 deg, yes 4]}",
    )
    assert seen(verdict) == []


DIALOGUE = """mission: m
tree:
  sequence:
    - set: {answer: ""}
    - sequence:
        - listen: {for: [again, stop]}
          as: answer
          retry: 2
        - say: "${answer}"
      repeat: forever
      until: answer == "stop"
returns: {answer: answer}
"""


@pytest.mark.parametrize(
    ("mock", "expect"),
    [
        ("{result: again, then: stop}", "said: [again, stop], ran: {listen: 2}"),
        ("{does: succeeds twice, result: again, then: stop}", "said: [again, again, stop], ran: {listen: 3}"),
        ('{result: again, then: [{does: fails because "deaf"}, stop]}', "said: [again, stop], ran: {listen: 3}"),
        ("{does: fails once, result: stop}", "said: stop, ran: {listen: 2}"),
        ('{does: fails because "deaf", then: stop}', "said: stop, order: [listen fails, listen succeeds]"),
        ("{does: 'fails, then succeeds', result: again, then: [{result: stop}]}", "said: [again, stop]"),
        ("{result: again, then: {does: succeeds after 2 s, result: stop}}", "after: 2 s, said: [again, stop]"),
    ],
)
def test_mock_returns_one_result_after_another(mock: str, expect: str, tmp_path: Path) -> None:
    body = f"given: [{{listen: {mock}}}], expect: {{result: success, returns: {{answer: stop}}, {expect}}}"
    assert seen(played(tmp_path, DIALOGUE, body)) == []


@pytest.mark.parametrize("name", ["inner", "a label"])
def test_named_mission_keeps_the_name_of_its_file(name: str, tmp_path: Path) -> None:
    write(tmp_path, {"inner.yaml": "mission: inner\ntree: {log: hi}\n"})
    tree = "sequence: [{mission: inner, name: a label}, {say: Hi}]"
    for mocks, result in (("", "success"), (f"given: [{{{name}: fails}}], ", "failure")):
        expect = f"{{result: {result}, ran: {{{name}: 1}}, order: [{name} starts]}}"
        verdict = played(tmp_path, f"mission: m\ntree: {{{tree}}}\n", f"{mocks}expect: {expect}")
        assert seen(verdict) == []


def test_one_entry_can_hold_several_mocks(tmp_path: Path) -> None:
    mocks = '{listen: {result: stop}, say: fails because "hoarse"}'
    assert seen(played(tmp_path, DIALOGUE, f"given: [{mocks}], expect: {{result: failure, reason: hoarse}}")) == []


def test_last_entry_is_repeated(tmp_path: Path) -> None:
    body = "timeout: 9 s, given: [{{listen: {}}}], expect: {{result: {}, said: {}}}"
    told = "[again, again, again, again]"
    assert seen(played(tmp_path, DIALOGUE, body.format("{result: again, then: again}", "running", told))) == []
    failing = "{result: again, then: {does: fails because 'deaf'}}".replace("'", '"')
    verdict = played(tmp_path, DIALOGUE, body.format(failing, "failure, reason: deaf, ran: {listen: 3}", "again"))
    assert seen(verdict) == []


def test_mocked_mission_stores_its_results_like_the_mission(tmp_path: Path) -> None:
    write(tmp_path, {"inner.yaml": INNER})
    mission = """mission: m
tree:
  sequence:
    - set: {first: null}
    - selector:
        - mission: inner
          as: first
        - succeed
    - mission: inner
      returns: {n: n, twice: n * 2}
    - say: "${first.n} ${first.way} ${n} ${twice}"
      if: first != null
"""
    mock = "{does: fails, result: {n: 1, way: 10 cm}, then: {n: 2, twice: 4}}"
    body = f"given: [{{inner: {mock}}}], expect: {{result: success, said: 1 0.1 m 2 4}}"
    assert seen(played(tmp_path, mission, body)) == []
    unset = f"given: [{{inner: {mock.replace(', twice: 4', '')}}}], expect: {{reason: is not set}}"
    assert seen(played(tmp_path, mission, unset)) == []


@dataclass(frozen=True)
class Tray:
    """Output of a leaf of the user's own."""

    cups: int
    width: Length
    full: bool
    label: str
    pose: HeadPose
    kept: Duration | None = None


@dataclass(frozen=True)
class Strict(Tray):
    """Output that refuses some values."""

    def __post_init__(self) -> None:
        if self.cups > 9:
            raise ValueError("at most 9 cups")


def test_values_of_any_type_have_no_kind() -> None:
    assert kind_of_type(Any) is None
    assert kind_of_type(object) is None
    assert kind_of_type(list[Any]) == ListKind(None)
    assert kind_of_type(Mapping[str, Any]) == RecordKind("a mapping", other_kind=None)


def test_record_of_a_class_has_all_its_members() -> None:
    kind = kind_of_type(list[Tray])
    assert kind == ListKind(RecordKind("a Tray", Tray))
    made = make_result(kind, [{"cups": 2, "pose": {"pan": 1.0}}], 3.0)
    assert made == [Tray(2, 0, False, "", HeadPose(1.0, 0))]
    face = make_result(kind_of_type(Face), {"name": "Anna"}, 3.0)
    assert isinstance(face, Face)
    assert (face.id, face.distance, face.stamp, face.yaw, face.name) == (1, 1.5, 3.0, 0, "Anna")
    assert isinstance(face.box, Box)
    for percept in (Thing, Marker):
        assert isinstance(make_result(kind_of_type(percept), {}, 3.0), percept)


OWN = """from typing import TypedDict
from behaviours.leaf import SUCCESS, Leaf
from tests.missions.testing.test_mock_results import Strict

class Sample(TypedDict):
    ph: float

class Count(Leaf):
    'Count the cups.'
    tag = 'count_cups'
    output_doc = 'the tray'
    output_type = Strict
    def update(self):
        return SUCCESS

class Measure(Count):
    'Measure the water.'
    tag = 'measure'
    output_type = Sample

class Guess(Count):
    'Guess something.'
    tag = 'guess'
    output_type = None

class Weigh(Count):
    'Weigh all cups.'
    tag = 'weigh'
    output_type = dict[str, float]
"""


def test_outputs_of_leaves_of_the_users_own_are_checked(tmp_path: Path) -> None:
    (tmp_path / "behaviours").mkdir()
    write(tmp_path / "behaviours", {"own.py": OWN})
    mission = """mission: m
tree:
  sequence:
    - count_cups:
      as: tray
    - measure:
      as: water
    - guess:
      as: guess
    - weigh:
      as: weights
    - say: ${tray.cups} ${tray.width} ${water.ph} ${guess} ${weights.red}
"""
    mocks = "{count_cups: {result: %s}}, {measure: {result: {ph: 7.5}}}, {guess: {result: %s}}, {weigh: {result: %s}}"
    good = mocks % ("{cups: 4, width: 30 cm}", "12 kg", "{red: 0.5}")
    verdict = played(tmp_path, mission, f"given: [{good}], expect: {{result: success, said: 4 0.3 m 7.5 12 kg 0.5}}")
    assert seen(verdict) == []
    bad = mocks % ("{cups: 10}", "[1, {a: 2}]", "{red: heavy}")
    with pytest.raises(InvalidFileError) as caught:
        cases(tmp_path, mission, f"given: [{bad}], expect: {{result: success}}")
    told = [fault.message for fault in caught.value.diagnostics]
    assert told == ["'result' cannot be made: at most 9 cups", "'red' needs a number, got 'heavy'"]


def test_turn_keeps_its_result_as_plain_data(tmp_path: Path) -> None:
    write(tmp_path, {"inner.yaml": INNER})
    body = "given: [{drive: {result: 70 cm, then: {does: fails}}}], expect: {result: success}"
    (case,) = cases(tmp_path, MISSION, body)
    (mock,) = case.mocks
    first, second = mock.script
    assert first == MockTurn("success", result=pytest.approx(0.7))
    assert second == MockTurn("failure", reason=DEFAULT_REASON)
