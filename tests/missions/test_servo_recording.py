"""A movement made by hand becomes keyframes that say the same, and no more than the servos can measure."""

from collections.abc import Callable, Mapping
from math import cos, pi, radians
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.keyframe_playback import lay_out
from config.yaml_writer import gesture_text
from drivers.api import JointState, Quality, Reading
from drivers.errors import BadRequest, NoReply
from missions.library.moves.load import load_move
from missions.library.moves.record import JointRecording, thin_out

STEP = radians(300) / 1024
RATE = 50.0


def seen(
    positions: Mapping[str, float], stamp: float, quality: Quality = Quality.GOOD
) -> dict[str, Reading[JointState]]:
    return {
        joint: Reading(JointState(position, 0.0, None, 0.0, 12.0, 30.0, moving=False, torque=False), stamp, quality)
        for joint, position in positions.items()
    }


def measured(angle: float) -> float:
    """What a servo makes of an angle: a whole number of its steps."""
    return round(angle / STEP) * STEP


def recorded(movement: Callable[[float], Mapping[str, float]], seconds: float, *, still: float = 0.0) -> JointRecording:
    """A movement as it is recorded, with the arm still for a while before and behind."""
    recording: JointRecording | None = None
    for number in range(round((seconds + 2 * still) * RATE) + 1):
        now = number / RATE
        positions = movement(min(max(now - still, 0.0), seconds))
        recording = recording or JointRecording(dict.fromkeys(positions, STEP))
        recording.add(seen({joint: measured(angle) for joint, angle in positions.items()}, 10 + now), 10 + now)
    assert recording is not None
    return recording


def waving(time: float) -> Mapping[str, float]:
    """To and fro with the elbow, to one side with the wrist; for 4 s, from rest to rest."""
    return {"elbow": 0.4 * (1 - cos(pi * time)), "wrist": 0.6 * (1 - cos(pi * time / 4))}


def test_playback_matches_the_recording_within_servo_resolution(tmp_path: Path) -> None:
    gesture = recorded(waving, 4.0, still=1.0).gesture("wave", "Wave.")
    path = tmp_path / "wave.yaml"
    path.write_text(gesture_text(gesture))
    move = load_move(path)
    assert move.interpolation == "cubic"
    assert len(move.keyframes) < 0.4 * 4.0 * RATE
    playing = lay_out(move.keyframes[0].positions, move.keyframes, {"elbow": 9.0, "wrist": 9.0}, interpolation="cubic")
    cut = 0.06  # the last reading before it was seen to move
    off = [
        abs(playing.at(time)[joint] - angle)
        for time in np.arange(0.0, playing.duration, 0.01).tolist()
        for joint, angle in waving(cut + time).items()
    ]
    assert max(off) < 3 * STEP


def test_the_stillness_before_and_behind_is_cut_off() -> None:
    recording = recorded(waving, 4.0, still=3.0)
    assert recording.seconds == pytest.approx(10.0)
    assert recording.gesture("wave").keyframes[-1][0] == pytest.approx(4.0, abs=0.15)


def test_a_movement_at_one_speed_is_two_keyframes() -> None:
    gesture = recorded(lambda time: {"wrist": 0.5 * time}, 2.0).gesture("turn")
    assert [positions for _, positions in gesture.keyframes] == [{"wrist": 0.0}, {"wrist": measured(1.0)}]


@pytest.mark.parametrize("movement", [lambda _: {"elbow": 0.3}, lambda time: {"elbow": STEP * (round(time * 7) % 2)}])
def test_to_and_fro_between_two_steps_is_no_movement(movement: Callable[[float], Mapping[str, float]]) -> None:
    with pytest.raises(BadRequest, match="no joint moved"):
        recorded(movement, 2.0).gesture("still")


def test_silent_joint_ends_the_recording() -> None:
    recording = JointRecording({"elbow": STEP, "wrist": STEP})
    recording.add(seen({"elbow": 0.0, "wrist": 0.0}, 1.0), 1.0)
    recording.add(seen({"elbow": 0.1, "wrist": 0.1}, 1.1), 1.1)
    states = {**seen({"elbow": 0.2}, 1.3), **seen({"wrist": 0.1}, 1.1, Quality.STALE)}
    recording.add(states, 1.3)
    with pytest.raises(NoReply, match=r"^wrist: no reading for 0\.30 s, 0\.1 s after the recording began"):
        recording.add(states, 1.4)
    assert len(recording.snapshots) == 2


def test_joint_that_never_reports_ends_the_recording() -> None:
    recording = JointRecording({"elbow": STEP})
    recording.add(seen({"elbow": 0.0}, 0.0, Quality.STALE), 5.0)
    with pytest.raises(NoReply, match="elbow"):
        recording.add(seen({"elbow": 0.0}, 0.0, Quality.STALE), 5.3)


def test_repeated_reading_is_recorded_once() -> None:
    recording = JointRecording({"elbow": STEP})
    for _ in range(3):
        recording.add(seen({"elbow": 0.0}, 1.0), 1.0)
    assert len(recording.snapshots) == 1


@given(st.lists(st.lists(st.integers(-50, 50), min_size=2, max_size=2), min_size=2, max_size=60))
def test_thinning_misses_no_reading_by_more_than_a_step(places: list[list[int]]) -> None:
    table, steps = np.array(places, dtype=float) * STEP, np.array([STEP, STEP])
    times = np.arange(len(places)) / RATE
    kept = thin_out(times, table, steps)
    assert (kept[0], kept[-1]) == (0, len(places) - 1)
    between = np.column_stack([np.interp(times, times[kept], table[kept, joint]) for joint in range(2)])
    assert np.abs(between - table).max() <= STEP * 1.000001
