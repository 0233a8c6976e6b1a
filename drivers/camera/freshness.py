"""Whether the pictures of a live camera are news: a camera can hang, or fall behind, and go on giving pictures."""

import numpy as np
import numpy.typing as npt

from drivers.api import DeviceStatus, Image, Report
from drivers.api.quick import dataclass

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
_FROZEN_HINT = "unplug the camera and plug it in again; `mission camera list` shows whether it is back"


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
