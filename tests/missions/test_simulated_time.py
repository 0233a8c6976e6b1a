"""Missions in simulated time: the same robot without waiting, alike from run to run."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import pytest
from py_trees.common import Status

import missions
from behaviours.run import RunState
from config.library import find_file
from config.world import load_world
from drivers.clock import ManualClock
from drivers.sim.timeline import Timeline
from missions.executive.events import Event, Logged, NodeChanged, PerceptSeen
from missions.executive.pace import MAX_STILL_SPEED, PausedPacer, SimulationPacer
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS
from missions.request import RunRequest
from missions.runner import Runner
from tests.cases import each
from tests.missions.command import command


def told(order: RunRequest) -> list[Event]:
    """Run ``order`` and return its events."""
    events: list[Event] = []
    Runner(order, listeners=[events.append]).run()
    return events


def fast(name: str, **options: object) -> RunRequest:
    return replace(RunRequest(name, simulate="fast"), **options)  # type: ignore[arg-type] # options of many types


@pytest.mark.parametrize("eyes", ["pixels", "truth"])
def test_greet_succeeds_on_twins(eyes: str) -> None:
    events = told(fast("greet", eyes=eyes))
    assert [event.text for event in events if isinstance(event, Logged) and event.level == "voice"] == ["Hello!"]
    assert any(isinstance(event, PerceptSeen) and event.faces for event in events)
    assert events[-1].as_dict()["result"] == "success"


def test_greet_times_out_in_an_empty_world() -> None:
    order = fast("greet", eyes="truth", world="empty", params={"patience": "5 s"})
    result = Runner(order).run()
    assert (result.result, result.reason) == ("failure", "no face found (timed out after 5 s)")
    assert result.seconds == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("options", [["--eyes", "truth"], ["--simulate", "fast"]])
def test_two_processes_with_one_seed_write_identical_events(tmp_path: Path, options: list[str]) -> None:
    for number in ("1", "2"):
        run = [sys.executable, "-m", "missions", "run", "greet", *options, "--seed", "3"]
        surroundings = {**os.environ, "PYTHONHASHSEED": number}
        subprocess.run([*run, "--events", str(tmp_path / number)], env=surroundings, check=True, capture_output=True)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()


def test_another_seed_gives_another_run() -> None:
    one, other = (told(fast("greet", eyes="truth", seed=seed)) for seed in (1, 2))
    assert [event.as_dict() for event in one] != [event.as_dict() for event in other]


def test_a_world_may_be_given_as_a_value() -> None:
    world = load_world(find_file("worlds", "living_room"))
    far = replace(world, people=tuple(replace(person, at=(4.9, person.y)) for person in world.people))
    result = Runner(fast("greet", eyes="truth", world=far, params={"patience": "8 s"})).run()
    assert result.result == "failure"


def test_every_time_is_on_the_simulated_clock() -> None:
    events = told(fast("motions/square", eyes="truth"))
    changes = [event for event in events if isinstance(event, NodeChanged)]
    assert [event.t for event in events] == sorted(event.t for event in events)
    assert changes[-1].t > 20.0


class Wall:
    """A wall clock that only waiting moves on."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.waited: list[float] = []

    def wait(self, seconds: float) -> None:
        self.waited.append(seconds)
        self.clock.advance(seconds)


def test_pacer_keeps_the_speed_by_waiting() -> None:
    wall, timeline = Wall(), Timeline()
    pace = SimulationPacer(RunState(timeline.clock, wall=wall.clock), timeline, speed=5.0, wait=wall.wait)
    for _ in range(100):
        pace(0.05)
    assert timeline.clock.now() == pytest.approx(5.0)
    assert wall.clock.now() == pytest.approx(1.0)


def test_time_does_not_race_after_a_pause() -> None:
    wall, timeline = Wall(), Timeline()
    pace = SimulationPacer(RunState(timeline.clock, wall=wall.clock), timeline, speed=1.0, wait=wall.wait)
    pace(0.05)
    wall.clock.advance(60.0)  # in which nobody let time pass
    began = wall.clock.now()
    for _ in range(100):
        pace(0.05)
    assert wall.clock.now() - began == pytest.approx(5.0, abs=0.06)


def test_without_a_speed_nothing_waits() -> None:
    wall, timeline = Wall(), Timeline()
    pace = SimulationPacer(RunState(timeline.clock, wall=wall.clock), timeline, wait=wall.wait)
    pace(1000.0)
    assert timeline.clock.now() == 1000.0
    assert not wall.waited


def test_wake_ends_the_wait_of_the_pacer() -> None:
    timeline = Timeline()
    run = RunState(timeline.clock)
    timeline.call_at(0.3, run.wake)
    assert SimulationPacer(run, timeline)(1.0)
    assert timeline.clock.now() == 0.3


