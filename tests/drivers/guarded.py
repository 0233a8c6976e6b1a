"""A guarded base in a simulated room, in simulated time, for tests of the range guard."""

from collections.abc import Callable
from math import hypot, inf
from typing import Any

import numpy as np

from drivers.api import DeviceStatus, Pose2D, Quality, RangeScan, Reading, Source, Velocity
from drivers.api.sections import BaseKeys
from drivers.api.steering import RangeGuardKeys
from drivers.base.arbitrated import settings_of
from drivers.base.range_twin import RangerTwin
from drivers.base.twin import BaseTwin
from drivers.sim.base_body import BaseBody
from drivers.sim.context import SimContext
from drivers.sim.room import Room
from drivers.sim.scanner import make_range_function
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import SimulatedWheels
from drivers.sim.world import SimulatedWorld

HALL = SimulatedWorld(room=Room(40.0, 40.0, centre=(0.0, 0.0), fixtures=()))
START = Pose2D(0.0, 0.0, 0.0)


class ScriptedRanger:
    """A range finder whose newest reading a test sets: ``value`` is returned, or raised where it is an error."""

    name = "range"
    place = (0.0, 0.0, 0.0)

    def __init__(self) -> None:
        self.value: RangeScan | Exception | None = None

    def scan(self) -> Reading[RangeScan]:
        if isinstance(self.value, Exception):
            raise self.value
        if self.value is None:
            return Reading(None, 0.0, Quality.NONE)
        return Reading(self.value, self.value.stamp, Quality.GOOD)

    def see(self, stamp: float, *points: tuple[float, float], number: int = 0, width: float = 360.0) -> None:
        """See the points (metres from the base), with a beam each degree, over so many degrees about straight ahead."""
        count = round(width)
        start = -np.radians(width / 2)
        ranges = np.full(count, np.nan, dtype=np.float32)
        for x, y in points:
            index = round((np.arctan2(y, x) - start) / np.radians(1.0)) % 360
            if index < count:
                ranges[index] = np.fmin(ranges[index], hypot(x, y))
        self.value = RangeScan(ranges, float(start), float(np.radians(1.0)), stamp, number, 0.1, 12.0)

    def __getattr__(self, name: str) -> Any:
        raise AssertionError(f"the range guard asks for '{name}'")


class GuardedBase:
    """The twin of a Kobuki with a range finder in a ``world``; ``ranger`` replaces the simulated one."""

    def __init__(
        self,
        world: SimulatedWorld = HALL,
        *,
        start: Pose2D = START,
        ranger: ScriptedRanger | None = None,
        guard: RangeGuardKeys | None = None,
        speed: float = 0.5,
        lag: float = 0.0,
        noise: float = 0.01,
        seed: int = 0,
        **keys: Any,
    ) -> None:
        self.timeline = Timeline()
        self.world = world
        self.notices: list[DeviceStatus] = []
        section = BaseKeys(max_speed=speed, range_guard=guard or RangeGuardKeys(), **keys)
        stage = SimContext(self.timeline.clock, world, lambda _: self.pose, report=self.notices.append)
        body = BaseBody(wheels=SimulatedWheels(pose=start, dead_time=lag), ground=world)
        self.base = BaseTwin(self.timeline.clock, body=body, **settings_of(section, stage))
        self.timeline.call_every(self.base.STEP_INTERVAL, self.base.step)
        self.ranger = ranger
        if ranger is None:
            twin = RangerTwin(
                make_range_function(world, (0.0, 0.0, 0.0), lambda _: self.pose), stage.clock, noise=noise, seed=seed
            )
            self.timeline.call_every(twin.STEP_INTERVAL, twin.step)
            twin.open()
            self.base.guard_by(twin)
        else:
            self.base.guard_by(ranger)
        self.base.open()
        self.touched = self.touched_moving = False
        self.least_clear = inf
        self.run(0.6)

    @property
    def pose(self) -> Pose2D:
        return self.base.body.pose

    @property
    def now(self) -> float:
        return self.timeline.clock.now()

    @property
    def faults(self) -> list[str]:
        return [each.message for each in self.notices if each.kind == "fault"]

    @property
    def because(self) -> str:
        return self.base.steering().reason

    def run(self, seconds: float) -> None:
        self.timeline.run_until(self.now + seconds)

    def drive(
        self,
        linear: float,
        angular: float = 0.0,
        *,
        seconds: float = 1.0,
        source: Source = Source.TELEOP,
        each: Callable[[], None] = lambda: None,
    ) -> None:
        """Command it 20 times a second, and watch how near it comes to what it could see."""
        end = self.now + seconds
        while self.now < end - 1e-9:
            each()
            self.base.drive(Velocity(linear, angular), source=source)
            self.run(0.05)
            clear = 0.0 if self.base.body.bumper else self.clear()
            self.least_clear = min(self.least_clear, clear)
            if clear <= 0.001 and not self.touched:
                self.touched, going = True, self.base.body.wheels.velocity.linear
                self.touched_moving = going * linear > 0.0 and abs(going) > 0.01

    def clear(self) -> float:
        """Return how far its rim is from anything, in metres."""
        x, y = self.pose.x, self.pose.y
        (x_low, x_high), (y_low, y_high) = self.world.room.extent()
        near = min(x - x_low, x_high - x, y - y_low, y_high - y)
        return min([near, *(hypot(*solid.nearest_offset(x, y)) for solid in self.world.solids(self.now))]) - 0.177
