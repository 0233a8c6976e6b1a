"""A camera that renders the simulated world from the position of the robot's head."""

from collections.abc import Callable
from math import radians
from threading import Event

from drivers.api import CameraFrame, Health
from drivers.clock import Clock
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import SimulatedWorld

_POLL_INTERVAL = 0.005
"""Seconds between two checks whether the next frame is due.

The clock may be simulated, so the seconds to sleep cannot be computed from it.
"""


class RenderedCamera:
    """A ``drivers.api.Camera`` that renders ``world`` from ``viewpoint(time)``, ``rate`` times per second of the clock.

    A frame is exposed when it is read; its stamp is the time of its viewpoint. Frames whose time passes between two
    reads are dropped, and their numbers are skipped. Only one thread may call ``read`` at a time.
    """

    def __init__(
        self,
        world: SimulatedWorld,
        viewpoint: Callable[[float], Viewpoint],
        clock: Clock,
        *,
        rate: float = 20.0,
        size: tuple[int, int] = (640, 480),
        field_of_view: float = radians(60.0),
        noise: float = 3.0,
        seed: int = 0,
        name: str = "camera",
    ) -> None:
        self.name = name
        self.field_of_view = field_of_view
        self._viewpoint = viewpoint
        self._clock = clock
        self._rate = rate
        self._renderer = Renderer(world, PinholeLens(*size, field_of_view), noise=noise, seed=seed)
        self._opened_at: float | None = None
        self._number = -1
        self._frames = 0
        self._closed = Event()

    def open(self) -> None:
        """Start counting frames; the first is due at once."""
        if self._opened_at is None:
            self._closed.clear()
            self._number = -1
            self._frames = 0
            self._opened_at = self._clock.now()

    def rest(self) -> None:
        """Do nothing: a camera has no actuator."""

    def close(self) -> None:
        """End a ``read`` that is waiting. Safe from any state, more than once."""
        self._opened_at = None
        self._closed.set()

    def health(self) -> Health:
        if self._opened_at is None:
            return Health(online=False, detail=f"{self.name}: not open")
        return Health(online=True, counters={"frames": self._frames, "dropped": self._number + 1 - self._frames})

    def read(self, timeout: float) -> CameraFrame | None:
        """Return the next frame once it is due; None after ``timeout`` seconds, or when closed."""
        waited = 0.0
        while (opened := self._opened_at) is not None:
            now = self._clock.now()
            number = int((now - opened) * self._rate + 1e-6)  # a clock moved on in steps of 1/rate is a hair early
            if number > self._number:
                return self._expose(number, now)
            due = opened + (self._number + 1) / self._rate
            pause = min(max(due - now, 0.0005), _POLL_INTERVAL, timeout - waited)
            if pause <= 0 or self._closed.wait(pause):
                return None
            waited += pause
        Event().wait(timeout)  # not open: no frame will come, but a reader must not spin
        return None

    def _expose(self, number: int, now: float) -> CameraFrame:
        self._number = number
        self._frames += 1
        return CameraFrame(self._renderer.draw(self._viewpoint(now), now), now, number)
