"""One trial of a controller: the leaf that follows faces, on the twins of a robot, in simulated time."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import radians
from random import Random

import numpy as np
from py_trees.common import Status

from behaviours.robot import Robot
from behaviours.run import Run
from behaviours.tracking.rules import RuleBases
from behaviours.tracking.track_face import TrackFace
from drivers.api import HeadLimits, HeadPose
from drivers.base.limits import Limits
from drivers.base.twin import BaseTwin
from drivers.head.axis import ServoAxis
from drivers.head.twin import HeadTwin
from drivers.sim.body import Body as KobukiBody
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import Wheels
from missions.assembly.seeing import SensorNoise
from missions.plugins.testing.controllers.scenario import Body, Scenario
from perception.api import Box, Face, Gaze, View
from perception.delay import Delay
from perception.delay_grid import GRID, Floats, find_unrecorded
from perception.exposure_clock import ExposureClock
from perception.geometry import FACE_WIDTH, Pinhole
from perception.senses import NewestView
from perception.tracks import Motion

# The eyes of a trial: faces, measured in pixels with noise, and filtered over time as perception does it.

NOISE = SensorNoise().noise
"""Pixels by which a found face is off, one sigma: as in simulations whose eyes know the truth."""

DISTANCE = 1.5
"""Metres to the face."""

LENS = Pinhole(640, 480, radians(60))
"""What the camera sees through."""


GONE = 1.0
"""Seconds after which a face that was not seen is forgotten."""

GATE = radians(20)
"""A face this far (radians) from where each of those before is expected is another one."""

FLOW_NOISE = radians(0.1)
"""Radians by which the background tells a turn of the camera wrongly, one sigma: as measured on rendered rooms."""


class FilteredSight(NewestView):
    """Faces, measured with noise that is drawn from ``random``; and how late the camera stamps them, learnt.

    ``gaze(time)`` is where the robot believes that its camera looked. ``now`` tells the time.
    """

    def __init__(self, random: Random, gaze: Callable[[float], Gaze], now: Callable[[], float]) -> None:
        self.delay = Delay()
        self._random = random
        self._gaze = gaze
        self._now = now
        self._followed: dict[int, tuple[Motion, Face]] = {}
        self._ids = 0
        self._before: tuple[float, Floats] | None = None
        self._clock = ExposureClock()
        self._looked = 0.0

    def measure(self, bearing: float) -> Box | None:
        """Return where a face is in a picture; None where it is not wholly inside."""
        if not abs(bearing) < LENS.field_of_view / 2:
            return None
        x, y = LENS.pixel(bearing, 0.0)
        x, y = x + self._random.gauss(0.0, NOISE), y + self._random.gauss(0.0, NOISE)
        half = FACE_WIDTH * LENS.focal / DISTANCE / 2
        return Box(x - half, y - half, 2 * half, 2 * half) if half <= x <= LENS.width - half else None

    def see(self, stamp: float, boxes: Sequence[Box], looked: float) -> None:
        """Take in what a picture shows that was stamped ``stamp``; ``looked`` is where the camera truly looked."""
        times = stamp - GRID
        yaws = np.array([self._gaze(time).yaw for time in times])
        if self._before is None:
            self.delay.begin(yaws)
        else:
            turned = looked - self._before[0] + self._random.gauss(0.0, FLOW_NOISE)
            unrecorded = find_unrecorded(yaws, self._gaze(times[0] + 1.0).yaw, times, self._now())
            self.delay.learn(turned, yaws - self._before[1], yaws, unrecorded)
        self._before = looked, yaws
        exposure = self._clock.expose(stamp, self.delay.seconds, self._now())
        stamp, gaze = exposure.stamp, self._gaze(exposure.time)
        gaze = replace(gaze, doubt=max(exposure.doubt, self.delay.doubt))
        for box in boxes:
            self._follow(stamp, box, gaze, alone=len(boxes) == 1)
        self._looked = gaze.yaw
        faces = (face for _, face in self._followed.values() if stamp - face.stamp < GONE)
        self._view = View(looked=stamp, faces=tuple(faces))

    def _follow(self, stamp: float, box: Box, gaze: Gaze, *, alone: bool) -> None:
        """Take a face for the one before that is nearest to where it is expected, or for a new one."""
        bearing, elevation = LENS.angles(*box.centre)
        yaw = gaze.yaw + bearing
        offs = {
            number: abs(face.predict(stamp)[0] - yaw)
            for number, (_, face) in self._followed.items()
            if face.stamp < stamp and stamp - face.stamp < GONE
        }
        number = min(offs, key=lambda number: offs[number], default=0)
        if number and offs[number] < GATE:
            motion, before = self._followed[number]
            motion.update(yaw, stamp - before.stamp, abs(gaze.yaw - self._looked), gaze.doubt)
        else:
            if alone:  # it has jumped; nobody is where it was
                self._followed.clear()
            self._ids = number = self._ids + 1
            motion = Motion(yaw)
        pitch = gaze.pitch + elevation
        face = Face(number, stamp, box, bearing, elevation, motion.angle, pitch, motion.rate, 0.0, DISTANCE)
        self._followed[number] = motion, face


START = 2.0
"""Seconds that the robot has to look where it is to begin."""

PERIOD = 0.05
"""Seconds between two pictures, and between two scheduled ticks: 20 Hz. A picture that is understood wakes a tick."""

PHASE = 0.02
"""Seconds by which pictures are taken after scheduled ticks: nothing keeps the two in step."""

LOOK = 0.01
"""Seconds between two looks at how far off the robot is."""

HEAD = HeadLimits(pan=(radians(-80), radians(80)), tilt=(radians(-60), radians(20)), speed=radians(120))
"""The head of the Rodney project, as the robot files have it."""

BASE = Limits(max_linear=0.5, max_angular=1.92, linear_acceleration=0.5, angular_acceleration=3.5)
"""A Kobuki, likewise."""


@dataclass(slots=True)
class Trace:
    """What a trial showed: at each of ``times`` (seconds) the ``errors`` (radians), and whether the face was lost.

    ``understood`` are the times at which the pictures that were taken from time 0 on were known. ``delay_errors`` are
    the errors (seconds) of the camera's delay, one a picture: NaN while it was not known.
    """

    times: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    understood: list[float] = field(default_factory=list)
    delay_errors: list[float] = field(default_factory=list)
    lost: bool = False


class Trial:
    """A robot that follows a face with ``rules``, by ``body``, in a ``scenario``. Equal seeds make equal traces.

    ``lag`` (seconds) is what the behaviour believes that the base takes to begin what it is told.
    """

    def __init__(
        self,
        rules: RuleBases,
        scenario: Scenario,
        body: Body,
        *,
        seed: int = 0,
        lag: float = 0.0,
    ) -> None:
        self._scenario = scenario
        self._timeline = Timeline()
        self._clock = self._timeline.clock
        self._random = Random(f"{scenario.name} {body} {seed}")  # noqa: S311 - noise is no secret
        self._begin = -radians(60) if body is Body.HEAD else 0.0  # a head walks from one side to the other
        self._head = None if body is Body.BASE else self._make_head()
        self._base = None if body is Body.HEAD else self._make_base(scenario.base_lag)
        self._sight = FilteredSight(self._random, self._believed, self._clock.now)
        self._arrived = 0.0
        self._leaf = TrackFace("track_face")
        self._leaf.run = Run(self._clock)
        self._leaf.robot = Robot(base_part=self._base, head_part=self._head, sight_part=self._sight)
        self._leaf.controller = rules
        self._leaf.lag = lag
        self._trace = Trace()

    def _make_head(self) -> HeadTwin:
        return HeadTwin(
            self._clock,
            pan=ServoAxis(0, *HEAD.pan),
            tilt=ServoAxis(1, *HEAD.tilt),
            speed=HEAD.speed,
            acceleration=HEAD.acceleration,
            start=HeadPose(self._begin, 0.0),
        )

    def _make_base(self, lag: float) -> BaseTwin:
        return BaseTwin(
            self._clock,
            max_linear=BASE.max_linear,
            max_angular=BASE.max_angular,
            linear_acceleration=BASE.linear_acceleration,
            angular_acceleration=BASE.angular_acceleration,
            body=KobukiBody(wheels=Wheels(dead_time=lag)),
        )

    def run(self) -> Trace:
        """Run it to its end; return what it showed."""
        timeline = self._timeline
        twins = [twin for twin in (self._base, self._head) if twin is not None]
        for twin in twins:
            twin.open()
            timeline.every(twin.PERIOD, twin.step)
        timeline.run(START)
        timeline.every(PERIOD, self._tick)
        timeline.every(PERIOD, self._expose, start=START + PHASE)
        timeline.every(LOOK, self._look)
        timeline.run(START + self._scenario.learning + self._scenario.seconds, lambda: self._trace.lost)
        for twin in twins:
            twin.close()
        return self._trace

    @property
    def delay(self) -> Delay:
        """What was learnt of how late the camera stamps its pictures."""
        return self._sight.delay

    def _time(self) -> float:
        """Return the time of the scenario: it begins with the first picture, or when the robot has learnt."""
        return round(self._clock.now() - START - PHASE - self._scenario.learning, 9)

    def _gaze(self) -> float:
        """Return where the camera truly looks, in radians."""
        now = self._clock.now()
        pan = 0.0 if self._head is None else self._head.true_pose(now).pan
        return pan + (0.0 if self._base is None else self._base.true_pose(now).heading)

    def _believed(self, time: float) -> Gaze:
        """Return where the robot believes that the camera looked at a time."""
        pose = None if self._head is None else self._head.pose_at(time)
        heading = 0.0 if self._base is None else self._base.heading_at(time) or 0.0
        return Gaze(heading + (pose.pan if pose else 0.0), pose.tilt if pose else 0.0)

    def _bearing(self) -> float:
        return self._begin + self._scenario.bearing(self._time()) - self._gaze()

    def _tick(self) -> None:
        self._leaf.run.tick += 1
        if self._leaf.execute_tick() is Status.FAILURE:
            self._trace.lost = True

    def _expose(self) -> None:
        scenario, now, bearings = self._scenario, self._clock.now(), [self._bearing()]
        if scenario.other is not None and self._time() >= 0:
            bearings.append(self._begin + scenario.other(self._time()) - self._gaze())
        boxes = [box for box in map(self._sight.measure, bearings) if box is not None]
        if not boxes or self._random.random() < scenario.drops:
            return
        late = scenario.latency + (self._random.uniform(-1, 1) * scenario.jitter if scenario.jitter else 0.0)
        self._arrived = max(now + max(late, 0.0), self._arrived)  # no picture overtakes another
        if self._time() >= 0:
            self._trace.understood.append(self._arrived - now + self._time())
        stamp = now + scenario.delay(self._time())
        if scenario.stamp_noise is not None:
            stamp += scenario.stamp_noise(self._time(), self._random)
        self._timeline.at(self._arrived, partial(self._understand, stamp, boxes, self._gaze()))

    def _understand(self, stamp: float, boxes: Sequence[Box], looked: float) -> None:
        self._sight.see(stamp, boxes, looked)
        error = self.delay.seconds - self._scenario.delay(self._time())
        self._trace.delay_errors.append(error if self.delay.known else math.nan)
        self._tick()

    def _look(self) -> None:
        if self._time() >= 0:
            self._trace.times.append(self._time())
            self._trace.errors.append(self._bearing())
