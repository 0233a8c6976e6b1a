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
from behaviours.run import RunState
from behaviours.tracking.fuzzy import RuleBases
from behaviours.tracking.track import TrackFace
from drivers.api import HeadLimits, HeadPose
from drivers.base.limits import VelocityLimits
from drivers.base.twin import BaseTwin
from drivers.head.axis import ServoAxis
from drivers.head.twin import ServoHeadTwin
from drivers.sim.base_body import BaseBody as KobukiBody
from drivers.sim.timeline import Timeline
from drivers.sim.wheels import SimulatedWheels
from missions.assembly.simulated_eyes import SensorNoise
from perception.api import Box, Face, Gaze, View
from perception.delay import CameraDelay
from perception.delay_grid import GRID, Floats, find_unrecorded
from perception.exposure_clock import ExposureClock
from perception.geometry import FACE_WIDTH, Pinhole
from perception.senses import NewestView
from perception.tracks import AngleFilter

# What a face does in front of a robot that follows it, and what the robot follows it with.

StampNoise = Callable[[float, Random], float]
"""Returns by how many seconds a stamp is off at a time of the scenario; random values come from its second argument."""

STEP_ANGLE = radians(25)
WALK_RATE = radians(20)  # per second
RUN_RATE = radians(60)
SWING_AMPLITUDE = radians(10)

LEARNING_ANGLE, LEARNING_HOLD_TIME, LEARNING_STILL_TIME = radians(12), 0.75, 1.0
"""While a robot learns, a face is this far to a side (radians), for so many seconds each; in the end it stands."""

LEARNING_TIME = LEARNING_STILL_TIME + 4 * LEARNING_HOLD_TIME
"""Seconds that a robot has to learn its delays: three with something to learn from."""


class TrackingBody(StrEnum):
    """What turns: the head on a base that stands, the base with the camera on it, or both."""

    HEAD = "head"
    BASE = "base"
    BOTH = "both"


@dataclass(frozen=True, slots=True)
class Scenario:
    """A face that is there from time 0 on, at the bearing ``path(time)`` (radians, left of where the robot looks then).

    What it does can be foreseen up to ``foreseeable_until`` seconds: whether the robot has centred it counts up to then. The
    camera takes 20 pictures a second; a share ``drop_share`` of them gets lost, the others are known ``latency`` seconds
    later. ``settled_from`` is the time from which on the error counts as that of a robot that follows.

    What the robot is not told: its camera stamps pictures ``stamp_delay`` seconds after their exposure, their latency
    varies by ``jitter`` seconds to both sides, its base begins what it is told ``base_lag`` seconds later. Before time
    0 it has ``learning_time`` seconds, of which the face jumps to and fro in all but the last. ``other_path`` is the path of a
    second face. ``stamp_noise`` is added to each stamp, ``delay_change`` (seconds) to those from time 0 on.
    """

    name: str
    path: Callable[[float], float]
    latency: float = 0.1
    drop_share: float = 0.0
    seconds: float = 6.0
    foreseeable_until: float = 6.0
    settled_from: float = 2.0
    stamp_delay: float = 0.0
    jitter: float = 0.0
    base_lag: float = 0.0
    learning_time: float = 0.0
    other_path: Callable[[float], float] | None = None
    stamp_noise: StampNoise | None = None
    delay_change: float = 0.0

    def delay(self, time: float) -> float:
        """Return how many seconds after their exposure pictures of ``time`` are stamped, apart from the noise."""
        return self.stamp_delay + (self.delay_change if time >= 0.0 else 0.0)

    def bearing(self, time: float) -> float:
        """Return the bearing of the face at ``time``, also while the robot learns."""
        if time >= 0.0:
            return self.path(time)
        since = time + self.learning_time
        if since < 0.0 or time > -LEARNING_STILL_TIME:
            return 0.0
        return LEARNING_ANGLE if since % (2 * LEARNING_HOLD_TIME) < LEARNING_HOLD_TIME else -LEARNING_ANGLE


