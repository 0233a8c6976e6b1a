"""Recorded movements: played after a slow run-in, measured against what was asked, and recorded in the first place."""

from itertools import pairwise
from pathlib import Path

import pytest

from behaviours.joint_motion import GOAL_LEAD_TIME, RUN_IN_SPEED, JointError
from behaviours.keyframe_playback import PEAK_SPEED_FACTORS, Play, RecordMove
from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from config.gesture import load_gesture
from drivers.api import Gesture as Movement
from drivers.api import Keyframe
from missions.library.moves.record import NewMoveFile
from missions.plugins.testing.recorders import HOLD, LeafTestBench
from tests.behaviours.servo_arm import TICK, ServoArm, moves, play, tick, with_servos

RISE = Movement(
    "rise", "", tuple(Keyframe(0.1 * n, {"elbow": 1.0 + 0.03 * n, "shoulder": 0.5}) for n in range(21)), "cubic"
)
RUN_IN_TIME = PEAK_SPEED_FACTORS["cubic"] * 1.0 / RUN_IN_SPEED


def playing(bench: LeafTestBench, movement: Movement = RISE, **arguments: object) -> Play:
    return bench.put(Play("play"), move=movement, **arguments)


# --- play ------------------------------------------------------------------------------------------------------------


def test_play_move_runs_in_slowly_and_then_keeps_its_times() -> None:
    bench, servos = with_servos()
    leaf = playing(bench)
    took = play(bench, leaf)
    assert leaf.status is SUCCESS
    assert took == pytest.approx(RUN_IN_TIME + 2.0, abs=3 * TICK)
    told = [move["elbow"] for move in moves(servos)]
    run_in = told[: round((RUN_IN_TIME - GOAL_LEAD_TIME) / TICK)]
    assert max(there - here for here, there in pairwise(run_in)) <= RUN_IN_SPEED * TICK + 1e-9


def test_play_move_at_half_speed_takes_twice_as_long_after_the_run_in() -> None:
    bench, _ = with_servos()
    assert play(bench, playing(bench, speed=0.5)) == pytest.approx(RUN_IN_TIME + 4.0, abs=3 * TICK)


def test_play_move_stores_tracking_errors_by_joint() -> None:
    bench, servos = with_servos()
    servos.short = 0.02
    leaf = playing(bench)
    play(bench, leaf)
    assert isinstance(leaf.result, dict)
    error = leaf.result["elbow"]
    assert isinstance(error, JointError)
    assert 0.005 < error.rms <= error.worst < 0.05
    assert RUN_IN_TIME <= error.at <= RUN_IN_TIME + 2.0
    assert error.readings == pytest.approx(2.0 / TICK, abs=3)
    assert leaf.result["shoulder"].worst == pytest.approx(0.02, abs=0.005)


def test_run_in_is_excluded_from_tracking_errors() -> None:
    bench, _ = with_servos()
    leaf = playing(bench)
    tick(bench, leaf, RUN_IN_TIME - 2 * TICK)
    assert leaf.tracking.samples == []


def test_a_pause_is_no_tracking_error() -> None:
    bench, _ = with_servos()
    leaf = playing(bench)
    tick(bench, leaf, RUN_IN_TIME + 1.0)
    bench.arm.hold()
    bench.clock.advance(30.0)
    play(bench, leaf)
    assert isinstance(leaf.result, dict)
    assert leaf.result["elbow"].worst < 0.08


def test_a_movement_beyond_the_limits_fails_before_anything_moves() -> None:
    bench = LeafTestBench()
    leaf = playing(bench, Movement("low", "", (Keyframe(0.0, {"elbow": 0.1}), Keyframe(1.0, {"elbow": -0.1})), "cubic"))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "elbow at -5.7 deg is outside its limits (0 deg to 126.1 deg)"
    assert bench.arm.commands == []


def test_play_move_fails_if_a_joint_does_not_arrive() -> None:
    bench, servos = with_servos()
    servos.stuck = {"elbow"}
    leaf = playing(bench)
    play(bench, leaf)
    assert leaf.status is FAILURE
    assert leaf.reason == "rise: elbow did not arrive"
    assert leaf.result is None
    assert servos.commands[-1] == (HOLD, "elbow", "shoulder")


# --- record ----------------------------------------------------------------------------------------------------------


def recording(bench: LeafTestBench, path: Path, **arguments: object) -> RecordMove:
    return bench.put(RecordMove("record_move"), move=NewMoveFile(str(path)), **arguments)


