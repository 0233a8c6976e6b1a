"""The pictures of a record: some of the frames that were searched, as JPEG, packed where nobody waits for it."""

from collections.abc import Callable
from threading import Condition, Thread

import cv2

from missions.records.recording.budget import FrameBudget
from missions.records.recording.items import Picture
from perception.api import Frame, Gaze

QUALITY = 80
"""Of the JPEG, in percent."""

Keep = Callable[[Picture], None]


class Pictures:
    """Packs the frames that are due by ``budget``, and hands them to ``keep``.

    On a thread of its own, with one frame waiting at most: a newer one takes its place, and ``missed`` is told. Where
    time is simulated (``patient``), at once instead.
    """

    def __init__(
        self, keep: Keep, budget: FrameBudget, *, patient: bool, missed: Callable[[], None] = lambda: None
    ) -> None:
        self._keep = keep
        self._budget = budget
        self._patient = patient
        self._missed = missed
        self._newest: tuple[Frame, Gaze | None] | None = None
        self._open = False
        self._news = Condition()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Begin to take frames."""
        self._open = True
        if not self._patient:
            self._thread = Thread(target=self._run, name="record pictures", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Pack what waits, then take no more. Safe more than once."""
        with self._news:
            self._open = False
            self._news.notify()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def take(self, frame: Frame, gaze: Gaze | None) -> None:
        """Take a frame, if one is due; returns at once. ``gaze`` is where the camera looked."""
        if not self._open or not self._budget.due(frame.stamp):
            return
        if self._patient:
            self._pack(frame, gaze)
            return
        with self._news:
            late, self._newest = self._newest, (frame, gaze)
            self._news.notify()
        if late is not None:
            self._missed()

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._newest is not None or not self._open)
                newest, self._newest = self._newest, None
            if newest is None:
                return
            self._pack(*newest)

    def _pack(self, frame: Frame, gaze: Gaze | None) -> None:
        try:
            done, packed = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        except cv2.error:  # a picture of a form that JPEG does not have
            done = False
        if done:
            self._budget.used(len(packed))
            self._keep(Picture(frame.stamp, packed.tobytes(), gaze))
        else:
            self._missed()
