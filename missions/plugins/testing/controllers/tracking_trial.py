"""Trial of a controller: the leaf that follows faces, on a robot of twins, in simulated time."""

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

# Motion of a face in front of a robot, and the robot's joints that follow it.

StampNoise = Callable[[float, Random], float]
"""Function that returns the error (s) of a time stamp, given the scenario time and a source of random values."""

STEP_ANGLE = radians(25)
WALK_RATE = radians(20)  # per second
RUN_RATE = radians(60)
SWING_AMPLITUDE = radians(10)

LEARNING_ANGLE, LEARNING_HOLD_TIME, LEARNING_STILL_TIME = radians(12), 0.75, 1.0
"""While a robot learns, a face is this far to a side (radians), for so many seconds each; in the end it stands."""

LEARNING_TIME = LEARNING_STILL_TIME + 4 * LEARNING_HOLD_TIME
"""Seconds for the robot to measure its delays: 3 s in which the face jumps from side to side, then 1 s at rest."""


class TrackingBody(StrEnum):
    """Joints that turn the camera: the head on a standing base, the base with the camera fixed on it, or both."""

    HEAD = "head"
    BASE = "base"
    BOTH = "both"


@dataclass(frozen=True, slots=True)
class Scenario:
    """A face visible from time 0 at the bearing ``path(time)``, in radians left of the robot's first gaze.

    The face's motion can be foreseen until ``foreseeable_until`` seconds; later errors do not count for the time to
    centre. The camera takes 20 pictures a second; a share ``drop_share`` of them is lost, the others arrive ``latency``
    seconds later. Errors from ``settled_from`` seconds on count for the RMS error.

    Unknown to the robot: pictures are stamped ``stamp_delay`` seconds after exposure, their latency varies by
    ``jitter`` seconds to both sides, and the base starts to move ``base_lag`` seconds after a command. Before time 0
    the robot has ``learning_time`` seconds to measure its delays: the face jumps from side to side, and is at rest in
    the last second. ``other_path`` is that of a second face. ``stamp_noise`` is added to each time stamp, and
    ``delay_change`` (seconds) to those from time 0 on.
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
        """Return the seconds from exposure to time stamp of a picture at ``time``, without the noise."""
        return self.stamp_delay + (self.delay_change if time >= 0.0 else 0.0)

    def bearing(self, time: float) -> float:
        """Return the bearing of the face at ``time``, also during the learning time."""
        if time >= 0.0:
            return self.path(time)
        since = time + self.learning_time
        if since < 0.0 or time > -LEARNING_STILL_TIME:
            return 0.0
        return LEARNING_ANGLE if since % (2 * LEARNING_HOLD_TIME) < LEARNING_HOLD_TIME else -LEARNING_ANGLE


def standing_path(time: float) -> float:
    """Return the bearing of a face that appears to the side and stays there."""
    del time
    return STEP_ANGLE


def walking_path(time: float) -> float:
    """Return the bearing of a face that walks past at constant angular speed."""
    return WALK_RATE * time


def returning_path(time: float) -> float:
    """Return the bearing of a face that walks past, and back after 3 seconds."""
    return WALK_RATE * (time if time < 3.0 else 6.0 - time)


def running_path(time: float) -> float:
    """Return the bearing of a face that passes three times as fast as ``walking_path``, then stops to the side."""
    return RUN_RATE * min(time, 1.5)


def crossing_path(time: float) -> float:
    """Return the bearing of a face that walks against the direction of ``walking_path``; they meet after one second."""
    return WALK_RATE * (2.0 - time)


def swinging_path(period: float) -> Callable[[float], float]:
    """Return the path of a face that swings by 10 degrees to both sides, once per ``period`` seconds."""

    def path(time: float) -> float:
        return SWING_AMPLITUDE * sin(2 * pi * time / period)

    return path


def uniform_jitter(max_jitter: float) -> StampNoise:
    """Return a noise of time stamps, uniform within ``max_jitter`` seconds to both sides."""

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
"""Scenarios of the benchmark, with a latency of 100 ms unless stated."""

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
"""Scenarios of `--delays`: delays unknown to the robot, and motions that no prediction foresees."""

JITTERS = (0.01, 0.02, 0.03)
"""Maximum errors of time stamps in the scenarios of `mission controller bench --stamps`: seconds, early or late."""

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
"""Scenarios of `--stamps`: jittering stamps with and without learning time, and a delay that changes."""


# Sight of a trial: faces measured in pixels with noise, and filtered over time as in perception.

PIXEL_NOISE = SensorNoise().noise
"""Standard deviation of a face position in pixels, as in simulations with ``--eyes truth``."""

FACE_DISTANCE = 1.5
"""Distance in metres from the camera to the simulated face."""

LENS = Pinhole(640, 480, radians(60))
"""Lens of the simulated camera: width and height in pixels, and field of view in radians."""


FACE_TIMEOUT = 1.0
"""Seconds after which the track of an unseen face is dropped."""

GATE_ANGLE = radians(20)
"""Distance in radians from the predicted positions of all known faces beyond which a face counts as new."""

FLOW_NOISE = radians(0.1)
"""Standard deviation in radians of a camera turn that is measured from the picture's background.

