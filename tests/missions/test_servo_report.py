"""Movements in words, figures and pictures: what would be sent, and how well it was followed."""

import csv
import io
from math import radians
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from behaviours.joint_motion import JointSample, TrackingErrors
from drivers.api import Gesture, JointLimits, Keyframe
from missions.plugins.pictures.moves_plot import draw_move
from missions.plugins.setup.servo.movement_tables import (
    MAX_POSE_ROWS,
    error_table,
    plan_playback,
    pose_table,
    write_csv,
)

LIMITS = {"elbow": JointLimits(-1.0, 1.0, 2.0), "wrist": JointLimits(-2.0, 2.0, 1.0)}


@pytest.fixture(scope="module", autouse=True)
def fonts() -> None:
    """Have Matplotlib open its fonts before the tests: it keeps their files open."""
    FigureCanvasAgg(figure := Figure())
    figure.text(0.1, 0.1, "plain")
    figure.savefig(io.BytesIO())


def gesture(*frames: tuple[float, dict[str, float]]) -> Gesture:
    return Gesture("test", "", tuple(Keyframe(time, positions) for time, positions in frames))


def test_a_rehearsal_begins_at_the_first_pose_and_takes_the_times_of_the_file() -> None:
    playing = plan_playback(gesture((3.0, {"elbow": 0.1}), (5.0, {"elbow": 0.2, "wrist": 0.3})), LIMITS, 0.5)
    assert playing.duration == pytest.approx(4.0)
    assert playing.at(0.0) == {"elbow": 0.1, "wrist": 0.3}  # a joint that is named later stands there until then
    assert playing.at(4.0) == {"elbow": 0.2, "wrist": 0.3}


def test_a_rehearsal_is_slowed_as_the_joints_are() -> None:
    playing = plan_playback(gesture((0.1, {"wrist": -1.0}), (0.2, {"wrist": 1.0})), LIMITS, 1.0)
    assert playing.duration == pytest.approx(1.875 * 2.0 / 1.0)


def test_the_table_of_poses_has_degrees_in_columns() -> None:
    playing = plan_playback(gesture((1.0, {"elbow": radians(10)}), (2.5, {"elbow": radians(-5.04)})), LIMITS, 1.0)
    assert pose_table(playing) == "   s  elbow\n0.00   10.0\n1.50   -5.0"


def test_long_pose_table_is_thinned_and_keeps_its_end() -> None:
    frames = [(0.1 * (number + 1), {"elbow": 0.001 * number}) for number in range(500)]
    lines = pose_table(plan_playback(gesture(*frames), LIMITS, 1.0)).splitlines()
    assert len(lines) <= MAX_POSE_ROWS + 2
    assert lines[1].split()[0] == "0.00"
    assert lines[-1].split()[0] == "49.90"


def test_error_table_lists_errors_by_joint() -> None:
    tracking = TrackingErrors()
    tracking.add([JointSample(0.5, "elbow", 0.0, radians(3)), JointSample(0.5, "wrist", 0.0, 0.0)])
    tracking.add([JointSample(1.0, "elbow", radians(10), radians(6)), JointSample(1.0, "wrist", 0.0, 0.0)])
    assert error_table(tracking.errors()).splitlines()[1].split() == ["elbow", "3.54", "4.00", "1.00", "2"]


def test_the_csv_has_a_line_for_each_reading(tmp_path: Path) -> None:
    write_csv(tmp_path / "t.csv", [JointSample(0.25, "elbow", 0.5, 0.4)])
    with (tmp_path / "t.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row == {"time": "0.2500", "joint": "elbow", "goal": "0.50000", "position": "0.40000", "error": "-0.10000"}


GOALS = {joint: ([0.0, 1.0, 2.0], [0.0, 0.5, 0.2]) for joint in ("elbow", "wrist", "gripper")}


def test_a_picture_has_a_panel_for_each_joint(tmp_path: Path) -> None:
    path = tmp_path / "move.svg"
    draw_move(path, "wave", GOALS, LIMITS, measured={"elbow": ([0.0, 1.0], [0.1, 0.4])})
    axes = [each for each in ET.parse(path).iter() if each.get("id", "").startswith("axes_")]  # noqa: S314 - our own
    assert len(axes) == 4  # three joints in two columns: the fourth panel is empty


def test_png_plot_shows_the_goal_in_its_colour(tmp_path: Path) -> None:
    path = tmp_path / "move.png"
    draw_move(path, "wave", GOALS, {})
    picture = cv2.imread(str(path))
    assert picture is not None
    assert (np.abs(picture.astype(int) - (0xB5, 0x78, 0x2A)).max(axis=2) < 20).sum() > 100


def test_unsupported_picture_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"a picture ends in \.png or \.svg"):
        draw_move(tmp_path / "move.gif", "wave", GOALS, {})
