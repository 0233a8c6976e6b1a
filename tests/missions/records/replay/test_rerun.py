"""Deciding a mission again from what a record knows: nothing moves, and what is other than then is named."""

import random
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from config.library import DEFAULT_ROBOT, find_file
from config.robot import RobotConfig
from missions.executive.events import NodeChanged
from missions.executive.tick_record import Answer, TickRecord
from missions.library.drivers import load_robot
from missions.library.shipped import load_mission, shipped_missions
from missions.plugins.records.replay.rerun import RerunResult, rerun
from missions.request import RunRequest
from missions.runner import Runner
from tests.missions.records.replay.past import Past, past_of

GREET = shipped_missions()["greet"]


@pytest.fixture(scope="module")
def robot() -> RobotConfig:
    return load_robot(find_file("robots", DEFAULT_ROBOT))


@pytest.fixture(scope="module")
def greeting() -> Past:
    """A run of greet that has gone well."""
    return past_of(RunRequest("greet", simulate="fast", eyes="truth"))


def changed(folder: Path, was: str, becomes: str) -> Path:
    """Return greet with a piece of it changed."""
    text = GREET.read_text()
    assert text.count(was) == 1
    path = folder / "greet.yaml"
    path.write_text(text.replace(was, becomes))
    return path


def again(past: Past, mission: Path, robot: RobotConfig) -> RerunResult:
    return rerun(past, load_mission(str(mission), complete=True), robot)


def test_an_unchanged_mission_decides_the_same(greeting: Past, robot: RobotConfig) -> None:
    found = again(greeting, GREET, robot)
    assert found.is_identical
    assert found.ticks == len(greeting.tick_records) > 100


def test_a_changed_threshold_is_named_with_tick_node_and_line(
    greeting: Past, robot: RobotConfig, tmp_path: Path
) -> None:
    mission = changed(tmp_path, "within: 5 deg", "within: 2 deg")
    difference = again(greeting, mission, robot).difference
    assert difference is not None
    assert (difference.current_place.key, difference.current_place.kind) == ("1.2.2.1", "face_centred")
    assert (difference.recorded_place.file, difference.recorded_place.line) == ("greet.yaml", 17)
    assert (difference.current_place.file, difference.current_place.line) == (str(mission), 17)
    assert (difference.recorded.status, difference.current.status) == ("success", "failure")
    assert "off" in difference.current.reason
    moment = next(moment for moment in greeting.tick_records if moment.tick == difference.tick)
    assert difference.t == moment.t


def test_rerun_uses_the_recorded_base_lag(robot: RobotConfig) -> None:
    past = past_of(RunRequest("follow_me", simulate="fast", eyes="truth"), lag=0.3)
    plan = load_mission(str(shipped_missions()["follow_me"]), complete=True)
    assert rerun(past, plan, robot, lag=0.3).is_identical
    assert rerun(past, plan, robot).command is not None


def test_rerun_ends_at_the_first_difference(greeting: Past, robot: RobotConfig, tmp_path: Path) -> None:
    found = again(greeting, changed(tmp_path, "within: 5 deg", "within: 2 deg"), robot)
    assert found.difference is not None
    assert found.ticks == found.difference.tick < len(greeting.tick_records)


def test_inserted_node_does_not_shift_others(greeting: Past, robot: RobotConfig, tmp_path: Path) -> None:
    mission = changed(tmp_path, "    - find_face", "    - log: looking\n    - find_face")
    found = again(greeting, mission, robot)
    assert found.difference is None
    assert found.nodes == sum(1 for _ in greeting.runner.plan.tree.walk())


def test_node_with_a_shifted_key_is_still_compared(greeting: Past, robot: RobotConfig, tmp_path: Path) -> None:
    path = changed(tmp_path, "    - find_face", "    - log: looking\n    - find_face")
    path.write_text(path.read_text().replace("within: 5 deg", "within: 2 deg"))
    difference = again(greeting, path, robot).difference
    assert difference is not None
    assert difference.recorded_place.key == "1.2.2.1"
    assert difference.current_place.key == "1.3.2.1"
    assert (difference.recorded_place.line, difference.current_place.line) == (17, 18)


def test_other_words_alone_are_other_commands_and_no_other_status(
    greeting: Past, robot: RobotConfig, tmp_path: Path
) -> None:
    found = again(greeting, changed(tmp_path, "say: ${greeting}", "say: Halloo"), robot)
    assert found.command is not None
    assert not found.is_identical
    assert (found.command.part, str(found.command.recorded), str(found.command.current)) == (
        "voice",
        "say(Hello!)",
        "say(Halloo)",
    )
    assert found.command.place.startswith("say (line")