def bend(bench: LeafTestBench, servos: ServoArm, leaf: RecordMove, seconds: float = 1.0) -> None:
    """Turn the elbow by hand at 1 rad/s."""
    for step in range(round(seconds / TICK)):
        servos.turn_by_hand("elbow", step * TICK)
        assert bench.tick(leaf, after=TICK) is RUNNING


def test_halted_recording_is_written_and_playable(tmp_path: Path) -> None:
    bench, servos = with_servos()
    leaf = recording(bench, tmp_path / "lift", joints=("elbow",))
    bend(bench, servos, leaf)
    assert list(tmp_path.iterdir()) == []
    assert bench.halt(leaf)
    found = load_gesture(tmp_path / "lift.yaml")
    assert (found.name, found.interpolation) == ("lift", "cubic")
    assert found.joints == {"elbow"}
    assert found.keyframes[-1][1]["elbow"] == pytest.approx(0.95, abs=0.01)
    assert found.keyframes[-1][0] == pytest.approx(0.95, abs=0.1)
    assert servos.commands == []


def test_recording_succeeds_after_its_duration(tmp_path: Path) -> None:
    bench, servos = with_servos()
    leaf = recording(bench, tmp_path / "lift.yaml", duration=1.0)
    bend(bench, servos, leaf)
    assert bench.tick(leaf, after=TICK) is SUCCESS
    assert leaf.result == str(tmp_path / "lift.yaml")
    assert load_gesture(tmp_path / "lift.yaml").joints == {"elbow", "shoulder"}


def test_recording_does_not_overwrite_a_file(tmp_path: Path) -> None:
    bench, _ = with_servos()
    (tmp_path / "lift.yaml").write_text("mine", encoding="utf-8")
    leaf = recording(bench, tmp_path / "lift")
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == f"{tmp_path / 'lift.yaml'} already exists: remove it, or choose another name"
    assert (tmp_path / "lift.yaml").read_text(encoding="utf-8") == "mine"


def test_recording_does_not_overwrite_a_file_created_meanwhile(tmp_path: Path) -> None:
    bench, servos = with_servos()
    leaf = recording(bench, tmp_path / "lift", duration=1.0)
    bend(bench, servos, leaf)
    (tmp_path / "lift.yaml").write_text("mine", encoding="utf-8")
    assert bench.tick(leaf, after=TICK) is FAILURE
    assert "cannot be written" in leaf.reason
    assert (tmp_path / "lift.yaml").read_text(encoding="utf-8") == "mine"


def test_recording_into_a_missing_folder_fails(tmp_path: Path) -> None:
    bench, servos = with_servos()
    leaf = recording(bench, tmp_path / "none" / "lift", duration=0.5)
    bend(bench, servos, leaf, 0.5)
    assert bench.tick(leaf, after=TICK) is FAILURE
    assert "cannot be written" in leaf.reason


def test_recording_without_motion_writes_no_file(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bench, _ = with_servos()
    leaf = recording(bench, tmp_path / "still")
    tick(bench, leaf, 1.0)
    assert bench.halt(leaf)
    assert list(tmp_path.iterdir()) == []
    assert "no joint moved during the recording" in caplog.text


def test_recording_fails_without_a_file_if_joints_fall_silent(tmp_path: Path) -> None:
    bench, servos = with_servos()
    leaf = recording(bench, tmp_path / "lift")
    bend(bench, servos, leaf)
    servos.silent = {"elbow"}
    assert tick(bench, leaf, 1.0) is FAILURE
    assert "elbow: no reading for" in leaf.reason
    assert list(tmp_path.iterdir()) == []


def test_recording_of_unknown_joints_fails(tmp_path: Path) -> None:
    bench, _ = with_servos()
    leaf = recording(bench, tmp_path / "lift", joints=("elbo",))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "the arm has no joint or group 'elbo' (did you mean 'elbow'?)"


@pytest.mark.parametrize(
    ("name", "file"), [("a", "a.yaml"), ("a.b", "a.b.yaml"), ("a.yml", "a.yml"), (" a ", "a.yaml")]
)
def test_new_move_name_becomes_a_file_name(name: str, file: str) -> None:
    assert NewMoveFile(name).path == Path(file)


@pytest.mark.parametrize("name", ["", " ", "/", "."])
def test_invalid_move_file_name_is_refused(name: str) -> None:
    with pytest.raises(LookupError, match="needs the name of a new file"):
        NewMoveFile(name)
