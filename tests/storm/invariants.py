"""What must hold whatever happens: each a small function that yields what is wrong, with a line for people."""

from collections.abc import Callable, Iterator
from math import inf, isfinite

from drivers.api import ignore
from missions.executive.event_reporter import capture_log
from missions.executive.events import NodeChanged, ReflexFired
from missions.executive.executive import HALT_TIMEOUT
from missions.plugins.records.replay.rerun import rerun
from tests.storm.leaves import DOOMED, LEFT
from tests.storm.looking import (
    STILL,
    back_within,
    by_itself,
    commanded,
    held_up,
    neck_joints,
    pairs,
    reach,
    recently,
    returns,
    turns,
)
from tests.storm.witness import Witness

Invariant = Callable[[Witness], Iterator[str]]

BASE_RESTS, ALL_REST = 0.7, 1.0
"""Seconds after its end by which the base, and everything, must be at rest."""

WAY_OUT = 1.0
"""Seconds for which something may move on after its leaf has ended: it brakes."""

GIVEN_UP = HALT_TIMEOUT + 0.5
"""Seconds within which a mission ends that has to, but for those in which no tick comes: its leaves', and a tick."""

SLACK = 0.03
"""Radians by which a servo may be beyond its limit: half a degree of rounding, and a step."""

AWAY, AWAY_OUT = 1.2, 0.1
"""Seconds from which on a part was away for long, and for which something may move once it is back."""

NOTICED = 5.0
"""Seconds within which a critical battery is told, which takes two looks."""

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
    for before, now in pairs(seen):
        late = now.time - seen.ended
        if late > BASE_RESTS + 0.001 and max(map(abs, now.speeds)) > STILL:
            yield f"the base moves at {now.speeds} {late:.2f} s after the end"
        for (part, axis), turned in turns(before, now):
            own_way = by_itself(seen, part, now.time) or back_within(seen, before, part, axis, turned)
            if late > ALL_REST + 0.001 and abs(turned) > STILL and not own_way:
                yield f"{axis} of the {part} turns {late:.2f} s after the end"


@invariant("nothing moves that no running behaviour claims, nor is commanded by one that does not claim it")
def claimed_motion(seen: Witness) -> Iterator[str]:
    """Compare what moves, and what is commanded, with claims."""
    neck = neck_joints(seen)
    by_hand = -1e9
    for before, now in pairs(seen):
        by_hand = now.time if now.by_hand else by_hand
        driven = now.time - by_hand <= WAY_OUT or recently(seen.claimed.get("base"), now.time, WAY_OUT)
        if max(map(abs, now.speeds)) > STILL and not driven:
            yield f"at {now.time:.2f} s the base moves at {now.speeds}, and nobody claims it"
        for (part, axis), turned in turns(before, now):
            owners = [part, "head"] if part == "arm" and axis in neck else [part]
            owners += ["arm"] if part == "head" and neck else []
            free = not any(
                recently(seen.claimed.get(owner), now.time, WAY_OUT) or by_itself(seen, owner, now.time)
                for owner in owners
            )
            if abs(turned) > STILL and free and not back_within(seen, before, part, axis, turned):
                yield f"at {now.time:.2f} s {axis} of the {part} turns, and nobody claims the {' or the '.join(owners)}"
    for command in seen.commands:
        leaf = seen.leaf(command)
        moves = {"linear", "pan", "follow"} & command.values.keys() or seen.kind(command.to) == "arm"
        if leaf is not None and moves and command.to not in leaf.claims and "hold" not in command.values:
            yield f"{leaf.label} commands the {command.to} ({dict(command.values)}), which it does not claim"


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
        # A base without its cable, or without ticks, stops by itself, and its wheels obey that as late as all else.
        lag = seen.lag if fault.part == "base" or fault.state == "stalled" else 0.0
        ends = [each.start + each.seconds for each in others]
        # The tick loop obeys a pause, once it comes to it.
        late = [end for start, end in held_up(seen) if start <= fault.start <= end and fault.state == "paused"]
        begin = max([fault.start, *late])
        over, by_hand = min(end for end in ends if end >= fault.start - AT_ONCE), -WAY_OUT
        for before, now in pairs(seen):
            by_hand = now.time if now.by_hand else by_hand
            if not begin + BASE_RESTS + lag < now.time < min(over, seen.ended):
                continue
            if max(map(abs, now.speeds)) > STILL and now.time - by_hand > WAY_OUT:
                yield f"at {now.time:.2f} s the base moves at {now.speeds}, though it is {fault.state}"
            for (part, axis), turned in turns(before, now) if fault.state in ("stopped", "paused") else ():
                own_way = by_itself(seen, part, now.time) or back_within(seen, before, part, axis, turned)
                if abs(turned) > STILL and not own_way:
                    yield f"at {now.time:.2f} s {axis} of the {part} turns, though the run is {fault.state}"


@invariant("a stop latches the base until it is released, or a person enables it")
def latched(seen: Witness) -> Iterator[str]:
    """See that its own driver holds it, from the stop on."""
    stops = [each for each in seen.struck if each.state == "stopped"]
    for stop in stops:
        over = min(each.start + each.seconds for each in stops if each.start >= stop.start)
        enabled = min((each.start for each in seen.struck if each.state == "button"), default=inf)
        for now in seen.samples:
            if stop.start + AT_ONCE < now.time < min(over, enabled, seen.ended) and not now.latched:
                yield f"at {now.time:.2f} s the base is not latched, though the run was stopped at {stop.start:.2f} s"


@invariant("a base with a range guard drives into nothing that was visible in time")
def no_touch(seen: Witness) -> Iterator[str]:
    """See ``tests.storm.touching``."""
    for touch in [] if seen.touching is None else seen.touching.bad:
        yield f"at {touch.time:.2f} s the base drives into {touch.what} at {touch.speed:.2f} m/s"


