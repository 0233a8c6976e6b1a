"""Verdict on a base from a small trial: motors, encoders and gyro, compared with the motion that a person saw."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from math import copysign, degrees, radians
from typing import Final

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf
from drivers.api import ZERO_VELOCITY, BaseState, Odometers, Velocity
from drivers.api.driver import Finding, failure, warning
from drivers.base.gyro_drift import drift

# Leaf that tries a base: at rest, a little to its left and back, a little ahead and back.

REST_TIME = 2.0
"""Seconds at rest in which the drift of a gyro is measured."""

STEP_TIME, SETTLING_TIME = 0.5, 1.0
"""Seconds after each movement until its odometry has arrived; ``STEP_TIME`` is that of the movement."""

TURN_ANGLE, DRIVE_DISTANCE = radians(10), 0.05
"""Maximum commanded distance of each movement in metres, as ``TURN_ANGLE`` is the angle in radians."""

MAX_MOTION_RATIO = 3.0
"""Ratio of measured to commanded motion above which a trial stops the base."""

SILENCE_TIMEOUT, TIMEOUT = 2.0, 20.0
"""Maximum duration of the trial in seconds; ``SILENCE_TIMEOUT`` is the maximum time without reports."""

WHEEL_TRACK = 0.23
"""Assumed distance (m) between the wheels, used to compute the motion of the wheels from the pose.

