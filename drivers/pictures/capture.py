"""Capture thread of a camera, which always has the newest picture ready; and cameras that use it."""

import logging
from collections.abc import Callable
from math import inf
from threading import Condition, Event, Thread
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import CameraFrame, DeviceStatus, Health, Image, StatusCallback
from drivers.api.fast_dataclass import dataclass
from drivers.api.image_orientation import UPRIGHT, ImageOrientation
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.pictures.decode import NO_PICTURE, SKIPPED_PICTURE
from drivers.transport.loop import guard_callback

# Whether the pictures of a live camera are news: a camera can hang, or fall behind, and go on giving pictures.

FROZEN_TIMEOUT = 3.0
"""Seconds of identical pictures after which a camera counts as frozen: noise makes real pictures differ."""

MIN_RATE = 4.0
"""Pictures per second below which a camera is too slow to follow people."""

RATE_WINDOW = 3.0
"""Seconds over which the picture rate is measured."""

SAMPLE_STRIDE = 16
"""Step in pixels, in x and y, between the pixels that are compared to detect identical pictures."""

_SLOW_HINT = "more light (webcams expose for longer in the dark), a smaller picture, or a USB port of its own"
_FROZEN_HINT = "unplug the camera and plug it in again; `mission robot camera list` shows whether it is back"


@dataclass(frozen=True, slots=True)
class _Fault:
    """Fault of a camera's pictures: ``text`` stays the same while the fault lasts, ``hint`` is what to do."""

    text: str
    hint: str


class FreshnessMonitor:
    """Detects frozen or slow pictures of one live camera, and reports the start and the end of such a fault once.

    A picture of one colour, as from a covered lens, never counts as frozen, because nothing in it could change. For one
    thread.
    """

    def __init__(self, name: str, report: StatusCallback) -> None:
        self._name = name
        self._report = report
        self._sample: npt.NDArray[np.uint8] | None = None
        self._changed_at = 0.0  # the stamp of the first picture that looked like the newest one
        self._stamps: list[float] = []
        self._fault: _Fault | None = None

    @property
    def problem(self) -> tuple[str, str]:
        """Current fault and hint; both empty if the pictures are fresh."""
        fault = self._fault
        return ("", "") if fault is None else (f"{self._name}: {fault.text}", fault.hint)

    def restart(self) -> None:
        """Forget the earlier pictures, because the camera was disconnected; the capture thread reports that."""
        self._sample = self._fault = None
        self._stamps.clear()

    def count_skipped(self, stamp: float) -> None:
        """Count a picture with the stamp ``stamp`` (s) that was not decoded."""
        self._stamps.append(stamp)

    def check(self, image: Image, stamp: float) -> None:
        """Check the next picture, taken at ``stamp`` seconds."""
        frozen, slow = self._find_freeze(image, stamp), self._find_slowness(stamp)
        fault = frozen or slow
        before, self._fault = self._fault, fault
        if fault is not None and fault != before:
            self._report(DeviceStatus(self._name, "fault", f"{self._name}: {fault.text}", fault.hint))
        elif fault is None and before is not None:
            self._report(DeviceStatus(self._name, "online", f"{self._name}: fresh pictures again"))

    def _find_freeze(self, image: Image, stamp: float) -> _Fault | None:
        sample = image[::SAMPLE_STRIDE, ::SAMPLE_STRIDE, 1]
        same = self._sample is not None and np.array_equal(sample, self._sample)
        if not same or sample.min() == sample.max():
            self._sample, self._changed_at = sample.copy(), stamp
            return None
        if stamp - self._changed_at < FROZEN_TIMEOUT:
            return None
        return _Fault(f"the same picture for {FROZEN_TIMEOUT:g} s", _FROZEN_HINT)

    def _find_slowness(self, stamp: float) -> _Fault | None:
        self._stamps.append(stamp)
        while len(self._stamps) > 2 and stamp - self._stamps[1] >= RATE_WINDOW:
            self._stamps.pop(0)
        span = stamp - self._stamps[0]
        slow = span >= RATE_WINDOW and (len(self._stamps) - 1) / span < MIN_RATE
        return _Fault(f"fewer than {MIN_RATE:g} pictures per second", _SLOW_HINT) if slow else None


# Turning pictures.

_ROTATIONS = (None, cv2.ROTATE_90_CLOCKWISE, cv2.ROTATE_180, cv2.ROTATE_90_COUNTERCLOCKWISE)
_FLIPS = {(True, False): 1, (False, True): 0, (True, True): -1}


