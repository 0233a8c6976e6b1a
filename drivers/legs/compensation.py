"""Compensation of servo compliance: goals set ahead so that joints follow the walk.

A servo's torque grows with its angle error. Under load, in motion and during acceleration it lags behind its goal by
the angle that the needed torque takes; the goal is set ahead by that angle.
"""

from collections.abc import Mapping

import numpy as np

from drivers.legs.body import SIDES, Floats, LeggedBody
from drivers.legs.engine import CONTROL_INTERVAL, LegPosture, whole_body_pose
from drivers.legs.kinematics import forward_kinematics, link_centres, sole_pose
from drivers.legs.pattern_generator import GRAVITY
from drivers.servos.models import MotorPhysics

MAX_LEAD = 0.5
"""Maximum radians by which a goal is set ahead."""


class Compensation:
    """Sets the goals of both legs ahead, posture by posture, from the physical model of their ``motors``."""

    def __init__(self, body: LeggedBody, motors: Mapping[str, MotorPhysics]) -> None:
        self._body = body
        mine = [motors[name] for name in body.leg_joints]
        self._compliance = np.array([1 / motor.stiffness for motor in mine])
        self._speed_lag = np.array([motor.damping / motor.stiffness for motor in mine])
        self._inertia_lag = np.array([motor.inertia / motor.stiffness for motor in mine])
        self._last: LegPosture | None = None
        self._rate = np.zeros(12)
        self._last_interval = CONTROL_INTERVAL

    def reset(self) -> None:
        """Forget earlier postures, because the legs begin a new motion."""
        self._last, self._rate = None, np.zeros(12)

    def goals(self, posture: LegPosture, dt: float = CONTROL_INTERVAL) -> Floats:
        """Return the goals of the legs (12,) for the posture before ``posture``, which follows it after ``dt`` seconds.

        They are one posture late, because the acceleration in a posture follows from the postures before and after it.
        """
        last, dt = self._last or posture, max(dt, CONTROL_INTERVAL / 2)
        before, after = self._rate, (posture.angles - last.angles) / dt
        gain = 2 * (after - before) / (self._last_interval + dt)
        held = static_torques(self._body, last)[self._body.leg_indices]
        ahead = self._compliance * held + self._speed_lag * (before + after) / 2 + self._inertia_lag * gain
        self._last, self._rate, self._last_interval = posture, after, dt
        sent: Floats = last.angles + np.clip(ahead, -MAX_LEAD, MAX_LEAD)
        return sent


def static_torques(body: LeggedBody, posture: LegPosture) -> Floats:
    """Return the joint torques (N,) in Nm that hold the body up in a posture of the legs."""
    placed = forward_kinematics(body, whole_body_pose(body, posture.angles))
    standing, feet = [], posture.pattern.feet
    shares = _weight_shares(posture)
    for side, share in zip(SIDES, shares, strict=True):
        place, turned = sole_pose(body, placed, side)
        x, y, _, heading = feet[side]
        c, s = np.cos(heading), np.sin(heading)
        dx, dy = posture.pattern.pressure[0] - x, posture.pattern.pressure[1] - y
        # A single foot stands on the centre of pressure; two stand on their middles.
        at = np.array([c * dx + s * dy, c * dy - s * dx, 0.0]) if share == 1.0 else np.zeros(3)
        standing.append((share, place + turned @ at, turned[:, 2]))
    up = sum(share * normal for share, _, normal in standing)
    force = -GRAVITY * body.mass[:, None] * up
    moment = np.cross(link_centres(body, placed), force)
    for side, (share, at, _) in zip(SIDES, standing, strict=True):
        foot, lifted = body.legs[side].joints[-1], GRAVITY * body.total_mass * share * up
        force[foot] += lifted
        moment[foot] += np.cross(at, lifted)
    for joint in range(len(body.joints) - 1, -1, -1):
        if (parent := body.parent[joint]) >= 0:
            force[parent] += force[joint]
            moment[parent] += moment[joint]
    axes = np.einsum("nij,nj->ni", placed.rotation, body.axis)
    torques: Floats = -np.einsum("ni,ni->n", axes, moment - np.cross(placed.position, force))
    return torques


def _weight_shares(posture: LegPosture) -> tuple[float, float]:
    """Return the shares of the weight on each foot, left and right."""
    pattern = posture.pattern
    if pattern.support != "both":
        return (1.0, 0.0) if pattern.support == "left" else (0.0, 1.0)
    (lx, ly, _, _), (rx, ry, _, _) = (pattern.feet[side] for side in SIDES)
    px, py = pattern.pressure
    apart = (lx - rx) ** 2 + (ly - ry) ** 2
    left = ((px - rx) * (lx - rx) + (py - ry) * (ly - ry)) / apart
    left = min(max(left, 0.0), 1.0)
    return left, 1.0 - left