Only the signs of the results are used, so the true distance does not matter.
"""


@dataclass(frozen=True, slots=True)
class InstrumentReadings:
    """Motion of a base during one step of a trial, as measured by its wheel encoders and gyro.

    ``left`` and ``right`` are the distances (m) that the wheels have rolled. ``turn`` is the base's rotation computed
    from the wheels, ``gyro`` its rotation by the gyro, both in radians. ``gyro`` is None without a gyro.
    """

    left: float = 0.0
    right: float = 0.0
    turn: float = 0.0
    gyro: float | None = None
    seconds: float = 0.0


@dataclass(slots=True)
class BaseTrial:
    """Measurements of a base trial: at ``rest``, during the ``turn`` to the left, and during the motion ``ahead``.

    ``measured`` is False if the pose is only computed from commands (dead reckoning). ``counted`` is True if the base
    has wheel encoders; otherwise the motion of the wheels is computed from the pose. ``faults`` are the reasons why the
    base's driver stopped it.
    """

    rest: InstrumentReadings = InstrumentReadings()
    turn: InstrumentReadings = InstrumentReadings()
    ahead: InstrumentReadings = InstrumentReadings()
    measured: bool = True
    counted: bool = False
    faults: list[str] = field(default_factory=list)


TRIAL_STEPS: tuple[tuple[str, Velocity, float], ...] = (
    ("rest", ZERO_VELOCITY, REST_TIME),
    ("turn", Velocity(0.0, TURN_ANGLE / STEP_TIME), STEP_TIME),
    ("", Velocity(0.0, -TURN_ANGLE / STEP_TIME), STEP_TIME),
    ("ahead", Velocity(DRIVE_DISTANCE / STEP_TIME, 0.0), STEP_TIME),
    ("", Velocity(-DRIVE_DISTANCE / STEP_TIME, 0.0), STEP_TIME),
)
"""Steps of a base trial: name of the measurement (empty if none is made), velocity, and duration (s)."""


class TrialPhase(Enum):
    """Phase of one step of a base trial.

    In ABORTING, the base comes to rest after a fault. The next step, which would drive it back, is then skipped.
    """

    READY, MOVING, SETTLING, ABORTING = range(4)


class TrialEvent(Enum):
    """Event that changes the phase of a base trial's step, for example the end of the step's time, or a fault."""

    START, TIME_UP, FAULT, SETTLED = range(4)


TRANSITIONS: Final = {
    (TrialPhase.READY, TrialEvent.START): TrialPhase.MOVING,
    (TrialPhase.MOVING, TrialEvent.TIME_UP): TrialPhase.SETTLING,
    (TrialPhase.MOVING, TrialEvent.FAULT): TrialPhase.ABORTING,
    (TrialPhase.SETTLING, TrialEvent.SETTLED): TrialPhase.READY,
    (TrialPhase.ABORTING, TrialEvent.SETTLED): TrialPhase.READY,
}


class TryBase(Leaf):
    """Move the base a little, with limited time and distance for each movement, and record the measurements.

    Running for 8 s, then succeeds. Fails if the base does not report.
    """

    tag = "try_base"
    needs = frozenset({"base"})
    drives = frozenset({"base"})
    trial: BaseTrial
    _index = 0
    _phase = TrialPhase.READY
    _start_readings = InstrumentReadings()
    _until = 0.0
    _commanded = 0.0
    _commanded_at = 0.0
    _reported_at = 0.0

    def initialise(self) -> None:
        self.trial = BaseTrial()
        self._index, self._phase = 0, TrialPhase.READY
        self._reported_at = self.run.now()

    def update(self) -> Status:
        now, reading = self.run.now(), self.robot.base.state()
        if self.elapsed > TIMEOUT:
            return self.fail(f"the trial timed out after {TIMEOUT:g} s")
        if reading.value is None or not reading.good:
            self.robot.base.stop()
            if now - self._reported_at > SILENCE_TIMEOUT:
                return self.fail(f"no report from the base for {SILENCE_TIMEOUT:g} s")
            return self.wait("waiting for the base to report")
        self._reported_at = now
        if self._index == len(TRIAL_STEPS):
            return SUCCESS
        return self._step(reading.value, now)

    def _step(self, state: BaseState, now: float) -> Status:
        name, velocity, seconds = TRIAL_STEPS[self._index]
        here = read_instruments(state)
        if self._phase is TrialPhase.READY:
            self.trial.measured, self.trial.counted = not state.reckoned, state.odometers is not None
            self._start_readings, self._until, self._commanded, self._commanded_at = here, now + seconds, 0.0, now
            self._handle(TrialEvent.START)
        moved = _readings_since(self._start_readings, here, now - self._until + seconds)
        if self._phase is TrialPhase.MOVING:
            if now < self._until and not self._runs_away(moved, velocity):
                self._drive(velocity, now)
                self._note_fault(velocity)
            if now < self._until and self._phase is TrialPhase.MOVING:
                return self.wait(f"{name or 'back'}: commanded {_command_text(velocity)}")
            if self._phase is TrialPhase.MOVING:
                self._handle(TrialEvent.TIME_UP)
            self._until = now + (SETTLING_TIME if velocity != ZERO_VELOCITY else 0.0)
            self.robot.base.stop()
        if now < self._until:
            return self.wait("settling")
        if name:
            setattr(self.trial, name, moved)
        self._index += 2 if name and self._phase is TrialPhase.ABORTING else 1
        self._handle(TrialEvent.SETTLED)
        return self.wait("next")

    def _drive(self, velocity: Velocity, now: float) -> None:
        """Send the step's velocity to the base, or stop it once the whole distance or angle was commanded."""
        if velocity == ZERO_VELOCITY:
            return
        self._commanded += (abs(velocity.linear) / DRIVE_DISTANCE + abs(velocity.angular) / TURN_ANGLE) * (
            now - self._commanded_at
        )
        self._commanded_at = now
        if self._commanded >= 1.0:
            self.robot.base.stop()
        else:
            self.robot.base.drive(velocity)

    def _runs_away(self, moved: InstrumentReadings, velocity: Velocity) -> bool:
        """Return whether the instruments show more than ``MAX_MOTION_RATIO`` times the commanded motion."""
        if velocity == ZERO_VELOCITY or not self.trial.measured:
            return False
        turned, way = abs(moved.gyro or 0.0), max(abs(moved.left), abs(moved.right))
        if turned <= MAX_MOTION_RATIO * TURN_ANGLE and way <= MAX_MOTION_RATIO * max(
            DRIVE_DISTANCE, TURN_ANGLE * WHEEL_TRACK
        ):
            return False
        self._add_fault(f"it moved by {way:.2f} m and {degrees(turned):.0f} deg: stopped")
        return True

    def _note_fault(self, velocity: Velocity) -> None:
        """Store the reason why the base's driver has stopped the base, if it has."""
        if velocity != ZERO_VELOCITY and (fault := self.robot.base.steering().fault):
            self._add_fault(fault)

    def _add_fault(self, reason: str) -> None:
        self._handle(TrialEvent.FAULT)
        self.trial.faults.append(reason)

    def _handle(self, event: TrialEvent) -> None:
        self._phase = TRANSITIONS[self._phase, event]

    def terminate(self, new_status: Status) -> None:
        """Stop the base."""
        del new_status
        self.robot.base.stop()


