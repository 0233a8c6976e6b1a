"""What must hold whatever happens: each a small function that yields what is wrong, with a line for people."""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from math import isfinite
from typing import Any

from drivers.api import ignore
from missions.executive.events import NodeChanged, ReflexFired
from missions.executive.telling import logging_to
from missions.records.replay.rerun import rerun
from missions.testing.storm.leaves import DOOMED
from missions.testing.storm.witness import Truth, Witness

Invariant = Callable[[Witness], Iterator[str]]

BASE_RESTS, ALL_REST = 0.7, 1.0
"""Seconds after its end by which the base, and everything, must be at rest."""

STILL = 0.002
"""Radians, metres or either a second, below which nothing moves."""

WAY_OUT = 1.0
"""Seconds for which something may move on after its leaf has ended: it brakes."""

RETURN = 2.5
"""Seconds that a head has, once it is there, to go where its board or its driver sends it by itself."""

GIVEN_UP = 9.0
"""Seconds within which a mission ends that has to: its leaves have two, and the longest stall lasts six."""

HAND = 1.0
"""Seconds after somebody has turned a joint, or overloaded it."""

SLACK = 0.03
"""Radians by which a servo may be beyond its limit: half a degree of rounding, and a step."""

AT_ONCE = 1e-6
"""Seconds within which two things happen at the same time, in whatever order."""

HELD = {"run": ("stopped", "paused", "stalled"), "base": ("unplugged",)}
"""Faults for as long as which nothing moves, or the base does not."""

INVARIANTS: dict[str, tuple[str, Invariant]] = {}
"""By name: what it says, and who looks."""


def invariant(about: str) -> Callable[[Invariant], Invariant]:
    """Add a function to those that look at every run."""

    def add(function: Invariant) -> Invariant:
        INVARIANTS[function.__name__] = about, function
        return function

    return add


@invariant(f"the base is at rest {BASE_RESTS:g} s after the end, all else after {ALL_REST:g} s, whatever the end")
def at_rest(seen: Witness) -> Iterator[str]:
    """See the last samples."""
    for before, now in _pairs(seen):
        late = now.time - seen.ended
        if late > BASE_RESTS + 0.001 and max(map(abs, now.speeds)) > STILL:
            yield f"the base moves at {now.speeds} {late:.2f} s after the end"
        for (part, axis), turned in _turned(before, now):
            own_way = _by_itself(seen, part, now.time) or _back_within(seen, before, part, axis, turned)
            if late > ALL_REST + 0.001 and abs(turned) > STILL and not own_way:
                yield f"{axis} of the {part} turns {late:.2f} s after the end"


@invariant("nothing moves that no running behaviour claims, nor is commanded by one that does not claim it")
def claimed_motion(seen: Witness) -> Iterator[str]:
    """Compare what moves, and what is commanded, with claims."""
    neck = _neck(seen)
    by_hand = -1e9
    for before, now in _pairs(seen):
        by_hand = now.time if now.by_hand else by_hand
        driven = now.time - by_hand <= WAY_OUT or _recent(seen.claimed.get("base"), now.time, WAY_OUT)
        if max(map(abs, now.speeds)) > STILL and not driven:
            yield f"at {now.time:.2f} s the base moves at {now.speeds}, and nobody claims it"
        for (part, axis), turned in _turned(before, now):
            owners = [part, "head"] if part == "arm" and axis in neck else [part]
            owners += ["arm"] if part == "head" and neck else []
            free = not any(
                _recent(seen.claimed.get(owner), now.time, WAY_OUT) or _by_itself(seen, owner, now.time)
                for owner in owners
            )
            if abs(turned) > STILL and free and not _back_within(seen, before, part, axis, turned):
                yield f"at {now.time:.2f} s {axis} of the {part} turns, and nobody claims the {' or the '.join(owners)}"
    for command in seen.commands:
        leaf = seen.leaf(command)
        moves = {"linear", "pan", "follow"} & command.values.keys() or command.to == "arm"
        if leaf is not None and moves and command.to not in leaf.claims and "hold" not in command.values:
            yield f"{leaf.place} commands the {command.to} ({dict(command.values)}), which it does not claim"


