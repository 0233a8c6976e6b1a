"""Test files are read whole, and every mistake in them is told at its place."""

from pathlib import Path
from typing import Any

import pytest

from config.diagnostics import InvalidFileError
from missions.language.plan import Plan
from missions.library.shipped import load_mission
from missions.plugins.testing import suite_context
from missions.plugins.testing.event_specs import EventSpec
from missions.plugins.testing.expectations import PoseTarget
from missions.plugins.testing.fault_specs import FaultSpec
from missions.plugins.testing.suite import Case, load_suite

MISSION = """mission: nod
params: {times: {type: count}, text: {default: Hello}}
tree:
  sequence:
    - look: {tilt: 10 deg}
      name: nod
      repeat: ${times}
    - say: ${text}
    - set: {done: "times"}
returns: {done: done}
"""


def read(folder: Path, text: str) -> tuple[Case, ...]:
    (folder / "nod.yaml").write_text(MISSION, encoding="utf-8")
    file = folder / "nod.test.yaml"
    file.write_text(text, encoding="utf-8")
    return load_suite(file)


def mistakes(folder: Path, text: str) -> list[str]:
    with pytest.raises(InvalidFileError) as caught:
        read(folder, text)
    return [f"{fault.mark.line}:{fault.mark.column}: {fault.message}" for fault in caught.value.diagnostics]


def one_case(lines: str, *, params: str = "{times: 2}") -> str:
    return f"tests: nod\ncases:\n  - case: it nods\n    params: {params}\n{lines}"


def test_case_combines_its_own_and_common_keys(tmp_path: Path) -> None:
    (tmp_path / "hall.yaml").write_text("world: hall\n", encoding="utf-8")
    first, second = read(
        tmp_path,
        """tests: nod
with: {params: {times: 2, text: Hi}, world: hall.yaml, eyes: truth, timeout: 10 s, given: [voice unplugged for 1 s]}
cases:
  - case: one
    params: {times: 5}
    seed: 3
    given: [head unplugged at 1 s]
    expect: {result: success}
  - case: two
    world: empty
    expect: {result: failure}
""",
    )
    assert (first.title, first.params, first.seed) == ("one", {"text": "Hi", "times": "5"}, 3)
    assert (first.world, first.eyes, first.timeout) == (str(tmp_path / "hall.yaml"), "truth", 10.0)
    assert first.injected_faults == (
        FaultSpec("voice", "unplugged", seconds=1.0),
        FaultSpec("head", "unplugged", start=1.0),
    )
    assert (second.params, second.world) == ({"times": "2", "text": "Hi"}, "empty")
    assert first.mission == str(tmp_path / "nod.yaml")


def test_every_expectation_is_read_into_plain_values(tmp_path: Path) -> None:
    (case,) = read(
        tmp_path,
        one_case(
            """    expect:
      result: success
      reason: because
      within: 2 min
      after: 500 ms
      said: Hello
      never_said: [Bye]
      ran: {nod: 2, say: 1}
      never_ran: [nod]
      succeeded: [sequence]
      failed: nod
      order: [nod starts, 'says "Hello"', head disconnects]
      faults: []
      base: stopped
      pose: {near: [1 m, -50 cm], heading: 90 deg +- 5 deg}
      returns: {done: 2}
"""
        ),
    )
    values = {each.key: [item.value for item in each.items] for each in case.expectations}
    assert values["within"] == [120.0]
    assert values["ran"] == [("nod", 2), ("say", 1)]
    assert values["order"][0] == EventSpec("nod", "starts")
    assert values["faults"] == []
    (place,) = values["pose"]
    assert isinstance(place, PoseTarget)
    assert (place.x, place.y, place.max_distance) == (1.0, -0.5, 0.1)
    assert (place.heading, place.max_angle) == pytest.approx((1.5708, 0.0873), abs=1e-4)
    assert values["returns"] == [("done", 2)]
    assert values["said"] == ["Hello"]


