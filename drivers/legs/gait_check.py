"""Feasibility check of a gait: reach, limits, speeds, static torque, collisions, support; errors by joint and time."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
import numpy.typing as npt

from drivers.api import JointLimits
from drivers.legs.balance import support_margins
from drivers.legs.body import SIDES, Floats, LeggedBody
from drivers.legs.engine import whole_body_pose
from drivers.legs.gait import Gait
from drivers.legs.kinematics import LinkPoses, centre_of_mass, forward_kinematics, joint_axes, link_centres
from drivers.legs.leg_ik import UNREACHABLE_REASONS
from drivers.legs.pattern_generator import GRAVITY

# Collisions between the links of a body: capsules, also for the trunk's box and the soles.

TRUNK = "trunk"


@dataclass(frozen=True)
class Capsule:
    """A capsule on the link with index ``link`` (-1: the trunk), from ``start`` to ``end`` in the frame of the link."""

    name: str
    link: int
    start: Floats
    end: Floats
    radius: float


@lru_cache(maxsize=16)
def capsules(body: LeggedBody) -> tuple[Capsule, ...]:
    """Return the capsules of a body: of its links, of its trunk, and two along the edges of each sole."""
    found = [
        Capsule(name, place, np.zeros(3), body.end[place], float(body.radius[place]))
        for place, name in enumerate(body.joints)
        if body.radius[place] > 0
    ]
    box, middle = body.trunk.box, body.trunk.middle
    radius = float(min(box)) / 2
    along = np.where(np.arange(3) == int(np.argmax(box)), (float(max(box)) / 2 - radius), 0.0)
    found.append(Capsule(TRUNK, -1, middle - along, middle + along, radius))
    for side in SIDES:
        leg = body.legs[side]
        half = leg.thickness / 2
        for edge in (-1, 1):
            at = leg.sole + np.array([0.0, edge * (leg.width / 2 - half), half])
            reach = np.array([leg.length / 2 - half, 0.0, 0.0])
            found.append(Capsule(body.joints[leg.joints[-1]], leg.joints[-1], at - reach, at + reach, half))
    return tuple(found)


@lru_cache(maxsize=16)
def collision_pairs(body: LeggedBody) -> tuple[tuple[Capsule, Capsule], ...]:
    """Return the pairs of capsules that may collide.

    They are on different links that are not joined, neither directly nor by links without a radius.
    """
    near = {frozenset((place, parent)) for place, parent in enumerate(body.parent)}
    return tuple(
        (one, other)
        for one, other in combinations(capsules(body), 2)
        if one.link != other.link
        and frozenset((one.link, other.link)) not in near
        and not _are_joined(body, one, other)
    )


def clearance(body: LeggedBody, placed: LinkPoses) -> tuple[Floats, tuple[tuple[str, str], ...]]:
    """Return the gap (..., P) of each pair of capsules in metres, negative if they overlap, and their names.

    ``placed`` are the poses of the links.
    """
    chosen = collision_pairs(body)
    ends = {id(each): _ends(each, placed) for each in capsules(body)}
    gaps = [_segment_distance(*ends[id(one)], *ends[id(other)]) - one.radius - other.radius for one, other in chosen]
    shape = placed.position.shape[:-2]
    found = np.stack([np.broadcast_to(gap, shape) for gap in gaps], axis=-1) if gaps else np.ones((*shape, 0))
    return found, tuple((one.name, other.name) for one, other in chosen)


def _are_joined(body: LeggedBody, one: Capsule, other: Capsule) -> bool:
    """True if two capsules are on links that are joined, directly or through links without a radius."""

    def solid(link: int) -> int:
        link = body.parent[link]
        while link >= 0 and body.radius[link] == 0:
            link = body.parent[link]
        return link

    return any(
        a.link >= 0 and (solid(a.link) == b.link or (a.link in _path(body, b.link) and solid(b.link) == a.link))
        for a, b in ((one, other), (other, one))
    )


def _path(body: LeggedBody, link: int) -> list[int]:
    found = []
    while link >= 0:
        found.append(link)
        link = body.parent[link]
    return found


def _ends(capsule: Capsule, placed: LinkPoses) -> tuple[Floats, Floats]:
    if capsule.link < 0:
        return capsule.start, capsule.end
    position, rotation = placed.position[..., capsule.link, :], placed.rotation[..., capsule.link, :, :]
    return position + rotation @ capsule.start, position + rotation @ capsule.end


def _segment_distance(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Return the distance between segments a to b and c to d (..., 3) (Ericson, Real-Time Collision Detection)."""
    along, across, between = b - a, d - c, a - c
    aa, ee = (along * along).sum(-1), (across * across).sum(-1)
    f, g, h = (across * between).sum(-1), (along * between).sum(-1), (along * across).sum(-1)
    safe_a, safe_e = np.where(aa > 0, aa, 1.0), np.where(ee > 0, ee, 1.0)
    flat = aa * ee - h * h
    s = np.clip(np.where(flat > 1e-15, (h * f - g * ee) / np.where(flat > 1e-15, flat, 1.0), 0.0), 0.0, 1.0)
    t = np.where(ee > 0, (h * s + f) / safe_e, 0.0)
    s = np.where(t < 0, np.clip(-g / safe_a, 0, 1), np.where(t > 1, np.clip((h - g) / safe_a, 0, 1), s))
    t = np.clip(t, 0.0, 1.0)
    way: Floats = a + s[..., None] * along - c - t[..., None] * across
    found: Floats = np.sqrt((way * way).sum(-1))
    return found


