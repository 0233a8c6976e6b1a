"""Movements as other programs keep them: pypot, dynamixel_workbench, RoboPlus. Each becomes a sheet."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from config.faults import Diagnostic, InvalidFileError, Mark, Source
from config.foreign import plain_data
from config.reading import read_regular
from drivers.api.sections import ArmKeys
from drivers.dynamixel.declared import DynamixelKeys
from missions.hands.moves.headings import TIME
from missions.hands.moves.sheet import Sheet

MAX_BYTES = 5_000_000

LAST = 1023
"""The highest step of the servos that RoboPlus moves."""


def sheet_of(path: Path, form: str, arm: ArmKeys | None) -> Sheet:
    """Return a movement as a sheet of its joints. Raises InvalidFileError for one that cannot be understood.

    pypot has degrees and speeds by motor and by seconds; dynamixel_workbench radians in the order of its joints;
    RoboPlus steps of servos by their IDs, which are joints of the ``arm``.
    """
    try:
        if form == "roboplus":
            frames = _roboplus(read_regular(path, MAX_BYTES).decode("latin-1"), arm)
        else:
            data = plain_data(path)
            frames = _pypot(data) if form == "pypot" else _workbench(data)
    except (OSError, ArithmeticError, ValueError, TypeError, LookupError, AttributeError) as error:
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
    rows = data["positions"]
    if isinstance(rows, list):  # as older versions keep them
        rows = {number / float(data["framerate"]): row for number, row in enumerate(rows)}
    found = {
        float(time): {motor: float(it[0] if isinstance(it, list) else it) for motor, it in motors.items()}
        for time, motors in rows.items()
    }
    return dict(sorted(found.items()))


def _workbench(data: Mapping[str, Any]) -> dict[float, dict[str, float]]:
    """Return radians by joint, by time (s) from the start."""
    joints, motion = data["joint"]["names"], data["motion"]
    steps = [motion[name] for name in motion["names"]]
    return {float(step["time_from_start"]): dict(zip(joints, map(float, step["step"]), strict=True)) for step in steps}


def _roboplus(text: str, arm: ArmKeys | None) -> dict[float, dict[str, float]]:
    """Return radians by joint, by time (s), of the one page of a motion file of RoboPlus.

    A step has a position for each ID from 0 on, how long it stays there, and how long it takes to get there (s).
    """
    if not isinstance(arm, DynamixelKeys):
        raise ValueError("its servos are told by their IDs: name a robot with Dynamixels (--robot FILE)")
    lines = [line.strip().partition("=") for line in text.splitlines()]
    used = next(([flag == "1" for flag in value.split()] for key, _, value in lines if key == "enable"), [])
    joints = {joint.id: (name, joint) for name, joint in arm.servos.items()}
    if missing := [number for number, on in enumerate(used) if on and number not in joints]:
        raise ValueError(f"no joint of the arm has the ID {' or '.join(map(str, missing))}, which it moves")
    frames: dict[float, dict[str, float]] = {}
    time = 0.0
    rate, steps = _page(lines)
    for step in steps:
        *places, pause, takes = (*step[:-2], step[-2] / rate, step[-1] / rate)
        pose = {}
        for number, place in enumerate(places[: len(used)]):
            if used[number]:
                name, joint = joints[number]
                if joint.kind.last != LAST:
                    raise ValueError(f"servo {number} is an {joint.model}: it has not the {LAST + 1} steps of an AX")
                if not 0 <= place <= joint.kind.last:
                    raise ValueError(f"servo {number}, an {joint.model}, has no step {place:g}")
                pose[name] = (joint.kind.angle(place) - joint.zero) * (-1 if joint.reverse else 1)
        time += takes
        frames[time] = pose
        if pause > 0:
            time += pause
            frames[time] = pose
    return frames


def _page(lines: list[tuple[str, str, str]]) -> tuple[float, list[list[float]]]:
    """Return how much faster it is played, and the steps, of the one page that has any.

    Raises ValueError for several pages, with their names.
    """
    pages: list[dict[str, Any]] = []
    for key, _, value in lines:
        if key == "page_begin":
            pages.append({"name": "", "rate": 1.0, "steps": []})
        elif key == "name" and pages:
            pages[-1]["name"] = value
        elif key == "play_param" and pages:  # the next page, the exit page, repeats, the rate, the inertia
            pages[-1]["rate"] = float(value.split()[3])
        elif key == "step" and pages:
            pages[-1]["steps"].append([float(number) for number in value.split()])
    moving = [page for page in pages if page["steps"]]
    if len(moving) != 1:
        names = ", ".join(f"'{page['name']}'" for page in moving[:10])
        raise ValueError(f"it has {len(moving)} pages ({names}): keep one of them in a copy of the file")
    if not 0.05 <= moving[0]["rate"] <= 20:
        raise ValueError(f"it is to be played {moving[0]['rate']:g} times as fast")
    return moving[0]["rate"], moving[0]["steps"]