def test_a_mission_is_checked_once_for_all_cases_with_the_same_robot_and_params(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checked: list[object] = []

    def load(*arguments: Any, **options: Any) -> Plan:
        checked.append(options["params"])
        return load_mission(*arguments, **options)

    monkeypatch.setattr(suite_context, "load_mission", load)
    cases = "".join(
        f"  - {{case: {name}, params: {{greeting: {greeting}}}, expect: {{result: success}}}}\n"
        for name, greeting in (("a", "Hi"), ("b", "Hi"), ("c", "Ho"))
    )
    path = tmp_path / "greet.test.yaml"
    path.write_text(f"tests: greet\ncases:\n{cases}", encoding="utf-8")
    assert [case.params for case in load_suite(path)] == [{"greeting": "Hi"}, {"greeting": "Hi"}, {"greeting": "Ho"}]
    assert checked == [{"greeting": "Hi"}, {"greeting": "Ho"}]


def test_a_mission_beside_the_file_goes_before_one_of_the_library(tmp_path: Path) -> None:
    (tmp_path / "greet.yaml").write_text("mission: greet\ntree: {wait: 1 s}\n", encoding="utf-8")
    file = tmp_path / "greet.test.yaml"
    file.write_text("tests: greet\ncases: [{case: a, expect: {ran: wait}}]\n", encoding="utf-8")
    assert load_suite(file)[0].mission == str(tmp_path / "greet.yaml")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("cases: []\n", "1:1: a test file needs 'tests'"),
        ("tests: nod\n", "1:1: a test file needs 'cases'"),
        ("tests: nod\ncases: []\n", "1:1: the file has no cases"),
        ("tests: nodd\ncases: [{case: a, expect: {result: success}}]\n", "1:8: unknown mission 'nodd'"),
        ("tests: nod\nwith: 3\ncases: [{case: a}]\n", "2:7: 'with' needs what all cases have in common"),
        ("tests: nod\ncase: a\ncases: []\n", "2:1: a test file has no key 'case'"),
        (one_case("    expect: {}\n"), "5:13: no expectation"),
        (one_case(""), "3:5: a case needs 'expect'"),
        (one_case("    expect: {result: good}\n"), "5:22: 'result' cannot be 'good'"),
        (one_case("    expect: {ran: []}\n"), "5:19: 'ran' has no names"),
        (one_case("    expect: {ran: nodd}\n"), "5:19: mission 'nod' has no 'nodd'; did you mean 'nod'?"),
        (one_case("    expect: {ran: repeat}\n"), "5:19: mission 'nod' has no 'repeat'; "),
        (one_case("    expect: {ran: {nod: often}}\n"), "5:25: how often 'nod' has to start needs a whole number"),
        (one_case("    expect: {order: [nod strats]}\n"), "5:26: the event of 'nod' cannot be 'strats'"),
        (one_case("    expect: {pose: {near: 1 m}}\n"), "5:27: 'near' needs a place, such as [1 m, 0 m]"),
        (one_case("    expect: {pose: {near: [0 m, 0 m], heading: 9}}\n"), "5:48: 'heading' needs an angle"),
        (one_case("    expect: {returns: {don: 2}}\n"), "5:24: the mission returns no 'don'"),
        (one_case("    expect: {base: still}\n"), "5:20: 'base' cannot be 'still'"),
        (one_case("    given: [{nodd: fails}]\n"), "5:14: mission 'nod' has no behaviour 'nodd'"),
        (one_case("    given: [{sequence: fails}]\n"), "5:14: 'sequence' is not the name of one behaviour"),
        (one_case("    given: [{nod: }]\n"), "5:19: what 'nod' does instead is missing"),
        (one_case("    given: [{nod: {does: fails, till: noon}}]\n"), "5:33: a mock has no key 'till'"),
        (one_case("    given: [nod: fails, say: fails, nod: succeeds]\n"), "5:37: a second mock of 'nod'"),
        (one_case("    expect: {result: running}\n"), "5:22: 'running' needs the time after which the run is ended"),
        (one_case("    given: [arm unplugged]\n"), "5:13: mission 'nod' does not use an arm"),
        (one_case("    given: [[a]]\n"), "5:13: neither a mock nor something that goes wrong"),
        (one_case("    world: nowhere\n"), "5:12: unknown world 'nowhere'"),
        (one_case("    robot: nobody\n"), "5:12: unknown robot 'nobody'"),
        (one_case("    eyes: closed\n"), "5:11: 'eyes' cannot be 'closed'"),
        (one_case("", params="{}"), "3:5: mission 'nod' needs 'times', a count"),
        (one_case("", params="{times: many}"), "4:21: 'times' needs a whole number"),
        (one_case("", params="{times: 2, tines: 3}"), "4:24: mission 'nod' has no param 'tines'"),
    ],
)
def test_mistake_is_reported_at_its_place(text: str, expected: str, tmp_path: Path) -> None:
    assert any(told.startswith(expected) for told in mistakes(tmp_path, text)), mistakes(tmp_path, text)


