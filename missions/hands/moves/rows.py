"""The rows of a sheet as keyframes: every column, or every three points of a body, becomes the angles of a joint."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import radians

from config.faults import closest, one_of
from config.gesture import beyond
from config.move import JointSource, MoveConfig
from drivers.api import Gesture, Keyframe
from drivers.api.sections import ArmKeys
from missions.hands.moves.headings import TIME_NAMES, heading_of, joint_called, time_unit
from missions.hands.moves.limbs import angle_at, steadied
from missions.hands.moves.sheet import Sheet


def played(sheet: Sheet, move: MoveConfig, *, rate: float | None, arm: ArmKeys | None) -> Gesture:
    """Return the movement that ``move`` makes of ``sheet``. Raises InvalidFileError with every mistake in the sheet.

    ``rate`` and ``arm`` as for ``missions.hands.moves.load.load_move``.
    """
    _check_headings(sheet, move, arm)
    times = _times(sheet, move.rate or rate)
    joints = {joint: list(_angles(sheet, move, joint, source)) for joint, source in move.joints.items()}
    if not sheet.faults and arm is not None:
        for joint, angles in joints.items():
            _check_reach(sheet, joint, move, angles, arm)
    sheet.refuse()
    steady = [steadied(angles, _dead_band(move, joint, arm)) for joint, angles in joints.items()]
    poses = (dict(zip(joints, angles, strict=True)) for angles in zip(*steady, strict=True))
    keyframes = tuple(Keyframe(time, pose) for time, pose in zip(times, poses, strict=True))
    return Gesture(move.name, move.summary, keyframes, "cubic")


def _check_headings(sheet: Sheet, move: MoveConfig, arm: ArmKeys | None) -> None:
    """Raise InvalidFileError for columns that are asked for and not there, and for joints that the arm lacks."""
    for joint, source in move.joints.items():
        for heading in source.headings:
            if heading not in sheet.headings:
                what = f"there is no column '{heading}', of which joint '{joint}' is made"
                sheet.fault(sheet.top, 1, what, one_of(heading, sheet.headings))
        if arm is not None and joint not in arm.reaches:
            column = sheet.headings.get(source.column, 1)
            sheet.fault(sheet.top, column, f"there is no joint '{joint}'", _meant(source.column or joint, arm))
    if not move.joints:
        sheet.fault(sheet.top, 1, "there is no column of a joint")
    _check_units(sheet, move)
    sheet.refuse()


def _check_units(sheet: Sheet, move: MoveConfig) -> None:
    """Note columns without a unit beside others in degrees: they would be radians, and hardly are."""
    columns = {joint: source.column for joint, source in move.joints.items() if source.points is None}
    units = {joint: heading_of(column, move.joints).unit for joint, column in columns.items()}
    in_degrees = [joint for joint, unit in units.items() if unit == "deg"]
    for joint, column in columns.items():
        if in_degrees and not units[joint] and not move.degrees:
            hint = f"head it '{column} (deg)' or '{column} (rad)', as its angles are"
            what = f"'{column}' has no unit, and '{columns[in_degrees[0]]}' has degrees"
            sheet.fault(sheet.top, sheet.headings.get(column, 1), what, hint)


def _meant(heading: str, arm: ArmKeys) -> str:
    """Return which joint a heading may mean, with its unit: without one its angles would be radians."""
    name, unit = heading_of(heading)
    if name.lower() in TIME_NAMES:
        return "a column of times is headed 'time (s)' or 'time (ms)'"
    if name.endswith(("_x", "_y", "_z")):
        return "a move file says of which points a joint is made"
    if close := joint_called(name, arm.reaches) or closest(name, arm.reaches):
        if unit in ("deg", "rad"):
            return f"did you mean '{close} ({unit})'?"
        if name.lower().startswith(close.lower()) and not joint_called(name, arm.reaches):  # a unit or kind behind it
            return f"a column of it is headed '{close} (deg)' or '{close} (rad)', and has its angles in that unit"
        return f"did you mean '{close}'? without a unit it has radians: '{close} (deg)' has degrees"
    return one_of(name, arm.reaches)


def _times(sheet: Sheet, rate: float | None) -> list[float]:
    """Return when each row is (s), the first at 0."""
    column = time_column(sheet)
    if not column:
        if rate is None:
            hint = "give the rate of its rows, or add a column 'time' (in seconds)"
            sheet.fault(sheet.top, 1, "it does not say when its rows are", hint)
        return [number / (rate or 1.0) for number in range(len(sheet.rows))]
    second = 1000.0 if time_unit(column) == "ms" else 1.0
    times, mistakes = [time / second for time in sheet.numbers(column)], len(sheet.faults)
    for (row, _), (before, time) in zip(sheet.rows[1:], pairwise(times), strict=True):
        if time <= before and not mistakes:
            sheet.fault(row, sheet.headings[column], f"{time:g} s is not later than the {before:g} s of the row before")
    return [time - times[0] for time in times]


def time_column(sheet: Sheet) -> str:
    """Return the heading of the column of times; empty without one."""
    return next((heading for heading in sheet.headings if time_unit(heading)), "")


def _in_degrees(move: MoveConfig, source: JointSource) -> bool:
    """Say whether a column has degrees: as its heading says, else the move file."""
    unit = heading_of(source.column, move.joints).unit
    return unit == "deg" if unit in ("deg", "rad") else move.degrees


def _angles(sheet: Sheet, move: MoveConfig, joint: str, source: JointSource) -> Iterator[float]:
    """Yield the angles (rad) of a joint, row by row."""
    if source.points is None:
        unit = radians(1) if _in_degrees(move, source) else 1.0
        found = [unit * value for value in sheet.numbers(source.column)]
    else:
        found = _bends(sheet, joint, source)
    return (source.sign * angle + source.offset for angle in found)


def _bends(sheet: Sheet, joint: str, source: JointSource) -> list[float]:
    """Return the angle at the middle one of three points in every row; a limb without length is a fault."""
    columns = [sheet.numbers(heading) for heading in source.headings]
    axes = len(source.plane)
    angles, problems = [], []
    for (row, _), *coordinates in zip(sheet.rows, *columns, strict=True):
        before, middle, behind = (tuple(coordinates[start : start + axes]) for start in (0, axes, 2 * axes))
        try:
            angles.append(angle_at(before, middle, behind))
        except ValueError as error:
            angles.append(0.0)
            problems.append((row, f"joint '{joint}': {error}"))
    if not sheet.faults:  # a cell without a number has one by now, and is no point
        _note(sheet, source, problems)
    return angles


def _check_reach(sheet: Sheet, joint: str, move: MoveConfig, angles: Sequence[float], arm: ArmKeys) -> None:
    """Note angles beyond the joint's limits."""
    limits, source, hint = arm.reaches[joint], move.joints[joint], ""
    found = [(row, beyond(joint, angle, limits)) for (row, _), angle in zip(sheet.rows, angles, strict=True)]
    if source.points is None and not _in_degrees(move, source):
        smaller = [radians(angle - source.offset) + source.offset for angle in angles]
        if not any(beyond(joint, angle, limits) for angle in smaller):
            hint = f"are these degrees? then head the column '{joint} (deg)'"
    _note(sheet, source, [(row, problem) for row, problem in found if problem], hint)


def _note(sheet: Sheet, source: JointSource, problems: Sequence[tuple[int, str]], hint: str = "") -> None:
    """Note the first problem of a joint, and how many more rows have one: where one has, mostly many do."""
    if problems:
        row, problem = problems[0]
        others = len(problems) - 1
        more = f", and so in {others} more {'row' if others == 1 else 'rows'}" if others else ""
        headings = source.headings  # the column, or the first of the middle point
        sheet.fault(row, sheet.headings[headings[len(headings) // 3]], problem + more, hint)


def _dead_band(move: MoveConfig, joint: str, arm: ArmKeys | None) -> float:
    """Return the change (rad) below which a joint is not moved."""
    if move.dead_band is not None or arm is None:
        return move.dead_band or 0.0
    return arm.step(joint)
