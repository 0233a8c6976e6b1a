"""One run of a camera, from its opening to its closing: the thread that always holds the newest picture ready."""

import logging
from collections.abc import Callable
from math import inf
from threading import Condition, Event, Thread
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import CameraFrame, DeviceStatus, Health, Image, Report
from drivers.api.quick import dataclass
from drivers.api.turn import UPRIGHT, Turn
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected
from drivers.pictures.decode import NOTHING, UNWANTED
from drivers.transport.loop import guarded

# Whether the pictures of a live camera are news: a camera can hang, or fall behind, and go on giving pictures.

FROZEN = 3.0
"""Seconds of the same picture after which a camera has hung: the noise of a sensor alone makes each one different."""

SLOW = 4.0
"""Pictures a second below which a camera is too slow to follow anybody by."""

LATELY = 3.0
"""Seconds over which their rate is taken."""

STRIDE = 16
"""Every how many pixels, each way, the green of one is compared: that costs microseconds, and a thousand pixels share
no noise."""

_SLOW_HINT = "more light (webcams expose for longer in the dark), a smaller picture, or a USB port of its own"
_FROZEN_HINT = "unplug the camera and plug it in again; `mission robot camera list` shows whether it is back"


@dataclass(frozen=True, slots=True)
class _Fault:
    """What is the matter, in words that stay the same while it lasts, and what helps."""

    what: str
    hint: str


class Freshness:
    """Watches the pictures of one live camera, and reports when they freeze or come too slowly; once, and when it ends.

    A picture of one colour, as from a covered lens, never counts as frozen: there is nothing in it that could change.
    For one thread.
    """

    def __init__(self, name: str, report: Report) -> None:
        self._name = name
        self._report = report
        self._sample: npt.NDArray[np.uint8] | None = None
        self._changed = 0.0  # the stamp of the first picture that looked like the newest one
        self._stamps: list[float] = []
        self._fault: _Fault | None = None

    @property
    def trouble(self) -> tuple[str, str]:
        """What is the matter with the pictures and what to do; both empty when they are fresh."""
        fault = self._fault
        return ("", "") if fault is None else (f"{self._name}: {fault.what}", fault.hint)

    def restart(self) -> None:
        """Begin anew: the camera was away, which others tell."""
        self._sample = self._fault = None
        self._stamps.clear()

    def pass_over(self, stamp: float) -> None:
        """Count a picture of ``stamp`` seconds that came, and was not decoded."""
        self._stamps.append(stamp)

    def take(self, image: Image, stamp: float) -> None:
        """Look at the next picture, that was taken at ``stamp`` seconds."""
        frozen, slow = self._frozen(image, stamp), self._slow(stamp)
        fault = frozen or slow
        before, self._fault = self._fault, fault
        if fault is not None and fault != before:
            self._report(DeviceStatus(self._name, "fault", f"{self._name}: {fault.what}", fault.hint))
        elif fault is None and before is not None:
            self._report(DeviceStatus(self._name, "online", f"{self._name}: fresh pictures again"))

    def _frozen(self, image: Image, stamp: float) -> _Fault | None:
        sample = image[::STRIDE, ::STRIDE, 1]
        same = self._sample is not None and np.array_equal(sample, self._sample)
        if not same or sample.min() == sample.max():
            self._sample, self._changed = sample.copy(), stamp
            return None
        if stamp - self._changed < FROZEN:
            return None
        return _Fault(f"the same picture for {FROZEN:g} s", _FROZEN_HINT)

    def _slow(self, stamp: float) -> _Fault | None:
        self._stamps.append(stamp)
        while len(self._stamps) > 2 and stamp - self._stamps[1] >= LATELY:
            self._stamps.pop(0)
        span = stamp - self._stamps[0]
        slow = span >= LATELY and (len(self._stamps) - 1) / span < SLOW
        return _Fault(f"fewer than {SLOW:g} pictures a second", _SLOW_HINT) if slow else None


# Turning pictures.

_ROTATIONS = (None, cv2.ROTATE_90_CLOCKWISE, cv2.ROTATE_180, cv2.ROTATE_90_COUNTERCLOCKWISE)
_FLIPS = {(True, False): 1, (False, True): 0, (True, True): -1}


