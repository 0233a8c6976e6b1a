"""Reader of move files: each says how the columns of a spreadsheet become a movement of joints."""

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
"""Axes (x, y, z) of the coordinates from which a joint's angle is computed."""

POINTS_ERROR = "'{}' needs three points, such as [shoulder, elbow, wrist]"
"""Error message for a value of ``points`` that is not three points."""


@dataclass(frozen=True, slots=True)
class JointSource:
    """Columns that give a joint's angle: one ``column``, or the coordinates of three ``points`` that enclose it.

    The angle is multiplied by ``sign``, and ``offset`` is added.
    """

    column: str = ""
    points: tuple[str, str, str] | None = None
    plane: Plane = "xyz"
    sign: int = 1
    offset: float = 0.0

    @property
    def headings(self) -> list[str]:
        """Headings of the columns that are read; for points, one per axis of ``plane``, point by point."""
        if self.points is None:
            return [self.column]
        return [f"{point}_{axis}" for point in self.points for axis in self.plane]


@keys
class SourceKeys:
    """Keys in a move file of one joint: the columns that give its angle."""

    column: str | None = key(default=None, help="Column with the angle.")
    points: tuple[str, ...] | None = key(
        default=None, wrong=POINTS_ERROR, help="Three points of a body, for the angle at the middle one."
    )
    plane: Plane | None = key(default=None, help="Axes of the points that count; all by default.")
    sign: Literal["1", "-1"] = key(default="1", help="Factor of the angle.")
    offset: float = key("angle", default=0.0, help="Angle added after the factor.")

    def source(self) -> JointSource:
        """Return a ``JointSource`` with the values of these keys: the columns that give the angle of a joint."""
        first, middle, last = self.points or ("", "", "")
        points = None if self.points is None else (first, middle, last)
        return JointSource(self.column or "", points, self.plane or "xyz", int(self.sign), self.offset)


@keys
class MoveKeys:
    """Keys of a move file, which says how the columns of a spreadsheet become a movement of joints."""

    move: str = key(help="Name.")
    summary: str = key(default="", help="Description in a line.")
    sheet: str = key(help="Spreadsheet beside this file: .xls, .xlsx, .ods or .csv.")
    tab: str | None = key(default=None, help="Sheet of the workbook; the first by default.")
    rate: float | None = key(
        "frequency", default=None, low=1.0, high=1000.0, help="Rows per second, unless there is a column `time` (s)."
    )
    unit: Literal["rad", "deg"] = key(default="rad", help="Unit of the joint columns.")
    dead_band: float | None = key(
        "angle", default=None, low=0.0, help="Changes below this are ignored; by default the step of the servo."
    )
    joints: Mapping[str, Annotated[SourceKeys, inside(each="joint")]] = key(help="Joints of the movement.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for a missing joint, and for each joint with no column or points, or with both."""
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
        """Yield an error for each joint that the robot does not have."""
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
    """Mapping from a spreadsheet to a movement of joints.

    ``tab`` is the name of the spreadsheet's tab, None for the first. ``rate`` (Hz) and ``dead_band`` (rad) are None if
    the file does not set them.
    """

    name: str
    summary: str
    sheet: Path
    joints: Mapping[str, JointSource]
    tab: str | None = None
    rate: float | None = None
    degrees: bool = False
    dead_band: float | None = None


def is_move(source: SourceText) -> bool:
    """Return True if a YAML text is a move file rather than a gesture file."""
    return re.search(r"^(move|sheet)\s*:", source.text, re.MULTILINE) is not None


def parse_move(source: SourceText, folder: Path, joints: Collection[str] | None = None) -> MoveConfig:
    """Return the move in a text; its sheet is in ``folder``, and ``joints`` are the only permitted joints.

    Raises InvalidFileError with all errors.
    """
    fields = fields_of(source, subject="a move file")
    parsed = read_keys(fields, MoveKeys)
    if joints is not None:
        add_mistakes(fields, parsed.unknown_joint_mistakes(joints))
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    sources = {name: each.source() for name, each in parsed.joints.items()}
    sheet, degrees = folder / parsed.sheet, parsed.unit == "deg"
    return MoveConfig(parsed.move, parsed.summary, sheet, sources, parsed.tab, parsed.rate, degrees, parsed.dead_band)