def turn_image(image: Image, turn: ImageOrientation) -> Image:
    """Return a picture rotated, then mirrored, by ``turn``."""
    rotation, flip = _ROTATIONS[turn.quarter_turns], _FLIPS.get((turn.flip_horizontal, turn.flip_vertical))
    found = image if rotation is None else cv2.rotate(image, rotation)
    found = found if flip is None else cv2.flip(found, flip)
    return np.asarray(found, np.uint8)


def unturn_image(image: Image, turn: ImageOrientation) -> Image:
    """Return the inverse of ``turn_image``: the picture that ``turn`` converts to ``image``."""
    return turn_image(
        turn_image(image, ImageOrientation(0, turn.flip_horizontal, turn.flip_vertical)),
        ImageOrientation(-turn.quarter_turns % 4),
    )


log = logging.getLogger(__name__)


class CameraFeed(Protocol):
    """Source of pictures for a ``CaptureThread``. It may be missing, may end, and may be started again.

    All methods are called from the capture thread. They must not block inside a C library: a thread that is still
    blocked when Python exits crashes the process.
    """

    @property
    def source_name(self) -> str:
        """Name of the source for users: a path, a device or an address."""
        ...

    @property
    def hint(self) -> str:
        """Next command to type when the source opens but gives no picture."""
        ...

    def start(self, closing: Event) -> float | None:
        """Open the source; return the seconds between the pictures of a recording, or None for a live source.

        ``closing`` is set when the camera is closed, and ends all waiting. Raises NotConnected if the source is
        missing.
        """
        ...

    def grab(self, skip_count: Callable[[], int]) -> Image | None:
        """Return the next picture; ``NO_PICTURE`` if none has arrived for a moment; None at the end.

        ``skip_count`` returns the number of next pictures that are not needed. For these return ``SKIPPED_PICTURE``,
        without decoding them.
        """
        ...

    def stop(self) -> None:
        """Release the source. Safe from any state, more than once."""
        ...


@runtime_checkable
class CountingFeed(Protocol):
    """A feed that counts skipped pictures itself, so it must be informed when their number changes."""

    def skip_next(self, pictures: int) -> None:
        """Skip the next ``pictures``, instead of the number set before. From any thread."""
        ...


_POLL_INTERVAL = 0.1
"""Seconds of real time between two checks whether the next picture of a recording is due.

The clock that decides this may be simulated, and run faster than real time.
"""

_UNREAD_TIMEOUT = 1.0
"""Seconds after the last call of ``read`` after which pictures are skipped without decoding."""

MAX_UNREAD_SKIP = 1_000_000
"""Number of pictures to skip while no thread reads the camera, high enough for hours."""

OFFLINE_TIMEOUT = 2.0
"""Seconds without a picture after which a camera counts as offline."""

NOT_YET_TEXT = "no picture yet"
"""Last words of the status of an opened camera that has neither delivered a picture nor failed."""

AGAIN_SUFFIX = " again"
"""Last word of the notice that a camera works again after a reported fault."""

_JOIN_TIMEOUT = 5.0
"""Maximum seconds that ``stop`` waits for the capture thread to end, which may still be decoding a picture."""