def gait_errors(
    body: LeggedBody, gait: Gait, limits: Mapping[str, JointLimits], torques: Mapping[str, float]
) -> Iterator[str]:
    """Yield the reasons why the body cannot play a gait, each with one time at which it occurs.

    ``torques`` (Nm) are the stall torques of the servos by joint.
    """
    angles, reason = gait.angles(body)
    for number, side in enumerate(SIDES):
        if reason[:, number].any():
            at = int(np.flatnonzero(reason[:, number])[0])
            knee = body.joints[body.legs[side].joints[3]]
            yield f"{knee} at {gait.times[at]:.2f} s: {UNREACHABLE_REASONS[int(reason[at, number])]}"
    if reason.any():
        return
    speeds = np.abs(np.roll(angles, -1, axis=0) - angles) * len(angles) / gait.period
    placed = forward_kinematics(body, whole_body_pose(body, angles))
    loads = static_leg_torques(body, gait, angles)
    for column, joint in enumerate(body.leg_joints):
        its = limits[joint]
        row = angles[:, column]
        yield from _worst_violation(
            gait, joint, row, row < its.lower - 1e-9, f"below its limit of {_deg(its.lower)}", "deg"
        )
        yield from _worst_violation(
            gait, joint, row, row > its.upper + 1e-9, f"above its limit of {_deg(its.upper)}", "deg"
        )
        fast = speeds[:, column]
        yield from _worst_violation(gait, joint, fast, fast > its.speed, f"faster than {_deg(its.speed)}/s", "deg/s")
        if joint in torques:
            load = loads[:, column]
            told = f"more than its servo's {torques[joint]:.1f} Nm"
            yield from _worst_violation(gait, joint, load, load > torques[joint], told, "Nm")
    gaps, names = clearance(body, placed)
    for pair in np.flatnonzero((gaps < 0).any(axis=0)):
        at = int(np.flatnonzero(gaps[:, pair] < 0)[0])
        one, other = names[pair]
        yield f"{one} at {gait.times[at]:.2f} s: hits {other}, {-1000 * gaps[at, pair]:.0f} mm deep"
    left = support_margins(body, gait, angles)
    at = int(left.argmin())
    if not gait.on_floor[at].any():
        yield f"the body at {gait.times[at]:.2f} s: no foot is on the floor"
    elif left[at] < 0:
        yield f"the body at {gait.times[at]:.2f} s: presses {-1000 * left[at]:.0f} mm outside of its soles"


def static_leg_torques(body: LeggedBody, gait: Gait, angles: Floats) -> Floats:
    """Return the torques (M, 12), in Nm, that hold the poses of a gait still.

    A leg on the floor carries all of the body above each of its joints; a lifted leg carries only its own links.
    """
    placed = forward_kinematics(body, whole_body_pose(body, angles))
    axis, masses = joint_axes(body, placed), link_centres(body, placed)
    everything = centre_of_mass(body, placed) * body.total_mass
    share = gait.on_floor / np.maximum(gait.on_floor.sum(axis=1, keepdims=True), 1)
    found = np.empty_like(angles)
    for number, side in enumerate(SIDES):
        chain = body.legs[side].joints
        for place, joint in enumerate(chain):
            below = list(chain[place:])
            mass = float(body.mass[below].sum())
            hung = (body.mass[below][:, None] * masses[:, below]).sum(axis=1)
            pivot = placed.position[:, joint]
            lifted = _torque(axis[:, joint], hung - mass * pivot)
            borne = _torque(axis[:, joint], everything - hung - (body.total_mass - mass) * pivot)
            on = gait.on_floor[:, number]
            found[:, 6 * number + place] = np.where(on, borne * share[:, number], lifted)
    return found


def _torque(axis: Floats, moment: Floats) -> Floats:
    """Return the gravity torque about an axis; ``moment`` is mass times position."""
    found: Floats = np.abs((axis * np.cross(moment, np.array([0.0, 0.0, -GRAVITY]))).sum(axis=-1))
    return found


def _worst_violation(
    gait: Gait, joint: str, row: Floats, wrong: npt.NDArray[np.bool_], message: str, unit: str
) -> Iterator[str]:
    if wrong.any():
        at = int(np.argmax(np.where(wrong, np.abs(row), -1.0)))
        value = row[at] if unit == "Nm" else np.degrees(row[at])
        yield f"{joint} at {gait.times[at]:.2f} s: {value:.1f} {unit}, {message}"


def _deg(angle: float) -> str:
    return f"{np.degrees(angle):.0f} deg"
