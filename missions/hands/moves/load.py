"""Movements out of files: a gesture, a spreadsheet of joint angles, or a sheet of which a move file says what it means.

A sheet alone has a column for every joint, headed by its name, in radians or with its unit behind it, and a row for
every moment; a column ``time`` (s), or the rate of the rows, says when they are. For all else: ``config.move``. Moves
of pypot and of dynamixel_workbench are read as such sheets.
"""

from pathlib import Path

from config.foreign import foreign_file
from config.gesture import gesture_of
from config.library import PLAYED, SHEETS, kinds_of
from config.marked import read_source
from config.move import JointSource, MoveConfig, is_move, move_of
from drivers.api import Gesture
from drivers.api.sections import ArmKeys
from missions.hands.moves.headings import TIME_NAMES, heading_of, joint_called
from missions.hands.moves.other_moves import sheet_of
from missions.hands.moves.rows import played, time_column
from missions.hands.moves.sheet import Sheet, read_sheet


def load_move(path: Path, *, rate: float | None = None, arm: ArmKeys | None = None) -> Gesture:
    """Read a movement. ``rate`` is that of a sheet's rows (Hz), where neither it nor its move file says when they are.

    With an ``arm``, it can move no other joints, and none beyond its limits; and what moves a joint by less than a step
    of its servo is no movement. Raises InvalidFileError with every mistake, at its line or its row and column.
    """
    if path.suffix.lower() in SHEETS:
        sheet = read_sheet(path)
        return played(sheet, _of_headings(sheet, path, arm), rate=rate, arm=arm)
    foreign = None if kinds_of(path) else foreign_file(path)
    if foreign is not None and foreign.form in PLAYED:
        sheet = sheet_of(path, foreign.form, arm)
        return played(sheet, _of_headings(sheet, path, arm, in_degrees=foreign.form == "pypot"), rate=None, arm=arm)
    source = read_source(path)
    if not is_move(source):
        return gesture_of(source, None if arm is None else arm.reaches).movement
    move = move_of(source, path.parent, None if arm is None else arm.reaches)
    return played(read_sheet(move.sheet, move.tab), move, rate=rate, arm=arm)


def _of_headings(sheet: Sheet, path: Path, arm: ArmKeys | None, *, in_degrees: bool = False) -> MoveConfig:
    """Take every column for a joint; a unit behind its name is that of its angles.

    Raises InvalidFileError for a unit that is none of an angle, and for two columns of one joint.
    """
    joints: dict[str, JointSource] = {}
    reaches = {} if arm is None else arm.reaches
    times = time_column(sheet)
    for heading, column in sheet.headings.items():
        name, unit = heading_of(heading, reaches)
        if heading == times:
            continue
        if unit not in ("", "deg", "rad") and name.lower() not in TIME_NAMES:
            hint = f"write '{name} (deg)' or '{name} (rad)', and its angles in that unit"
            sheet.fault(sheet.top, column, f"'{unit}' is not a unit of angle", hint)
        joint = (joint_called(name, reaches) or name) if unit in ("deg", "rad") else heading
        if joint in joints:
            sheet.fault(sheet.top, column, f"joint '{joint}' has a column already: '{joints[joint].column}'")
        joints[joint] = JointSource(column=heading)
    sheet.refuse()
    return MoveConfig(path.stem, sheet.remark, path, joints, degrees=in_degrees)
