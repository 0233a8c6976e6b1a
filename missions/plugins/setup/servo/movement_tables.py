"""Tables of movements: planned poses, and measured errors."""

import csv
from collections.abc import Mapping, Sequence
from io import StringIO
from math import degrees
from pathlib import Path

from behaviours.joint_motion import JointError, JointSample
from behaviours.keyframe_playback import KeyframeMotion, lay_out
from config.file_io import save_file
from drivers.api import Gesture, JointLimits, Keyframe
from missions.cli.printable import format_columns

MAX_POSE_ROWS = 40
"""Maximum number of rows of a pose table; of a longer movement, evenly spaced rows are shown."""

CSV_COLUMNS = ("time", "joint", "goal", "position", "error")
"""Columns of a played movement as CSV: seconds, a joint name, and radians. One line for each reading of each joint."""


def plan_playback(movement: Gesture, limits: Mapping[str, JointLimits], speed: float) -> KeyframeMotion:
    """Return the playback of a gesture at ``speed`` times its own speed, starting with its first pose.

    ``limits`` must contain all its joints. The motion to the first pose is not included, since it depends on the
    present pose.
    """
    start: dict[str, float] = {}
    for frame in movement.keyframes:
        start = {**frame.positions, **start}  # a joint holds its first position until its first keyframe
    first = movement.keyframes[0].time
    frames = [Keyframe(frame.time - first, frame.positions) for frame in movement.keyframes]
    speeds = {joint: limits[joint].speed for joint in start}
    return lay_out(start, frames, speeds, pace=speed, interpolation=movement.interpolation)


def pose_table(playing: KeyframeMotion) -> str:
    """Return a table of the joint angles of a movement, in degrees, with at most about ``MAX_POSE_ROWS`` rows."""
    times = list(dict.fromkeys(playing.times))
    step = max(1, -(-len(times) // MAX_POSE_ROWS))
    shown = times if step == 1 else [*times[:-1:step], times[-1]]
    rows = [[f"{time:.2f}", *(f"{degrees(angle) + 0.0:.1f}" for angle in playing.at(time).values())] for time in shown]
    return format_columns(("s", *playing.joints), rows)


def error_table(errors: Mapping[str, JointError]) -> str:
    """Return a table of the tracking errors of each joint, in degrees."""
    rows = [
        [joint, f"{degrees(each.rms):.2f}", f"{degrees(each.worst):.2f}", f"{each.at:.2f}", str(each.readings)]
        for joint, each in errors.items()
    ]
    return format_columns(("joint", "rms deg", "worst deg", "at s", "readings"), rows, left=frozenset({"joint"}))


def write_csv(path: Path, samples: Sequence[JointSample]) -> None:
    """Write the readings of a played movement to a CSV file, a line for each reading of each joint.

    ``CSV_COLUMNS`` lists the columns. Raises OSError.
    """
    text = StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(CSV_COLUMNS)
    for each in samples:
        figures = (each.goal, each.position, each.error)
        writer.writerow([f"{each.time:.4f}", each.joint, *(f"{figure:.5f}" for figure in figures)])
    save_file(path, text.getvalue())