@invariant("nothing moves in a run that is stopped or paused, nor a base without ticks or unplugged, but by hand")
def helpless(seen: Witness) -> Iterator[str]:
    """Look at the times between: from the end of braking to the end of the fault, or of another of its kind."""
    for fault in seen.struck:
        if fault.state not in HELD.get(fault.part, ()):
            continue
        # Who releases the last stop releases all; a pause ends with any stop or pause, and one plug is in for all.
        others = [each for each in seen.struck if each.part == fault.part and each.state in HELD[fault.part]]
        if fault.state not in ("paused", "unplugged"):
            others = [each for each in others if each.state == fault.state and each.start >= fault.start]
        # A base without its cable is stopped by its firmware, and its wheels obey that as late as all else.
        lag = seen.lag if fault.part == "base" else 0.0
        ends = [each.start + each.seconds for each in others]
        over, by_hand = min(end for end in ends if end >= fault.start - AT_ONCE), -WAY_OUT
        for before, now in _pairs(seen):
            by_hand = now.time if now.by_hand else by_hand
            if not fault.start + BASE_RESTS + lag < now.time < min(over, seen.ended):
                continue
            if max(map(abs, now.speeds)) > STILL and now.time - by_hand > WAY_OUT:
                yield f"at {now.time:.2f} s the base moves at {now.speeds}, though it is {fault.state}"
            for (part, axis), turned in _turned(before, now) if fault.state in ("stopped", "paused") else ():
                own_way = _by_itself(seen, part, now.time) or _back_within(seen, before, part, axis, turned)
                if abs(turned) > STILL and not own_way:
                    yield f"at {now.time:.2f} s {axis} of the {part} turns, though the run is {fault.state}"


@invariant("no actuator has two owners")
def one_owner(seen: Witness) -> Iterator[str]:
    """See what the history has found."""
    if seen.history.claimed:
        yield seen.history.claimed


@invariant("speeds, joints and heads keep their limits, as commanded and in truth")
def limits_kept(seen: Witness) -> Iterator[str]:
    """Compare commands and samples with the robot file."""
    limits = {part: twin.limits for part, twin in seen.twins.parts.items() if hasattr(twin, "limits")}
    for command in seen.commands:
        yield from _commanded(command.to, command.values, limits)
    base = limits.get("base")
    for before, now in _pairs(seen):
        if base is not None:
            for speed, most, what in zip(now.speeds, (base.speed, base.turn), ("speed", "turn rate"), strict=True):
                if abs(speed) > most * 1.03 + 0.01:
                    yield f"at {now.time:.2f} s the base has a {what} of {speed:.3f}, and may have {most:.3f}"
        for (part, axis), turned in _turned(before, now):
            low, high, most = _of_axis(limits[part], axis)
            angle, step = now.angles[part, axis], now.time - before.time
            moved = abs(turned) > STILL and not _by_itself(seen, part, now.time)
            moved = moved and not _back_within(seen, before, part, axis, turned)
            # Joints of a neck that the arm drives go as far as the arm may.
            if part == "head" and _neck(seen) and _recent(seen.claimed.get("arm"), now.time, WAY_OUT):
                continue
            if moved and not low - SLACK <= angle <= high + SLACK:
                yield f"at {now.time:.2f} s {axis} of the {part} is at {angle:.3f}, and may be {low:.3f} to {high:.3f}"
            if moved and most and abs(turned) > most * step * 1.1 + SLACK:
                yield f"at {now.time:.2f} s {axis} of the {part} turns at {turned / step:.2f}, and may at {most:.2f}"


@invariant("no goal and no place is ever not a number, or infinite")
def finite(seen: Witness) -> Iterator[str]:
    """Look at all numbers that were commanded, and at the truth."""
    for command in seen.commands:
        for name, value in command.values.items():
            if isinstance(value, float) and not isfinite(value):
                yield f"at {command.t:.2f} s the {command.to} was told {name}: {value}"
    for sample in seen.samples:
        if not all(map(isfinite, (*sample.speeds, *sample.angles.values()))):
            yield f"at {sample.time:.2f} s something is nowhere: {sample}"
            return


@invariant("a battery that is critical ends the mission")
def battery(seen: Witness) -> Iterator[str]:
    """See how long it went on, which is longer where no tick comes."""
    fired = (event for event in seen.events if isinstance(event, ReflexFired))
    for event in fired:
        if event.what == "battery_critical" and event.on and event.t + GIVEN_UP < seen.ended:
            yield f"it is critical at {event.t:.2f} s, and the mission goes on until {seen.ended:.2f} s"


@invariant("every failure has a reason")
def reasons(seen: Witness) -> Iterator[str]:
    """Look at all nodes that failed, and at the mission."""
    for event in seen.events:
        if isinstance(event, NodeChanged) and event.status == "failure" and not event.reason:
            yield f"{event.kind} ({event.node}) fails at {event.t:.2f} s, and does not say why"
    result = seen.history.result
    if result is None:
        yield "the mission has no result"
    elif result.result != "success" and not result.reason:
        yield f"the mission ends as {result.result}, and does not say why"