@pytest.mark.parametrize(
    ("given", "column", "script"),
    [
        ("[nod: fails twice, then succeeds]", 18, "fails twice, then succeeds"),
        ("[{nod: fails, then fails, then runs}, say: fails]", 19, "fails, then fails, then runs"),
        ("[nod: {does: fails, then succeeds}]", 25, "fails, then succeeds"),
        ('[nod: runs for 2 s, then fails because "no, never", say: fails]', 18, 'fails because "no, never"'),
    ],
)
def test_script_that_yaml_splits_is_one_mistake(given: str, column: int, script: str, tmp_path: Path) -> None:
    text = one_case(f"    given: {given}\n    expect: {{result: success}}\n")
    with pytest.raises(InvalidFileError) as caught:
        read(tmp_path, text)
    (fault,) = caught.value.diagnostics
    assert (fault.mark.line, fault.mark.column) == (5, column)
    assert fault.message.endswith("is split at its comma in {...} or [...]")
    assert script in fault.suggestion
    quoted = fault.suggestion.removeprefix("put quotes around it: ")
    assert read(tmp_path, one_case(f"    given: [nod: {quoted}]\n    expect: {{result: success}}\n"))


def test_mocks_of_a_case_replace_shared_ones(tmp_path: Path) -> None:
    head = "tests: nod\nwith: {params: {times: 2}, given: [nod: fails, say: fails, voice unplugged for 1 s]}\n"
    cases = """cases:
  - {case: one, given: [nod: succeeds, head unplugged at 1 s], expect: {result: success}}
  - {case: two, expect: {result: success}}
  - {case: three, given: [], expect: {result: success}}
"""
    one, two, three = read(tmp_path, head + cases)
    assert {mock.target: mock.script[0].end for mock in one.mocks} == {"say": "failure", "nod": "success"}
    assert [fault.part for fault in one.injected_faults] == ["voice", "head"]
    assert {mock.target: mock.script[0].end for mock in two.mocks} == {"nod": "failure", "say": "failure"}
    assert (three.mocks, three.injected_faults) == ((), ())


def test_two_cases_of_one_title_are_a_mistake(tmp_path: Path) -> None:
    case = "{case: a, params: {times: 1}, expect: {result: success}}"
    told = mistakes(tmp_path, f"tests: nod\ncases:\n  - {case}\n  - {case}\n")
    assert told == ["4:5: a second case 'a'"]


def test_faults_of_the_mission_are_reported_once(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("mission: bad\ntree: {wiat: 1 s}\n", encoding="utf-8")
    file = tmp_path / "bad.test.yaml"
    case = "{case: %s, expect: {result: success}}"
    file.write_text(f"tests: bad\ncases: [{case % 'a'}, {case % 'b'}]\n", encoding="utf-8")
    with pytest.raises(InvalidFileError) as caught:
        load_suite(file)
    (fault,) = caught.value.diagnostics
    assert fault.source.name.endswith("bad.yaml")
    assert "wiat" in fault.message


def test_leaves_of_the_users_own_can_be_named(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from behaviours.leaf import Leaf, SUCCESS\n\n\nclass Hop(Leaf):\n    'Hop.'\n    tag = 'hop'\n"
        "    def update(self):\n        return SUCCESS\n",
        encoding="utf-8",
    )
    (tmp_path / "hop.yaml").write_text("mission: hop\ntree: hop\n", encoding="utf-8")
    file = tmp_path / "hop.test.yaml"
    file.write_text("tests: hop\nbehaviours: [own.py]\ncases: [{case: a, expect: {ran: hop}}]\n", encoding="utf-8")
    assert load_suite(file)[0].behaviours == (tmp_path / "own.py",)