def read_instruments(state: BaseState) -> InstrumentReadings:
    """Return the readings of a base's instruments; without encoders, wheel motion is computed from the pose."""
    found: Odometers | None = state.odometers
    if found is not None:
        return InstrumentReadings(found.left, found.right, found.turn, found.gyro)
    # The trial turns back before it drives, so the way is along the initial x axis.
    way, half = state.pose.x, state.pose.heading * WHEEL_TRACK / 2
    return InstrumentReadings(way - half, way + half, state.pose.heading)


def _readings_since(before: InstrumentReadings, after: InstrumentReadings, seconds: float) -> InstrumentReadings:
    gyro = None if before.gyro is None or after.gyro is None else after.gyro - before.gyro
    left, right, turn = after.left - before.left, after.right - before.right, after.turn - before.turn
    return InstrumentReadings(left, right, turn, gyro, seconds)


def _command_text(velocity: Velocity) -> str:
    if velocity.angular:
        return f"{degrees(velocity.angular) * STEP_TIME:+.0f} deg"
    return f"{100 * velocity.linear * STEP_TIME:+.0f} cm"


MIN_WHEEL_SHARE = 0.2
"""Minimum share of the commanded distance by which a wheel must move to count as turning."""

MIN_GYRO_SHARE = 0.25
"""Minimum share of the commanded angle that the gyro must measure; below, it counts as not measuring the turn."""

MAX_TURN_RATIO = 1.7
"""Maximum ratio of the rotations by gyro and by wheels, or its inverse, at which they agree.

It is large because wheels slip, and the distance between them is an estimate.
"""


class SeenMotion(Enum):
    """Motion of a base that a person saw in a trial."""

    LEFT = "left"
    RIGHT = "right"
    AHEAD = "ahead"
    BACK = "back"
    NONE = "none"


Signs = tuple[int, int]
"""Directions of the left and the right wheel: 1 forwards, -1 backwards, 0 still."""

_WHEELS: dict[SeenMotion, Signs] = {
    SeenMotion.LEFT: (-1, 1),
    SeenMotion.RIGHT: (1, -1),
    SeenMotion.AHEAD: (1, 1),
    SeenMotion.BACK: (-1, -1),
    SeenMotion.NONE: (0, 0),
}

_SWAP_PLUGS = "swap the plugs of the left and the right motor"
_MOTORS: dict[tuple[SeenMotion, SeenMotion], tuple[str, str]] = {
    (SeenMotion.RIGHT, SeenMotion.AHEAD): ("the left and the right motor are swapped", _SWAP_PLUGS),
    (SeenMotion.RIGHT, SeenMotion.BACK): ("both motors turn the wrong way", "swap the two wires of each motor"),
    (SeenMotion.LEFT, SeenMotion.BACK): (
        "the left and the right motor are swapped, and both turn the wrong way",
        f"{_SWAP_PLUGS}, and the two wires of each",
    ),
    (SeenMotion.AHEAD, SeenMotion.LEFT): ("the left motor turns the wrong way", "swap the two wires of the left motor"),
    (SeenMotion.BACK, SeenMotion.RIGHT): (
        "the right motor turns the wrong way",
        "swap the two wires of the right motor",
    ),
    (SeenMotion.BACK, SeenMotion.LEFT): (
        "the left and the right motor are swapped, and the one on the left turns the wrong way",
        f"{_SWAP_PLUGS}, then try again",
    ),
    (SeenMotion.AHEAD, SeenMotion.RIGHT): (
        "the left and the right motor are swapped, and the one on the right turns the wrong way",
        f"{_SWAP_PLUGS}, then try again",
    ),
    (SeenMotion.LEFT, SeenMotion.LEFT): (
        "the left wheel does not turn",
        "check the left motor, its plug and its fuse",
    ),
    (SeenMotion.LEFT, SeenMotion.RIGHT): (
        "the right wheel does not turn",
        "check the right motor, its plug and its fuse",
    ),
}
"""Fault of the motors and its fix, by the motions that a person saw in the turn to the left and in the motion ahead."""