def turned(image: Image, turn: Turn) -> Image:
    """Return a picture, turned and then mirrored."""
    rotation, flip = _ROTATIONS[turn.quarters], _FLIPS.get((turn.across, turn.down))
    found = image if rotation is None else cv2.rotate(image, rotation)
    found = found if flip is None else cv2.flip(found, flip)
    return np.asarray(found, np.uint8)


def unturned(image: Image, turn: Turn) -> Image:
    """Return the picture that ``turn`` makes ``image`` of."""
    return turned(turned(image, Turn(0, turn.across, turn.down)), Turn(-turn.quarters % 4))


log = logging.getLogger(__name__)


class Feed(Protocol):
    """A source of pictures that may be absent, may end and may be started again. Used from one thread.

    None of it is stuck in C: a thread that is, as Python ends, takes the process down with it.
    """

    @property
    def what(self) -> str:
        """What the user calls it: a path, a device or an address."""
        ...

    @property
    def hint(self) -> str:
        """What to type next when it opens and yet gives no picture."""
        ...

    def start(self, ending: Event) -> float | None:
        """Open it; return the seconds between the pictures of a recording, or None for one that is live.

        ``ending`` is set when the camera is closed: nothing is waited for then. Raises NotConnected when it is not
        there.
        """
        ...

    def grab(self, spare: Callable[[], int]) -> Image | None:
        """Return the next picture; ``NOTHING`` when none has come for a moment; None when there is no more.

        ``spare`` returns how many of the next pictures nobody needs: those are ``UNWANTED``, and are not decoded.
        """
        ...

    def stop(self) -> None:
        """Release it. Safe from any state, more than once."""
        ...


@runtime_checkable
class CountingFeed(Protocol):
    """A feed that does not ask ``spare`` for each picture, so it has to hear when the answer changes."""

    def let_by(self, pictures: int) -> None:
        """Let so many of the next pictures go by, instead of as many as before. From any thread."""
        ...


_GLANCE = 0.1
"""Seconds between looks at the clock while a recording waits; no waiting can be matched to a simulated clock."""

_UNREAD = 1.0
"""Seconds after which pictures that nobody reads go by without being decoded."""

UNREAD_PICTURES = 1_000_000
"""How many go by then, if nobody reads meanwhile: those of some hours."""

SILENCE = 2.0
"""Seconds without a picture after which a camera counts as offline."""

NOT_YET = "no picture yet"
"""The end of what is said of a camera that has neither shown a picture nor failed."""

AGAIN = " again"
"""The end of a notice that says that something is over that was told of."""

_JOIN_TIMEOUT = 5.0
"""Seconds that ``end`` waits for a thread that decodes a picture: a feed takes a moment at most."""


