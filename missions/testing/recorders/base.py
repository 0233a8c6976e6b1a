"""A base and a range finder that keep what they were told."""

from collections.abc import Mapping
from math import radians

import numpy as np

from drivers.api import (
    STILL,
    Base,
    BaseLimits,
    BaseState,
    Lamp,
    Pose2D,
    Quality,
    Ranger,
    RangeScan,
    Reading,
    Source,
    Steering,
    Tune,
    Velocity,
)
from drivers.api.gait import GaitKeys
from drivers.clock import ManualClock
from missions.testing.recorders.spy import ENABLE, LATCH, STOP, Spy, good, none


def drive(linear: float, angular: float) -> Velocity:
    """Return what a base keeps when it is told to drive so, in m/s and rad/s."""
    return Velocity(linear, angular)


class RecordedBase(Spy):
    """A ``drivers.api.Base``; the test sets ``reading``, ``limits``, ``latched``, ``steers`` and ``performed``.

    ``steers`` is who has the wheels, ``performed`` how far an act of its legs has come.
    """

    protocol = Base

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("base", clock)
        self.reading: Reading[BaseState] = good(BaseState(Pose2D(0.0, 0.0, 0.0), STILL))
        self.limits = BaseLimits(0.5, radians(110), 0.5, radians(200))
        self.latched = ""
        self.performed = 0.0
        self.steers = Steering(None, STILL, STILL)

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Keep the velocity; of another source than a mission, with the source."""
        self.keep(velocity if source is Source.MISSION else (source, velocity))
        return velocity

    def perform(self, act: str, gait: GaitKeys | None = None) -> float:
        """Keep the act, with the name of a gait; return ``performed``, which the test sets."""
        self.keep((act,) if gait is None else (act, gait.gait))
        return self.performed

    def stop(self, *, source: Source | None = None) -> None:
        """Keep that it was told to stop, whoever is to."""
        del source
        self.keep_anyway(STOP)

    def latch(self, reason: str) -> None:
        """Be latched, and keep that."""
        self.latched = self.latched or reason
        self.keep_anyway((LATCH, reason))

    def enable(self) -> None:
        """Be latched no more, and keep that."""
        self.latched = ""
        self.keep_anyway(ENABLE)

    def steering(self) -> Steering:
        """Return what the test has set."""
        return self.steers

    def play(self, tune: Tune) -> None:
        """Keep the tune."""
        self.keep(tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """Keep the tone as (hertz, seconds)."""
        self.keep((frequency, seconds))

    def light(self, number: int, colour: Lamp) -> None:
        """Keep the light and its colour."""
        self.keep((number, colour))

    def state(self) -> Reading[BaseState]:
        """Return what the test has set."""
        return self.reading

    def heading_at(self, stamp: float) -> float | None:
        """Return the heading now, for want of a past."""
        del stamp
        return None if self.reading.value is None else self.reading.value.pose.heading


class RecordedRanger(Spy):
    """A ``drivers.api.Ranger`` in the middle of the base; the test sets ``reading``. Nothing is around it at first."""

    protocol = Ranger

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("range", clock)
        self.place = (0.0, 0.0, 0.0)
        self.reading: Reading[RangeScan] = none()
        self.show({})

    def show(self, distances: Mapping[int, float]) -> None:
        """Let it see something at these distances (m), by whole degrees to the left of straight ahead, now."""
        ranges = np.full(360, np.nan, dtype=np.float32)
        for angle, distance in distances.items():
            ranges[angle % 360] = distance
        number = 0 if self.reading.value is None else self.reading.value.number + 1
        now = self.clock.now()
        scan = RangeScan(ranges, 0.0, radians(1), now, number, least=0.15, most=12.0)
        self.reading = Reading(scan, now, Quality.GOOD)

    def scan(self) -> Reading[RangeScan]:
        """Return what the test has set."""
        return self.reading
