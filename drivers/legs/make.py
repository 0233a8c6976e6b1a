"""From the keys of a robot file to a base that walks."""

from collections.abc import Callable
from typing import Any

from drivers.api import DeviceStatus, Imu, Joints, ignore
from drivers.api.driver import Site
from drivers.base.arbitrated import settings_of
from drivers.legs.body import body_of
from drivers.legs.compensation import Compensation
from drivers.legs.declared import LegsKeys
from drivers.legs.driver import LegsBase
from drivers.legs.engine import PERIOD, Engine, Felt
from drivers.legs.pressure import Balance
from drivers.servos.commanded import CommandedJoints
from drivers.servos.models import motor_of
from drivers.transport.loop import Loop, MakeLoop, ThreadLoop

# A base that walks by itself: on a thread of its own, 100 times a second.

RESTING = 0.02
"""Seconds from one look at the joints to the next while it stands."""

LAST_STEPS = 4.0
"""Seconds that a walk has to come to its end when the base is closed."""


class WalkingBase(LegsBase):
    """A ``LegsBase`` that steps itself while it is open."""

    make_loop: MakeLoop = ThreadLoop
    """Makes what steps it."""
    _loop: Loop | None = None
    _fault = ""

    def open(self) -> None:
        """Use the joints as soon as they are there; does nothing while it is open."""
        super().open()
        if self._loop is None:
            self._loop = self.make_loop(f"{self.name} legs", self._turn, ignore)
        self._loop.start()

    def close(self) -> None:
        """Let a walk come to its end, for ``LAST_STEPS`` at most; then take no step any more."""
        self.stop()
        if self._loop is not None:
            if self._loop.alive:
                self.stands.wait(LAST_STEPS)
            self._loop.end()
        super().close()

    def _turn(self) -> float:
        began = self._clock.now()
        try:
            self.step()
        except BaseException as error:  # SystemExit too: without this thread the walk would stop in mid-step
            if (fault := f"{type(error).__name__}: {error}") != self._fault:
                self._fault = fault
                self._report(DeviceStatus(self.name, "fault", fault))
        return max(0.0, (PERIOD if self.walking else RESTING) - (self._clock.now() - began))


def make(keys: LegsKeys, site: Site) -> WalkingBase:
    """Return the driver; the arm whose joints it leads, and the IMU, are opened and closed besides."""
    joints, walks = site.parts["arm"], engine(keys)
    return WalkingBase(
        joints,
        site.clock,
        walks,
        felt=feeling(site.parts.get("imu")),
        # Virtual servos are where they are told to be.
        compensation=None if site.virtual else compensation(walks, joints),
        torques=torques(walks, joints),
        at_fall=keys.at_fall,
        tucked=keys.body.tucked,
        **settings_of(keys, site),
    )


def engine(keys: LegsKeys) -> Engine:
    """Return what walks. Raises BadRequest for strides that the legs cannot make."""
    found = Engine(body_of(keys.body), keys.stride)
    found.balance = Balance(keys.stride, found.walker.manner.com_height)
    return found


def compensation(walks: Engine, joints: Joints) -> Compensation | None:
    """Return what sets the goals of servos ahead; None for joints of which it is not known how soft they are."""
    if not isinstance(joints, CommandedJoints):
        return None
    servos = {name: joints.described[name] for name in walks.body.walking}
    return Compensation(walks.body, {name: motor_of(it.model, it.spec.torque_limit) for name, it in servos.items()})


def torques(walks: Engine, joints: Joints) -> dict[str, float]:
    """Return what the servos of the legs stall at (Nm), for gaits to be checked; nothing where that is not known."""
    if not isinstance(joints, CommandedJoints):
        return {}
    servos = {name: joints.described[name] for name in walks.body.walking}
    return {name: it.model.stall_torque * it.spec.torque_limit for name, it in servos.items()}


def feeling(imu: Any) -> Callable[[], Felt | None]:
    """Return what tells how the trunk leans; it knows nothing without an IMU, or while that is silent."""
    part: Imu | None = imu

    def felt() -> Felt | None:
        reading = None if part is None else part.attitude()
        if reading is None or reading.value is None or not reading.good:
            return None
        found = reading.value
        return Felt(found.roll, found.pitch, found.rates[0], found.rates[1])

    return felt