def standing_path(time: float) -> float:
    """Return the bearing of a face that appears aside, and stays there."""
    del time
    return STEP_ANGLE


def walking_path(time: float) -> float:
    """Return the bearing of a face that walks by at an even angular speed."""
    return WALK_RATE * time


def returning_path(time: float) -> float:
    """Return the bearing of a face that walks by, and back again after 3 seconds."""
    return WALK_RATE * (time if time < 3.0 else 6.0 - time)


def running_path(time: float) -> float:
    """Return the bearing of a face that goes by three times as fast, and stops when it is well aside."""
    return RUN_RATE * min(time, 1.5)


def crossing_path(time: float) -> float:
    """Return the bearing of a face that crosses the way of one that walks by, a second after time 0."""
    return WALK_RATE * (2.0 - time)


def swinging_path(period: float) -> Callable[[float], float]:
    """Return the path of a face that sways by 10 degrees to both sides, once in ``period`` seconds."""

    def path(time: float) -> float:
        return SWING_AMPLITUDE * sin(2 * pi * time / period)

    return path


def uniform_jitter(max_jitter: float) -> StampNoise:
    """Return the noise of stamps that jitter by up to ``most`` seconds to both sides."""

    def noise(time: float, random: Random) -> float:
        del time
        return random.uniform(-max_jitter, max_jitter)

    return noise


SCENARIOS = (
    Scenario("step of 25 deg", standing_path),
    Scenario("walk at 20 deg/s", walking_path),
    Scenario("walk, turning around", returning_path, foreseeable_until=3.0),
    Scenario("walk, 20 % dropped", walking_path, drop_share=0.2),
    Scenario("step, 200 ms late", standing_path, latency=0.2),
    Scenario("walk, 200 ms late", walking_path, latency=0.2),
)
"""What is benched: all with 100 ms from a picture to what it shows, unless they say otherwise."""

DELAY_SCENARIOS = (
    *(
        Scenario(
            f"stamps {1000 * late:+.0f} ms",
            standing_path,
            latency=max(0.1, late + 0.01),
            stamp_delay=late,
            learning_time=LEARNING_TIME,
        )
        for late in (-0.05, 0.0, 0.02, 0.05, 0.15)
    ),
    *(
        Scenario(f"base {1000 * lag:.0f} ms", standing_path, base_lag=lag, learning_time=LEARNING_TIME)
        for lag in (0.1, 0.2, 0.3)
    ),
    *(
        Scenario(f"{name}, {1000 * late:.0f} ms late", path, latency=late, learning_time=LEARNING_TIME)
        for name, path in (("step", standing_path), ("walk", walking_path))
        for late in (0.0, 0.2, 0.3)
    ),
    *(
        Scenario(f"{name}, jitter 80 ms", path, jitter=0.08, learning_time=LEARNING_TIME)
        for name, path in (("step", standing_path), ("walk", walking_path))
    ),
    *(
        Scenario(f"walk, {100 * lost:.0f} % dropped", walking_path, drop_share=lost, learning_time=LEARNING_TIME)
        for lost in (0.2, 0.5)
    ),
    Scenario(
        "run at 60 deg/s",
        running_path,
        learning_time=LEARNING_TIME,
        foreseeable_until=1.5,
        settled_from=0.7,
        seconds=4.0,
    ),
    *(
        Scenario(
            f"swing in {period:g} s",
            swinging_path(period),
            learning_time=LEARNING_TIME,
            seconds=9.0,
            settled_from=3.0,
            foreseeable_until=0.0,
        )
        for period in (0.25, 0.5, 1.0, 2.0)
    ),
    Scenario("two cross", walking_path, other_path=crossing_path, learning_time=LEARNING_TIME),
)
"""What is benched by `--delays`: what no robot is told, and what no prediction can know."""