def test_rerun_ends_at_a_query_without_recorded_answer(robot: RobotConfig, tmp_path: Path) -> None:
    looked = past_of(RunRequest("look_around", simulate="fast", eyes="truth"))
    mission = tmp_path / "look_around.yaml"
    mission.write_text("mission: look_around\ntree:\n  gesture: hello\n")
    found = again(looked, mission, robot)
    assert not found.is_identical
    assert found.unanswered.startswith("in tick 1, at 0.0")
    assert found.unanswered.endswith("gesture (line 3) queries arm.limits")


def test_changed_answer_is_a_difference(greeting: Past, robot: RobotConfig) -> None:
    def unseen(answer: Answer) -> Answer:
        return (*answer[:3], ()) if answer[:2] == ("sight", "faces") else answer

    blind = [replace(moment, answers=[unseen(answer) for answer in moment.answers]) for moment in greeting.tick_records]
    found = again(replace(greeting, tick_records=blind), GREET, robot)
    assert found.difference is not None
    assert found.difference.current_place.kind == "find_face"
    assert found.difference.recorded.status == "success"


def test_last_tick_of_a_killed_run_is_ignored(greeting: Past, robot: RobotConfig) -> None:
    torn = replace(greeting, tick_records=greeting.tick_records[:50], is_complete=False)
    found = again(torn, GREET, robot)
    assert found.is_identical
    assert found.ticks == 49


def test_rerun_of_an_interrupted_run_includes_the_halt(robot: RobotConfig) -> None:
    def stop(runner: Runner, moment: TickRecord) -> None:
        if moment.tick == 60:
            runner.executive.stop("enough")

    past = past_of(RunRequest("patrol", simulate="fast", eyes="truth"), act=stop)
    assert [moment.kind for moment in past.tick_records[59:61]] == ["tick", "halt"]
    assert again(past, shipped_missions()["patrol"], robot).is_identical


RECOVERING = """mission: recovering
tree:
  sequence:
    - drive: 2 m
      timeout: 1 s
      retry: 2
      recover: {say: "${failure}"}
      on_failure: succeed
      finally: {say: Once}
    - drive: 2 m
      finally: {sequence: [{set: {done: true}}, {say: Stopped}]}
"""


def test_run_that_is_interrupted_in_a_cleanup_is_decided_again(robot: RobotConfig, tmp_path: Path) -> None:
    def stop(runner: Runner, moment: TickRecord) -> None:
        if moment.tick == 180:
            runner.executive.stop("enough")

    mission = tmp_path / "recovering.yaml"
    mission.write_text(RECOVERING, encoding="utf-8")
    past = past_of(RunRequest(str(mission), simulate="fast", eyes="truth"), act=stop)
    said = [event for event in past.events if isinstance(event, NodeChanged) and event.kind == "say"]
    assert [moment.kind for moment in past.tick_records].count("halt") > 5
    assert {event.node for event in said if event.status == "running"} == {"1.1.1.1.2", "1.1.2", "1.2.2.2"}
    assert again(past, mission, robot).is_identical


def test_rerun_of_a_paused_run_is_identical(robot: RobotConfig) -> None:
    def pause(runner: Runner, moment: TickRecord) -> None:
        if moment.kind == "look":
            runner.executive.resume()
        elif moment.tick == 40:
            runner.executive.pause()
        elif moment.tick == 80:
            runner.executive.stop("enough")

    past = past_of(RunRequest("patrol", simulate="fast", eyes="truth"), act=pause)
    assert {moment.kind for moment in past.tick_records} == {"tick", "look", "halt"}
    assert again(past, shipped_missions()["patrol"], robot).is_identical


def test_a_run_in_real_time_is_decided_again(robot: RobotConfig) -> None:
    def stop(runner: Runner, moment: TickRecord) -> None:
        if moment.tick == 20:
            runner.executive.stop("enough")

    past = past_of(RunRequest("look_around", simulate="wire"), act=stop)
    assert len(past.tick_records) > 10
    found = again(past, shipped_missions()["look_around"], robot)
    assert found.is_identical
    assert found.reworded_count == 0


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(tick=st.integers(min_value=2, max_value=200), seed=st.integers(min_value=0, max_value=2**32))
def test_changed_status_is_found_anywhere(greeting: Past, robot: RobotConfig, tick: int, seed: int) -> None:
    changes = [event for event in greeting.events if isinstance(event, NodeChanged) and event.tick >= tick]
    wrong = random.Random(seed).choice(changes[:10])  # noqa: S311 - any will do
    other = "failure" if wrong.status != "failure" else "success"
    events = [replace(wrong, status=other) if event is wrong else event for event in greeting.events]
    difference = again(replace(greeting, events=events), GREET, robot).difference
    assert difference is not None
    assert difference.recorded.status == other
    assert (difference.tick, difference.recorded_place.key) == (wrong.tick, wrong.node)