class Capture:
    """Drains a feed on its own thread, and opens it again, every ``retry`` seconds, while it is away.

    The feed and all state belong to one run, and the next run gets new ones.
    """

    def __init__(
        self,
        name: str,
        feed: Feed,
        clock: Clock,
        *,
        loop: bool,
        retry: float,
        report: Report,
        turn: Turn = UPRIGHT,
    ) -> None:
        self._turn = turn
        self._name = name
        self._feed = feed
        self._counting = feed if isinstance(feed, CountingFeed) else None
        self._clock = clock
        self._loop = loop
        self._retry = retry
        self._report = guarded(report)
        self._freshness = Freshness(name, self._report)
        self._arrived = Condition()
        self._frame: CameraFrame | None = None
        self._given = -1
        self._came_at = 0.0  # the newest picture, decoded or not
        self._read_at = inf  # since it was opened nobody has
        self._frames = self._dropped = self._starts = 0
        self._online = False
        self._trouble = NotConnected(f"{name}: {feed.what}: {NOT_YET}", hint=feed.hint)
        self._silence = SILENCE
        self._due = 0.0
        self._ending = Event()
        self._thread = Thread(target=self._run, name=f"camera {name}", daemon=True)

    def begin(self) -> None:
        """Start the thread."""
        self._due = self._clock.now()
        self._thread.start()

    def end(self) -> None:
        """End the thread, and a ``read`` that waits."""
        self._ending.set()
        with self._arrived:
            self._arrived.notify_all()
        self._thread.join(_JOIN_TIMEOUT)

    def read(self, timeout: float) -> CameraFrame | None:
        """Return the newest frame once it is newer than the last one given; None after ``timeout`` seconds."""
        with self._arrived:
            slept = not self._read_lately()
            self._read_at = inf  # for as long as it waits, which may be longer than a camera takes to start
            if slept:
                self._update_spare()
            self._arrived.wait_for(lambda: self._ending.is_set() or self._newest() is not None, timeout)
            self._read_at = self._clock.now()
            frame = None if self._ending.is_set() else self._newest()
            if frame is not None:
                self._dropped += frame.number - self._given - 1
                self._given = frame.number
                return frame
            silent = None if self._ending.is_set() else self._silent()
        if silent is not None:  # the camera's own thread may be stuck in its driver
            self._lost(silent)
        return None

    def skip(self, pictures: int) -> None:
        """Let so many pictures go by after the last one given: none of them is decoded."""
        with self._arrived:
            self._given += pictures
            self._update_spare()

    def health(self) -> Health:
        """Say whether pictures arrive, and if not, why."""
        with self._arrived:
            counters = {"frames": self._frames, "dropped": self._dropped, "starts": self._starts}
            trouble = self._silent() if self._online else self._trouble
            detail, hint = self._freshness.trouble
        if trouble is None:
            return Health(online=True, detail=detail, hint=hint, counters=counters)
        return Health(online=False, detail=str(trouble), hint=trouble.hint, counters=counters)

    def _silent(self) -> NotConnected | None:
        """Return what to say of a camera that counts as online, and yet gives nothing; None while it gives pictures."""
        if not self._online:
            return None
        silent = self._clock.now() - self._came_at
        if silent <= self._silence:
            return None
        return NotConnected(f"{self._name}: {self._feed.what}: no picture for {silent:.1f} s", hint=self._feed.hint)

    def _newest(self) -> CameraFrame | None:
        return self._frame if self._frame is not None and self._frame.number > self._given else None

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                trouble = self._serve()
            except NotConnected as error:
                trouble = error
            except (OSError, MemoryError) as error:  # it is tried again, like a camera that is away
                hint = "`ulimit -a`, `free -h` and `ls /proc/PID/fd` show what has run out"
                what = f"{self._name}: {self._feed.what}: {str(error) or 'out of memory'}"
                trouble = NotConnected(what, hint=hint)
            except Exception as error:  # of the source: another start may bring the pictures back
                log.exception("%s: %s failed", self._name, self._feed.what)
                trouble = NotConnected(f"{self._name}: {self._feed.what}: {type(error).__name__}: {error}")
            finally:
                self._feed.stop()
            if trouble is not None and not self._ending.is_set():
                self._lost(trouble)
                self._ending.wait(self._retry)
        self._feed.stop()  # once more: it may keep what a next start needs

    def _serve(self) -> NotConnected | None:
        """Pass pictures on until there are no more; return what is the matter then, None to start at once again."""
        period = self._feed.start(self._ending)
        self._starts += 1
        self._freshness.restart()
        before = self._frames
        self._silence = max(SILENCE, 3 * (period or 0.0))
        while (image := self._feed.grab(self._spare)) is not None:
            if image is NOTHING and not self._ending.is_set():
                if (silent := self._silent()) is not None:
                    self._lost(silent)
                continue
            if self._ending.is_set() or (period is not None and not self._paced(period)):
                return None
            if image is UNWANTED:
                self._let_go_by(live=period is None)
                continue
            image = turned(image, self._turn) if self._turn else image
            self._offer(image)
            if period is None:  # a recording may well hold still
                self._freshness.take(image, self._clock.now())
        who, shown = f"{self._name}: {self._feed.what}", self._frames - before
        if shown == 0:
            return NotConnected(f"{who}: gives no picture that can be decoded", hint=self._feed.hint)
        if period is None:
            return NotConnected(f"{who}: gives no more pictures, after {shown}", hint=self._feed.hint)
        if self._loop:
            return None
        self._lost(NotConnected(f"{who}: has ended after {shown} pictures", hint="with loop on it would start again"))
        self._ending.wait()
        return None

    def _spare(self) -> int:
        """Return how many of the next pictures nobody needs."""
        return max(0, self._given + 1 - self._frames) if self._read_lately() else UNREAD_PICTURES

    def _update_spare(self) -> None:
        if self._counting is not None:
            self._counting.let_by(self._spare())

    def _read_lately(self) -> bool:
        return self._clock.now() - self._read_at <= _UNREAD

    def _let_go_by(self, *, live: bool) -> None:
        """Take note of a picture that was not decoded. Where nobody reads, what is read next is none of before."""
        now, read = self._clock.now(), self._read_lately()
        if not read:
            self._freshness.restart()
        elif live:
            self._freshness.pass_over(now)
        with self._arrived:
            self._came_at = now
            if read:
                self._frames += 1
            else:
                self._frame = None
        self._found()

    def _paced(self, period: float) -> bool:
        """Wait until the next picture of a recording is due on the clock; False when the camera is closed first."""
        while (left := self._due - self._clock.now()) > 1e-6:
            if self._ending.wait(min(left, _GLANCE)):
                return False
        self._due = max(self._due + period, self._clock.now())
        return True

    def _offer(self, image: Image) -> None:
        with self._arrived:
            self._came_at = self._clock.now()
            self._frame = CameraFrame(image, self._came_at, self._frames)
            self._frames += 1
            self._arrived.notify_all()
        self._found()

    def _found(self) -> None:
        """Count it as online, and report that it is there, or back."""
        with self._arrived:
            was_online, self._online = self._online, True
            back = self._frames > 1
        if not was_online:
            self._freshness.restart()
            self._report(DeviceStatus(self._name, "online", f"{self._feed.what} gives pictures{AGAIN * back}"))

    def _lost(self, trouble: NotConnected) -> None:
        with self._arrived:
            self._trouble = trouble
            was_online, self._online = self._online, False
        if was_online:
            self._report(DeviceStatus(self._name, "offline", str(trouble), trouble.hint))


