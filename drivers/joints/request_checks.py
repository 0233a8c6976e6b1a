"""What cannot be asked of joints, whoever is asked: each check tells all that is wrong at once."""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from math import isfinite

from drivers.api import Coupling, JointLimits
from drivers.errors import BadRequest


def check_names(part: str, names: AbstractSet[str], joints: Mapping[str, object]) -> None:
    """Raise BadRequest for names that none of ``joints`` has."""
    if wrong := _unknown_joints(names, joints):
        raise BadRequest(f"{part}: {'; '.join(wrong)}")


def narrow_limits(
    part: str, limits: Mapping[str, JointLimits], widest: Mapping[str, JointLimits]
) -> Mapping[str, JointLimits]:
    """Return ``wanted`` limits within the ``widest`` of those joints.

    Raises BadRequest for an unknown joint, and for limits that leave nothing.
    """
    check_names(part, set(limits), widest)
    found = {}
    for name, its in limits.items():
        bounds = widest[name]
        lower, upper = max(its.lower, bounds.lower), min(its.upper, bounds.upper)
        found[name] = JointLimits(lower, upper, min(its.speed, bounds.speed))
        if not (lower < upper and found[name].speed > 0):
            raise BadRequest(f"{part}: limits {its} of {name} leave nothing of {bounds}")
    return found


def check_move(
    part: str, goals: Mapping[str, float], speeds: Mapping[str, float], joints: Mapping[str, object]
) -> None:
    """Raise BadRequest for a move of unknown joints, or with values that are not finite."""
    wrong = _unknown_joints(goals.keys() | speeds.keys(), joints)
    for what, values in (("goal", goals), ("speed", speeds)):
        wrong += [f"{name}: a {what} of {value} is not finite" for name, value in values.items() if not isfinite(value)]
    if wrong:
        raise BadRequest(f"{part}: {'; '.join(wrong)}")


def check_couplings(part: str, couplings: Sequence[Coupling], joints: Mapping[str, object]) -> None:
    """Raise BadRequest for couplings of unknown joints, of joints that two lead or that both lead and follow."""
    wrong = _unknown_joints({name for coupling in couplings for name in (coupling.leader, coupling.follower)}, joints)
    leaders = {coupling.leader for coupling in couplings}
    followers: set[str] = set()
    for coupling in couplings:
        pair = f"{coupling.follower} after {coupling.leader}"
        if coupling.follower in followers:
            wrong.append(f"{pair}: {coupling.follower} follows another joint already")
        if coupling.follower in leaders:
            wrong.append(f"{pair}: {coupling.follower} leads, and cannot follow as well")
        if not (isfinite(coupling.scale) and isfinite(coupling.offset)):
            wrong.append(f"{pair}: scale {coupling.scale} and offset {coupling.offset} must be finite")
        followers.add(coupling.follower)
    if wrong:
        raise BadRequest(f"{part}: {'; '.join(wrong)}", hint="a joint follows one other, which follows none")


def _unknown_joints(names: AbstractSet[str], joints: Mapping[str, object]) -> list[str]:
    return [f"no joint {name!r} (there are {', '.join(joints)})" for name in sorted(names - joints.keys())]
