"""Move files: how the columns of a spreadsheet become a movement of the joints.

A row of the sheet is a moment. A joint's angle comes out of a column, or out of three points of a body: it is the angle
at the middle one, 180 degrees where the three lie in a line. A point ``elbow`` is three columns, ``elbow_x``,
``elbow_y`` and ``elbow_z``, all in one unit of length::

    move: reach
    summary: A reach, as a camera saw it.
    sheet: reach.xlsx            # beside this file; .xls, .xlsx, .ods or .csv
    tab: Sheet1                  # the first of the workbook, where it is not given
    rate: 50 Hz                  # rows a second; not where there is a column `time` (s)
    unit: deg                    # of the columns of joints: rad, where it is not given
    dead_band: 0.3 deg           # smaller changes are no change: the step of the joint's servo, where it is not given
    joints:
      left_elbow: {column: L_ELBOW, sign: -1, offset: 90 deg}
      right_elbow: {points: [right_shoulder, right_elbow, right_wrist], sign: -1, offset: 180 deg}
      right_shoulder_roll: {points: [right_hip, right_shoulder, right_elbow], plane: yz}

What a column or three points give is multiplied by ``sign``, then ``offset`` is added. ``plane`` looks at the points
along the third axis, so that, say, only what lifts an arm sideways counts.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from config.diagnostics import InvalidFileError, SourceText
from config.fields import fields_of
from config.section_reader import add_mistakes, read_keys
from drivers.api.keys import KeyDiagnostic, inside, key, keys

Plane = Literal["xyz", "xy", "xz", "yz"]
"""The axes that count."""

POINTS_ERROR = "'{}' needs three points, such as [shoulder, elbow, wrist]"
"""What is said of points that are not three."""


@dataclass(frozen=True, slots=True)
class JointSource:
    """Where a joint's angle comes from: from ``column``, or from three ``points``; times ``sign``, plus ``offset``."""

    column: str = ""
    points: tuple[str, str, str] | None = None
    plane: Plane = "xyz"
    sign: int = 1
    offset: float = 0.0

    @property
    def headings(self) -> list[str]:
        """The columns that it is made of; of points, every axis that counts, one point after the other."""
        if self.points is None:
            return [self.column]
        return [f"{point}_{axis}" for point in self.points for axis in self.plane]


@keys
class SourceKeys:
    """Where a joint's angle comes from."""

    column: str | None = key(default=None, help="The column that it is.")
    points: tuple[str, ...] | None = key(
        default=None, wrong=POINTS_ERROR, help="Three points of a body: it is the angle at the middle one."
    )
    plane: Plane | None = key(default=None, help="The axes of the points that count; all, if not given.")
    sign: Literal["1", "-1"] = key(default="1", help="What it is multiplied by.")
    offset: float = key("angle", default=0.0, help="What is added then.")

    def source(self) -> JointSource:
        """Return where it comes from."""
        first, middle, last = self.points or ("", "", "")
        points = None if self.points is None else (first, middle, last)
        return JointSource(self.column or "", points, self.plane or "xyz", int(self.sign), self.offset)


@keys
class MoveKeys:
    """The keys of a move file."""

    move: str = key(help="What it is called.")
    summary: str = key(default="", help="What it is, in a line.")
    sheet: str = key(help="The spreadsheet beside this file: .xls, .xlsx, .ods or .csv.")
    tab: str | None = key(default=None, help="The sheet of the workbook; the first, if not given.")
    rate: float | None = key(
        "frequency", default=None, low=1.0, high=1000.0, help="Rows a second; not where there is a column `time` (s)."
    )
    unit: Literal["rad", "deg"] = key(default="rad", help="Of the columns of joints.")
    dead_band: float | None = key(
        "angle", default=None, low=0.0, help="Smaller changes are no change: the step of the servo, if not given."
    )
    joints: Mapping[str, Annotated[SourceKeys, inside(each="joint")]] = key(help="The joints that it moves.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield what moves nothing, and joints that come from nowhere, or from two."""
        if not self.joints:
            hint = "such as elbow: {column: elbow}"
            yield KeyDiagnostic("'joints' needs at least one joint", ("joints",), hint=hint, about=(("joints",),))
        for name, each in self.joints.items():
            at = ("joints", name)
            if (each.column is None) == (each.points is None):
                yield KeyDiagnostic(f"joint '{name}' needs either 'column' or 'points'", at, about=(at,))
            elif each.points is not None and not len(each.points) == 3 == len({*each.points}):
                points = (*at, "points")
                yield KeyDiagnostic(POINTS_ERROR.format("points"), points, about=(points,))
            if each.points is None and each.plane is not None:
                plane = (*at, "plane")
                yield KeyDiagnostic(
                    f"joint '{name}' has no key 'plane'", plane, marks_key=True, about=((*at, "column"),)
                )

    def unknown_joint_mistakes(self, joints: Collection[str]) -> Iterator[KeyDiagnostic]:
        """Yield joints that the robot lacks."""
        for name in self.joints:
            if name not in joints:
                at = ("joints", name)
                yield KeyDiagnostic(
                    f"there is no joint '{name}'",
                    at,
                    marks_key=True,
                    unknown_word=name,
                    known_words=joints,
                    about=((*at, ""),),
                )


@dataclass(frozen=True, slots=True)
class MoveConfig:
    """How a sheet becomes a movement. ``tab``, ``rate`` (Hz) and ``dead_band`` (rad) are None where not given."""

    name: str
    summary: str
    sheet: Path
    joints: Mapping[str, JointSource]
    tab: str | None = None
    rate: float | None = None
    degrees: bool = False
    dead_band: float | None = None


def is_move(source: SourceText) -> bool:
    """Say whether a text in YAML is a move file, rather than one of a gesture."""
    return re.search(r"^(move|sheet)\s*:", source.text, re.MULTILINE) is not None


def parse_move(source: SourceText, folder: Path, joints: Collection[str] | None = None) -> MoveConfig:
    """Read the text of a move file that lies in ``folder``; with ``joints``, it can move none but these.

    Raises InvalidFileError with every mistake in it.
    """
    fields = fields_of(source, subject="a move file")
    told = read_keys(fields, MoveKeys)
    if joints is not None:
        add_mistakes(fields, told.unknown_joint_mistakes(joints))
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    sources = {name: each.source() for name, each in told.joints.items()}
    sheet, degrees = folder / told.sheet, told.unit == "deg"
    return MoveConfig(told.move, told.summary, sheet, sources, told.tab, told.rate, degrees, told.dead_band)
