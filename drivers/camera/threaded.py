"""What cameras over a feed have in common: opened, read and closed in any order, by whoever."""

from collections.abc import Callable
from threading import Event

from drivers.api import CameraFrame, Health, Report
from drivers.api.turn import UPRIGHT, Turn
from drivers.camera.capture import Capture, Feed
from drivers.clock import Clock
from drivers.errors import BadRequest


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
