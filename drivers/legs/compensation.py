"""What servos are sent so that joints get where a walk wants them: servos are soft, slow and heavy.

A servo turns by the error of its angle. Carrying weight, in motion and gathering speed it stays behind its goal by as
much as that torque takes; so the goal is set ahead by as much.
"""

from collections.abc import Mapping

import numpy as np

from drivers.legs.body import SIDES, Body, Floats
from drivers.legs.engine import PERIOD, Posture, whole
from drivers.legs.kinematics import centres, forward, sole
from drivers.legs.walker import GRAVITY
from drivers.servos.models import Motor

MOST = 0.5
"""Radians by which a goal is set ahead at most."""


class Compensation:
    """Sets the goals of both legs ahead, posture after posture, by what is known of their ``motors``."""

    def __init__(self, body: Body, motors: Mapping[str, Motor]) -> None:
        self._body = body
        mine = [motors[name] for name in body.walking]
        self._soft = np.array([1 / motor.stiffness for motor in mine])
        self._slow = np.array([motor.damping / motor.stiffness for motor in mine])
        self._heavy = np.array([motor.inertia / motor.stiffness for motor in mine])
        self._last: Posture | None = None
        self._rate = np.zeros(12)
        self._took = PERIOD

    def rest(self) -> None:
        """Forget what was before: the legs begin anew."""
        self._last, self._rate = None, np.zeros(12)

    def goals(self, posture: Posture, dt: float = PERIOD) -> Floats:
        """Return what the legs are sent (12,), by a posture that comes ``dt`` seconds after the one before.

        They are a posture behind: how a motion gathers speed is known from what comes before and after.
        """
        last, dt = self._last or posture, max(dt, PERIOD / 2)
        before, after = self._rate, (posture.angles - last.angles) / dt
        gain = 2 * (after - before) / (self._took + dt)
        held = static_torques(self._body, last)[self._body.leg_places]
        ahead = self._soft * held + self._slow * (before + after) / 2 + self._heavy * gain
        self._last, self._rate, self._took = posture, after, dt
        sent: Floats = last.angles + np.clip(ahead, -MOST, MOST)
        return sent


def static_torques(body: Body, posture: Posture) -> Floats:
    """Return the torques (N,) in Nm with which the joints hold the body up in a posture of the legs."""
    placed = forward(body, whole(body, posture.angles))
    standing, feet = [], posture.pattern.feet
    shares = _shares(posture)
    for side, share in zip(SIDES, shares, strict=True):
        place, turned = sole(body, placed, side)
        x, y, _, heading = feet[side]
        c, s = np.cos(heading), np.sin(heading)
        dx, dy = posture.pattern.pressure[0] - x, posture.pattern.pressure[1] - y
        # One foot alone stands on the point of pressure; both stand on their middles.
        at = np.array([c * dx + s * dy, c * dy - s * dx, 0.0]) if share == 1.0 else np.zeros(3)
        standing.append((share, place + turned @ at, turned[:, 2]))
    up = sum(share * normal for share, _, normal in standing)
    force = -GRAVITY * body.mass[:, None] * up
    moment = np.cross(centres(body, placed), force)
    for side, (share, at, _) in zip(SIDES, standing, strict=True):
        foot, lifted = body.legs[side].joints[-1], GRAVITY * body.total * share * up
        force[foot] += lifted
        moment[foot] += np.cross(at, lifted)
    for joint in range(len(body.joints) - 1, -1, -1):
        if (parent := body.parent[joint]) >= 0:
            force[parent] += force[joint]
            moment[parent] += moment[joint]
    axes = np.einsum("nij,nj->ni", placed.rotation, body.axis)
    torques: Floats = -np.einsum("ni,ni->n", axes, moment - np.cross(placed.position, force))
    return torques


def _shares(posture: Posture) -> tuple[float, float]:
    """Return which share of the weight each foot carries, left and right."""
    pattern = posture.pattern
    if pattern.support != "both":
        return (1.0, 0.0) if pattern.support == "left" else (0.0, 1.0)
    (lx, ly, _, _), (rx, ry, _, _) = (pattern.feet[side] for side in SIDES)
    px, py = pattern.pressure
    apart = (lx - rx) ** 2 + (ly - ry) ** 2
    left = ((px - rx) * (lx - rx) + (py - ry) * (ly - ry)) / apart
    left = min(max(left, 0.0), 1.0)
    return left, 1.0 - left
