"""Simulated camera: draws a picture for each exposure, with faults on demand."""

from collections.abc import Callable
from math import radians
from random import Random

from drivers.api import CameraFrame, Health, Image, StatusCallback, ignore
from drivers.clock import Clock
from drivers.sim.plug import SimulatedPlug


def black_like(picture: Image) -> Image:
    """Return a black picture of the same size as ``picture``."""
    import numpy as np  # noqa: PLC0415 - only a covered lens needs it

    return np.zeros_like(picture)


class CameraTwin:
    """Simulated camera: a ``drivers.api.Camera`` whose pictures come from ``draw(time)``. Not thread-safe.

    ``rate`` is in pictures per second, ``field_of_view`` horizontal in radians. ``dropouts`` is the share 0..1 of lost
    pictures, drawn from ``seed``. ``black(picture)`` returns the picture that is seen while the lens is covered. Raises
    ValueError for values out of range.
    """

    name = "camera"

    def __init__(
        self,
        draw: Callable[[float], Image],
        clock: Clock,
        *,
        rate: float = 20.0,
        field_of_view: float = radians(60.0),
        report: StatusCallback = ignore,
        dropouts: float = 0.0,
        seed: int = 0,
        black: Callable[[Image], Image] = black_like,
    ) -> None:
        if not (rate > 0 and 0 < field_of_view < 3.14 and 0 <= dropouts <= 1):
            raise ValueError(f"{self.name}: {rate=}, {field_of_view=}, {dropouts=}: out of range")
        self.field_of_view = field_of_view
        self.plug = SimulatedPlug(self.name, report)
        self.period = 1 / rate
        self._draw = draw
        self._black = black
        self._clock = clock
        self._dropouts = dropouts
        self._random = Random(f"{seed} {self.name}")  # noqa: S311 - chance, not a secret
        self._picture: Image | None = None  # the newest
        self._frozen = self._covered = False
        self._keep_every = 1  # one picture of so many comes through
        self._opened_at: float | None = None
        self._number = -1
        self._frames = 0

    def open(self) -> None:
        """Connect at once, unless the simulated plug is pulled. The first picture is due immediately.

        Does nothing if the camera is already open.
        """
        if self._opened_at is None:
            self._opened_at = self._clock.now()
            self._number, self._frames = -1, 0
            self.plug.open()

    def rest(self) -> None:
        """Do nothing: a camera has no actuator."""

    def close(self) -> None:
        self._opened_at = None
        self.plug.close()

    def health(self) -> Health:
        return self.plug.health({"frames": self._frames, "dropped": self._number + 1 - self._frames})

    def expose(self, now: float) -> CameraFrame | None:
        """Return a picture taken at time ``now``; None if the camera is unplugged, or the picture is lost."""
        if not self.plug.online:
            return None
        self._number += 1
        if self._number % self._keep_every or (self._dropouts and self._random.random() < self._dropouts):
            return None
        self._frames += 1
        if self._picture is None or not self._frozen:
            self._picture = self._picture_through_lens(now)
        return CameraFrame(self._picture, now, self._number)

    def read(self, timeout: float) -> CameraFrame | None:
        """Return the picture that is due by the clock, None if there is none. Does not wait.

        ``timeout`` is ignored, because simulated time does not advance during a read. The frame number counts the
        pictures that were not read as well.
        """
        del timeout
        now = self._clock.now()
        if self._opened_at is None or not self.plug.online:
            return None
        due = int((now - self._opened_at) / self.period + 1e-6)  # a clock moved on in such steps is a hair early
        if due <= self._number:
            return None
        self._number = due - 1
        return self.expose(now)

    # --- the hand of whoever tests a mission --------------------------------------------------------------------------

    def freeze(self) -> None:
        """Fault: repeat the newest picture, each time with a new stamp."""
        self._frozen = True

    def thaw(self) -> None:
        """End ``freeze``."""
        self._frozen = False

    def cover(self) -> None:
        """Fault: cover the lens, so that pictures are black."""
        self._covered = True

    def uncover(self) -> None:
        """End ``cover``."""
        self._covered = False

    def slow_down(self, keep_every: int = 8) -> None:
        """Fault: deliver only one picture in ``keep_every``; 1 delivers all."""
        self._keep_every = keep_every

    def _picture_through_lens(self, now: float) -> Image:
        """Return the picture at time ``now``, black if the lens is covered."""
        if not self._covered:
            return self._draw(now)
        return self._black(self._draw(now) if self._picture is None else self._picture)
