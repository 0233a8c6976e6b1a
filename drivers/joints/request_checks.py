"""Checks of requests to joints; each reports all errors at once."""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from math import isfinite

from drivers.api import Coupling, JointLimits
from drivers.errors import BadRequest


def check_names(part: str, names: AbstractSet[str], joints: Mapping[str, object]) -> None:
    """Raise BadRequest for names that are not in ``joints``; ``part`` is the device in the message, such as "arm"."""
    if errors := _unknown_joints(names, joints):
        raise BadRequest(f"{part}: {'; '.join(errors)}")


def narrow_limits(
    part: str, limits: Mapping[str, JointLimits], widest: Mapping[str, JointLimits]
) -> Mapping[str, JointLimits]:
    """Return ``limits`` by joint, clamped to the ``widest`` limits of the same joints.

    Raises BadRequest for an unknown joint, and for limits that leave no range; ``part`` is the device in the message.
    """
    check_names(part, set(limits), widest)
    narrowed = {}
    for name, joint_limits in limits.items():
        bounds = widest[name]
        lower, upper = max(joint_limits.lower, bounds.lower), min(joint_limits.upper, bounds.upper)
        narrowed[name] = JointLimits(lower, upper, min(joint_limits.speed, bounds.speed))
        if not (lower < upper and narrowed[name].speed > 0):
            raise BadRequest(f"{part}: limits {joint_limits} of {name} are outside of {bounds}")
    return narrowed


def check_move(
    part: str, goals: Mapping[str, float], speeds: Mapping[str, float], joints: Mapping[str, object]
) -> None:
    """Raise BadRequest for a move of joints that are not in ``joints``, or with a goal or speed that is not finite.

    ``goals`` and ``speeds`` are by joint; ``part`` is the device in the message.
    """
    errors = _unknown_joints(goals.keys() | speeds.keys(), joints)
    for quantity, values in (("goal", goals), ("speed", speeds)):
        errors += [
            f"{name}: a {quantity} of {value} is not finite" for name, value in values.items() if not isfinite(value)
        ]
    if errors:
        raise BadRequest(f"{part}: {'; '.join(errors)}")


def check_couplings(part: str, couplings: Sequence[Coupling], joints: Mapping[str, object]) -> None:
    """Raise BadRequest for invalid couplings. A coupling lets a follower joint copy the motion of a leader joint.

    Couplings are invalid if a joint is unknown, has two leaders, or both leads and follows, and if a scale or offset is
    not finite. ``part`` is the device in the message.
    """
    errors = _unknown_joints({name for coupling in couplings for name in (coupling.leader, coupling.follower)}, joints)
    leaders = {coupling.leader for coupling in couplings}
    followers: set[str] = set()
    for coupling in couplings:
        pair = f"{coupling.follower} after {coupling.leader}"
        if coupling.follower in followers:
            errors.append(f"{pair}: {coupling.follower} follows another joint already")
        if coupling.follower in leaders:
            errors.append(f"{pair}: {coupling.follower} leads, and cannot follow as well")
        if not (isfinite(coupling.scale) and isfinite(coupling.offset)):
            errors.append(f"{pair}: scale {coupling.scale} and offset {coupling.offset} must be finite")
        followers.add(coupling.follower)
    if errors:
        raise BadRequest(f"{part}: {'; '.join(errors)}", hint="a joint follows one leader, which must not follow")


def _unknown_joints(names: AbstractSet[str], joints: Mapping[str, object]) -> list[str]:
    return [f"no joint {name!r} (there are {', '.join(joints)})" for name in sorted(names - joints.keys())]
