"""Vision: from the newest frame to the newest percepts, frame by frame or on a thread."""

from collections.abc import Callable
from dataclasses import replace
from threading import Event, Thread

from drivers.api.fast_dataclass import dataclass
from perception.api import Frame, Gaze, Scene, View, ignore
from perception.delay import CameraDelay, ExposureEstimator
from perception.geometry import Pinhole
from perception.scene_motion import measure_scene
from perception.senses import ActiveSenses, FrameSkipper, FrameSource, NewestView, SkippableSource

READ_TIMEOUT = 0.1
"""Seconds to wait for a frame, and to pause after an error; ``close`` may take that long."""

REST_AFTER = 2.0
"""Seconds without a query of results after which ``Eyes`` with ``may_rest`` stop reading frames."""

WARM_UP_PICTURES = 3
"""Number of pictures to search after a rest before results are valid.

Near and far faces are searched alternately, in different pictures, so one picture may not show all faces.
"""

WARM_UP_TIMEOUT = 1.0
"""Seconds after which a query no longer waits for the end of the warm-up, because the camera may be disconnected."""

SCENE_LIFETIME = 0.2
"""Seconds for which a measured scene (brightness, contrast) is valid, unless motion is used."""

MAX_PICTURE_INTERVAL = 0.15
"""Maximum seconds between two pictures that are searched, even if the detectors could skip more."""

NO_FRAME_PAUSE = 0.005
"""Seconds to pause if a camera returned no frame, because a closed camera returns at once."""


@dataclass(frozen=True, slots=True)
class VisionEffort:
    """Cost of vision so far: frames searched, frames that failed, seconds of searching."""

    frames: int = 0
    failed: int = 0
    seconds: float = 0.0


class Vision(NewestView):
    """Searches frames and keeps the newest result: a ``perception.api.Sight``.

    ``gaze(stamp)`` returns the direction of the camera at a past time, or None. ``field_of_view``, ``centre`` and
    ``distortion`` are those of ``perception.geometry.Pinhole``; ``field_of_view`` may also be a function that returns
    it for the width and height of a picture. ``now`` returns the time. ``delay`` is the camera delay, which is also
    estimated; None if stamps are exact. ``on_resume`` is called before the first frame after a rest.

    Callbacks run on the thread that passes the frames, and must return at once: ``on_view(view)`` after each frame,
    then ``on_frame(frame, gaze)``, then ``changed``; ``on_trouble`` for an error.
    """

    def __init__(
        self,
        gaze: Callable[[float], Gaze | None],
        *,
        field_of_view: float | Callable[[int, int], float],
        centre: tuple[float, float] = (0.5, 0.5),
        distortion: tuple[float, ...] = (),
        senses: ActiveSenses,
        now: Callable[[], float],
        delay: CameraDelay | None = None,
        changed: Callable[[], None] = ignore,
        on_view: Callable[[View], None] = ignore,
        on_frame: Callable[[Frame, Gaze | None], None] = ignore,
        on_trouble: Callable[[Exception], None] = ignore,
        on_resume: Callable[[], object] = ignore,
    ) -> None:
        self.now = now
        self.on_resume = on_resume
        self._gaze = gaze
        self._angle = field_of_view
        self._lens = centre, distortion
        self._senses = senses
        faces: object = senses.faces
        self._frame_skipper = faces if isinstance(faces, FrameSkipper) else None
        self._exposures = None if delay is None else ExposureEstimator(gaze, delay, now)
        self._changed = changed
        self._on_view = on_view
        self._on_frame = on_frame
        self._on_trouble = on_trouble
        self._newest: Frame | None = None
        self._measures_scene = senses.scene is not None  # else from the first query of the scene on
        self._effort = VisionEffort()
        self._last_error: Exception | None = None

    @property
    def effort(self) -> VisionEffort:
        """Cost of vision so far."""
        return self._effort

    @property
    def last_error(self) -> Exception | None:
        """Error of the newest frame, or None."""
        return self._last_error

    def scene(self) -> Scene | None:
        """Return the brightness and contrast of the newest frame, None before the first. The first call measures it."""
        view, frame, self._measures_scene = self._view, self._newest, True
        if view.scene is None and frame is not None:
            return measure_scene(frame.image, stamp=frame.stamp)
        return view.scene

    def see(self, frame: Frame) -> bool:
        """Search one frame and publish the result; return False for an error.

        After an error (of the frame, a detector or a callback) the frame has no result, and the next one is searched as
        usual. The error is stored in ``last_error`` until a frame succeeds, and reported if it differs from the one
        before.
        """
        try:
            self._search(frame)
        except Exception as error:  # any error: a permanently blind robot is worse
            self.note_error(error)
            return False
        self._last_error = None
        return True

    def _search(self, frame: Frame) -> None:
        began = self.now()
        height, width = frame.image.shape[:2]
        angle = self._angle(width, height) if callable(self._angle) else self._angle
        camera, senses = Pinhole(width, height, angle, *self._lens), self._senses
        if self._exposures is None:
            gaze = self._gaze(frame.stamp)
        else:
            frame = self._exposures.expose(frame, camera)
            gaze = self._exposures.gaze()
        view = View(
            looked=frame.stamp,
            faces=() if senses.faces is None else senses.faces.sense(frame, camera, gaze),
            things=() if senses.things is None else senses.things.sense(frame, camera, gaze),
            markers=() if senses.markers is None else senses.markers.sense(frame, camera, gaze),
            scene=self._scene(frame) if self._measures_scene else None,
        )
        spent = self.now() - began
        self._effort = VisionEffort(self._effort.frames + 1, self._effort.failed, self._effort.seconds + spent)
        self._newest, self._view = frame, (view := replace(view, spent=spent))
        self._on_view(view)
        self._on_frame(frame, gaze)
        self._changed()

    def _scene(self, frame: Frame) -> Scene:
        sense, before = self._senses.scene, self._view.scene
        if sense is not None:
            return sense.measure(frame)
        if before is not None and 0 <= frame.stamp - before.stamp < SCENE_LIFETIME:
            return before
        return measure_scene(frame.image, stamp=frame.stamp)

    def skip_frames(self, limit: int) -> int:
        """Return how many of the next frames, at most ``limit``, may be skipped, and count them as searched."""
        senses, exposures = self._senses, self._exposures
        only_faces = senses.things is None and senses.markers is None and senses.scene is None
        comparing = exposures is not None and exposures.is_comparing
        if not only_faces or comparing or self._frame_skipper is None:
            return 0
        return self._frame_skipper.skip_frames(limit)

    def note_error(self, error: Exception) -> None:
        """Store an error, and report it unless it equals the last one."""
        before, self._last_error = self._last_error, error
        self._effort = VisionEffort(self._effort.frames, self._effort.failed + 1, self._effort.seconds)
        if before is not None and (type(before), str(before)) == (type(error), str(error)):
            return
        try:
            self._on_trouble(error)
        except Exception as worse:  # nor must an error of the callback
            self._last_error = worse


