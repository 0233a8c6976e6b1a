"""Simulated camera: draws a picture for each exposure, with faults on demand."""

from collections.abc import Callable
from math import radians
from random import Random

from drivers.api import CameraFrame, Health, Image, StatusCallback, ignore
from drivers.clock import Clock
from drivers.sim.plug import SimulatedPlug


def black_like(picture: Image) -> Image:
    """Return a black picture of the same size."""
    import numpy as np  # noqa: PLC0415 - only a covered lens needs it

    return np.zeros_like(picture)


class CameraTwin:
    """A ``drivers.api.Camera`` for one thread, whose pictures come from ``draw(time)``.

    ``rate`` is in pictures per second of the clock, ``field_of_view`` horizontal in radians, ``dropouts`` the share
    0..1 of lost pictures, drawn from ``seed``. ``black`` returns the picture of a covered lens for one of an open lens.
    Raises ValueError for values out of range.
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
        """Connect at once, unless it is unplugged; the first picture is due at once. Does nothing while open."""
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
        """Return a picture taken at time ``now``; None if the camera is offline, or the picture is lost."""
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
        """Return the picture that is due by the clock, or None; the numbers of unread pictures are skipped.

        Ignores ``timeout``: simulated time does not advance during a read.
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
