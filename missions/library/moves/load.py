"""Movements from files: gestures, spreadsheets of joint angles, and move files that describe a spreadsheet.

A spreadsheet has a column for each joint, headed by its name, in radians or with its unit, and a row for each time. A
column ``time`` (s), or the rate of the rows, gives the times. For other forms see ``config.move``. Moves of pypot and
of dynamixel_workbench are read in the same way.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import acos, dist, radians
from pathlib import Path
from typing import Any

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText, closest, suggest_from
from config.file_io import read_regular
from config.foreign_files import read_plain_data, recognise_file
from config.gesture import limit_error, parse_gesture
from config.library import MOVEMENT_FORMS, SHEET_SUFFIXES, kinds_of
from config.move import JointSource, MoveConfig, is_move, parse_move
from config.yaml_nodes import read_source
from drivers.api import Gesture, Keyframe
from drivers.api.sections import ArmKeys
from drivers.servos.declared import DynamixelKeys
from missions.library.moves.sheet import (
    TIME_HEADING,
    TIME_NAMES,
    Sheet,
    find_joint,
    parse_heading,
    read_sheet,
    time_unit,
)

# Angles of limbs from points of a body by the law of cosines, to the resolution of a servo.

Point = tuple[float, ...]
"""Coordinates of a point of a body in one unit of length, in two or three dimensions."""

SAME_POINT_SHARE = 1e-9
"""Limit below which two points of a limb count as the same, as a share of the longer segment's length."""


def angle_at(before: Point, joint: Point, behind: Point) -> float:
    """Return the angle at ``joint`` between the points ``before`` and ``behind`` (rad), by the law of cosines.

    It is 0 for a folded limb, pi for a straight one. Raises ValueError if ``joint`` coincides with another point.
    """
    near, far, across = dist(joint, before), dist(joint, behind), dist(before, behind)
    if min(near, far) <= SAME_POINT_SHARE * max(near, far):
        raise ValueError("two of its points coincide")
    cosine = (near**2 + far**2 - across**2) / (2 * near * far)
    return acos(min(max(cosine, -1.0), 1.0))  # clamped, since rounding may exceed the range


def apply_dead_band(angles: Iterable[float], resolution: float) -> list[float]:
    """Return ``angles`` in which changes below ``resolution`` are replaced by the previous angle.

    So a servo does not oscillate with noise below its own resolution.
    """
    smoothed: list[float] = []
    for angle in angles:
        smoothed.append(angle if not smoothed or abs(angle - smoothed[-1]) >= resolution else smoothed[-1])
    return smoothed


# Movements of other programs (pypot, dynamixel_workbench, RoboPlus), converted to sheets.

MAX_FILE_BYTES = 5_000_000

MAX_AX_STEP = 1023
"""Highest position, in steps, of the Dynamixel AX servos that RoboPlus moves."""


def read_foreign_sheet(path: Path, form: str, arm: ArmKeys | None) -> Sheet:
    """Return a movement file of another program as a sheet with a column for each joint. Raises InvalidFileError.

    ``form`` is the program: pypot files have degrees and speeds by motor and time; dynamixel_workbench files have
    radians in the order of its joints; RoboPlus files have steps by servo ID, which need the joints of the ``arm``.
    """
    try:
        if form == "roboplus":
            frames = _roboplus(read_regular(path, MAX_FILE_BYTES).decode("latin-1"), arm)
        else:
            data = read_plain_data(path)
            frames = _pypot(data) if form == "pypot" else _workbench(data)
    except (OSError, ArithmeticError, ValueError, TypeError, LookupError, AttributeError) as error:
        raise InvalidFileError(
            [Diagnostic(SourceText(str(path), ""), Mark(), f"its frames cannot be parsed: {error}")]
        ) from error
    joints = list(dict.fromkeys(joint for frame in frames.values() for joint in frame))
    if not joints:
        raise InvalidFileError([Diagnostic(SourceText(str(path), ""), Mark(), "it has no frames")])
    sheet = Sheet(str(path), 1, headings={name: column for column, name in enumerate((TIME_HEADING, *joints), 1)})
    pose: dict[str, float] = {}
    for frame in reversed(frames.values()):  # a motor without a value yet has its first one
        pose = {**pose, **frame}
    for time, frame in frames.items():
        pose = {**pose, **frame}
        sheet.rows.append((1, [time, *(pose[joint] for joint in joints)]))
    return sheet