MOVES = {
    "the base": "mission: m\ntree:\n  drive: {distance: 50 m, speed: 0.5 m/s}\n",
    "the base, which turns": "mission: m\ntree:\n  turn: 3000 deg\n",
    "the head": "mission: m\ntree:\n  sequence:\n    - look: {pan: -80 deg}\n    - look: {pan: 80 deg}\n",
    "the arm": "mission: m\ntree:\n  gesture: hello\n  repeat: forever\n",
}


@each("what", list(MOVES))
@each("how", ["pause", "stop"])
def test_the_robot_comes_to_rest_before_a_pause_holds_the_world(what: str, how: str, tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(MOVES[what], encoding="utf-8")
    runner = Runner(RunRequest(str(path), robot="turtlebot2_arm", simulate="fast"), limits=IN_PROCESS_LIMITS)
    twins, robot, idle = runner.twins, runner.assembled_robot.robot, runner.executive.idle
    assert twins is not None
    assert isinstance(idle, PausedPacer)
    idle._pacer._wait = lambda _: None
    stood: list[bool] = []

    def pause() -> None:
        runner.executive.pause() if how == "pause" else runner.latch.stop("somebody")

    def look(seconds: float) -> None:
        before = twins.timeline.clock.now()
        idle(seconds)
        stood.append(twins.timeline.clock.now() == before)
        if stood[-3:] == [True] * 3:
            runner.executive.stop("seen")

    twins.timeline.call_at(2.03, pause)
    runner.executive.idle = look
    runner.run()
    assert not stood[0]  # it moved when it was told to pause, and had the time to come to rest
    state = None if robot.base_part is None else robot.base_part.state().value
    if state is not None:
        assert max(abs(state.velocity.linear), abs(state.velocity.angular)) < MAX_STILL_SPEED
    joints = {} if robot.arm_part is None else robot.arm_part.states()
    assert not any(joint.value is not None and joint.value.moving for joint in joints.values())


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--simulate", "wire", "--eyes", "truth"], "add --simulate fast"),
        (["--robot", "turtlebot2_arm", "--speed", "2"], "add --simulate fast"),
        (["--simulate", "fast", "--camera", "0"], "--camera gives pictures in real time"),
        (["--simulate", "--film", "x.mp4"], "add --simulate fast"),
        (["--film", "/nowhere/x.mp4"], "no such folder"),
        (["--speed", "0"], "--speed"),
    ],
)
def test_incompatible_run_options_are_refused(
    capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    outcome = command(capsys, "run", "greet", *options)
    assert outcome.code == 2
    assert said in outcome.err


def test_the_level_of_the_simulation_may_be_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "run", "--simulate", "greet", "--eyes", "truth")  # wire, which has no eyes of this kind
    assert outcome.code == 2
    assert "add --simulate fast" in outcome.err


def test_a_run_can_be_filmed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "run", "motions/spin_left", "--film", str(tmp_path / "film.avi"), "--json")
    seconds = json.loads(outcome.out)["seconds"]
    film = cv2.VideoCapture(str(tmp_path / "film.avi"))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == pytest.approx(12.5 * seconds, abs=2)
    film.release()


def test_a_film_may_be_a_folder_of_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command(capsys, "run", "motions/spin_left", "--film", str(tmp_path / "frames"))
    pictures = sorted((tmp_path / "frames").iterdir())
    assert pictures[0].name == "00000.jpg"
    assert len(pictures) > 10
    assert command(capsys, "run", "greet", "--film", str(tmp_path / "frames")).code == 2  # not over what is there


def test_filming_changes_nothing_of_the_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, options in {"plain": [], "filmed": ["--film", str(tmp_path / "x.avi")]}.items():
        command(capsys, "run", "greet", "--eyes", "truth", "--events", str(tmp_path / name), *options)
    assert (tmp_path / "plain").read_bytes() == (tmp_path / "filmed").read_bytes()


def test_python_runs_missions_in_simulated_time_too() -> None:
    assert missions.run("motions/forward", simulate="fast").result == "success"


def test_manual_ticks_advance_simulated_time() -> None:
    with missions.load("motions/forward", robot="turtlebot2_arm", simulate="fast") as mission:
        statuses = [mission.tick()]
        while statuses[-1] is Status.RUNNING:
            statuses.append(mission.tick())
    assert statuses[-1] is Status.SUCCESS
    assert 40 < len(statuses) < 400


def test_endless_simulated_run_is_ended_by_until(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "deaf.yaml").write_text("mission: deaf\ntree:\n  sequence:\n    - listen: say anything\n")
    words = ("run", str(tmp_path / "deaf.yaml"), "--simulate", "fast")
    ended = command(capsys, *words, "--until", "90 s")
    assert ended.code == 130
    assert "interrupted after 90.0 s: still running after 90 s of simulated time: listen (line 4)" in ended.out
    assert "after 3600 s of simulated time" in command(capsys, *words).out
    assert (
        "--physics and --until are for simulated time"
        in command(capsys, *words, "--simulate", "wire", "--until", "1 h").err
    )
