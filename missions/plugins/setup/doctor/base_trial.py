"""The leaf that tries a base: at rest, a little to its left and back, a little ahead and back."""

from dataclasses import dataclass, field
from enum import Enum
from math import degrees, radians
from typing import Final

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf
from drivers.api import STILL, BaseState, Odometers, Velocity

REST_TIME = 2.0
"""Seconds in which the drift of a gyro is measured."""

STEP_TIME, SETTLING_TIME = 0.5, 1.0
"""Seconds of each movement, and seconds after it until its odometry has come."""

TURN, WAY = radians(10), 0.05
"""Radians and metres that are commanded in each movement at most, whatever is measured."""

EXCESS = 3.0
"""A base that moves by so many times what it was commanded is stopped at once."""

SILENCE_TIMEOUT, TIMEOUT = 2.0, 20.0
"""Seconds without reports, and in all, after which the trial ends."""

TRACK = 0.23
"""Metres between the wheels of a base whose odometry comes as a pose: only signs count."""


@dataclass(frozen=True, slots=True)
class InstrumentReadings:
    """Motion by the instruments.

    Metres of the left and the right wheel, the radians that these make, and those of the gyro (None without one).
    """

    left: float = 0.0
    right: float = 0.0
    turn: float = 0.0
    gyro: float | None = None
    seconds: float = 0.0


@dataclass(slots=True)
class BaseTrial:
    """Measurements of a trial: at ``rest``, after the ``turn`` to the left, and after the way ``ahead``.

    ``measured`` is False for a base that measures nothing. ``counted`` says that its wheels are counted; otherwise its
    odometry was taken apart. ``faults`` are the reasons for which its driver stopped it meanwhile.
    """

    rest: InstrumentReadings = InstrumentReadings()
    turn: InstrumentReadings = InstrumentReadings()
    ahead: InstrumentReadings = InstrumentReadings()
    measured: bool = True
    counted: bool = False
    faults: list[str] = field(default_factory=list)


STEPS: tuple[tuple[str, Velocity, float], ...] = (
    ("rest", STILL, REST_TIME),
    ("turn", Velocity(0.0, TURN / STEP_TIME), STEP_TIME),
    ("", Velocity(0.0, -TURN / STEP_TIME), STEP_TIME),
    ("ahead", Velocity(WAY / STEP_TIME, 0.0), STEP_TIME),
    ("", Velocity(-WAY / STEP_TIME, 0.0), STEP_TIME),
)
"""The name under which a step is kept, its velocity, and how long it takes."""


class TrialPhase(Enum):
    """Phase of one step of a trial; ABORTING: it settles after a fault, and its way back is left out."""

    READY, MOVING, SETTLING, ABORTING = range(4)


class TrialEvent(Enum):
    """Event of one step of a trial."""

    START, TIME_UP, FAULT, SETTLED = range(4)


TRANSITIONS: Final = {
    (TrialPhase.READY, TrialEvent.START): TrialPhase.MOVING,
    (TrialPhase.MOVING, TrialEvent.TIME_UP): TrialPhase.SETTLING,
    (TrialPhase.MOVING, TrialEvent.FAULT): TrialPhase.ABORTING,
    (TrialPhase.SETTLING, TrialEvent.SETTLED): TrialPhase.READY,
    (TrialPhase.ABORTING, TrialEvent.SETTLED): TrialPhase.READY,
}