The value was found on rendered rooms.
"""


class FilteredSight(NewestView):
    """Simulated sight: the face's position with random noise, filtered as in a real run.

    It also measures the delay of the camera's stamps. ``random`` supplies the noise. ``gaze(time)`` is the robot's
    estimate of the camera's direction. ``now`` returns the time.
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
        """Return the box of a face in a picture; None unless it is completely inside."""
        if not abs(bearing) < LENS.field_of_view / 2:
            return None
        x, y = LENS.angles_to_pixel(bearing, 0.0)
        x, y = x + self._random.gauss(0.0, PIXEL_NOISE), y + self._random.gauss(0.0, PIXEL_NOISE)
        half = FACE_WIDTH * LENS.focal / FACE_DISTANCE / 2
        return Box(x - half, y - half, 2 * half, 2 * half) if half <= x <= LENS.width - half else None

    def see(self, stamp: float, boxes: Sequence[Box], looked: float) -> None:
        """Process a picture with time stamp ``stamp``; ``boxes`` are the faces found in it.

        ``looked`` is the camera's true direction in radians.
        """
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
        """Assign a face to the nearest predicted track, or begin a new track.

        ``gaze`` is the estimated direction of the camera. If the face is ``alone`` in the picture and near no track, it
        has jumped, and all old tracks are dropped.
        """
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
            if alone:  # the face has jumped; the old track is wrong
                self._tracks.clear()
            self._ids = number = self._ids + 1
            motion = AngleFilter(yaw)
        pitch = gaze.pitch + elevation
        face = Face(number, stamp, box, bearing, elevation, motion.angle, pitch, motion.rate, 0.0, FACE_DISTANCE)
        self._tracks[number] = motion, face


WARM_UP_TIME = 2.0
"""Seconds at the begin of a trial in which the robot looks at its start direction, before the first picture."""

FRAME_INTERVAL = 0.05
"""Seconds between two pictures, and between two scheduled ticks. A processed picture also starts a tick early."""

FRAME_PHASE = 0.02
"""Offset of pictures from scheduled ticks in seconds: they are not synchronised."""

SAMPLE_INTERVAL = 0.01
"""Seconds between two samples of the tracking error."""

HEAD_LIMITS = HeadLimits(pan=(radians(-80), radians(80)), tilt=(radians(-60), radians(20)), speed=radians(120))
"""Limits of the Rodney head, as in the robot files."""

BASE_LIMITS = VelocityLimits(max_linear=0.5, max_angular=1.92, linear_acceleration=0.5, angular_acceleration=3.5)
"""Limits of a Kobuki base, as in the robot files."""


@dataclass(slots=True)
class TrackingTrace:
    """Trace of a trial: the ``errors`` (radians) at ``times`` (seconds), and whether the face was lost.

    ``known_times`` are the arrival times of the pictures taken from time 0 on. ``delay_errors`` are the errors
    (seconds) of the camera's delay, one a picture: NaN while it was unknown.
    """

    times: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    known_times: list[float] = field(default_factory=list)
    delay_errors: list[float] = field(default_factory=list)
    lost: bool = False


class TrackingTrial:
    """A robot that follows the face of a ``scenario`` by the controller ``rules``; ``body`` tells which joints turn.

    Equal seeds give equal traces. ``lag`` is the base's lag in seconds that the behaviour assumes.
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
        self._random = Random(f"{scenario.name} {body} {seed}")  # noqa: S311 - noise needs no security
        self._begin = -radians(60) if body is TrackingBody.HEAD else 0.0  # the head turns from one side to the other
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
        """Run the trial to its end; return its trace."""
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
        """Delay of the camera's time stamps as the robot has measured it."""
        return self._sight.delay

    def _time(self) -> float:
        """Return the scenario time, which is 0 at the first picture or at the end of the learning time."""
        return round(self._clock.now() - WARM_UP_TIME - FRAME_PHASE - self._scenario.learning_time, 9)

    def _true_gaze(self) -> float:
        now = self._clock.now()
        pan = 0.0 if self._head is None else self._head.true_pose(now).pan
        return pan + (0.0 if self._base is None else self._base.true_pose(now).heading)

    def _estimated_gaze(self, time: float) -> Gaze:
        """Return the robot's estimate of the camera's direction at a time."""
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
        self._last_arrival = max(now + max(late, 0.0), self._last_arrival)  # pictures arrive in order
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
