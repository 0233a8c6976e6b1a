"""What was learnt of a robot's delays outlives the run, and a file that is damaged or of another robot does no harm."""

import json
import os
from pathlib import Path

import pytest

from config.robot import RobotConfig
from missions.assembly.learnt_delays import MAX_LAG_SIGMA, MIN_SAMPLES, LearntDelays, delays_file
from missions.library.drivers import load_robot

ROBOT = "robot: {}\nbase: {{driver: kobuki, port: /dev/kobuki}}\ncamera: {{delay: 20 ms}}\n"


@pytest.fixture(autouse=True)
def state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


@pytest.fixture
def rodney(tmp_path: Path) -> RobotConfig:
    return robot(tmp_path)


def robot(folder: Path, name: str = "rodney", *, more: str = "") -> RobotConfig:
    path = folder / "robot.yaml"
    path.write_text(ROBOT.format(json.dumps(name)) + more)
    return load_robot(path)


def learn(
    config: RobotConfig,
    *,
    camera: float | None = None,
    base: float | None = None,
    spread: float = 0.003,
    times: int = MIN_SAMPLES,
) -> None:
    """A run in which one or both delays were learnt."""
    lags = LearntDelays(config, simulated=False)
    if camera is not None:
        lags.delay.seconds, lags.delay.spread, lags.delay.informative_pairs = camera, spread, times
    if base is not None:
        lags.lag.seconds, lags.lag.spread, lags.lag.reports = base, spread, times
    lags.save()


def known(config: RobotConfig) -> tuple[float, float | None]:
    """What the next run begins with: the delay of the camera, and the lag of the base if that is more than a guess."""
    lags = LearntDelays(config, simulated=False)
    return lags.delay.seconds, lags.lag.seconds if lags.lag.learnt else None


def test_learnt_delays_are_used_by_the_next_run(rodney: RobotConfig) -> None:
    assert known(rodney) == (0.02, None)
    learn(rodney, camera=0.042)
    assert known(rodney) == (0.042, None)
    learn(rodney, base=0.19)
    assert known(rodney) == (0.042, 0.19), "a run that learns one keeps the other"
    learn(rodney, camera=-0.01)
    assert known(rodney) == (-0.01, 0.19)


def test_learnt_delays_apply_only_to_their_robot_file(tmp_path: Path, rodney: RobotConfig) -> None:
    learn(rodney, camera=0.042, base=0.19)
    assert known(robot(tmp_path, more="voice: {}\n")) == (0.02, None)
    assert known(robot(tmp_path, "another")) == (0.02, None)
    assert known(robot(tmp_path)) == (0.042, 0.19)


def test_no_name_leads_out_of_the_folder(tmp_path: Path) -> None:
    elsewhere = robot(tmp_path, "../../elsewhere/rodney")
    learn(elsewhere, camera=0.05)
    assert known(elsewhere) == (0.05, None)
    assert not (tmp_path / "elsewhere").exists()
    assert [path.parent for path in tmp_path.rglob("*.json")] == [delays_file("rodney").parent]


def test_uncertain_delays_are_not_stored(rodney: RobotConfig) -> None:
    learn(rodney, camera=0.042, base=0.19, spread=2 * MAX_LAG_SIGMA)
    learn(rodney, camera=0.042, base=0.19, times=MIN_SAMPLES - 1)
    assert not delays_file("rodney").exists()


def test_implausible_or_distrusted_delay_is_not_stored(rodney: RobotConfig) -> None:
    for camera in (-0.098, -0.07, 0.26):
        learn(rodney, camera=camera)
    for name, value in (("jitter", 0.02), ("is_distrusted", True)):
        lags = LearntDelays(rodney, simulated=False)
        lags.delay.seconds, lags.delay.spread, lags.delay.informative_pairs = 0.042, 0.003, MIN_SAMPLES
        setattr(lags.delay, name, value)
        lags.save()
    assert not delays_file("rodney").exists()


def test_distrusted_stored_delay_is_dropped(rodney: RobotConfig) -> None:
    learn(rodney, camera=0.042, base=0.19)
    lags = LearntDelays(rodney, simulated=False)
    lags.delay.is_distrusted = True
    lags.save()
    assert known(rodney) == (0.02, 0.19)


def test_impossible_stored_delay_is_ignored(rodney: RobotConfig) -> None:
    learn(rodney, camera=0.042, base=0.19)
    text = delays_file("rodney").read_text()
    delays_file("rodney").write_text(text.replace("0.042", "-0.0931"))
    assert known(rodney) == (0.02, 0.19)


def test_delay_of_another_camera_is_neither_used_nor_stored(rodney: RobotConfig) -> None:
    learn(rodney, camera=0.042, base=0.19)
    lags = LearntDelays(rodney, simulated=False, other_camera=True)
    assert (lags.delay.seconds, lags.lag.seconds) == (0.0, 0.19)
    lags.delay.seconds, lags.delay.spread, lags.delay.informative_pairs = 0.11, 0.003, MIN_SAMPLES
    lags.save()
    assert known(rodney) == (0.042, 0.19)


def test_a_simulated_robot_neither_takes_nor_keeps(rodney: RobotConfig) -> None:
    learn(rodney, camera=0.042, base=0.19)
    before = delays_file("rodney").read_bytes()
    lags = LearntDelays(rodney, simulated=True)
    assert (lags.delay.seconds, lags.lag.learnt) == (0.02, False)
    lags.delay.spread, lags.delay.informative_pairs = 0.001, MIN_SAMPLES
    lags.save()
    assert delays_file("rodney").read_bytes() == before


def test_damaged_delays_file_is_ignored(rodney: RobotConfig) -> None:
    learn(rodney, camera=0.042)
    of = json.loads(delays_file("rodney").read_text())["robot_file"]
    values = ('"x"', "9.0", "NaN", "Infinity", "-1e999", "true", "null", "[0.01]", "{}", "1" * 500)
    damaged = [f'{{"robot_file": "{of}", "camera": {value}, "base": {value}}}' for value in values]
    for text in ("", "{", "[]", "7", "\x00" * 5000, "[" * 900, '{"camera": 0.1, "base": 0.1}', *damaged):
        delays_file("rodney").write_text(text)
        assert known(rodney) == (0.02, None), text
    delays_file("rodney").unlink()
    os.mkfifo(delays_file("rodney"))
    assert known(rodney) == (0.02, None), "a pipe, which nobody waits for"