class TryBase(Leaf):
    """Move the base a little, each movement bounded in time and in what is commanded; note what is measured.

    Running for 8 s, then succeeds. Fails when the base does not report, and while it is stopped.
    """

    word = "try_base"
    needs = frozenset({"base"})
    drives = frozenset({"base"})
    trial: BaseTrial
    _index = 0
    _phase = TrialPhase.READY
    _from = InstrumentReadings()  # the instruments when the step began
    _until = 0.0
    _commanded = 0.0
    _seen_at = 0.0
    _reported_at = 0.0

    def initialise(self) -> None:
        """Begin at rest."""
        self.trial = BaseTrial()
        self._index, self._phase = 0, TrialPhase.READY
        self._reported_at = self.run.now()

    def update(self) -> Status:
        """Go on with the present step."""
        now, reading = self.run.now(), self.robot.base.state()
        if self.elapsed > TIMEOUT:
            return self.fail(f"the trial has not ended within {TIMEOUT:g} s")
        if reading.value is None or not reading.good:
            self.robot.base.stop()
            if now - self._reported_at > SILENCE_TIMEOUT:
                return self.fail(f"no report of the base for {SILENCE_TIMEOUT:g} s")
            return self.wait("waiting for the base to report")
        self._reported_at = now
        if self._index == len(STEPS):
            return SUCCESS
        return self._step(reading.value, now)

    def _step(self, state: BaseState, now: float) -> Status:
        name, velocity, seconds = STEPS[self._index]
        here = instruments(state)
        if self._phase is TrialPhase.READY:
            self.trial.measured, self.trial.counted = not state.reckoned, state.odometers is not None
            self._from, self._until, self._commanded, self._seen_at = here, now + seconds, 0.0, now
            self._handle(TrialEvent.START)
        moved = _since(self._from, here, now - self._until + seconds)
        if self._phase is TrialPhase.MOVING:
            if now < self._until and not self._runs_away(moved, velocity):
                self._drive(velocity, now)
                self._note_fault(velocity)
            if now < self._until and self._phase is TrialPhase.MOVING:
                return self.wait(f"{name or 'back'}: commanded {_amount(velocity)}")
            if self._phase is TrialPhase.MOVING:
                self._handle(TrialEvent.TIME_UP)
            self._until = now + (SETTLING_TIME if velocity != STILL else 0.0)
            self.robot.base.stop()
        if now < self._until:
            return self.wait("settling")
        if name:
            setattr(self.trial, name, moved)
        self._index += 2 if name and self._phase is TrialPhase.ABORTING else 1
        self._handle(TrialEvent.SETTLED)
        return self.wait("next")

    def _drive(self, velocity: Velocity, now: float) -> None:
        """Command a velocity, unless all that may be commanded has been."""
        if velocity == STILL:
            return
        self._commanded += (abs(velocity.linear) / WAY + abs(velocity.angular) / TURN) * (now - self._seen_at)
        self._seen_at = now
        if self._commanded >= 1.0:
            self.robot.base.stop()
        else:
            self.robot.base.drive(velocity)

    def _runs_away(self, moved: InstrumentReadings, velocity: Velocity) -> bool:
        """Whether the instruments show far more motion than was commanded."""
        if velocity == STILL or not self.trial.measured:
            return False
        turned, way = abs(moved.gyro or 0.0), max(abs(moved.left), abs(moved.right))
        if turned <= EXCESS * TURN and way <= EXCESS * max(WAY, TURN * TRACK):
            return False
        self._fault(f"it moved by {way:.2f} m and {degrees(turned):.0f} deg: stopped")
        return True

    def _note_fault(self, velocity: Velocity) -> None:
        """Keep the reason for which the driver has stopped the base, if it has."""
        if velocity != STILL and (fault := self.robot.base.steering().fault):
            self._fault(fault)

    def _fault(self, reason: str) -> None:
        self._handle(TrialEvent.FAULT)
        self.trial.faults.append(reason)

    def _handle(self, event: TrialEvent) -> None:
        self._phase = TRANSITIONS[self._phase, event]

    def terminate(self, new_status: Status) -> None:
        """Stand still, whatever comes."""
        del new_status
        self.robot.base.stop()


def instruments(state: BaseState) -> InstrumentReadings:
    """Return the readings of a base's instruments; a pose without counters is taken apart into two wheels."""
    found: Odometers | None = state.odometers
    if found is not None:
        return InstrumentReadings(found.left, found.right, found.turn, found.gyro)
    # Without a turn in between, the way is along x of the start; the trial turns back before it drives.
    way, half = state.pose.x, state.pose.heading * TRACK / 2
    return InstrumentReadings(way - half, way + half, state.pose.heading)


def _since(before: InstrumentReadings, after: InstrumentReadings, seconds: float) -> InstrumentReadings:
    gyro = None if before.gyro is None or after.gyro is None else after.gyro - before.gyro
    left, right, turn = after.left - before.left, after.right - before.right, after.turn - before.turn
    return InstrumentReadings(left, right, turn, gyro, seconds)


def _amount(velocity: Velocity) -> str:
    if velocity.angular:
        return f"{degrees(velocity.angular) * STEP_TIME:+.0f} deg"
    return f"{100 * velocity.linear * STEP_TIME:+.0f} cm"
