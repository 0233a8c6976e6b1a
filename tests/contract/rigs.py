"""What the rigs of all contracts share: time that passes by itself or is made to pass, and the notices told."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import pytest

from drivers.api import DeviceStatus
from drivers.clock import Clock, SystemClock
from drivers.sim.timeline import Timeline
from tests.drivers.cranked import pass_until
from tests.waiting import wait_until


class Rig(ABC):
    """A device, whatever it is made of, with the hand that unplugs it and the eye that sees it from outside."""

    clock: Clock

    def __init__(self) -> None:
        self.notices: list[DeviceStatus] = []
        self.changes = 0

    def changed(self) -> None:
        self.changes += 1

    def told(self, kind: str, text: str = "") -> bool:
        """Whether a notice of that kind, with these words in it, has come."""
        return any(notice.kind == kind and text in notice.message for notice in list(self.notices))

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Let time pass."""

    @abstractmethod
    def until(self, holds: Callable[[], object]) -> None:
        """Let time pass until ``holds`` is true; fail when that takes unreasonably long."""

    @abstractmethod
    def unplug(self) -> None:
        """Pull the plug."""

    @abstractmethod
    def plug_in(self) -> None:
        """Put it in again."""

    @abstractmethod
    def close(self) -> None:
        """Leave nothing behind."""


class InRealTime(Rig):
    """For the real drivers, which have threads."""

    def __init__(self) -> None:
        super().__init__()
        self.clock = SystemClock()

    def wait(self, seconds: float) -> None:
        end = self.clock.now() + seconds
        wait_until(lambda: self.clock.now() >= end)

    def until(self, holds: Callable[[], object]) -> None:
        wait_until(holds)


class InSimulatedTime(Rig):
    """For twins, and for drivers that are turned by hand, on a timeline."""

    def __init__(self) -> None:
        super().__init__()
        self.timeline = Timeline()
        self.clock = self.timeline.clock

    def wait(self, seconds: float) -> None:
        self.timeline.run_until(self.clock.now() + seconds)

    def until(self, holds: Callable[[], object]) -> None:
        pass_until(self.timeline, holds)


def simulated(rig: type[object], name: str) -> Any:
    """Return ``rig`` as a parameter whose time is made to pass: a twin, or a real driver that is turned by hand."""
    return pytest.param(rig, id=name)
