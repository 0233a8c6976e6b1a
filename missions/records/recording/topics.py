"""From what a run hands over to the messages of its record.

Each message is JSON, with ``t`` in seconds of the run where it is ours; its topic's schema stands in
``missions.records.recording.schemas``. An event is its fields, as ``missions.executive.events`` has them.
"""

from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Any, NamedTuple

from missions.executive.tick_record import TickRecord
from missions.records.recording import foxglove
from missions.records.recording.codec import dumps, number, tagged, to_json
from missions.records.recording.figures import Figures
from missions.records.recording.foxglove import Epoch
from missions.records.recording.head import Head
from missions.records.recording.items import EVENTS, Checked, Feedback, Other, Picture, Seen
from missions.records.recording.moments import Shortened
from perception.api import View

SCHEMAS: Mapping[str, str] = {
    "/mission": "missiontree.Mission",
    "/moments": "missiontree.Moment",
    "/nodes": "missiontree.NodeChanged",
    "/feedback": "missiontree.Feedback",
    "/variables": "missiontree.VariableSet",
    "/percepts": "missiontree.View",
    "/commands": "missiontree.CommandSent",
    "/faults": "missiontree.FaultRaised",
    "/reflexes": "missiontree.ReflexFired",
    "/notices": "missiontree.Notified",
    "/end": "missiontree.Ended",
    "/lost": "missiontree.Lost",
    "/log": "foxglove.Log",
    "/camera": "foxglove.CompressedImage",
    "/camera/marks": "foxglove.ImageAnnotations",
    "/tf": "foxglove.FrameTransform",
    "/base/pose": "foxglove.PoseInFrame",
    "/scan": "foxglove.LaserScan",
    "/state/base": "missiontree.BaseState",
    "/state/head": "missiontree.HeadState",
    "/state/arm": "missiontree.ArmState",
    "/state/devices": "missiontree.DeviceStates",
}
"""The schema of every topic."""

VIEWS_KEPT = 16
"""So many views wait for the picture that they were found in: a picture is there later, once it is packed."""


class Message(NamedTuple):
    """What is to be written: on which topic, of when, and what."""

    topic: str
    t: float
    data: bytes


class Topics:
    """Makes messages of the items of one run."""

    def __init__(self, head: Head) -> None:
        self.epoch = Epoch(round(datetime.fromisoformat(head.started).timestamp() * 1e6) * 1000)
        self._head = head
        self._moments = Shortened()
        self._figures = Figures(self.epoch, head.eye)
        self._views: dict[float, View] = {}

    def forget(self) -> None:
        """Let what comes next be read without what was before."""
        self._moments.forget()

    def first(self) -> Message:
        """Return the message at the beginning of a record."""
        return Message("/mission", 0.0, dumps(to_json(self._head)))

    def lost(self, t: float, counts: Mapping[str, int], why: str) -> Message:
        """Return the message that says that others are missing."""
        return Message("/lost", t, dumps({"t": t, "counts": dict(counts), "why": why}))

    def messages(self, item: Any) -> Iterator[Message]:
        """Yield the messages that an item makes."""
        match item:
            case TickRecord():
                yield Message("/moments", item.t, self._moments.written(item))
                for topic, t, data in self._figures.of(item):
                    yield Message(topic, t, dumps(data))
            case Seen():
                yield from self._seen(item)
            case Picture():
                yield from self._picture(item)
            case Checked():
                devices = {name: to_json(health) for name, health in item.health.items()}
                yield Message("/state/devices", item.t, dumps({"t": item.t, "devices": devices}))
            case Feedback():
                yield Message("/feedback", item.t, dumps(item._asdict()))
            case Other() if type(item).__name__ == "Logged":
                yield self._logged(**vars(item))
            case Other():
                topic, values = EVENTS[type(item).__name__], vars(item)
                yield Message(topic, values["t"], dumps({name: tagged(value) for name, value in values.items()}))

    def _seen(self, seen: Seen) -> Iterator[Message]:
        view = seen.view
        if view.looked is not None:
            self._views[view.looked] = view
            while len(self._views) > VIEWS_KEPT:
                del self._views[next(iter(self._views))]
        written = to_json(view)
        yield Message("/percepts", seen.t, dumps({"t": seen.t, **(written if isinstance(written, dict) else {})}))

    def _picture(self, picture: Picture) -> Iterator[Message]:
        stamp, gaze = self.epoch.stamp(picture.t), picture.gaze
        looked = None if gaze is None else {"yaw": number(gaze.yaw), "pitch": number(gaze.pitch)}
        image = foxglove.image(stamp, picture.jpeg)
        yield Message("/camera", picture.t, dumps({**image, "t": picture.t, "gaze": looked}))
        view = self._views.pop(picture.t, None)
        if view is not None:
            yield Message("/camera/marks", picture.t, dumps(foxglove.marks(stamp, view)))

    def _logged(self, t: float, level: str, text: str) -> Message:
        line = foxglove.log(self.epoch.stamp(t), level, text, self._head.file)
        return Message("/log", t, dumps({**line, "t": t, "kind": level}))