def _pypot(data: Mapping[str, Any]) -> dict[float, dict[str, float]]:
    """Return a pypot movement: for each time (s), the angle in degrees of each motor.

    In the file, a motor has its angle, or a list of angle and speed.
    """
    rows = data["positions"]
    if isinstance(rows, list):  # the form of older versions
        rows = {number / float(data["framerate"]): row for number, row in enumerate(rows)}
    found = {
        float(time): {motor: float(it[0] if isinstance(it, list) else it) for motor, it in motors.items()}
        for time, motors in rows.items()
    }
    return dict(sorted(found.items()))


def _workbench(data: Mapping[str, Any]) -> dict[float, dict[str, float]]:
    """Return a dynamixel_workbench movement as radians by joint, by time (s) from the start."""
    joints, motion = data["joint"]["names"], data["motion"]
    steps = [motion[name] for name in motion["names"]]
    return {float(step["time_from_start"]): dict(zip(joints, map(float, step["step"]), strict=True)) for step in steps}


def _roboplus(text: str, arm: ArmKeys | None) -> dict[float, dict[str, float]]:
    """Return radians by joint, by time (s), of the only page of a RoboPlus motion file.

    A step has a position for each ID from 0 on, its pause, and its duration (s).
    """
    if not isinstance(arm, DynamixelKeys):
        raise ValueError("its servos have only IDs: name a robot with Dynamixels (--robot FILE)")
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
                if joint.servo_model.last_tick != MAX_AX_STEP:
                    raise ValueError(
                        f"servo {number} is an {joint.model}: it does not have the {MAX_AX_STEP + 1} steps of an AX"
                    )
                if not 0 <= place <= joint.servo_model.last_tick:
                    raise ValueError(f"servo {number}, an {joint.model}, has no step {place:g}")
                pose[name] = (joint.servo_model.angle(place) - joint.zero) * (-1 if joint.reverse else 1)
        time += takes
        frames[time] = pose
        if pause > 0:
            time += pause
            frames[time] = pose
    return frames


def _page(lines: list[tuple[str, str, str]]) -> tuple[float, list[list[float]]]:
    """Return the playback rate and the steps of the only page with steps.

    Raises ValueError with the names if there are several pages.
    """
    pages: list[dict[str, Any]] = []
    for key, _, value in lines:
        if key == "page_begin":
            pages.append({"name": "", "rate": 1.0, "steps": []})
        elif key == "name" and pages:
            pages[-1]["name"] = value
        elif key == "play_param" and pages:  # values: next page, exit page, repeats, rate, inertia
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


# Rows of a sheet as keyframes: each column, or each three points of a body, becomes the angles of a joint.


def build_movement(sheet: Sheet, move: MoveConfig, *, rate: float | None, arm: ArmKeys | None) -> Gesture:
    """Return the movement of a ``sheet`` as its ``move`` file describes it.

    ``rate`` (Hz) is that of the rows, if neither sheet nor move file has times. With an ``arm``, its joints and limits
    are checked, and changes below the resolution of a servo are ignored. Raises InvalidFileError with all errors in the
    sheet.
    """
    _check_headings(sheet, move, arm)
    times = _times(sheet, move.rate or rate)
    joints = {joint: list(_angles(sheet, move, joint, source)) for joint, source in move.joints.items()}
    if not sheet.faults and arm is not None:
        for joint, angles in joints.items():
            _check_reach(sheet, joint, move, angles, arm)
    sheet.raise_faults()
    steady = [apply_dead_band(angles, _dead_band(move, joint, arm)) for joint, angles in joints.items()]
    poses = (dict(zip(joints, angles, strict=True)) for angles in zip(*steady, strict=True))
    keyframes = tuple(Keyframe(time, pose) for time, pose in zip(times, poses, strict=True))
    return Gesture(move.name, move.summary, keyframes, "cubic")


def _check_headings(sheet: Sheet, move: MoveConfig, arm: ArmKeys | None) -> None:
    """Raise InvalidFileError for missing columns, and for joints that the arm does not have."""
    for joint, source in move.joints.items():
        for heading in source.headings:
            if heading not in sheet.headings:
                what = f"there is no column '{heading}', of which joint '{joint}' is made"
                sheet.fault(sheet.heading_row, 1, what, suggest_from(heading, sheet.headings))
        if arm is not None and joint not in arm.ranges:
            column = sheet.headings.get(source.column, 1)
            sheet.fault(
                sheet.heading_row, column, f"there is no joint '{joint}'", _heading_hint(source.column or joint, arm)
            )
    if not move.joints:
        sheet.fault(sheet.heading_row, 1, "there is no column of a joint")
    _check_units(sheet, move)
    sheet.raise_faults()


