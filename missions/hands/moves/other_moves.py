"""Movements as other programs keep them: pypot's moves, and those of dynamixel_workbench. Each becomes a sheet."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from config.faults import Diagnostic, InvalidFileError, Mark, Source
from config.foreign import plain_data
from missions.hands.moves.headings import TIME
from missions.hands.moves.sheet import Sheet


def sheet_of(path: Path, form: str) -> Sheet:
    """Return a movement as a sheet of its joints. Raises InvalidFileError for one that cannot be understood.

    pypot has degrees and speeds by motor and by seconds; dynamixel_workbench radians in the order of its joints.
    """
    data = plain_data(path)
    try:
        frames = _pypot(data) if form == "pypot" else _workbench(data)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InvalidFileError(
            [Diagnostic(Source(str(path), ""), Mark(), f"its frames cannot be understood: {error}")]
        ) from error
    joints = list(dict.fromkeys(joint for frame in frames.values() for joint in frame))
    if not joints:
        raise InvalidFileError([Diagnostic(Source(str(path), ""), Mark(), "there is no frame in it")])
    sheet = Sheet(str(path), 1, headings={name: column for column, name in enumerate((TIME, *joints), 1)})
    pose: dict[str, float] = {}
    for frame in reversed(frames.values()):  # a motor that is named later stands there until then
        pose = {**pose, **frame}
    for time, frame in frames.items():
        pose = {**pose, **frame}
        sheet.rows.append((1, [time, *(pose[joint] for joint in joints)]))
    return sheet


def _pypot(data: Mapping[str, Any]) -> dict[float, dict[str, float]]:
    """Return degrees by motor, by time (s): a motor has its angle, or its angle and its speed."""
    found = {
        float(time): {motor: float(it[0] if isinstance(it, list) else it) for motor, it in motors.items()}
        for time, motors in data["positions"].items()
    }
    return dict(sorted(found.items()))


def _workbench(data: Mapping[str, Any]) -> dict[float, dict[str, float]]:
    """Return radians by joint, by time (s) from the start."""
    joints, motion = data["joint"]["names"], data["motion"]
    steps = [motion[name] for name in motion["names"]]
    return {float(step["time_from_start"]): dict(zip(joints, map(float, step["step"]), strict=True)) for step in steps}
