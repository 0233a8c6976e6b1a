"""What is changed of a robot while it runs: within its file's bounds, obeyed, and kept in the file on request."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from math import radians
from pathlib import Path
from typing import Any

import pytest

from config.library import find_file
from drivers.api import ZERO_VELOCITY, BaseLimits, BaseState, HeadPose, JointLimits, Limitable, Pose2D, Velocity
from drivers.errors import BadRequest
from missions.control import sockets
from missions.control.command_handler import TunableValues
from missions.control.commands import BadMessage
from missions.request import RunRequest
from missions.runner import Runner
from tests.browser import Browser
from tests.missions.command import Process
from tests.missions.studio.page import Page
from tests.missions.studio.serving import Client, Served
from tests.waiting import wait_until

WAITING = (
    "mission: waiting\ntree:\n  sequence:\n    - wait: 1000 s\n"
    "    - drive: 1 m\n    - look: {pan: 0 deg}\n    - gesture: hello\n"
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A robot file of somebody's own."""
    path = tmp_path / "mine.yaml"
    path.write_text(find_file("robots", "turtlebot2_arm").read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "waiting.yaml").write_text(WAITING, encoding="utf-8")
    return path


@pytest.fixture
def runner(file: Path) -> Runner:
    return Runner(RunRequest(str(file.with_name("waiting.yaml")), robot=str(file), simulate="fast"))


@pytest.fixture
def tuning(runner: Runner) -> TunableValues:
    return TunableValues(runner.config, runner.assembled_robot.devices)


def knobs(told: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    return {each["name"]: each for each in told["knobs"]}


def test_trims_speeds_and_the_limits_of_joints_may_be_changed(tuning: TunableValues) -> None:
    found = knobs(tuning.as_dict())
    assert {"base.max_speed", "base.max_turn", "head.speed", "head.pan.trim", "head.tilt.trim"} <= set(found)
    assert found["arm.joints.elbow.upper"]["value"] == pytest.approx(radians(130))
    assert len(found) == 5 + 10 * 3
    assert not any(each["tuned"] for each in found.values())


def test_tuned_base_stays_within_the_new_speed(tuning: TunableValues, runner: Runner) -> None:
    base = runner.assembled_robot.devices["base"]
    assert isinstance(base, Limitable)
    told = tuning.tune("base.max_speed", 0.2)
    assert (told["value"], told["tuned"]) == (0.2, True)
    assert base.limits == BaseLimits(0.2, base.limits.turn, 0.5, radians(200))
    runner.assembled_robot.open()
    state = BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY)
    assert base._mux.request(Velocity(0.5, 0.0), 0.0, state) == Velocity(0.2, 0.0)  # type: ignore[attr-defined]
    tuning.tune("base.max_speed", 0.5)
    assert base.limits.speed == 0.5


def test_tuned_arm_stays_within_the_new_limits(tuning: TunableValues, runner: Runner) -> None:
    arm: Any = runner.assembled_robot.devices["arm"]
    tuning.tune("arm.joints.elbow.upper", radians(60))
    tuning.tune("arm.joints.elbow.speed", radians(30))
    arm.open()
    accepted = arm.move({"elbow": radians(100), "wrist_bend": radians(50)})
    assert accepted["elbow"] == pytest.approx(radians(60))
    assert accepted["wrist_bend"] == pytest.approx(radians(50))
    assert arm.limits["elbow"].speed == pytest.approx(radians(30))
    tuning.tune("arm.joints.elbow.upper", radians(130))
    assert arm.move({"elbow": radians(100)})["elbow"] == pytest.approx(radians(100))


def test_a_head_turns_more_slowly_at_once_and_does_not_leap(runner: Runner, tuning: TunableValues) -> None:
    head: Any = runner.assembled_robot.devices["head"]
    way, now = head._motion, 0.0
    way.look(HeadPose(radians(60), 0.0), now)
    places = []
    for step in range(1, 400):
        now = step * 0.005
        if step == 60:
            fast = way._profiles[0].velocity
            tuning.tune("head.speed", radians(12))
        places.append(way.advance(now)[0].angle)
    speeds = [(after - before) / 0.005 for before, after in pairwise(places)]
    assert fast > radians(90)
    assert max(abs(b - a) for a, b in pairwise(speeds)) < radians(400) * 0.0051
    assert speeds[-1] == pytest.approx(radians(12))


