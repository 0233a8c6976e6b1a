"""Factory of a walking base."""

from collections.abc import Callable
from typing import Any

from drivers.api import DeviceStatus, Imu, Joints, ignore
from drivers.api.driver import DriverContext
from drivers.base.arbitrated import settings_of
from drivers.legs.balance import BalanceController
from drivers.legs.body import body_of
from drivers.legs.compensation import Compensation
from drivers.legs.declared import LegsKeys
from drivers.legs.driver import LegsBase
from drivers.legs.engine import CONTROL_INTERVAL, AttitudeEstimate, WalkingEngine
from drivers.servos.models import motor_physics
from drivers.servos.servo_joints import ServoJoints
from drivers.transport.loop import Loop, LoopFactory, ThreadLoop

# A walking base with its own thread, 100 steps of control a second.

STANDING_INTERVAL = 0.02
"""Seconds between two reads of the joints while the base stands."""

STOP_TIMEOUT = 4.0
"""Seconds that a walk has to end when the base is closed."""


class WalkingBase(LegsBase):
    """A ``LegsBase`` that steps itself while it is open."""

    make_loop: LoopFactory = ThreadLoop
    """Factory of the loop that calls ``step`` of this base."""
    _loop: Loop | None = None
    _last_step_error = ""

    def open(self) -> None:
        """Use the joints as soon as they are online. Does nothing if the base is already open."""
        super().open()
        if self._loop is None:
            self._loop = self.make_loop(f"{self.name} legs", self._run_step, ignore)
        self._loop.start()

    def close(self) -> None:
        """Let a walk end, for ``STOP_TIMEOUT`` at most; then stop stepping."""
        self.stop()
        if self._loop is not None:
            if self._loop.is_alive:
                self.standing.wait(STOP_TIMEOUT)
            self._loop.end()
        super().close()

    def _run_step(self) -> float:
        began = self._clock.now()
        try:
            self.step()
        except BaseException as error:  # SystemExit too: without this thread the walk would stop in mid-step
            if (fault := f"{type(error).__name__}: {error}") != self._last_step_error:
                self._last_step_error = fault
                self._report(DeviceStatus(self.name, "fault", fault))
        return max(0.0, (CONTROL_INTERVAL if self.is_walking else STANDING_INTERVAL) - (self._clock.now() - began))


def make(keys: LegsKeys, site: DriverContext) -> WalkingBase:
    """Return the driver of a walking base; the caller opens and closes the arm that it controls, and the IMU."""
    joints, walks = site.needed_parts["arm"], make_engine(keys)
    return WalkingBase(
        joints,
        site.clock,
        walks,
        read_attitude=attitude_reader(site.needed_parts.get("imu")),
        # Virtual servos are exactly at their goals.
        compensation=None if site.is_virtual else make_compensation(walks, joints),
        torques=stall_torques(walks, joints),
        at_fall=keys.at_fall,
        tucked=keys.body.tucked_angles,
        **settings_of(keys, site),
    )


def make_engine(keys: LegsKeys) -> WalkingEngine:
    """Return the walking engine. Raises BadRequest for strides that the legs cannot make."""
    found = WalkingEngine(body_of(keys.body), keys.stride)
    found.balance = BalanceController(keys.stride, found.walker.manner.com_height)
    return found


def make_compensation(engine: WalkingEngine, joints: Joints) -> Compensation | None:
    """Return the goal compensation; None for joints with unknown servos."""
    if not isinstance(joints, ServoJoints):
        return None
    servos = {name: joints.joints[name] for name in engine.body.leg_joints}
    return Compensation(
        engine.body, {name: motor_physics(it.model, it.spec.torque_limit) for name, it in servos.items()}
    )


def stall_torques(engine: WalkingEngine, joints: Joints) -> dict[str, float]:
    """Return the stall torques of the leg servos (Nm), for gait checks; empty if unknown."""
    if not isinstance(joints, ServoJoints):
        return {}
    servos = {name: joints.joints[name] for name in engine.body.leg_joints}
    return {name: it.model.stall_torque * it.spec.torque_limit for name, it in servos.items()}


def attitude_reader(imu: Any) -> Callable[[], AttitudeEstimate | None]:
    """Return a function that reads the trunk's attitude: None without an IMU, or without a recent reading."""
    part: Imu | None = imu

    def felt() -> AttitudeEstimate | None:
        reading = None if part is None else part.attitude()
        if reading is None or reading.value is None or not reading.good:
            return None
        found = reading.value
        return AttitudeEstimate(found.roll, found.pitch, found.rates[0], found.rates[1])

    return felt
