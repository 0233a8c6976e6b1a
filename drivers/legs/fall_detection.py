"""Fall detection from the trunk's lean and its rate, or without an IMU from the load of the knees.

A body falls if its capture point is farther away than a step can reach; it has fallen if it leans too far. Knee loads
only show that the legs carry nothing although they should: the body lies, was lifted, or sits on something.
"""

from collections.abc import Sequence
from math import acos, cos, hypot, inf, radians

import numpy as np

from drivers.api import JointState
from drivers.legs.actions import make_posture
from drivers.legs.body import Floats
from drivers.legs.compensation import static_torques
from drivers.legs.engine import AttitudeEstimate, WalkingEngine
from drivers.legs.pattern_generator import pendulum_rate

FALLEN_LEAN = radians(50)
"""Lean of the trunk from upright, in radians, above which the body has fallen."""

FALL_DEBOUNCE_TIME = 0.05
"""Seconds for which the capture point must be out of reach to count as a fall; a landing foot only jerks the trunk."""

UPRIGHT_DEBOUNCE_TIME = 0.5
"""Seconds for which a fallen body must be upright to count as standing."""

KNEE_LOAD_INTERVAL = 0.05
"""Seconds between two computations of the knee load, each of which takes the masses of the whole body into account."""

KNEE_LOAD_TIME_CONSTANT = 1.0
"""Time constant of the knee load in seconds.

It averages over a stride, and over the noise of servos that only estimate their load.
"""

UNLOADED_SHARE, LOADED_SHARE = 0.25, 0.5
"""Shares of the earlier knee load below which the knees count as unloaded, and above which as loaded again."""

UNLOADED_DEBOUNCE_TIME = 1.0
"""Seconds for which the knees must be unloaded to count as a fall, or be loaded again to count as standing."""

MIN_KNEE_LOAD = 0.15
"""Minimum sum of the loads of both knees that shows that they carry the body, as a share of the stall torque.

Falls are detected only after such a load. Knees without a load report about 0.05 each, by friction.
"""

MIN_BENT_SHARE = 0.5
"""Minimum computed torque of the knees at which their load is used, as a share of the torque in a stand.

Straighter knees carry the body almost without torque.
"""


class FallDetector:
    """Detects falls of the body that ``engine`` moves. Call ``update`` in every step.

    ``lean`` is the angle of the trunk from upright in radians, None if it is not measured. ``fallen`` is the result.
    """

    def __init__(self, engine: WalkingEngine) -> None:
        manner, self._body = engine.walker.manner, engine.body
        self._upright_pitch, self._height, self._rate = (
            engine.stride.lean,
            manner.com_height,
            pendulum_rate(manner.com_height),
        )
        self._reach = manner.max_step + manner.sole_length / 2
        self._knees = [self._body.legs["left"].joints[3], self._body.legs["right"].joints[3]]
        self._min_torque = MIN_BENT_SHARE * float(np.abs(self._knee_torques(engine.ready_angles)).sum())
        self._since, self._knee_load_at = inf, -inf
        self._load_ratio = self._max_load_ratio = 0.0
        self.lean: float | None = None
        self.fallen = False

    def update(
        self, attitude: AttitudeEstimate | None, joints: Sequence[JointState], now: float, *, legs_led: bool
    ) -> None:
        """Update with the trunk's attitude (None: not measured) and the states of both legs' joints at time ``now``.

        ``legs_led`` is True while a walk or another action controls the legs.
        """
        if attitude is None:
            self.lean = None
            self._update_knee_load(joints, now)
            return
        self.lean = acos(min(max(cos(attitude.roll) * cos(attitude.pitch), -1.0), 1.0))
        if self.lean > FALLEN_LEAN:
            self.fallen, self._since = True, now
        ahead, aside = (
            attitude.pitch - self._upright_pitch + attitude.pitch_rate / self._rate,
            attitude.roll + attitude.roll_rate / self._rate,
        )
        lost = self._height * hypot(ahead, aside) > self._reach
        self._debounce(
            lost if self.fallen or legs_led else False,
            now,
            UPRIGHT_DEBOUNCE_TIME if self.fallen else FALL_DEBOUNCE_TIME,
        )

    def _debounce(self, fallen: bool, now: float, after: float) -> None:
        """Change ``fallen`` once the new value has lasted for ``after`` seconds."""
        if fallen == self.fallen:
            self._since = now
        elif now - self._since >= after - 1e-9:
            self.fallen, self._since = fallen, now

    def _update_knee_load(self, joints: Sequence[JointState], now: float) -> None:
        """Update ``fallen`` from the load of the knees, without an IMU.

        The load is divided by the load that a standing body would have in the same pose, and compared with the maximum
        of this ratio so far.
        """
        if now - self._knee_load_at < KNEE_LOAD_INTERVAL:
            return
        since, self._knee_load_at = now - self._knee_load_at, now
        held = self._knee_torques(np.array([each.position for each in joints]))
        should = float(np.abs(held).sum())
        if should < self._min_torque or not all(each.torque for each in joints):
            self._since = now
            return
        loads = np.array([joints[3].load, joints[9].load])
        told = float((loads * np.sign(held)).sum())
        self._load_ratio += (told / should - self._load_ratio) * min(1.0, since / KNEE_LOAD_TIME_CONSTANT)
        if self._load_ratio * should > MIN_KNEE_LOAD:
            self._max_load_ratio = max(self._max_load_ratio, self._load_ratio)
        if self._max_load_ratio:
            share = self._load_ratio / self._max_load_ratio
            self._debounce(share < (LOADED_SHARE if self.fallen else UNLOADED_SHARE), now, UNLOADED_DEBOUNCE_TIME)

    def _knee_torques(self, angles: Floats) -> Floats:
        """Return the torques (Nm) with which both knees hold the body up at angles (12,) of its legs."""
        posture = make_posture(self._body, angles, (True, True))
        found: Floats = static_torques(self._body, posture)[self._knees]
        return found