def _check_units(sheet: Sheet, move: MoveConfig) -> None:
    """Report columns without a unit beside columns in degrees; they would be radians, which is unlikely."""
    columns = {joint: source.column for joint, source in move.joints.items() if source.points is None}
    units = {joint: parse_heading(column, move.joints).unit for joint, column in columns.items()}
    in_degrees = [joint for joint, unit in units.items() if unit == "deg"]
    for joint, column in columns.items():
        if in_degrees and not units[joint] and not move.degrees:
            hint = f"head it '{column} (deg)' or '{column} (rad)', as its angles are"
            what = f"'{column}' has no unit, and '{columns[in_degrees[0]]}' has degrees"
            sheet.fault(sheet.heading_row, sheet.headings.get(column, 1), what, hint)


def _heading_hint(heading: str, arm: ArmKeys) -> str:
    """Return a hint for an unknown heading of a column: the joint that it may mean, with the unit to write."""
    name, unit = parse_heading(heading)
    if name.lower() in TIME_NAMES:
        return "a column of times is headed 'time (s)' or 'time (ms)'"
    if name.endswith(("_x", "_y", "_z")):
        return "a move file says of which points a joint is made"
    if close := find_joint(name, arm.ranges) or closest(name, arm.ranges):
        if unit in ("deg", "rad"):
            return f"did you mean '{close} ({unit})'?"
        if name.lower().startswith(close.lower()) and not find_joint(name, arm.ranges):  # followed by a unit or type
            return f"a column of it is headed '{close} (deg)' or '{close} (rad)', and has its angles in that unit"
        return f"did you mean '{close}'? without a unit it has radians: '{close} (deg)' has degrees"
    return suggest_from(name, arm.ranges)


def _times(sheet: Sheet, rate: float | None) -> list[float]:
    """Return the times of a sheet's rows (s), the first at 0."""
    column = time_column(sheet)
    if not column:
        if rate is None:
            hint = "give the rate of its rows, or add a column 'time' (in seconds)"
            sheet.fault(sheet.heading_row, 1, "it has no times", hint)
        return [number / (rate or 1.0) for number in range(len(sheet.rows))]
    second = 1000.0 if time_unit(column) == "ms" else 1.0
    times, mistakes = [time / second for time in sheet.read_numbers(column)], len(sheet.faults)
    for (row, _), (before, time) in zip(sheet.rows[1:], pairwise(times), strict=True):
        if time <= before and not mistakes:
            sheet.fault(row, sheet.headings[column], f"{time:g} s is not later than the {before:g} s of the row before")
    return [time - times[0] for time in times]


def time_column(sheet: Sheet) -> str:
    """Return the heading of the time column; empty if there is none."""
    return next((heading for heading in sheet.headings if time_unit(heading)), "")


def _in_degrees(move: MoveConfig, source: JointSource) -> bool:
    """Return whether a column of a sheet is in degrees: by its heading, or else by the move file."""
    unit = parse_heading(source.column, move.joints).unit
    return unit == "deg" if unit in ("deg", "rad") else move.degrees


def _angles(sheet: Sheet, move: MoveConfig, joint: str, source: JointSource) -> Iterator[float]:
    """Yield the angles (rad) of a joint by row."""
    if source.points is None:
        unit = radians(1) if _in_degrees(move, source) else 1.0
        found = [unit * value for value in sheet.read_numbers(source.column)]
    else:
        found = _point_angles(sheet, joint, source)
    return (source.sign * angle + source.offset for angle in found)


def _point_angles(sheet: Sheet, joint: str, source: JointSource) -> list[float]:
    """Return the angle at the middle one of three points in each row; coinciding points are errors."""
    columns = [sheet.read_numbers(heading) for heading in source.headings]
    axes = len(source.plane)
    angles, problems = [], []
    for (row, _), *coordinates in zip(sheet.rows, *columns, strict=True):
        before, middle, behind = (tuple(coordinates[start : start + axes]) for start in (0, axes, 2 * axes))
        try:
            angles.append(angle_at(before, middle, behind))
        except ValueError as error:
            angles.append(0.0)
            problems.append((row, f"joint '{joint}': {error}"))
    if not sheet.faults:  # cells without a number have a substitute, which must not be checked as a point
        _report_problems(sheet, source, problems)
    return angles