@invariant("no actuator has two owners")
def one_owner(seen: Witness) -> Iterator[str]:
    """See what the history has found."""
    if seen.history.claim_conflict:
        yield seen.history.claim_conflict


@invariant("speeds, joints and heads keep their limits, as commanded and in truth")
def limits_kept(seen: Witness) -> Iterator[str]:
    """Compare commands and samples with the robot file."""
    limits = {part: twin.limits for part, twin in seen.twins.parts.items() if hasattr(twin, "limits")}
    for command in seen.commands:
        yield from commanded(command.to, command.values, limits)
    base = limits.get("base")
    for before, now in pairs(seen):
        if base is not None:
            for speed, most, what in zip(now.speeds, (base.speed, base.turn), ("speed", "turn rate"), strict=True):
                if abs(speed) > most * 1.03 + 0.01:
                    yield f"at {now.time:.2f} s the base has a {what} of {speed:.3f}, and may have {most:.3f}"
        for (part, axis), turned in turns(before, now):
            low, high, most = reach(limits[part], axis)
            angle, step = now.angles[part, axis], now.time - before.time
            moved = abs(turned) > STILL and not by_itself(seen, part, now.time)
            moved = moved and not back_within(seen, before, part, axis, turned)
            # Joints of a neck that the arm drives go as far as the arm may.
            if part == "head" and neck_joints(seen) and recently(seen.claimed.get("arm"), now.time, WAY_OUT):
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


@invariant("a battery that is critical ends the mission, which may be paused")
def battery(seen: Witness) -> Iterator[str]:
    """See when that was told, and how long the mission went on, which is longer where no tick comes."""
    fired = [event for event in seen.events if isinstance(event, ReflexFired) and event.condition == "battery_critical"]
    told, stalls = [event.t for event in fired], list(held_up(seen))
    for event in fired:
        most = GIVEN_UP + sum(end - start for start, end in stalls if end > event.t)
        if event.on and event.t + most < seen.ended:
            yield f"it is critical at {event.t:.2f} s, and the mission goes on until {seen.ended:.2f} s"
    since = inf
    for now in seen.samples:
        stalled = any(start <= now.time <= end for start, end in stalls)
        since = min(since, now.time) if now.weak and not stalled and now.time < seen.ended else inf
        if now.time - since > NOTICED and not told[:1] <= [now.time]:
            yield f"it is critical from {since:.2f} s on, and nobody says so by {now.time:.2f} s"
            return


@invariant("what was decided before a part was away for long moves it no more")
def anew(seen: Witness) -> Iterator[str]:
    """Look at what moves from its return on, until a behaviour begins that drives it."""
    others = ((part, {part}) for part, kind in seen.config.extra_parts.items() if kind == "arm")
    for part, owners in (("base", {"base"}), ("arm", {"arm", "head"} if neck_joints(seen) else {"arm"}), *others):
        leaves = {key: leaf for key, leaf in seen.leaves.items() if leaf.claims & owners}
        if any(getattr(leaf, "way", "") == LEFT for leaf in leaves.values()):
            continue  # what it has left moving goes on
        begun = [
            event.t
            for event in seen.events
            if isinstance(event, NodeChanged) and event.node in leaves and event.status in ("running", "success")
        ]
        for back in returns(seen, part, AWAY):
            until = min([time for time in begun if time >= back], default=seen.ended)
            by_hand = -WAY_OUT
            for before, now in pairs(seen):
                by_hand = now.time if now.by_hand else by_hand
                if not back + AWAY_OUT + seen.lag < now.time < until:
                    continue
                if part == "base" and max(map(abs, now.speeds)) > STILL and now.time - by_hand > WAY_OUT:
                    yield f"at {now.time:.2f} s the base moves at {now.speeds}, as before it was away"
                for axis, turned in ((axis, by) for (owner, axis), by in turns(before, now) if owner == part):
                    own_way = by_itself(seen, part, now.time) or back_within(seen, before, part, axis, turned)
                    if abs(turned) > STILL and not own_way:
                        yield f"at {now.time:.2f} s {axis} of the {part} turns, as before it was away"


@invariant("a behaviour that does not stop is stopped, once its time for that is over")
def halted(seen: Witness) -> Iterator[str]:
    """Look at the rogues, which count how often they are asked too late."""
    for leaf in seen.leaves.values():
        if getattr(leaf, "overdue", 0) > 1:
            yield f"{leaf.label} is still asked whether it stops, more than {leaf.halt_limit:g} s after it was halted"


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
    with capture_log(ignore):
        found = rerun(seen, seen.runner.plan, seen.config, seed=seen.seed)
    if not found.is_identical:
        yield f"{found.difference or found.command or found.unanswered}"


@invariant("a record can be read, whatever became of who wrote it, and what is in it is decided again as it was")
def readable(seen: Witness) -> Iterator[str]:
    """Read it, where there is one."""
    if seen.record is not None:
        yield from seen.record.wrong(seen.tick_records, seen.runner.plan, seen.config, seen.seed)


@invariant("nothing is left behind: no thread, no open file, no file, no behaviour that goes on")
def nothing_left(seen: Witness) -> Iterator[str]:
    """See what was there afterwards, and not before."""
    yield from seen.left
    yield from (f"{leaf.label} is still at it" for leaf in seen.leaves.values() if leaf.is_acting)


def broken(seen: Witness) -> dict[str, str]:
    """Return the first thing that is wrong by each invariant that does not hold."""
    return {name: first for name, (_, look) in INVARIANTS.items() if (first := next(look(seen), ""))}