JITTERS = (0.01, 0.02, 0.03)
"""Seconds by which stamps jitter to both sides in `--stamps`."""

STAMP_SCENARIOS = (
    *(
        Scenario(f"{name} ±{1000 * most:.0f} ms{after}", path, stamp_noise=uniform_jitter(most), learning_time=learning)
        for after, learning in (("", LEARNING_TIME), (", at once", 0.0))
        for name, path in (("step", standing_path), ("walk", walking_path))
        for most in JITTERS
    ),
    *(
        Scenario(f"delay {1000 * change:+.0f} ms", standing_path, delay_change=change, learning_time=LEARNING_TIME)
        for change in (0.08, -0.08)
    ),
)
"""What is benched by `--stamps`: stamps that jitter, with seconds to learn and "at once", and a delay that changes."""


# The eyes of a trial: faces, measured in pixels with noise, and filtered over time as perception does it.

PIXEL_NOISE = SensorNoise().noise
"""Pixels by which a found face is off, one sigma: as in simulations whose eyes know the truth."""

FACE_DISTANCE = 1.5
"""Metres to the face."""

LENS = Pinhole(640, 480, radians(60))
"""What the camera sees through."""


FACE_TIMEOUT = 1.0
"""Seconds after which a face that was not seen is forgotten."""

GATE_ANGLE = radians(20)
"""A face this far (radians) from where each of those before is expected is another one."""

FLOW_NOISE = radians(0.1)
"""Radians by which the background tells a turn of the camera wrongly, one sigma: as measured on rendered rooms."""


class FilteredSight(NewestView):
    """Faces, measured with noise that is drawn from ``random``; and how late the camera stamps them, learnt.

    ``gaze(time)`` is where the robot believes that its camera looked. ``now`` tells the time.
    """

    def __init__(self, random: Random, gaze: Callable[[float], Gaze], now: Callable[[], float]) -> None:
        self.delay = CameraDelay()
        self._random = random
        self._gaze = gaze
        self._now = now
        self._tracks: dict[int, tuple[AngleFilter, Face]] = {}
        self._ids = 0
        self._before: tuple[float, Floats] | None = None
        self._clock = ExposureClock()
        self._looked = 0.0

    def measure(self, bearing: float) -> Box | None:
        """Return where a face is in a picture; None where it is not wholly inside."""
        if not abs(bearing) < LENS.field_of_view / 2:
            return None
        x, y = LENS.angles_to_pixel(bearing, 0.0)
        x, y = x + self._random.gauss(0.0, PIXEL_NOISE), y + self._random.gauss(0.0, PIXEL_NOISE)
        half = FACE_WIDTH * LENS.focal / FACE_DISTANCE / 2
        return Box(x - half, y - half, 2 * half, 2 * half) if half <= x <= LENS.width - half else None

    def see(self, stamp: float, boxes: Sequence[Box], looked: float) -> None:
        """Take in what a picture shows that was stamped ``stamp``; ``looked`` is where the camera truly looked."""
        times = stamp - GRID
        yaws = np.array([self._gaze(time).yaw for time in times])
        if self._before is None:
            self.delay.start_chain(yaws)
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
        faces = (face for _, face in self._tracks.values() if stamp - face.stamp < FACE_TIMEOUT)
        self._view = View(looked=stamp, faces=tuple(faces))

    def _follow(self, stamp: float, box: Box, gaze: Gaze, *, alone: bool) -> None:
        """Take a face for the one before that is nearest to where it is expected, or for a new one."""
        bearing, elevation = LENS.pixel_to_angles(*box.centre)
        yaw = gaze.yaw + bearing
        offs = {
            number: abs(face.predict(stamp)[0] - yaw)
            for number, (_, face) in self._tracks.items()
            if face.stamp < stamp and stamp - face.stamp < FACE_TIMEOUT
        }
        number = min(offs, key=lambda number: offs[number], default=0)
        if number and offs[number] < GATE_ANGLE:
            motion, before = self._tracks[number]
            motion.update(yaw, stamp - before.stamp, abs(gaze.yaw - self._looked), gaze.doubt)
        else:
            if alone:  # it has jumped; nobody is where it was
                self._tracks.clear()
            self._ids = number = self._ids + 1
            motion = AngleFilter(yaw)
        pitch = gaze.pitch + elevation
        face = Face(number, stamp, box, bearing, elevation, motion.angle, pitch, motion.rate, 0.0, FACE_DISTANCE)
        self._tracks[number] = motion, face