def test_nothing_goes_beyond_the_robot_file(tuning: TunableValues, runner: Runner) -> None:
    for name, value in (
        ("base.max_speed", 0.6),
        ("base.max_speed", 0.0),
        ("head.pan.trim", radians(50)),
        ("arm.joints.elbow.upper", radians(140)),
    ):
        with pytest.raises(BadMessage, match=f"{name}: .* is not within"):
            tuning.tune(name, value)
    tuning.tune("arm.joints.elbow.lower", radians(90))
    with pytest.raises(BadMessage, match="are outside of"):
        tuning.tune("arm.joints.elbow.upper", radians(80))
    with pytest.raises(BadMessage, match=r"unknown value 'head\.pan\.trimm'"):
        tuning.tune("head.pan.trimm", 0.0)
    base: Any = runner.assembled_robot.devices["base"]
    assert base.restrict_limits(replace(base.limits, speed=9.0)).speed == 0.5
    with pytest.raises(BadRequest, match="positive"):
        base.restrict_limits(replace(base.limits, speed=-1.0))
    arm: Any = runner.assembled_robot.devices["arm"]
    with pytest.raises(BadRequest, match="elbow"):
        arm.restrict_limits({"elbow": JointLimits(1.0, 0.5, 1.0)})


@contextmanager
def running(file: Path) -> Iterator[str]:
    """Run the mission that waits on a simulated robot of one's own, until this is over."""
    process = Process(
        "run", str(file.with_name("waiting.yaml")), "--robot", str(file), "--simulate", "fast", "--speed", "1"
    )
    try:
        run = str(process.process.pid)
        wait_until(lambda: sockets.socket_path(run).exists())
        yield run
    finally:
        process.process.terminate()
        process.end()


def test_tuned_values_are_written_to_the_robot_file_with_comments_kept(served: Served, file: Path) -> None:
    before = file.read_text(encoding="utf-8")
    with running(file) as run, served.client(served.operator) as client:
        for name, value in (
            ("head.tilt.trim", radians(-3)),
            ("base.max_speed", 0.25),
            ("arm.joints.elbow.upper", radians(120)),
        ):
            assert tuned(client, run, name, value)["ok"]
        told = client.ask("keep_tuning", run=run)
        assert told["result"] == {
            "file": str(file),
            "changes": [
                "base: max_speed: 0.25 m/s",
                "head: tilt: trim: -3 deg",
                "arm: joints: elbow: limits: [0 deg, 120 deg]",
            ],
        }
    wanted = before.replace("max_speed: 0.5 m/s", "max_speed: 0.25 m/s")
    wanted = wanted.replace("tilt: {servo: 1", "tilt: {trim: -3 deg, servo: 1")
    assert file.read_text(encoding="utf-8") == wanted.replace("limits: [0 deg, 130 deg]", "limits: [0 deg, 120 deg]")


def test_head_is_trimmed_on_the_page_and_written_to_the_file(browser: Browser, served: Served, file: Path) -> None:
    with running(file):
        page = Page(browser, served, view="#robot")
        page.wait_for("mine", "Base", "elbow", "Trims and limits")
        assert not page.enabled("Write to the robot file")
        typed = "const e = document.querySelector('[aria-label=\"head pan trim in °\"]'); e.value = '4'; "
        page.tab.evaluate(typed + "e.dispatchEvent(new Event('change'))")
        page.press("Write to the robot file")
        page.wait_for("Wrote to", "head: pan: trim: 4 deg")
    assert "pan: {trim: 4 deg, servo: 0" in file.read_text(encoding="utf-8")


def tuned(client: Client, run: str, name: str, value: float) -> Mapping[str, Any]:
    def there() -> bool:
        return any(each["run"] == run for each in client.hear(lambda told: told["say"] == "runs")["runs"])

    answer = client.ask("tune", run=run, name=name, value=value)
    while answer.get("error") == "no_such_run":
        there()
        answer = client.ask("tune", run=run, name=name, value=value)
    return answer
