"""All that a report tells of a record, found once: for its words, its page and its pictures for papers."""

from collections.abc import Sequence
from dataclasses import dataclass

from missions.executive.events import NodeChanged
from missions.plugins.records.recording.read import Record
from missions.plugins.records.report.following import Miss, tracking
from missions.plugins.records.report.joints import JointFigures, figures_of, joint_charts, tracks_of
from missions.plugins.records.report.percepts import Picture, Sighting, Views, pictures, sightings
from missions.plugins.records.report.slider import Moments, moments_of
from missions.plugins.records.report.timeline import Lane, lanes_of
from missions.plugins.records.report.traces import Chart, Route, charts_of, route_of
from missions.trees.drawing import Drawing

MOST_PICTURES = 60
"""Pictures of the camera in a report, where nobody says how many."""


@dataclass(frozen=True, slots=True)
class Study:
    """What was found in a ``record``; see the modules that these values come from."""

    record: Record
    drawing: Drawing
    moments: Moments
    lanes: Sequence[Lane]
    misses: Sequence[Miss]
    charts: Sequence[Chart]
    route: Route
    views: Views
    pictures: Sequence[Picture]
    sightings: Sequence[Sighting]
    joints: Sequence[JointFigures]
    joint_charts: Sequence[Chart]


def study(record: Record, *, most_pictures: int = 0) -> Study:
    """Read a record through. Raises InvalidRecordError for one that is damaged or has no drawing of its tree."""
    drawing, moments, views = record.drawing(), moments_of(record), list(record.views())
    changes = [event for event in record.events if isinstance(event, NodeChanged)]
    lanes = lanes_of(drawing, changes, record.statuses(moments.end), moments.end)
    misses, tracks = tracking(record, views, lanes), tracks_of(record)
    return Study(
        record,
        drawing,
        moments,
        lanes,
        misses,
        charts_of(record, misses, moments.begin),
        route_of(record),
        views,
        pictures(record, views, most_pictures),
        sightings(views),
        figures_of(record, tracks),
        joint_charts(tracks),
    )
