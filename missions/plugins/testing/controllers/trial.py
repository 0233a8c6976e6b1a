"""One trial of a controller: the leaf that follows faces, on the twins of a robot, in simulated time."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from math import pi, radians, sin
from random import Random

import numpy as np
from py_trees.common import Status

from behaviours.robot import Robot
from behaviours.run import Run
from behaviours.tracking.fuzzy import RuleBases
from behaviours.tracking.track import TrackFace
from drivers.api import HeadLimits, HeadPose
from drivers.base.limits import Limits
from drivers.base.twin import BaseTwin
from drivers.head.axis import ServoAxis
from drivers.head.twin import HeadTwin
from drivers.sim.body import Body as KobukiBody
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import Wheels
from missions.assembly.seeing import SensorNoise
from perception.api import Box, Face, Gaze, View
from perception.delay import Delay
from perception.delay_grid import GRID, Floats, find_unrecorded
from perception.exposure_clock import ExposureClock
from perception.geometry import FACE_WIDTH, Pinhole
from perception.senses import NewestView
from perception.tracks import Motion

# What a face does in front of a robot that follows it, and what the robot follows it with.

StampNoise = Callable[[float, Random], float]
"""Returns by how many seconds a stamp is off at a time of the scenario; random values come from its second argument."""

STEP = radians(25)
WALK = radians(20)  # per second
RUN = radians(60)
SWING = radians(10)

ASIDE, STAYS, STILL = radians(12), 0.75, 1.0
"""While a robot learns, a face is this far to a side (radians), for so many seconds each; in the end it stands."""

LEARNING = STILL + 4 * STAYS
"""Seconds that a robot has to learn its delays: three with something to learn from."""


class Body(StrEnum):
    """What turns: the head on a base that stands, the base with the camera on it, or both."""

    HEAD = "head"
    BASE = "base"
    BOTH = "both"


@dataclass(frozen=True, slots=True)
class Scenario:
    """A face that is there from time 0 on, at the bearing ``path(time)`` (radians, left of where the robot looks then).

    What it does can be foreseen up to ``surprise`` seconds: whether the robot has centred it counts up to then. The
    camera takes 20 pictures a second; a share ``drops`` of them gets lost, the others are known ``latency`` seconds
    later. ``settled`` is the time from which on the error counts as that of a robot that follows.

    What the robot is not told: its camera stamps pictures ``stamped`` seconds after their exposure, their latency
    varies by ``jitter`` seconds to both sides, its base begins what it is told ``base_lag`` seconds later. Before time
    0 it has ``learning`` seconds, of which the face jumps to and fro in all but the last. ``other`` is the path of a
    second face. ``stamp_noise`` is added to each stamp, ``delay_change`` (seconds) to those from time 0 on.
    """

    name: str
    path: Callable[[float], float]
    latency: float = 0.1
    drops: float = 0.0
    seconds: float = 6.0
    surprise: float = 6.0
    settled: float = 2.0
    stamped: float = 0.0
    jitter: float = 0.0
    base_lag: float = 0.0
    learning: float = 0.0
    other: Callable[[float], float] | None = None
    stamp_noise: StampNoise | None = None
    delay_change: float = 0.0

    def delay(self, time: float) -> float:
        """Return how many seconds after their exposure pictures of ``time`` are stamped, apart from the noise."""
        return self.stamped + (self.delay_change if time >= 0.0 else 0.0)

    def bearing(self, time: float) -> float:
        """Return the bearing of the face at ``time``, also while the robot learns."""
        if time >= 0.0:
            return self.path(time)
        since = time + self.learning
        if since < 0.0 or time > -STILL:
            return 0.0
        return ASIDE if since % (2 * STAYS) < STAYS else -ASIDE


def stands(time: float) -> float:
    """Return the bearing of a face that appears aside, and stays there."""
    del time
    return STEP


def walks(time: float) -> float:
    """Return the bearing of a face that walks by at an even angular speed."""
    return WALK * time


def turns_around(time: float) -> float:
    """Return the bearing of a face that walks by, and back again after 3 seconds."""
    return WALK * (time if time < 3.0 else 6.0 - time)


def runs(time: float) -> float:
    """Return the bearing of a face that goes by three times as fast, and stops when it is well aside."""
    return RUN * min(time, 1.5)


def comes_across(time: float) -> float:
    """Return the bearing of a face that crosses the way of one that walks by, a second after time 0."""
    return WALK * (2.0 - time)


def swings(period: float) -> Callable[[float], float]:
    """Return the path of a face that sways by 10 degrees to both sides, once in ``period`` seconds."""

    def path(time: float) -> float:
        return SWING * sin(2 * pi * time / period)

    return path


def uniform(most: float) -> StampNoise:
    """Return the noise of stamps that jitter by up to ``most`` seconds to both sides."""

    def noise(time: float, random: Random) -> float:
        del time
        return random.uniform(-most, most)

    return noise


SCENARIOS = (
    Scenario("step of 25 deg", stands),
    Scenario("walk at 20 deg/s", walks),
    Scenario("walk, turning around", turns_around, surprise=3.0),
    Scenario("walk, 20 % dropped", walks, drops=0.2),
    Scenario("step, 200 ms late", stands, latency=0.2),
    Scenario("walk, 200 ms late", walks, latency=0.2),
)
"""What is benched: all with 100 ms from a picture to what it shows, unless they say otherwise."""

DELAYS = (
    *(
        Scenario(
            f"stamps {1000 * late:+.0f} ms", stands, latency=max(0.1, late + 0.01), stamped=late, learning=LEARNING
        )
        for late in (-0.05, 0.0, 0.02, 0.05, 0.15)
    ),
    *(Scenario(f"base {1000 * lag:.0f} ms", stands, base_lag=lag, learning=LEARNING) for lag in (0.1, 0.2, 0.3)),
    *(
        Scenario(f"{name}, {1000 * late:.0f} ms late", path, latency=late, learning=LEARNING)
        for name, path in (("step", stands), ("walk", walks))
        for late in (0.0, 0.2, 0.3)
    ),
    *(
        Scenario(f"{name}, jitter 80 ms", path, jitter=0.08, learning=LEARNING)
        for name, path in (("step", stands), ("walk", walks))
    ),
    *(Scenario(f"walk, {100 * lost:.0f} % dropped", walks, drops=lost, learning=LEARNING) for lost in (0.2, 0.5)),
    Scenario("run at 60 deg/s", runs, learning=LEARNING, surprise=1.5, settled=0.7, seconds=4.0),
    *(
        Scenario(f"swing in {period:g} s", swings(period), learning=LEARNING, seconds=9.0, settled=3.0, surprise=0.0)
        for period in (0.25, 0.5, 1.0, 2.0)
    ),
    Scenario("two cross", walks, other=comes_across, learning=LEARNING),
)
"""What is benched by `--delays`: what no robot is told, and what no prediction can know."""

JITTERS = (0.01, 0.02, 0.03)
"""Seconds by which stamps jitter to both sides in `--stamps`."""

STAMPS = (
    *(
        Scenario(f"{name} ±{1000 * most:.0f} ms{after}", path, stamp_noise=uniform(most), learning=learning)
        for after, learning in (("", LEARNING), (", at once", 0.0))
        for name, path in (("step", stands), ("walk", walks))
        for most in JITTERS
    ),
    *(
        Scenario(f"delay {1000 * change:+.0f} ms", stands, delay_change=change, learning=LEARNING)
        for change in (0.08, -0.08)
    ),
)
"""What is benched by `--stamps`: stamps that jitter, with seconds to learn and "at once", and a delay that changes."""


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