class CaptureThread:
    """Thread that reads a feed, and reopens it every ``retry`` seconds while it is disconnected.

    ``loop`` repeats a recording at its end. ``turn`` rotates or mirrors each picture. Each opening of a camera makes a
    new feed and a new thread.
    """

    def __init__(
        self,
        name: str,
        feed: CameraFeed,
        clock: Clock,
        *,
        loop: bool,
        retry: float,
        report: StatusCallback,
        turn: ImageOrientation = UPRIGHT,
    ) -> None:
        self._turn = turn
        self._name = name
        self._feed = feed
        self._counting_feed = feed if isinstance(feed, CountingFeed) else None
        self._clock = clock
        self._loop = loop
        self._retry = retry
        self._report = guard_callback(report)
        self._freshness = FreshnessMonitor(name, self._report)
        self._condition = Condition()
        self._frame: CameraFrame | None = None
        self._last_read_number = -1
        self._last_picture_at = 0.0  # of the newest picture, decoded or not
        self._read_at = inf  # no read since the opening
        self._frames = self._dropped = self._starts = 0
        self._online = False
        self._error = NotConnected(f"{name}: {feed.source_name}: {NOT_YET_TEXT}", hint=feed.hint)
        self._offline_timeout = OFFLINE_TIMEOUT
        self._due = 0.0
        self._closing = Event()
        self._thread = Thread(target=self._run, name=f"camera {name}", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._due = self._clock.now()
        self._thread.start()

    def stop(self) -> None:
        """End the thread, and a waiting ``read``."""
        self._closing.set()
        with self._condition:
            self._condition.notify_all()
        self._thread.join(_JOIN_TIMEOUT)

    def read(self, timeout: float) -> CameraFrame | None:
        """Wait up to ``timeout`` seconds for a frame that was not returned before; return it, or None."""
        with self._condition:
            slept = not self._was_read_recently()
            self._read_at = inf  # for as long as it waits, which may be longer than a camera takes to start
            if slept:
                self._update_skip_count()
            self._condition.wait_for(lambda: self._closing.is_set() or self._next_frame() is not None, timeout)
            self._read_at = self._clock.now()
            frame = None if self._closing.is_set() else self._next_frame()
            if frame is not None:
                self._dropped += frame.number - self._last_read_number - 1
                self._last_read_number = frame.number
                return frame
            silent = None if self._closing.is_set() else self._offline_error()
        if silent is not None:  # the camera's own thread may be stuck in its driver
            self._set_offline(silent)
        return None

    def skip(self, pictures: int) -> None:
        """Skip this many pictures after the last frame that ``read`` returned, without decoding them."""
        with self._condition:
            self._last_read_number += pictures
            self._update_skip_count()

    def health(self) -> Health:
        """Return whether pictures arrive, or the reason."""
        with self._condition:
            counters = {"frames": self._frames, "dropped": self._dropped, "starts": self._starts}
            trouble = self._offline_error() if self._online else self._error
            detail, hint = self._freshness.problem
        if trouble is None:
            return Health(online=True, detail=detail, hint=hint, counters=counters)
        return Health(online=False, detail=str(trouble), hint=trouble.hint, counters=counters)

    def _offline_error(self) -> NotConnected | None:
        """Return an error if an online camera has delivered no picture for too long; else None."""
        if not self._online:
            return None
        silent = self._clock.now() - self._last_picture_at
        if silent <= self._offline_timeout:
            return None
        return NotConnected(
            f"{self._name}: {self._feed.source_name}: no picture for {silent:.1f} s", hint=self._feed.hint
        )

    def _next_frame(self) -> CameraFrame | None:
        return self._frame if self._frame is not None and self._frame.number > self._last_read_number else None

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                trouble = self._pass_pictures()
            except NotConnected as error:
                trouble = error
            except (OSError, MemoryError) as error:  # it is tried again, like a camera that is away
                hint = "`ulimit -a`, `free -h` and `ls /proc/PID/fd` show what has run out"
                what = f"{self._name}: {self._feed.source_name}: {str(error) or 'out of memory'}"
                trouble = NotConnected(what, hint=hint)
            except Exception as error:  # of the source: another start may bring the pictures back
                log.exception("%s: %s failed", self._name, self._feed.source_name)
                trouble = NotConnected(f"{self._name}: {self._feed.source_name}: {type(error).__name__}: {error}")
            finally:
                self._feed.stop()
            if trouble is not None and not self._closing.is_set():
                self._set_offline(trouble)
                self._closing.wait(self._retry)
        self._feed.stop()  # once more: it may keep what a next start needs

    def _pass_pictures(self) -> NotConnected | None:
        """Publish the pictures of the feed until it ends; return the error, or None to start the feed again at once."""
        period = self._feed.start(self._closing)
        self._starts += 1
        self._freshness.restart()
        before = self._frames
        self._offline_timeout = max(OFFLINE_TIMEOUT, 3 * (period or 0.0))
        while (image := self._feed.grab(self._skip_count)) is not None:
            if image is NO_PICTURE and not self._closing.is_set():
                if (silent := self._offline_error()) is not None:
                    self._set_offline(silent)
                continue
            if self._closing.is_set() or (period is not None and not self._wait_until_due(period)):
                return None
            if image is SKIPPED_PICTURE:
                self._on_skipped(live=period is None)
                continue
            image = turn_image(image, self._turn) if self._turn else image
            self._publish(image)
            if period is None:  # a recording may well hold still
                self._freshness.check(image, self._clock.now())
        who, shown = f"{self._name}: {self._feed.source_name}", self._frames - before
        if shown == 0:
            return NotConnected(f"{who}: no picture can be decoded", hint=self._feed.hint)
        if period is None:
            return NotConnected(f"{who}: no more pictures after {shown}", hint=self._feed.hint)
        if self._loop:
            return None
        self._set_offline(NotConnected(f"{who}: has ended after {shown} pictures", hint="set loop to repeat it"))
        self._closing.wait()
        return None

    def _skip_count(self) -> int:
        """Return how many of the next pictures no thread will read, so that they need not be decoded."""
        return max(0, self._last_read_number + 1 - self._frames) if self._was_read_recently() else MAX_UNREAD_SKIP

    def _update_skip_count(self) -> None:
        if self._counting_feed is not None:
            self._counting_feed.skip_next(self._skip_count())

    def _was_read_recently(self) -> bool:
        return self._clock.now() - self._read_at <= _UNREAD_TIMEOUT

    def _on_skipped(self, *, live: bool) -> None:
        """Count a skipped picture of a live source or a recording.

        If no thread reads the camera, also drop the stored frame, so that the next read waits for a new one.
        """
        now, read = self._clock.now(), self._was_read_recently()
        if not read:
            self._freshness.restart()
        elif live:
            self._freshness.count_skipped(now)
        with self._condition:
            self._last_picture_at = now
            if read:
                self._frames += 1
            else:
                self._frame = None
        self._set_online()

    def _wait_until_due(self, period: float) -> bool:
        """Wait until the next picture of a recording is due; return False if the camera is closed first."""
        while (left := self._due - self._clock.now()) > 1e-6:
            if self._closing.wait(min(left, _POLL_INTERVAL)):
                return False
        self._due = max(self._due + period, self._clock.now())
        return True

    def _publish(self, image: Image) -> None:
        with self._condition:
            self._last_picture_at = self._clock.now()
            self._frame = CameraFrame(image, self._last_picture_at, self._frames)
            self._frames += 1
            self._condition.notify_all()
        self._set_online()

    def _set_online(self) -> None:
        """Count the camera as online, and report that it has connected or reconnected."""
        with self._condition:
            was_online, self._online = self._online, True
            back = self._frames > 1
        if not was_online:
            self._freshness.restart()
            self._report(
                DeviceStatus(self._name, "online", f"{self._feed.source_name} gives pictures{AGAIN_SUFFIX * back}")
            )

    def _set_offline(self, error: NotConnected) -> None:
        with self._condition:
            self._error = error
            was_online, self._online = self._online, False
        if was_online:
            self._report(DeviceStatus(self._name, "offline", str(error), error.hint))


# What cameras over a feed have in common: opened, read and closed in any order, by whoever.


class ThreadedCamera:
    """A ``drivers.api.Camera`` that reads pictures on a thread, so that the newest is always ready.

    ``make_feed`` returns a new feed for each opening. ``name`` is the part. ``field_of_view`` is the horizontal angle
    in radians of the picture after ``turn``, which rotates or mirrors it. ``loop`` repeats a recording at its end.
    ``retry`` is the reconnect interval in seconds. Only one thread at a time may call ``read``. Raises BadRequest for a
    ``field_of_view`` or ``retry`` out of range.
    """

    def __init__(
        self,
        make_feed: Callable[[], CameraFeed],
        clock: Clock,
        *,
        name: str,
        field_of_view: float,
        loop: bool,
        retry: float,
        report: StatusCallback,
        turn: ImageOrientation = UPRIGHT,
    ) -> None:
        if not 0 < field_of_view < 3.14:
            raise BadRequest(f"{name}: field of view {field_of_view} rad: must be above 0 and below 3.14")
        if retry <= 0:
            raise BadRequest(f"{name}: retry {retry} s: must be above 0 s")
        self.name = name
        self.field_of_view = field_of_view
        self._make_feed = make_feed
        self._clock = clock
        self._loop = loop
        self._retry = retry
        self._report = report
        self._turn = turn
        self._capture: CaptureThread | None = None

    def open(self) -> None:
        """Start the capture thread; returns at once. Does nothing when open."""
        if self._capture is None:
            capture = CaptureThread(
                self.name,
                self._make_feed(),
                self._clock,
                loop=self._loop,
                retry=self._retry,
                report=self._report,
                turn=self._turn,
            )
            self._capture = capture
            capture.start()

    def rest(self) -> None:
        """Do nothing: a camera has no actuator."""

    def close(self) -> None:
        """Stop the thread and release the source. Safe from any state, more than once; never hangs."""
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.stop()

    def health(self) -> Health:
        capture = self._capture
        return Health(online=False, detail=f"{self.name}: not open") if capture is None else capture.health()

    def skip(self, pictures: int) -> None:
        """Skip this many pictures after the last frame that ``read`` returned, without decoding them.

        Does nothing if the camera is not open.
        """
        if self._capture is not None:
            self._capture.skip(pictures)

    def read(self, timeout: float) -> CameraFrame | None:
        """Return the newest frame, waiting up to ``timeout`` seconds; None if there is none, or when not open."""
        capture = self._capture
        if capture is not None:
            return capture.read(timeout)
        Event().wait(timeout)  # no frame will come, but a reader must not spin
        return None