WARM_UP_TIME = 2.0
"""Seconds that the robot has to look where it is to begin."""

FRAME_INTERVAL = 0.05
"""Seconds between two pictures, and between two scheduled ticks: 20 Hz. A picture that is understood wakes a tick."""

FRAME_PHASE = 0.02
"""Seconds by which pictures are taken after scheduled ticks: nothing keeps the two in step."""

SAMPLE_INTERVAL = 0.01
"""Seconds between two looks at how far off the robot is."""

HEAD_LIMITS = HeadLimits(pan=(radians(-80), radians(80)), tilt=(radians(-60), radians(20)), speed=radians(120))
"""The head of the Rodney project, as the robot files have it."""

BASE_LIMITS = VelocityLimits(max_linear=0.5, max_angular=1.92, linear_acceleration=0.5, angular_acceleration=3.5)
"""A Kobuki, likewise."""


@dataclass(slots=True)
class TrackingTrace:
    """What a trial showed: at each of ``times`` (seconds) the ``errors`` (radians), and whether the face was lost.

    ``known_times`` are the times at which the pictures that were taken from time 0 on were known. ``delay_errors`` are
    the errors (seconds) of the camera's delay, one a picture: NaN while it was not known.
    """

    times: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    known_times: list[float] = field(default_factory=list)
    delay_errors: list[float] = field(default_factory=list)
    lost: bool = False