# What cameras over a feed have in common: opened, read and closed in any order, by whoever.


class ThreadedCamera:
    """A camera whose newest picture is always ready; meets ``drivers.api.Camera``.

    ``make_feed`` makes a new feed for each opening. ``field_of_view`` is the horizontal angle of view in radians, as
    the user knows it (OpenCV cannot tell), of the pictures after their ``turn``. ``retry`` is the time in seconds
    between attempts to find a source that is away. ``read`` is for one thread at a time. Raises BadRequest for a
    ``field_of_view`` or ``retry`` of 0 or less.
    """

    def __init__(
        self,
        make_feed: Callable[[], Feed],
        clock: Clock,
        *,
        name: str,
        field_of_view: float,
        loop: bool,
        retry: float,
        report: Report,
        turn: Turn = UPRIGHT,
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
        self._capture: Capture | None = None

    def open(self) -> None:
        """Start the thread that looks for the source; returns at once. Does nothing when open."""
        if self._capture is None:
            capture = Capture(
                self.name,
                self._make_feed(),
                self._clock,
                loop=self._loop,
                retry=self._retry,
                report=self._report,
                turn=self._turn,
            )
            self._capture = capture
            capture.begin()

    def rest(self) -> None:
        """Do nothing: a camera moves nothing."""

    def close(self) -> None:
        """End the thread and release the source. Safe from any state, more than once; never hangs."""
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.end()

    def health(self) -> Health:
        """Say whether pictures arrive; if not, why, and what to type next."""
        capture = self._capture
        return Health(online=False, detail=f"{self.name}: not open") if capture is None else capture.health()

    def skip(self, pictures: int) -> None:
        """Let so many pictures go by after the newest that was read; they are not decoded. Nothing when not open."""
        if self._capture is not None:
            self._capture.skip(pictures)

    def read(self, timeout: float) -> CameraFrame | None:
        """Return the newest frame, waiting up to ``timeout`` seconds for it; None when there is none, or not open."""
        capture = self._capture
        if capture is not None:
            return capture.read(timeout)
        Event().wait(timeout)  # no frame will come, but a reader must not spin
        return None
