"""What was decided before a part was back moves it no more: the behaviour fails, and the mission decides anew."""

from collections.abc import Callable

from behaviours.run import Run
from drivers.api import Device
from drivers.errors import DeviceFault


class Decided:
    """The permit of a run: asked before a device is set moving; ``permit`` is asked before.

    A behaviour that began before the device was back from a long absence raises DeviceFault, so it fails; whatever the
    mission starts then (the next of a selector, another try) is a fresh decision, and may move it.
    """

    def __init__(self, run: Run, permit: Callable[[], None]) -> None:
        self._run = run
        self._permit = permit

    def __call__(self, device: Device) -> None:
        """Raise DeviceFault where the behaviour that has the word is not to move ``device`` now."""
        self._permit()
        leaf, returned = self._run.working, device.health().returned
        if leaf is not None and returned is not None and leaf.since < returned:
            raise DeviceFault(
                f"{device.name}: it was away for a while, and {leaf.place} began before it was back",
                hint="decide anew when it is back: put a 'retry' around it",
            )