_ONE_WHEEL: dict[tuple[SeenMotion, SeenMotion], tuple[Signs, Signs]] = {
    (SeenMotion.LEFT, SeenMotion.LEFT): ((0, 1), (0, 1)),
    (SeenMotion.LEFT, SeenMotion.RIGHT): ((-1, 0), (1, 0)),
}
"""Directions in which the wheels really turned if only one wheel turns, by the motions that a person saw.

Key and value have two members: the first for the turn to the left, the second for the motion ahead.
"""


def judge_base(trial: BaseTrial, turn: SeenMotion, ahead: SeenMotion) -> Iterator[Finding]:
    """Yield the findings on a base after its trial.

    ``turn`` and ``ahead`` are the motions that a person saw in the two steps: the turn to the left, and the motion
    ahead.
    """
    if trial.rest.gyro is not None:
        yield drift(trial.rest.gyro, trial.rest.seconds)
    yield from _motor_findings(trial, turn, ahead)
    if not trial.measured:
        yield Finding("odometry", "no odometry: its pose is estimated from the commanded speeds")
        return
    truth = _ONE_WHEEL.get((turn, ahead), (_WHEELS[turn], _WHEELS[ahead]))
    counted = _wheel_signs(trial.turn, TURN_ANGLE * WHEEL_TRACK / 2), _wheel_signs(trial.ahead, DRIVE_DISTANCE)
    if turn is ahead is SeenMotion.NONE:
        yield from _findings_without_motion(trial, counted)
        return
    encoders = encoder_fault(truth, counted)
    name = "encoders" if trial.counted else "odometry"
    if encoders:
        fix = "the plugs and the wires of the encoders" if trial.counted else "the node of its odometry"
        yield failure(name, encoders, f"check {fix}")
    else:
        yield Finding(name, "agree with the motion of the wheels")
    yield from _gyro_findings(trial, truth, encoders_right=not encoders)


def encoder_fault(truth: tuple[Signs, Signs], counted: tuple[Signs, Signs]) -> str:
    """Return the fault of the wheel encoders; an empty text if they are right.

    ``truth`` are the real directions of the wheels in the turn and in the motion ahead, ``counted`` those by the
    encoders.
    """
    moves = [(there, here) for there, here in zip(truth, counted, strict=True) if there != (0, 0)]
    if all(there == here for there, here in moves):
        return ""
    if all(here == (0, 0) for _, here in moves):
        return "do not count, though the wheels turn: blocked, or not connected"
    for what, change in _ENCODER_FAULTS:
        if all(change(there) == here for there, here in moves):
            return what
    pairs = "; ".join(f"wheels {_signs_text(there)}, counted {_signs_text(here)}" for there, here in moves)
    return f"do not match: {pairs}"


_ENCODER_FAULTS = (
    ("the left one does not count", lambda it: (0, it[1])),
    ("the right one does not count", lambda it: (it[0], 0)),
    ("left and right are swapped", lambda it: (it[1], it[0])),
    ("both count the wrong way", lambda it: (-it[0], -it[1])),
    ("the left one counts the wrong way", lambda it: (-it[0], it[1])),
    ("the right one counts the wrong way", lambda it: (it[0], -it[1])),
    ("left and right are swapped, and both count the wrong way", lambda it: (-it[1], -it[0])),
)


