"""The pytest plugin: test files of missions are collected, and Python tests get their fixtures."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from drivers.clock import ManualClock
from drivers.sim.world import SimulatedWorld
from missions.plugins.testing.mission_run import MissionRun
from missions.plugins.testing.recorders import STOP, LeafTestBench, drive
from tests.missions.testing.playing import write

pytest_plugins = ["pytester"]

DOCS = Path(__file__).parents[3] / "docs" / "testing.md"
NAP = {
    "nap.yaml": "mission: nap\ntree: {wait: 1 s}\n",
    "nap.test.yaml": "tests: nap\ncases:\n"
    "  - {case: it sleeps, expect: {result: success}}\n"
    "  - {case: it snores, expect: {said: Rrr}}\n",
}


# Under pytest-xdist, the plugin that tries again listens on a port for as long as its process lives.
ALONE = ("-p", "no:rerunfailures")


def test_test_files_are_collected_and_their_failures_show_the_line(pytester: pytest.Pytester) -> None:
    write(pytester.path, NAP)
    result = pytester.runpytest_inprocess("-v", *ALONE)
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        [
            "nap.test.yaml::it sleeps PASSED*",
            "nap.test.yaml::it snores FAILED*",
            '*nap.test.yaml:4:38: it never said "Rrr"; it said nothing',
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")


def test_a_mistake_in_a_test_file_is_an_error_of_the_collection(pytester: pytest.Pytester) -> None:
    write(pytester.path, NAP | {"nap.test.yaml": "tests: nap\ncases: [{case: a, expect: {rusult: success}}]\n"})
    result = pytester.runpytest_inprocess(*ALONE)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*nap.test.yaml:2:28: 'expect' has no key 'rusult'", "*did you mean 'result'?"])


def test_in_a_foreign_project_nothing_is_collected_and_nothing_imported(pytester: pytest.Pytester) -> None:
    write(
        pytester.path,
        {
            "api.test.yaml": "name: GET /\nrequest: {url: /}\n",
            "binary.test.yaml": "\x00\x01",
            "test_own.py": "import sys\n\ndef test_own():\n"
            "    assert not {'drivers', 'config', 'cv2', 'py_trees'} & sys.modules.keys()\n",
        },
    )
    result = pytester.runpytest_subprocess()
    result.assert_outcomes(passed=1)


def test_the_python_of_the_docs_passes(pytester: pytest.Pytester) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```$", DOCS.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert len(blocks) == 2
    for number, block in enumerate(blocks):
        (pytester.path / f"test_docs_{number}.py").write_text(block, encoding="utf-8")
    pytester.runpytest_inprocess(*ALONE).assert_outcomes(passed=3)


def test_run_mission_returns_commands_events_and_result(run_mission: Callable[..., MissionRun], tmp_path: Path) -> None:
    write(tmp_path, {"m.yaml": "mission: m\nparams: {far: 1 m}\ntree: {sequence: [{say: Off}, {drive: '${far}'}]}\n"})
    ran = run_mission(
        tmp_path / "m.yaml", params={"far": "20 cm"}, world="empty", given=[{"say": "succeeds after 1 s"}]
    )
    assert (ran.result, ran.reason, ran.said) == ("success", "", [])
    assert ran.pose is not None
    assert ran.pose.x == pytest.approx(0.2, abs=0.02)
    assert (ran.starts("drive"), ran.ends("say")) == (1, ["success"])
    assert ran.seconds > 2.0
    assert [node.key for node in ran.nodes] == ["1", "1.1", "1.2"]
    again = run_mission(tmp_path / "m.yaml", world="empty", given=["base bumped when base moves"])
    assert (again.result, again.reason, again.said) == ("failure", "bumped into something", ["Off"])


def test_invalid_run_mission_arguments_are_refused(run_mission: Callable[..., MissionRun]) -> None:
    with pytest.raises(ValueError, match=r"run_mission\('greet'\):\d+:\d+: the fault of the camera cannot be 'frozn'"):
        run_mission("greet", given=["camera frozn"])
    with pytest.raises(ValueError, match="unknown world 'moon'"):
        run_mission("greet", world="moon")


def test_recorders_store_commands_with_times(robot: LeafTestBench, clock: ManualClock) -> None:
    robot.base.drive(drive(0.2, 0.0))
    clock.advance(1.0)
    robot.base.stop()
    assert robot.base.commands == [drive(0.2, 0.0), STOP]
    assert robot.base.times == [0.0, 1.0]
    assert robot.base.commands != [drive(0.2, 0.0)], "too few expected"
    assert robot.base.commands != [drive(0.2, 0.0), STOP, STOP], "too many expected"


def test_worlds_are_given_by_name(world: Callable[[str], SimulatedWorld]) -> None:
    assert len(world("two_people").people_at(0.0)) == 2
    assert len(world("empty").people_at(0.0)) == 0
