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
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from config.faults import InvalidFileError, Source, one_of
from config.fields import Fields, fields_of
from config.marked import Listing, Node, Scalar

Plane = Literal["xyz", "xy", "xz", "yz"]
"""The axes that count."""


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


def is_move(source: Source) -> bool:
    """Say whether a text in YAML is a move file, rather than one of a gesture."""
    return re.search(r"^(move|sheet)\s*:", source.text, re.MULTILINE) is not None


def move_of(source: Source, folder: Path, joints: Collection[str] | None = None) -> MoveConfig:
    """Read the text of a move file that lies in ``folder``; with ``joints``, it can move none but these.

    Raises InvalidFileError with every mistake in it.
    """
    fields = fields_of(source, what="a move file")
    move = MoveConfig(
        name=fields.text("move"),
        summary=fields.text("summary", ""),
        sheet=folder / fields.text("sheet"),
        tab=fields.text("tab", "") or None,
        rate=None if fields.node_of("rate") is None else fields.quantity("rate", "frequency", low=1.0, high=1000.0),
        degrees=fields.choice("unit", ["rad", "deg"], "rad") == "deg",
        dead_band=None if fields.node_of("dead_band") is None else fields.quantity("dead_band", "angle", low=0.0),
        joints=_sources(fields.section("joints", required=True), joints),
    )
    fields.done()
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return move


def _sources(section: Fields | None, known: Collection[str] | None) -> dict[str, JointSource]:
    if section is None:
        return {}
    found = {}
    for key, node in section.entries():
        if known is not None and key.text not in known:
            section.fault(key.mark, f"there is no joint '{key.text}'", one_of(key.text, known))
        found[key.text] = _source(Fields(section.source, node, section.faults, what=f"joint '{key.text}'"))
    if not found:
        section.fault(section.node.mark, "'joints' needs at least one joint", "such as elbow: {column: elbow}")
    return found


def _source(fields: Fields) -> JointSource:
    if isinstance(fields.node, Scalar | Listing):  # which is a fault already
        return JointSource()
    column, points = fields.text("column", ""), fields.items("points")
    listed = fields.node_of("points")
    if (fields.node_of("column") is None) == (listed is None):
        fields.fault(fields.node.mark, f"{fields.what} needs either 'column' or 'points'")
    source = JointSource(
        column,
        None if listed is None else _points(fields, listed, points),
        "xyz" if listed is None else _plane(fields),
        -1 if fields.choice("sign", ["1", "-1"], "1") == "-1" else 1,
        fields.quantity("offset", "angle", 0.0),
    )
    fields.done()
    return source


def _points(fields: Fields, listed: Node, nodes: list[Node]) -> tuple[str, str, str]:
    names = [node.text for node in nodes if isinstance(node, Scalar) and node.text]
    if len(names) == 3 == len(set(names)):
        return names[0], names[1], names[2]
    fields.fault(listed.mark, "'points' needs three points, such as [shoulder, elbow, wrist]")
    return "", "", ""


def _plane(fields: Fields) -> Plane:
    written = fields.choice("plane", get_args(Plane), "xyz")
    return next(plane for plane in get_args(Plane) if plane == written)
