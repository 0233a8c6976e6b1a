"""Leaves that walk, on the twin of a humanoid in simulated time."""

from pathlib import Path

from behaviours.run import DEAD_RECKONING_REASON
from missions.request import RunRequest
from missions.runner import Runner


def walked(tmp_path: Path, step: str) -> tuple[str, str]:
    mission = tmp_path / "m.yaml"
    mission.write_text(f"mission: m\ntree:\n  sequence:\n    - {step}\n")
    result = Runner(RunRequest(str(mission), robot="humanoid", simulate="fast", world="empty", eyes="truth")).run()
    return result.result, result.reason


def test_walk_in_a_curve_ends_after_its_distance(tmp_path: Path) -> None:
    ended = walked(tmp_path, "walk: {distance: 1 m, turn: 20 deg/s}\n      timeout: 20 s")
    assert ended == ("success", DEAD_RECKONING_REASON)


def test_walk_with_zero_velocity_fails(tmp_path: Path) -> None:
    result, reason = walked(tmp_path, "walk: {distance: 1 m, velocity: 0 m/s}")
    assert result == "failure"
    assert "the velocity is 0" in reason
