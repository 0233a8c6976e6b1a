"""Missions in physics: a humanoid walks, whatever pushes it falls, and who has no body is told so."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from drivers.errors import BadRequest
from drivers.sim.rigid.stick_drawing import LEFT
from missions.cli.root import mission
from missions.plugins.testing.mission_run import MissionRun, run_mission
from missions.request import RunRequest
from missions.runner import Runner

WALK = "mission: stroll\ntree:\n  walk: {distance: 0.2 m, velocity: 0.2 m/s}\n"
PUSHED = "world: rough\nphysics: {friction: 0.7, pushes: [{at: 2 s, speed: 2 m/s, towards: 90 deg}]}\n"


def walked(folder: Path, *, world: str | None = None, seed: int = 0) -> MissionRun:
    (folder / "stroll.yaml").write_text(WALK)
    if world is not None:
        (folder / "rough.yaml").write_text(world)
        world = str(folder / "rough.yaml")
    mission = str(folder / "stroll.yaml")
    return run_mission(mission, robot="humanoid", world=world, seed=seed, eyes="truth", physics=True, timeout="15 s")


def test_humanoid_walks_reproducibly_in_physics(tmp_path: Path) -> None:
    ran = walked(tmp_path)
    assert ran.result == "success", ran.reason
    assert ran.pose is not None
    assert ran.pose.x == pytest.approx(0.2, abs=0.07)
    assert abs(ran.pose.y) < 0.1
    assert walked(tmp_path).pose == ran.pose


@pytest.mark.parametrize(("robot", "at"), [("humanoid", 2), ("op3", 4)])
def test_hard_push_makes_the_robot_fall(tmp_path: Path, robot: str, at: int) -> None:
    (tmp_path / "stroll.yaml").write_text(WALK.replace("0.2 m,", "1 m,"))
    (tmp_path / "rough.yaml").write_text(PUSHED.replace("2 s", f"{at} s"))
    order = RunRequest(
        str(tmp_path / "stroll.yaml"),
        robot=robot,
        simulate="fast",
        world=str(tmp_path / "rough.yaml"),
        eyes="truth",
        physics=True,
    )
    result = Runner(order).run()
    assert (result.result, result.reason) == ("failure", "the base is stopped: it has fallen")


SQUARE = """
tests: walk_square
with: {robot: humanoid, world: empty, eyes: truth, params: {side: 10 cm}}
cases:
  - case: a small square
    expect:
      result: success
      ran: {walk: 4, turn_in_place: 4}
      pose: {near: [0 m, 0 m], within: 0.2 m, heading: 360 deg +- 30 deg}
      base: stopped
      faults: []
"""


@pytest.mark.usefixtures("here")
def test_shipped_mission_walks_a_square_in_physics(tmp_path: Path) -> None:
    (tmp_path / "square.test.yaml").write_text(SQUARE)
    said = CliRunner().invoke(mission, ["test", str(tmp_path / "square.test.yaml"), "--physics", "-j", "1"])
    assert said.exit_code == 0, said.output


def test_film_of_a_physics_run_shows_the_body(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.sim.rigid.body_camera._has_egl", lambda: False)  # lines are the same on every machine
    (tmp_path / "stand.yaml").write_text("mission: stand\ntree:\n  wait: 0.3 s\n")
    run = ["run", str(tmp_path / "stand.yaml"), "--robot", "humanoid", "--simulate", "fast", "--physics"]
    ran = CliRunner().invoke(mission, [*run, "--film", str(tmp_path / "film")])
    assert ran.exit_code == 0, ran.output
    pictures = [np.asarray(cv2.imread(str(path)), np.uint8) for path in sorted((tmp_path / "film").iterdir())]
    assert len(pictures) == pytest.approx(0.3 * 12.5, abs=1)
    body = pictures[0][:, : pictures[0].shape[1] * 3 // 7]
    assert (np.abs(body.astype(int) - LEFT).max(axis=2) < 20).mean() > 0.005


def test_a_robot_without_a_body_has_no_physics(tmp_path: Path) -> None:
    (tmp_path / "stroll.yaml").write_text("mission: stroll\ntree:\n  drive: 10 cm\n")
    with pytest.raises(BadRequest, match="no body that could fall"):
        Runner(RunRequest(str(tmp_path / "stroll.yaml"), robot="turtlebot2", simulate="fast", physics=True))


def test_physics_are_for_simulated_time() -> None:
    said = CliRunner().invoke(mission, ["run", "walk_square", "--robot", "op3", "--physics"])
    assert said.exit_code == 2
    assert "--simulate fast" in said.output