class TrackingTrial:
    """A robot that follows a face with ``rules``, by ``body``, in a ``scenario``. Equal seeds make equal traces.

    ``lag`` (seconds) is what the behaviour believes that the base takes to begin what it is told.
    """

    def __init__(
        self,
        rules: RuleBases,
        scenario: Scenario,
        body: TrackingBody,
        *,
        seed: int = 0,
        lag: float = 0.0,
    ) -> None:
        self._scenario = scenario
        self._timeline = Timeline()
        self._clock = self._timeline.clock
        self._random = Random(f"{scenario.name} {body} {seed}")  # noqa: S311 - noise is no secret
        self._begin = -radians(60) if body is TrackingBody.HEAD else 0.0  # a head walks from one side to the other
        self._head = None if body is TrackingBody.BASE else self._make_head()
        self._base = None if body is TrackingBody.HEAD else self._make_base(scenario.base_lag)
        self._sight = FilteredSight(self._random, self._estimated_gaze, self._clock.now)
        self._last_arrival = 0.0
        self._leaf = TrackFace("track_face")
        self._leaf.run = RunState(self._clock)
        self._leaf.robot = Robot(base_part=self._base, head_part=self._head, sight_part=self._sight)
        self._leaf.controller = rules
        self._leaf.lag = lag
        self._trace = TrackingTrace()

    def _make_head(self) -> ServoHeadTwin:
        return ServoHeadTwin(
            self._clock,
            pan=ServoAxis(0, *HEAD_LIMITS.pan),
            tilt=ServoAxis(1, *HEAD_LIMITS.tilt),
            speed=HEAD_LIMITS.speed,
            acceleration=HEAD_LIMITS.acceleration,
            start=HeadPose(self._begin, 0.0),
        )

    def _make_base(self, lag: float) -> BaseTwin:
        return BaseTwin(
            self._clock,
            max_linear=BASE_LIMITS.max_linear,
            max_angular=BASE_LIMITS.max_angular,
            linear_acceleration=BASE_LIMITS.linear_acceleration,
            angular_acceleration=BASE_LIMITS.angular_acceleration,
            body=KobukiBody(wheels=SimulatedWheels(dead_time=lag)),
        )

    def run(self) -> TrackingTrace:
        """Run it to its end; return what it showed."""
        timeline = self._timeline
        twins = [twin for twin in (self._base, self._head) if twin is not None]
        for twin in twins:
            twin.open()
            timeline.call_every(twin.STEP_INTERVAL, twin.step)
        timeline.run_until(WARM_UP_TIME)
        timeline.call_every(FRAME_INTERVAL, self._tick)
        timeline.call_every(FRAME_INTERVAL, self._expose, start=WARM_UP_TIME + FRAME_PHASE)
        timeline.call_every(SAMPLE_INTERVAL, self._sample_error)
        timeline.run_until(
            WARM_UP_TIME + self._scenario.learning_time + self._scenario.seconds, lambda: self._trace.lost
        )
        for twin in twins:
            twin.close()
        return self._trace

    @property
    def delay(self) -> CameraDelay:
        """What was learnt of how late the camera stamps its pictures."""
        return self._sight.delay

    def _time(self) -> float:
        """Return the time of the scenario: it begins with the first picture, or when the robot has learnt."""
        return round(self._clock.now() - WARM_UP_TIME - FRAME_PHASE - self._scenario.learning_time, 9)

    def _true_gaze(self) -> float:
        """Return where the camera truly looks, in radians."""
        now = self._clock.now()
        pan = 0.0 if self._head is None else self._head.true_pose(now).pan
        return pan + (0.0 if self._base is None else self._base.true_pose(now).heading)

    def _estimated_gaze(self, time: float) -> Gaze:
        """Return where the robot believes that the camera looked at a time."""
        pose = None if self._head is None else self._head.pose_at(time)
        heading = 0.0 if self._base is None else self._base.heading_at(time) or 0.0
        return Gaze(heading + (pose.pan if pose else 0.0), pose.tilt if pose else 0.0)

    def _bearing(self) -> float:
        return self._begin + self._scenario.bearing(self._time()) - self._true_gaze()

    def _tick(self) -> None:
        self._leaf.run.tick += 1
        if self._leaf.execute_tick() is Status.FAILURE:
            self._trace.lost = True

    def _expose(self) -> None:
        scenario, now, bearings = self._scenario, self._clock.now(), [self._bearing()]
        if scenario.other_path is not None and self._time() >= 0:
            bearings.append(self._begin + scenario.other_path(self._time()) - self._true_gaze())
        boxes = [box for box in map(self._sight.measure, bearings) if box is not None]
        if not boxes or self._random.random() < scenario.drop_share:
            return
        late = scenario.latency + (self._random.uniform(-1, 1) * scenario.jitter if scenario.jitter else 0.0)
        self._last_arrival = max(now + max(late, 0.0), self._last_arrival)  # no picture overtakes another
        if self._time() >= 0:
            self._trace.known_times.append(self._last_arrival - now + self._time())
        stamp = now + scenario.delay(self._time())
        if scenario.stamp_noise is not None:
            stamp += scenario.stamp_noise(self._time(), self._random)
        self._timeline.call_at(self._last_arrival, partial(self._receive_picture, stamp, boxes, self._true_gaze()))

    def _receive_picture(self, stamp: float, boxes: Sequence[Box], looked: float) -> None:
        self._sight.see(stamp, boxes, looked)
        error = self.delay.seconds - self._scenario.delay(self._time())
        self._trace.delay_errors.append(error if self.delay.is_known else math.nan)
        self._tick()

    def _sample_error(self) -> None:
        if self._time() >= 0:
            self._trace.times.append(self._time())
            self._trace.errors.append(self._bearing())
