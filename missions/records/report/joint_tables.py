"""How joints kept to their goals, as tables: on a page, on a terminal, and for other programs."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields

from missions.records.recording.export import cell
from missions.records.report.joints import JointFigures, all_energy, all_rms, sentences
from missions.records.report.slider import Moments
from missions.records.report.tables import go_to
from missions.views.columns import in_columns
from missions.views.pictures.page.markup import Markup, tag

HEADINGS = ("joint", "rms deg", "at most deg", "at s", "motor J", "load %", "degC", "samples")
"""The columns on a terminal."""

UNKNOWN = "-"

NONE = "no joint was heard of in this record"


def joints_table(joints: Sequence[JointFigures], moments: Moments) -> Markup:
    """Return the table of a report; a click goes to when a joint was off the most."""
    heads = ("Joint", "Off its goal (rms)", "At most", "At", "Its motor did", "Load at most", "Hottest")
    rows = [
        tag(
            "tr",
            tag("th", each.name, scope="row"),
            tag("td", _told(each.rms, ".2f", "°")),
            tag("td", _told(each.worst, "+.1f", "°")),
            tag("td", UNKNOWN if each.worst_at is None else go_to(each.worst_at, moments)),
            tag("td", _told(each.energy, ".1f", " J")),
            tag("td", _told(each.load, "+.0%")),
            tag("td", _told(each.hottest, ".0f", " °C")),
        )
        for each in joints
    ]
    head = tag("thead", tag("tr", *(tag("th", text, scope="col") for text in heads)))
    return tag("div", tag("table", head, tag("tbody", *rows)), class_="sightings")


def lines_of(joints: Sequence[JointFigures]) -> Iterator[str]:
    """Yield the same as lines for a terminal."""
    if not joints:
        yield NONE
        return
    rows = [
        (
            each.name,
            _told(each.rms, ".2f"),
            _told(each.worst, "+.1f"),
            _told(each.worst_at, ".2f"),
            _told(each.energy, ".1f"),
            _told(None if each.load is None else 100 * each.load, "+.0f"),
            _told(each.hottest, ".0f"),
            str(each.samples),
        )
        for each in joints
    ]
    yield from in_columns(HEADINGS, rows, left=frozenset({"joint"})).splitlines()
    yield ""
    yield from sentences(joints)


def as_json(joints: Sequence[JointFigures]) -> Mapping[str, object]:
    """Return the same for programs: degrees, joules, loads in -1..1 of the stall torque, degC."""
    return {"rms": all_rms(joints), "energy": all_energy(joints), "joints": [asdict(each) for each in joints]}


def as_csv(joints: Sequence[JointFigures]) -> str:
    """Return the same for a spreadsheet."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([field.name for field in fields(JointFigures)])
    for each in joints:
        writer.writerow(["" if value is None else cell(value) for value in asdict(each).values()])
    return out.getvalue()


def _told(value: float | None, form: str, unit: str = "") -> str:
    return UNKNOWN if value is None else f"{value:{form}}{unit}"