def _motor_findings(trial: BaseTrial, turn: SeenMotion, ahead: SeenMotion) -> Iterator[Finding]:
    stopped = f" (its driver stopped it: {'; '.join(dict.fromkeys(trial.faults))})" if trial.faults else ""
    if (turn, ahead) == (SeenMotion.LEFT, SeenMotion.AHEAD):
        yield Finding("motors", "turn as commanded")
    elif turn is ahead is SeenMotion.NONE:
        fix = "is its E-stop pressed, or a motor switch off? check the motors' supply"
        yield failure("motors", f"it did not move{stopped}", fix)
    elif fault := _MOTORS.get((turn, ahead)):
        yield failure("motors", f"{fault[0]}{stopped}", fault[1])
    else:
        what = f"the turn to its left went {turn.value}, the way ahead went {ahead.value}{stopped}"
        yield failure("motors", what, "check the motors, their plugs, and for obstacles; then try again")


def _findings_without_motion(trial: BaseTrial, counted: tuple[Signs, Signs]) -> Iterator[Finding]:
    """Yield findings on the instruments of a base that did not move.

    ``counted`` are the directions of the wheels by the encoders, in the turn and in the motion ahead.
    """
    if any(signs != (0, 0) for signs in counted):
        what = "counted, though the base did not move: its wheels slip, or hang in the air"
        yield warning("encoders" if trial.counted else "odometry", what, "put it on the floor, and try again")


def _gyro_findings(trial: BaseTrial, truth: tuple[Signs, Signs], *, encoders_right: bool) -> Iterator[Finding]:
    """Yield findings on the gyro, whose rotations are compared with those that the base really made.

    ``truth`` are the real directions of the wheels in the turn and in the motion ahead. If gyro and encoders disagree,
    the finding names the one that is probably wrong.
    """
    drift = 0.0 if trial.rest.gyro is None or not trial.rest.seconds else trial.rest.gyro / trial.rest.seconds
    for moved, (left, right), commanded in (
        (trial.turn, truth[0], TURN_ANGLE),
        (trial.ahead, truth[1], 2 * DRIVE_DISTANCE / WHEEL_TRACK),
    ):
        if moved.gyro is None or left == right:
            continue
        turned, way = moved.gyro - drift * moved.seconds, 1.0 if right > left else -1.0
        if abs(turned) < MIN_GYRO_SHARE * commanded * abs(right - left) / 2:
            yield failure("gyro", "shows no turn, though the base turned", "is it connected?")
        elif turned * way < 0:
            yield failure("gyro", "shows the opposite turn: its sign is reversed", "check how it is mounted")
        elif encoders_right:
            yield _compare_turns(turned, moved.turn, commanded, counted=trial.counted)
        else:
            yield Finding("gyro", f"turned by {degrees(turned):+.1f} deg")
        return


def _compare_turns(gyro: float, wheels: float, commanded: float, *, counted: bool) -> Finding:
    """Return a finding on whether the rotations (rad) by ``gyro`` and by ``wheels`` agree; their signs must be equal.

    If they do not agree, the one further from the ``commanded`` rotation is probably wrong. ``counted`` tells whether
    encoders measured the wheels; otherwise their rotation comes from the odometry.
    """
    both = f"gyro {degrees(gyro):+.1f} deg, {'encoders' if counted else 'odometry'} {degrees(wheels):+.1f} deg"
    ratio = gyro / wheels if wheels else 0.0
    if 1 / MAX_TURN_RATIO <= ratio <= MAX_TURN_RATIO:
        return Finding("gyro", f"gyro and wheels agree: {both}")
    expected = copysign(commanded, gyro)
    culprit = "the gyro" if abs(gyro - expected) > abs(wheels - expected) else "the wheels (they slip, or the track)"
    what = f"{both}, for {degrees(expected):+.0f} deg commanded: likely wrong is {culprit}"
    return warning("gyro", what, "try it on a floor with more grip; check the wheels' measures in the robot file")


def _wheel_signs(moved: InstrumentReadings, commanded: float) -> Signs:
    """Return the direction of each wheel according to the encoders; a wheel that hardly moved counts as still.

    ``commanded`` is the distance in metres that each wheel should have rolled.
    """
    left, right = (
        0 if abs(way) < MIN_WHEEL_SHARE * commanded else 1 if way > 0 else -1 for way in (moved.left, moved.right)
    )
    return left, right


def _signs_text(signs: Signs) -> str:
    return " and ".join({1: "ahead", -1: "back", 0: "still"}[sign] for sign in signs)