def _check_reach(sheet: Sheet, joint: str, move: MoveConfig, angles: Sequence[float], arm: ArmKeys) -> None:
    """Report an error for each angle in a sheet beyond the joint's limits."""
    limits, source, hint = arm.ranges[joint], move.joints[joint], ""
    found = [(row, limit_error(joint, angle, limits)) for (row, _), angle in zip(sheet.rows, angles, strict=True)]
    if source.points is None and not _in_degrees(move, source):
        smaller = [radians(angle - source.offset) + source.offset for angle in angles]
        if not any(limit_error(joint, angle, limits) for angle in smaller):
            hint = f"are these degrees? then head the column '{joint} (deg)'"
    _report_problems(sheet, source, [(row, problem) for row, problem in found if problem], hint)


def _report_problems(sheet: Sheet, source: JointSource, problems: Sequence[tuple[int, str]], hint: str = "") -> None:
    """Report the first of a joint's ``problems`` (row and text) in a sheet, with the number of further rows."""
    if problems:
        row, problem = problems[0]
        others = len(problems) - 1
        more = f", and in {others} more {'row' if others == 1 else 'rows'}" if others else ""
        headings = source.headings  # the column, or the first one of the middle point
        sheet.fault(row, sheet.headings[headings[len(headings) // 3]], problem + more, hint)


def _dead_band(move: MoveConfig, joint: str, arm: ArmKeys | None) -> float:
    """Return the change of an angle (rad) below which a joint is not moved: as in the move file, else its resolution.

    It is 0 if both are unknown.
    """
    if move.dead_band is not None or arm is None:
        return move.dead_band or 0.0
    return arm.resolution(joint)


def load_move(path: Path, *, rate: float | None = None, arm: ArmKeys | None = None) -> Gesture:
    """Read a movement. ``rate`` (Hz) is that of a sheet's rows, if neither sheet nor move file has times.

    With an ``arm``, its joints and limits are checked, and changes below the resolution of a servo are ignored. Raises
    InvalidFileError with all errors, by line, or by row and column.
    """
    if path.suffix.lower() in SHEET_SUFFIXES:
        sheet = read_sheet(path)
        return build_movement(sheet, _config_from_headings(sheet, path, arm), rate=rate, arm=arm)
    foreign = None if kinds_of(path) else recognise_file(path)
    if foreign is not None and foreign.form in MOVEMENT_FORMS:
        sheet = read_foreign_sheet(path, foreign.form, arm)
        return build_movement(
            sheet, _config_from_headings(sheet, path, arm, in_degrees=foreign.form == "pypot"), rate=None, arm=arm
        )
    source = read_source(path)
    if not is_move(source):
        return parse_gesture(source, None if arm is None else arm.ranges).movement
    move = parse_move(source, path.parent, None if arm is None else arm.ranges)
    return build_movement(read_sheet(move.sheet, move.tab), move, rate=rate, arm=arm)


def _config_from_headings(sheet: Sheet, path: Path, arm: ArmKeys | None, *, in_degrees: bool = False) -> MoveConfig:
    """Return a move file for a sheet that has none: each column is a joint, in the unit of its heading.

    Without a unit, a column is in radians, or in degrees if ``in_degrees``. Raises InvalidFileError for other units
    than those of angles, and for two columns of one joint.
    """
    joints: dict[str, JointSource] = {}
    reaches = {} if arm is None else arm.ranges
    times = time_column(sheet)
    for heading, column in sheet.headings.items():
        name, unit = parse_heading(heading, reaches)
        if heading == times:
            continue
        if unit not in ("", "deg", "rad") and name.lower() not in TIME_NAMES:
            hint = f"write '{name} (deg)' or '{name} (rad)', and its angles in that unit"
            sheet.fault(sheet.heading_row, column, f"'{unit}' is not a unit of angle", hint)
        joint = (find_joint(name, reaches) or name) if unit in ("deg", "rad") else heading
        if joint in joints:
            sheet.fault(sheet.heading_row, column, f"joint '{joint}' has a column already: '{joints[joint].column}'")
        joints[joint] = JointSource(column=heading)
    sheet.raise_faults()
    return MoveConfig(path.stem, sheet.remark, path, joints, degrees=in_degrees)
