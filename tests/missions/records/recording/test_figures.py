"""What of a robot's state is told to people: rarely enough, only what is new, and where Foxglove expects it."""

from math import nan, pi, sqrt

import pytest

from drivers.api import BaseState, HeadPose, Pose2D, Quality, Reading, Velocity
from missions.executive.tick_record import Answer, TickRecord
from missions.plugins.records.recording.foxglove import Epoch, Json, camera_transform
from missions.plugins.records.recording.writer import PartStateMessage, StateSampler
from missions.plugins.testing.recorders import LeafTestBench
from perception.api import Gaze


def figures(*ticks: tuple[float, list[Answer]]) -> list[PartStateMessage]:
    follow = StateSampler(Epoch(0), (0.1, 0.0, 1.0))
    return [each for t, answers in ticks for each in follow.sample(TickRecord("tick", 1, t, 0.0, 0.0, answers))]


def state(t: float, heading: float = 0.0) -> Answer:
    return "base", "state", (), Reading(BaseState(Pose2D(t, 0.0, heading), Velocity(0.1, 0.0)), t, Quality.GOOD)


def drive(wanted: float, given: float) -> Answer:
    return "base", "drive", (Velocity(wanted, 0.0),), Velocity(given, 0.0)


def test_base_state_is_recorded_ten_times_a_second_if_new() -> None:
    ticks = [(tick / 50, [state(tick / 50)]) for tick in range(51)]
    told = [figure.t for figure in figures(*ticks) if figure.topic == "/state/base"]
    assert len(told) == 11
    assert [figure.topic for figure in figures((1.0, [state(1.0)]), (2.0, [state(1.0)]))].count("/state/base") == 1


def test_unchanged_pose_is_recorded_twice_a_second_and_a_change_at_once() -> None:
    poses = [HeadPose(0.1 if tick < 60 else 0.2, 0.0) for tick in range(75)]
    ticks: list[tuple[float, list[Answer]]] = [
        (tick / 50, [("head", "pose", (), Reading(pose, tick / 50, Quality.GOOD))]) for tick, pose in enumerate(poses)
    ]
    for topic in ("/state/head", "/tf"):
        told = [figure.t for figure in figures(*ticks) if figure.topic == topic]
        assert len(told) == 4
        assert told[-1] == 1.2


def test_requested_speed_lasts_as_long_as_its_command() -> None:
    told = figures(
        (1.0, [state(1.0), drive(0.5, 0.3)]), (1.2, [state(1.2)]), (1.4, [state(1.4)]), (1.5, [state(1.5), drive(1, 1)])
    )
    wanted = [
        (figure.data["requested_speed"], figure.data["given_speed"]) for figure in told if figure.topic == "/state/base"
    ]
    assert wanted == [(0.5, 0.3), (0.5, 0.3), (0.0, 0.0), (1, 1)]


def test_stop_resets_the_requested_speed() -> None:
    told = figures((1.0, [drive(0.5, 0.5), ("base", "stop", (None,), None), state(1.0)]))
    assert [figure.data["requested_speed"] for figure in told if figure.topic == "/state/base"] == [0.0]


def test_position_that_is_not_a_number_gives_no_frame() -> None:
    assert {figure.topic for figure in figures((1.0, [state(1.0, nan)]))} == {"/state/base"}


def test_head_state_includes_the_requested_pose() -> None:
    pose = Reading(HeadPose(0.1, 0.2), 1.0, Quality.GOOD)
    told = figures((1.0, [("head", "pose", (), pose), ("head", "look", (HeadPose(9.0, 0.0),), HeadPose(1.0, 0.0))]))
    (head,) = (figure.data for figure in told if figure.topic == "/state/head")
    assert (head["pan"], head["tilt"], head["requested_pan"], head["requested_tilt"]) == (0.1, 0.2, 1.0, 0.0)


def test_pose_of_another_head_gives_no_camera_frame() -> None:
    pose = Reading(HeadPose(0.1, 0.2), 1.0, Quality.GOOD)
    assert figures((1.0, [("lidar_mast", "pose", (), pose)])) == []


def test_joints_of_all_arms_are_recorded_together() -> None:
    bench = LeafTestBench()
    answers: list[Answer] = [(part, "states", (), bench.arm.states()) for part in ("arm", "right_arm")]
    (arms,) = figures((1.0, answers))
    joints = arms.data["joints"]
    assert isinstance(joints, dict)
    assert {"elbow", "right_arm.elbow"} <= joints.keys()


@pytest.mark.parametrize(
    ("gaze", "forward"),
    [(Gaze(0.0, 0.0), (1, 0, 0)), (Gaze(pi / 2, 0.0), (0, 1, 0)), (Gaze(0.0, pi / 4), (sqrt(0.5), 0, -sqrt(0.5)))],
)
def test_the_camera_looks_left_and_down_as_the_head_does(gaze: Gaze, forward: tuple[float, float, float]) -> None:
    turn = camera_transform({}, (0.0, 0.0, 1.0), gaze)["rotation"]
    assert isinstance(turn, dict)
    assert _forward(turn) == pytest.approx(forward)


def _forward(turn: Json) -> tuple[float, float, float]:
    """Return where a turned frame's x axis points: the first column of the matrix of a quaternion."""
    x, y, z, w = (float(str(turn[axis])) for axis in "xyzw")
    return 1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)
