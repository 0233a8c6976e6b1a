"""Pictures of a record with percepts, the running leaves and the robot's face drawn in."""

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import replace

import cv2
import numpy as np

from drivers.api import Image, Mood, ScreenContent
from drivers.pictures.decode import decode_picture
from drivers.screen.drawing import face_image
from drivers.screen.expression import face_expression
from missions.executive.events import CommandSent, Ticked
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.replay.player_screen import node_states, running_leaves
from missions.trees.drawing_builder import with_states
from perception.annotate import annotate
from perception.api import Box, View

# The robot's face over time.


class RecordedFace:
    """Face and text on the robot's screen over time, from recorded commands and screen states."""

    def __init__(self, record: RunRecord) -> None:
        changes: list[tuple[float, ScreenContent | Mapping[str, object]]] = [
            (event.t, event.values)
            for event in record.events
            if isinstance(event, CommandSent) and event.to == "screen"
        ]
        changes += [
            (moment.t, value)
            for moment in record.tick_records
            for part, what, _, value in moment.answers
            if (part, what) == ("screen", "content") and isinstance(value, ScreenContent)
        ]
        self._states: list[tuple[float, ScreenContent]] = []
        state = ScreenContent()
        for time, change in sorted(changes, key=lambda each: each[0]):
            if isinstance(change, ScreenContent):
                state = change
            elif "mood" in change:
                state = replace(state, mood=Mood(str(change["mood"])))
            elif "show" in change:
                state = replace(state, text=str(change["show"]))
            self._states.append((time, state))

    def __bool__(self) -> bool:
        """Return whether the record has commands to the robot's screen, or states of it."""
        return bool(self._states)

    def at(self, time: float, size: tuple[int, int]) -> Image:
        """Return the robot's face at ``time`` (s) as an image of ``size`` (width, height): (height, width, 3) BGR."""
        place = bisect_right(self._states, time, key=lambda state: state[0]) - 1
        shown = self._states[place][1] if place >= 0 else ScreenContent()
        return face_image(face_expression(shown, time), shown.text, size)


CAPTION_HEIGHT = 28
"""Height in pixels of the caption below a picture."""

CAPTION_SCALE = 0.45
"""Font scale of the caption, as OpenCV defines it."""

STAMP_TOLERANCE = 1e-3
"""Maximum difference in seconds between the stamps of a view and its picture: half a frame at 500 Hz."""


def annotate_frames(record: RunRecord) -> Iterator[tuple[float, Image]]:
    """Yield the time (s) of each picture, and the picture with labels and a caption, beside the robot's face.

    Pictures that cannot be decoded are left out.
    """
    views = [view for _, view in record.views() if view.looked is not None]
    stamps = [view.looked or 0.0 for view in views]
    caption, face = _CaptionSource(record), RecordedFace(record)
    for stamp, data in record.frames():
        image = decode_picture(data)
        if image is not None:
            place = bisect_right(stamps, stamp + STAMP_TOLERANCE) - 1
            marks = labelled_boxes(views[place]) if place >= 0 else ()
            image = annotate(image, marks)
            if face:
                height = image.shape[0]
                image = np.hstack((image, face.at(stamp, (height * 2 // 3, height))))
            yield stamp, np.vstack((image, _draw_caption(caption.at(stamp), image.shape[1])))


def resample_frames(pictures: Iterator[tuple[float, Image]], rate: float) -> Iterator[Image]:
    """Yield pictures at a constant ``rate`` (Hz); each one is repeated until the time of the next."""
    shown, begun, number = None, 0.0, 0
    for stamp, picture in pictures:
        if shown is None:
            begun = stamp
        while shown is not None and begun + number / rate < stamp:
            yield shown
            number += 1
        shown = picture
    if shown is not None:
        yield shown


def labelled_boxes(view: View) -> Iterator[tuple[Box, str]]:
    """Yield box and label of the percepts in a view, without those that are remembered but no longer visible."""
    found = [
        *((face, f"face {face.id}") for face in view.faces),
        *((thing, thing.name) for thing in view.things),
        *((marker, marker.name or f"marker {marker.number}") for marker in view.markers),
    ]
    yield from ((percept.box, label) for percept, label in found if percept.stamp == view.looked)


class _CaptionSource:
    """Captions of a record's pictures: time, tick and running leaves."""

    def __init__(self, record: RunRecord) -> None:
        self._record = record
        self._drawing = record.drawing()
        self._ticks = [event for event in record.events if isinstance(event, Ticked)]

    def at(self, time: float) -> str:
        place = bisect_right(self._ticks, time, key=lambda event: event.t) - 1
        tick = self._ticks[place].tick if place >= 0 else 0
        root = with_states(self._drawing, node_states(self._record, time), time).root
        doing = ", ".join(box.title for box in running_leaves(root))
        return f"{time:.2f} s  tick {tick}  {doing}"


def _draw_caption(text: str, width: int) -> Image:
    strip: Image = np.zeros((CAPTION_HEIGHT, width, 3), np.uint8)
    plain = text.encode("ascii", "replace").decode()  # OpenCV's fonts are ASCII only
    cv2.putText(
        strip, plain, (6, CAPTION_HEIGHT - 9), cv2.FONT_HERSHEY_SIMPLEX, CAPTION_SCALE, (235, 235, 235), 1, cv2.LINE_AA
    )
    return strip
