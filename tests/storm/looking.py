"""What the invariants of the storm look at: what moves by itself, what was claimed, and how far anything may go."""

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from math import inf, radians
from typing import Any

from missions.executive.events import FaultRaised
from tests.storm.witness import Truth, Witness

STILL = 0.002
"""Radians, metres or either a second, below which nothing moves."""

HALF_STEP = radians(0.15)
"""Radians by which the last step of a servo may lie within its limit: half of the coarsest."""

RETURN = 2.5
"""Seconds that a head has, once it is there, to go where its board or its driver sends it by itself."""

HANGS = 2.0
"""Seconds for which a tick may hang in a stop."""

HAND = 1.0
"""Seconds after somebody has turned a joint, or overloaded it."""


def pairs(seen: Witness) -> Iterator[tuple[Truth, Truth]]:
    """Yield each look at the truth with the one before."""
    return (
        (before, now) for before, now in zip(seen.samples, seen.samples[1:], strict=False) if now.time > before.time
    )


def turns(before: Truth, now: Truth) -> Iterator[tuple[tuple[str, str], float]]:
    """Yield the axes that have turned, with how far (radians)."""
    for axis, angle in now.angles.items():
        if angle != before.angles[axis]:
            yield axis, angle - before.angles[axis]


def recently(times: list[float] | None, now: float, seconds: float) -> bool:
    """Whether one of the times lies that shortly before now."""
    place = bisect_right(times, now) if times else 0
    return times is not None and place > 0 and now - times[place - 1] <= seconds


def by_itself(seen: Witness, part: str, now: float) -> bool:
    """Whether something may turn though nobody commands it: it has just come back, or a hand was at it."""
    carrier = "arm" if part == "head" and neck_joints(seen) else part
    at = part, carrier
    hands = [each.start for each in seen.struck if each.part in at and each.state in ("turned", "overloaded")]
    came = [*seen.back.get(part, []), *seen.back.get(carrier, [])]
    return recently(sorted(hands), now, HAND) or (seen.kind(part) != "arm" and recently(sorted(came), now, RETURN))


def back_within(seen: Witness, before: Truth, part: str, axis: str, turned: float) -> bool:
    """Whether an axis that a hand has turned beyond its limits comes back: no servo holds what is beyond them."""
    low, high, _ = reach(seen.twins.parts[part].limits, axis)
    angle = before.angles[part, axis]
    return (angle < low + HALF_STEP and turned > 0) or (angle > high - HALF_STEP and turned < 0)


def returns(seen: Witness, part: str, seconds: float) -> Iterator[float]:
    """Yield when a part came back that was away for longer than some seconds."""
    gone = inf
    for event in seen.events:
        if isinstance(event, FaultRaised) and event.part == part and event.status in ("offline", "online"):
            if event.status == "online" and event.t - gone > seconds:
                yield event.t
            gone = event.t if event.status == "offline" else inf


def held_up(seen: Witness) -> Iterator[tuple[float, float]]:
    """Yield from when to when no tick came, since one was held up, at the longest."""
    for each in seen.struck:
        if each.state == "stalled" or (each.state == "stopped" and each.detail):
            yield each.start, each.start + max(each.seconds, HANGS)


def neck_joints(seen: Witness) -> set[str]:
    """Return the joints of the arm that are the head's."""
    head, arm = seen.config.head, seen.config.arm
    named = {getattr(getattr(head, axis, None), "joint", "") for axis in ("pan", "tilt")}
    return set() if arm is None else named & arm.limits.keys()


def reach(limits: Any, axis: str) -> tuple[float, float, float]:
    """Return how far (radians) and how fast (rad/s) an axis may go."""
    if isinstance(limits, Mapping):
        return limits[axis].lower, limits[axis].upper, limits[axis].speed
    low, high = getattr(limits, axis)
    return low, high, limits.speed


def commanded(part: str, values: Mapping[str, Any], limits: Mapping[str, Any]) -> Iterator[str]:
    """Yield what was told a part beyond its limits."""
    known = limits.get(part)
    if part == "base" and "linear" in values and known is not None:
        if abs(values["linear"]) > known.speed + 1e-3 or abs(values["angular"]) > known.turn + 1e-3:
            yield f"the base was told {dict(values)}, and may {known}"
    elif known is not None:
        for axis, goal in values.items():
            if axis in ("pan", "tilt") or (isinstance(known, Mapping) and axis in known and isinstance(goal, float)):
                low, high, _ = reach(known, axis)
                if not low - 1e-3 <= goal <= high + 1e-3:
                    yield f"{axis} of the {part} was told {goal}, and may be at {low:.3f} to {high:.3f}"
