"""Gaits out of files and into files: gait files, and spreadsheets of the angles of both legs in radians."""

import csv
import json
from collections.abc import Sequence
from io import StringIO
from math import degrees
from pathlib import Path

import numpy as np

from config.gait import load_gait
from config.library import SHEETS
from config.robot import RobotConfig
from drivers.api import JointLimits
from drivers.errors import BadRequest
from drivers.legs.body import SIDES, Body, Floats, body_of
from drivers.legs.checking import mistakes
from drivers.legs.declared import LegsKeys, StrideKeys
from drivers.legs.gait import Gait, of_keys, splined
from drivers.legs.kinematics import forward, sole
from drivers.servos.declared import DynamixelKeys
from missions.library.moves.load import load_move

LEVEL = 0.01
"""Radians by which a sole of a spreadsheet may tilt: gaits have level ones."""

TOUCHING = 0.0005
"""Metres above the lower sole within which the other one of a spreadsheet is on the floor too."""

TIME = "time"


class Walker:
    """A robot with legs, as gaits see it. Raises BadRequest for a robot without."""

    def __init__(self, robot: RobotConfig) -> None:
        keys, arm = robot.keys(LegsKeys), robot.arm
        if keys is None or arm is None:
            raise BadRequest(f"robot '{robot.name}' has no legs", hint="a gait needs a base of `driver: legs`")
        self.arm = arm
        self.body: Body = body_of(keys.body)
        self.stride: StrideKeys = keys.stride
        self.limits: dict[str, JointLimits] = dict(arm.limits)
        servos = arm.servos if isinstance(arm, DynamixelKeys) else {}
        self.torques = {name: servo.kind.stall_torque * servo.torque for name, servo in servos.items()}

    def mistakes(self, gait: Gait) -> list[str]:
        """Return what this robot cannot do of a gait."""
        return [f"{gait.name}: {each}" for each in mistakes(self.body, gait, self.limits, self.torques)]

    def load(self, path: Path) -> Gait:
        """Read a gait. Raises InvalidFileError for mistakes in a file, BadRequest for what is no gait of the robot."""
        if path.suffix.lower() in SHEETS:
            return self._of_sheet(path)
        return of_keys(load_gait(path), self.body, self.stride)

    def _of_sheet(self, path: Path) -> Gait:
        """Take a spreadsheet for one cycle, whose last row is the first one again."""
        move = load_move(path)
        known = set(self.arm.limits)
        if strange := sorted({joint for frame in move.keyframes for joint in frame.positions} - known):
            raise BadRequest(f"{path}: there is no joint '{strange[0]}'", hint="a column is headed by its joint")
        times = np.array([frame.time for frame in move.keyframes])
        if len(times) < 4:
            raise BadRequest(f"{path}: a cycle needs more than three rows")
        poses, now = [], dict.fromkeys(self.body.joints, 0.0)
        for frame in move.keyframes[:-1]:
            now |= frame.positions
            poses.append(self.body.pose(now))
        placed = forward(self.body, np.array(poses))
        feet, headings = np.empty((len(poses), 2, 3)), np.empty((len(poses), 2))
        for number, side in enumerate(SIDES):
            feet[:, number], turned = sole(self.body, placed, side)
            tilt = np.arccos(np.clip(turned[:, 2, 2], -1.0, 1.0))
            if tilt.max() > LEVEL:
                at = times[int(tilt.argmax())] - times[0]
                told = f"the {side} sole is not level, {degrees(tilt.max()):.1f} deg at {at:.2f} s"
                raise BadRequest(f"{path}: {told}", hint="play it as a movement: mission servo play")
            headings[:, number] = np.arctan2(turned[:, 1, 0], turned[:, 0, 0])
        on = feet[..., 2] - feet[..., 2].min(axis=1, keepdims=True) < TOUCHING
        period = float(times[-1] - times[0])
        return splined(path.stem, period, (times[:-1] - times[0]) / period, feet, headings, on)

    def table(self, times: Floats, angles: Floats) -> str:
        """Return a spreadsheet of the legs (.csv): a column of times (s), and one for each joint (rad)."""
        out = StringIO()
        lines = csv.writer(out, lineterminator="\n")
        lines.writerow([TIME, *self.body.walking])
        for time, row in zip(times.tolist(), angles.tolist(), strict=True):
            lines.writerow([f"{time:.4f}", *(f"{angle:.6f}" for angle in row)])
        return out.getvalue()


def written(gait: Gait, name: str) -> str:
    """Return a gait file of points."""
    lines = [f"gait: {json.dumps(name)}", f"period: {gait.period:.6g} s", "points:"]
    for place in range(len(gait.feet)):
        left, right = (_vector(gait.feet[place, number].tolist()) for number in (0, 1))
        turns = [f"{degrees(each):.4f} deg" for each in gait.headings[place].tolist()]
        on = "both" if gait.on[place].all() else "left" if gait.on[place, 0] else "right"
        at = 100 * place / len(gait.feet)
        ends = f"left_turn: {turns[0]}, right_turn: {turns[1]}, on: {on}"
        lines.append(f"  - {{at: {at:g} %, left: {left}, right: {right}, {ends}}}")
    return "\n".join(lines) + "\n"


def _vector(place: Sequence[float]) -> str:
    return "[" + ", ".join(f"{1000 * each:.3f} mm" for each in place) + "]"