@invariant("a behaviour that raises, or returns no status, never succeeds")
def told(seen: Witness) -> Iterator[str]:
    """Look at the rogues, whose way says how they end."""
    for event in seen.events:
        way = getattr(seen.leaves.get(getattr(event, "node", "")), "way", "")
        if isinstance(event, NodeChanged) and event.status == "success" and way in DOOMED:
            yield f"{event.kind} ({event.node}) succeeds at {event.t:.2f} s, though its way is '{way}'"


@invariant("what was recorded is decided again as it was")
def decided_again(seen: Witness) -> Iterator[str]:
    """Decide it again, from memory."""
    with logging_to(ignore):
        found = rerun(seen, seen.runner.plan, seen.config, seed=seen.seed)
    if not found.same:
        yield f"{found.difference or found.command or found.unheard}"


@invariant("a record can be read, whatever became of who wrote it, and what is in it is decided again as it was")
def readable(seen: Witness) -> Iterator[str]:
    """Read it, where there is one."""
    if seen.record is not None:
        yield from seen.record.wrong(seen.moments, seen.runner.plan, seen.config, seen.seed)


@invariant("nothing is left behind: no thread, no open file, no file, no behaviour that goes on")
def nothing_left(seen: Witness) -> Iterator[str]:
    """See what was there afterwards, and not before."""
    yield from seen.left
    yield from (f"{leaf.place} is still at it" for leaf in seen.leaves.values() if leaf.acting)


def broken(seen: Witness) -> dict[str, str]:
    """Return the first thing that is wrong by each invariant that does not hold."""
    return {name: first for name, (_, look) in INVARIANTS.items() if (first := next(look(seen), ""))}


# --- what they look at ------------------------------------------------------------------------------------------------


def _pairs(seen: Witness) -> Iterator[tuple[Truth, Truth]]:
    return (
        (before, now) for before, now in zip(seen.samples, seen.samples[1:], strict=False) if now.time > before.time
    )


def _turned(before: Truth, now: Truth) -> Iterator[tuple[tuple[str, str], float]]:
    for axis, angle in now.angles.items():
        if angle != before.angles[axis]:
            yield axis, angle - before.angles[axis]


def _recent(times: list[float] | None, now: float, seconds: float) -> bool:
    """Whether one of the times lies that shortly before now."""
    place = bisect_right(times, now) if times else 0
    return times is not None and place > 0 and now - times[place - 1] <= seconds


def _by_itself(seen: Witness, part: str, now: float) -> bool:
    """Whether something may turn though nobody commands it: it has just come back, or a hand was at it."""
    hands = [each.start for each in seen.struck if each.part == part and each.state in ("turned", "overloaded")]
    carrier = "arm" if part == "head" and _neck(seen) else part
    came = [*seen.back.get(part, []), *seen.back.get(carrier, [])]
    return _recent(sorted(hands), now, HAND) or (part != "arm" and _recent(sorted(came), now, RETURN))


def _back_within(seen: Witness, before: Truth, part: str, axis: str, turned: float) -> bool:
    """Whether an axis that a hand has turned beyond its limits comes back: no servo holds what is beyond them."""
    low, high, _ = _of_axis(seen.twins.parts[part].limits, axis)
    angle = before.angles[part, axis]
    return (angle < low and turned > 0) or (angle > high and turned < 0)


def _neck(seen: Witness) -> set[str]:
    """Return the joints of the arm that are the head's."""
    head, arm = seen.config.head, seen.config.arm
    named = {getattr(getattr(head, axis, None), "joint", "") for axis in ("pan", "tilt")}
    return set() if arm is None else named & arm.limits.keys()


def _of_axis(limits: Any, axis: str) -> tuple[float, float, float]:
    """Return how far (radians) and how fast (rad/s) an axis may go."""
    if isinstance(limits, Mapping):
        return limits[axis].lower, limits[axis].upper, limits[axis].speed
    low, high = getattr(limits, axis)
    return low, high, limits.speed


def _commanded(part: str, values: Mapping[str, Any], limits: Mapping[str, Any]) -> Iterator[str]:
    """Yield what was told a part beyond its limits."""
    known = limits.get(part)
    if part == "base" and "linear" in values and known is not None:
        if abs(values["linear"]) > known.speed + 1e-3 or abs(values["angular"]) > known.turn + 1e-3:
            yield f"the base was told {dict(values)}, and may {known}"
    elif known is not None:
        for axis, goal in values.items():
            if axis in ("pan", "tilt") or (isinstance(known, Mapping) and axis in known and isinstance(goal, float)):
                low, high, _ = _of_axis(known, axis)
                if not low - 1e-3 <= goal <= high + 1e-3:
                    yield f"{axis} of the {part} was told {goal}, and may be at {low:.3f} to {high:.3f}"
