"""Whether a body falls, or lies: by how its trunk leans, and how fast; without an IMU, by what its knees bear.

A body falls when its capture point is farther off than a step can reach; it lies when it leans too far. Of legs alone
it is known that they bear nothing though they should: a body that lies, that was lifted, or that sits on something.
"""

from collections.abc import Sequence
from math import acos, cos, hypot, inf, radians

import numpy as np

from drivers.api import JointState
from drivers.legs.acts import pressed
from drivers.legs.body import Floats
from drivers.legs.compensation import static_torques
from drivers.legs.engine import Engine, Felt
from drivers.legs.walker import rate

LIES = radians(50)
"""How far from upright its trunk leans when it has fallen."""

SURE = 0.05
"""Seconds for which the capture point has to be out of reach to be believed: a foot that lands jerks the trunk."""

UPRIGHT = 0.5
"""Seconds for which a body that has fallen has to be upright to stand again."""

EVERY = 0.05
"""Seconds from one look at what the knees bear to the next: it is worked out from the whole body."""

SMOOTH = 1.0
"""Seconds over which that is averaged: over a stride, and over the noise of servos that guess their load."""

NOTHING, SOMETHING = 0.25, 0.5
"""The shares of what its knees have borne before below which they bear nothing, and above which they do again."""

UNBORNE = 1.0
"""Seconds for which they have to bear nothing."""

TOLD = 0.15
"""What both knees together must have told once to be believed: without a burden each tells its friction, 0.05 or so."""

BENT = 0.5
"""The share of the torque in a stand below which knees are too straight to tell anything."""


class Falls:
    """Tells whether the body of an engine falls: ``look`` is asked in every turn. ``lean`` is None where unmeasured."""

    def __init__(self, engine: Engine) -> None:
        manner, self._body = engine.walker.manner, engine.body
        self._upright, self._height, self._rate = engine.stride.lean, manner.com_height, rate(manner.com_height)
        self._reach = manner.longest + manner.length / 2
        self._knees = [self._body.legs["left"].joints[3], self._body.legs["right"].joints[3]]
        self._least = BENT * float(np.abs(self._held(engine.ready)).sum())
        self._since, self._looked = inf, -inf
        self._bears = self._bore = 0.0
        self.lean: float | None = None
        self.fallen = False

    def look(self, felt: Felt | None, joints: Sequence[JointState], now: float, *, afoot: bool) -> None:
        """Take in what is felt of the trunk and the joints of both legs at a time; ``afoot``: the legs are led."""
        if felt is None:
            self.lean = None
            self._weigh(joints, now)
            return
        self.lean = acos(min(max(cos(felt.roll) * cos(felt.pitch), -1.0), 1.0))
        if self.lean > LIES:
            self.fallen, self._since = True, now
        ahead, aside = (
            felt.pitch - self._upright + felt.pitch_rate / self._rate,
            felt.roll + felt.roll_rate / self._rate,
        )
        lost = self._height * hypot(ahead, aside) > self._reach
        self._believe(lost if self.fallen or afoot else False, now, UPRIGHT if self.fallen else SURE)

    def _believe(self, fallen: bool, now: float, after: float) -> None:
        """Believe that it falls, or stands, once it has been so for long enough."""
        if fallen == self.fallen:
            self._since = now
        elif now - self._since >= after - 1e-9:
            self.fallen, self._since = fallen, now

    def _weigh(self, joints: Sequence[JointState], now: float) -> None:
        """Compare what the knees bear to what they have borne before, each by the pose that they are in."""
        if now - self._looked < EVERY:
            return
        since, self._looked = now - self._looked, now
        held = self._held(np.array([each.position for each in joints]))
        should = float(np.abs(held).sum())
        if should < self._least or not all(each.torque for each in joints):
            self._since = now
            return
        loads = np.array([joints[3].load, joints[9].load])
        told = float((loads * np.sign(held)).sum())
        self._bears += (told / should - self._bears) * min(1.0, since / SMOOTH)
        if self._bears * should > TOLD:
            self._bore = max(self._bore, self._bears)
        if self._bore:
            share = self._bears / self._bore
            self._believe(share < (SOMETHING if self.fallen else NOTHING), now, UNBORNE)

    def _held(self, angles: Floats) -> Floats:
        """Return the torques (Nm) with which both knees hold the body up at angles (12,) of its legs."""
        posture = pressed(self._body, angles, (True, True))
        found: Floats = static_torques(self._body, posture)[self._knees]
        return found
