"""What is wrong with a gait, by the joint and the time: reach, limits, speeds, torque at rest, collisions, support."""

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from drivers.api import JointLimits
from drivers.legs.body import SIDES, Body, Floats
from drivers.legs.collision import clearance
from drivers.legs.engine import whole
from drivers.legs.gait import Gait
from drivers.legs.kinematics import axes, centre_of_mass, centres, forward
from drivers.legs.leg_ik import REASONS
from drivers.legs.pendulum import GRAVITY
from drivers.legs.pressure import margins


def mistakes(body: Body, gait: Gait, limits: Mapping[str, JointLimits], torques: Mapping[str, float]) -> Iterator[str]:
    """Yield what the body cannot do of a gait, the first moment of each. ``torques`` (Nm) are what servos stall at."""
    angles, reason = gait.angles(body)
    for number, side in enumerate(SIDES):
        if reason[:, number].any():
            at = int(np.flatnonzero(reason[:, number])[0])
            knee = body.joints[body.legs[side].joints[3]]
            yield f"{knee} at {gait.times[at]:.2f} s: {REASONS[int(reason[at, number])]}"
    if reason.any():
        return
    speeds = np.abs(np.roll(angles, -1, axis=0) - angles) * len(angles) / gait.period
    placed = forward(body, whole(body, angles))
    loads = statics(body, gait, angles)
    for column, joint in enumerate(body.walking):
        its = limits[joint]
        row = angles[:, column]
        yield from _first(gait, joint, row, row < its.lower - 1e-9, f"below its limit of {_deg(its.lower)}", "deg")
        yield from _first(gait, joint, row, row > its.upper + 1e-9, f"above its limit of {_deg(its.upper)}", "deg")
        fast = speeds[:, column]
        yield from _first(gait, joint, fast, fast > its.speed, f"faster than {_deg(its.speed)}/s", "deg/s")
        if joint in torques:
            load = loads[:, column]
            told = f"more than its servo's {torques[joint]:.1f} Nm"
            yield from _first(gait, joint, load, load > torques[joint], told, "Nm")
    gaps, names = clearance(body, placed)
    for pair in np.flatnonzero((gaps < 0).any(axis=0)):
        at = int(np.flatnonzero(gaps[:, pair] < 0)[0])
        one, other = names[pair]
        yield f"{one} at {gait.times[at]:.2f} s: hits {other}, {-1000 * gaps[at, pair]:.0f} mm deep"
    left = margins(body, gait, angles)
    at = int(left.argmin())
    if not gait.on[at].any():
        yield f"the body at {gait.times[at]:.2f} s: no foot is on the floor"
    elif left[at] < 0:
        yield f"the body at {gait.times[at]:.2f} s: presses {-1000 * left[at]:.0f} mm outside of its soles"


def statics(body: Body, gait: Gait, angles: Floats) -> Floats:
    """Return the torques (M, 12) in Nm that hold the pose: a standing leg bears all above it, a lifted one itself."""
    placed = forward(body, whole(body, angles))
    axis, masses = axes(body, placed), centres(body, placed)
    everything = centre_of_mass(body, placed) * body.total
    share = gait.on / np.maximum(gait.on.sum(axis=1, keepdims=True), 1)
    found = np.empty_like(angles)
    for number, side in enumerate(SIDES):
        chain = body.legs[side].joints
        for place, joint in enumerate(chain):
            below = list(chain[place:])
            mass = float(body.mass[below].sum())
            hung = (body.mass[below][:, None] * masses[:, below]).sum(axis=1)
            pivot = placed.position[:, joint]
            lifted = _torque(axis[:, joint], hung - mass * pivot)
            borne = _torque(axis[:, joint], everything - hung - (body.total - mass) * pivot)
            on = gait.on[:, number]
            found[:, 6 * number + place] = np.where(on, borne * share[:, number], lifted)
    return found


def _torque(axis: Floats, moment: Floats) -> Floats:
    """Return how hard a mass pulls about an axis: its ``moment`` is mass times place."""
    found: Floats = np.abs((axis * np.cross(moment, np.array([0.0, 0.0, -GRAVITY]))).sum(axis=-1))
    return found


def _first(gait: Gait, joint: str, row: Floats, wrong: npt.NDArray[np.bool_], told: str, unit: str) -> Iterator[str]:
    if wrong.any():
        at = int(np.argmax(np.where(wrong, np.abs(row), -1.0)))
        value = row[at] if unit == "Nm" else np.degrees(row[at])
        yield f"{joint} at {gait.times[at]:.2f} s: {value:.1f} {unit}, {told}"


def _deg(angle: float) -> str:
    return f"{np.degrees(angle):.0f} deg"