class Eyes:
    """Reads frames from ``source`` on its own thread and passes each to ``vision``. After an error it goes on.

    With ``may_rest`` it reads no frames after ``REST_AFTER`` seconds without a query. Frames that are not needed
    (``Vision.skip_frames``) are skipped, for at most ``MAX_PICTURE_INTERVAL``.
    """

    def __init__(self, source: FrameSource, vision: Vision) -> None:
        self.vision = vision
        self.may_rest = False
        self._last_query_at = 0.0
        self._warm_pictures = WARM_UP_PICTURES  # pictures searched since the last rest
        self._warm_up_started_at = 0.0  # time of the query that ended the rest
        self._wake_up = Event()
        self._source = source
        self._skippable_source = source if isinstance(source, SkippableSource) else None
        self._newest_stamp = 0.0  # of the newest picture
        self._skipped = self._frames_to_drop = (
            0  # pictures skipped after it; and those of them that are still read and dropped
        )
        self._closing = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start the thread; returns at once. Safe more than once."""
        if self._thread is None:
            self._closing.clear()
            self._last_query_at = self.vision.now()
            self._thread = Thread(target=self._run, name="eyes", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread and wait for it. Safe from any state, more than once, but not from a callback."""
        self._closing.set()
        self._wake_up.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def looked(self) -> float | None:
        """Return the stamp of the newest frame that was searched, None before the first."""
        return self.vision.looked()

    def wake(self) -> bool:
        """End a rest because of a query; return whether results are valid. From any thread, without waiting."""
        before, self._last_query_at = self._last_query_at, self.vision.now()
        self._wake_up.set()
        if self._warm_pictures >= WARM_UP_PICTURES:
            return True
        if self._last_query_at - before > REST_AFTER:
            self._warm_up_started_at = self._last_query_at
        return self._last_query_at - self._warm_up_started_at > WARM_UP_TIMEOUT

    def is_awake(self) -> bool:
        """Return whether the results are valid, without ending a rest. From any thread, without waiting."""
        return self._warm_pictures >= WARM_UP_PICTURES

    def _rest(self) -> None:
        """Wait until the next query."""
        self._warm_pictures = 0
        self._wake_up.clear()
        if self._is_idle and not self._closing.is_set():  # a query meanwhile has updated its time before the event
            self._wake_up.wait()
        self.vision.on_resume()

    @property
    def _is_idle(self) -> bool:
        return self.may_rest and self.vision.now() - self._last_query_at > REST_AFTER

    def _run(self) -> None:
        while not self._closing.is_set():
            if self._is_idle:
                self._rest()
            try:
                frame = self._source.read(READ_TIMEOUT)
            except Exception as error:  # of the camera
                self.vision.note_error(error)
                self._closing.wait(READ_TIMEOUT)
                continue
            if frame is None:
                self._closing.wait(NO_FRAME_PAUSE)
            elif self._frames_to_drop > 0:
                self._frames_to_drop -= 1
            elif self.vision.see(frame):
                self._warm_pictures += 1
                self._skip_unneeded(frame.stamp)
            else:
                self._closing.wait(READ_TIMEOUT)

    def _skip_unneeded(self, stamp: float) -> None:
        """Skip the next frames that are not needed; ``stamp`` is the time of the newest frame."""
        period = (stamp - self._newest_stamp) / (self._skipped + 1)
        self._newest_stamp = stamp
        self._skipped = (
            self.vision.skip_frames(int(MAX_PICTURE_INTERVAL / period) - 1) if 0 < period < MAX_PICTURE_INTERVAL else 0
        )
        if self._skippable_source is None:
            self._frames_to_drop = self._skipped
        elif self._skipped > 0:
            self._skippable_source.skip(self._skipped)
