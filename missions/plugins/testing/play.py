"""Plays one case of a test file in simulated time, and says whether all was as it expects."""

import math
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from config.faults import Diagnostic, InvalidFileError, Mark
from drivers.api import Pose2D
from drivers.clock import SystemClock
from missions.executive.events import CommandSent, Ended, Logged
from missions.executive.telling import OVERRIDES
from missions.executive.watchdog import Limits
from missions.language.expressions import shown
from missions.language.nodes import BRANCHES, MISSION
from missions.plugins.testing.expectations import Expectation, Place
from missions.plugins.testing.history import History, NodeRecord
from missions.plugins.testing.moments import BASE_VERBS, EventSpec, Happening
from missions.plugins.testing.stage import Stage
from missions.plugins.testing.suite import Case

# Whether a run was as a test file expects: what was seen instead, at the place of each expectation.

Miss = tuple[Mark, str]
"""Where the file expects what did not come true, and what was seen instead."""


def judge(expectations: Sequence[Expectation], history: History) -> list[Miss]:
    """Return what did not come true, in the file's order."""
    misses = [miss for each in expectations for miss in CHECKS[each.key](each, history)]
    return sorted(misses, key=lambda miss: miss[0])


def _result(wanted: Expectation, history: History) -> Iterator[Miss]:
    result, reason = _ended(history)
    for item in wanted.items:
        if item.value != result:
            yield item.mark, f"the result was {result}" + (f": {reason}" if reason else "")


def _reason(wanted: Expectation, history: History) -> Iterator[Miss]:
    reason = _ended(history)[1]
    for item in wanted.items:
        if item.value not in reason:
            yield item.mark, f"the reason was '{reason}'" if reason else "there was no reason"


def _within(wanted: Expectation, history: History) -> Iterator[Miss]:
    for item in wanted.items:
        if _seconds(history) > item.value:
            yield item.mark, f"it took {_seconds(history):.2f} s"


def _after(wanted: Expectation, history: History) -> Iterator[Miss]:
    for item in wanted.items:
        if _seconds(history) < item.value:
            yield item.mark, f"it took only {_seconds(history):.2f} s"


def _said(wanted: Expectation, history: History) -> Iterator[Miss]:
    yield from _in_turn("said", history.said, wanted)


def _in_turn(did: str, texts: Sequence[str], wanted: Expectation) -> Iterator[Miss]:
    """Hold texts, of each of which a part is expected, against what there was, in order; none against nothing.

    An empty text is part of nothing but itself.
    """
    if texts and not wanted.items:
        yield wanted.mark, f"it {did} {_quoted(texts)}"
    left, before = iter(texts), ""
    for item in wanted.items:
        if not any(item.value in text if item.value else not text for text in left):
            yield item.mark, f'it never {did} "{item.value}"{before}; it {did} {_quoted(texts)}'
            return
        before = f' after "{item.value}"'


def _never_said(wanted: Expectation, history: History) -> Iterator[Miss]:
    for item in wanted.items:
        found = next((text for text in history.said if item.value in text), None)
        if found is not None:
            yield item.mark, f'it said "{found}"'


def _heard_by(wanted: Expectation, history: History) -> Iterator[Miss]:
    """Hold each one's texts, in order, against what they heard; who is to hear nothing must not hear anything."""
    for item in wanted.items:
        who, texts = item.value
        heard = history.heard_by.get(who, [])
        left = iter(heard)
        if (heard and not texts) or not all(any(text in each for each in left) for text in texts):
            yield item.mark, f"{who} heard {_quoted(heard)}"


def _showed(wanted: Expectation, history: History) -> Iterator[Miss]:
    """Hold words against those on the screen; an empty text is for words that were taken away, and only for that."""
    words = history.showed if wanted.items else [text for text in history.showed if text]
    yield from _in_turn("showed", words, wanted)


def _moods(wanted: Expectation, history: History) -> Iterator[Miss]:
    yield from _in_turn("looked", history.moods, wanted)


def _ran(wanted: Expectation, history: History) -> Iterator[Miss]:
    for item in wanted.items:
        name, count = item.value
        starts = history.starts(name)
        if starts == 0 and count != 0:
            yield item.mark, f"'{name}' never ran"
        elif count is not None and starts != count:
            yield item.mark, f"'{name}' started {_times(starts)}"


def _never_ran(wanted: Expectation, history: History) -> Iterator[Miss]:
    for item in wanted.items:
        starts = [each for each in history.happenings if each.verb == "starts" and item.value in each.names]
        if starts:
            yield item.mark, f"'{item.value}' started {_times(len(starts))}, first at {starts[0].time:.2f} s"


def _succeeded(wanted: Expectation, history: History) -> Iterator[Miss]:
    yield from _ended_so("succeeds", wanted, history)


def _failed(wanted: Expectation, history: History) -> Iterator[Miss]:
    yield from _ended_so("fails", wanted, history)


def _ended_so(verb: str, wanted: Expectation, history: History) -> Iterator[Miss]:
    words = {"starts": "started", "succeeds": "succeeded", "fails": "failed", "halts": "was halted"}
    for item in wanted.items:
        outcomes = history.outcomes(item.value)
        if not outcomes:
            yield item.mark, f"'{item.value}' never ran"
        elif verb not in outcomes:
            did = ", ".join(f"{words[each]} {_times(count)}" for each, count in outcomes.items())
            yield item.mark, f"'{item.value}' {did}"


def _order(wanted: Expectation, history: History) -> Iterator[Miss]:
    left, before = iter(history.happenings), ""
    for item in wanted.items:
        moment: EventSpec = item.value
        found = next((each for each in left if moment.fits(each)), None)
        if found is None:
            earlier = [each for each in history.happenings if moment.fits(each)]
            when = f"'{moment}' happened only before, at {earlier[-1].time:.2f} s" if earlier else ""
            yield item.mark, when or (f"after '{before}' it never happened" if before else "it never happened")
            return
        before = f"{found}"


def _faults(wanted: Expectation, history: History) -> Iterator[Miss]:
    """Each text is part of a notice, and each notice contains one of the texts."""
    verbs = ("disconnects", "complains")
    notices = [f"{each.names[0]} {each.verb}: {each.text}" for each in history.happenings if each.verb in verbs]
    for item in wanted.items:
        if not any(item.value in notice for notice in notices):
            yield item.mark, f"the notices were {_quoted(notices)}"
    strange = [notice for notice in notices if not any(item.value in notice for item in wanted.items)]
    if strange:
        yield wanted.mark, f"it was not to be told that {_quoted(strange)}"


def _reflexes(wanted: Expectation, history: History) -> Iterator[Miss]:
    """Each text is part of what a reflex was told with."""
    fired = [f"{each.names[0]} {each.text}".strip() for each in history.happenings if each.verb == "fires"]
    if fired and not wanted.items:
        yield wanted.mark, f"these reflexes fired: {_quoted(fired)}"
    for item in wanted.items:
        if not any(item.value in each for each in fired):
            yield item.mark, f"the reflexes that fired were {_quoted(fired)}"


def _base(wanted: Expectation, history: History) -> Iterator[Miss]:
    commands = (event for event in history.events if isinstance(event, CommandSent) and event.to == "base")
    told = [event.values for event in commands if event.source not in OVERRIDES]
    stopped = bool(told) and told[-1].get("linear") == told[-1].get("angular") == 0.0
    for item in wanted.items:
        if history.moving and not stopped:
            yield item.mark, "the base was still moving when the mission ended"


def _pose(wanted: Expectation, history: History) -> Iterator[Miss]:
    pose = history.pose
    for item in wanted.items:
        if pose is None:
            yield item.mark, "the robot has no base"
        elif not _there(pose, item.value):
            yield item.mark, f"the base was at {_at(pose)}"


def _joints(wanted: Expectation, history: History) -> Iterator[Miss]:
    for item in wanted.items:
        joint, angle, either = item.value
        found = history.joints.get(joint)
        if found is None:
            yield item.mark, "the arm was not there"
        elif abs(found - angle) > either:
            yield item.mark, f"'{joint}' was at {math.degrees(found):.1f} deg"


def _notified(wanted: Expectation, history: History) -> Iterator[Miss]:
    yield from _in_turn("notified", history.notified, wanted)


def _returns(wanted: Expectation, history: History) -> Iterator[Miss]:
    for item in wanted.items:
        name, value = item.value
        found = history.returns.get(name)
        if not _same(found, value):
            yield item.mark, f"'{name}' was {shown(found)}"


CHECKS: Mapping[str, Callable[[Expectation, History], Iterator[Miss]]] = {
    "result": _result,
    "reason": _reason,
    "within": _within,
    "after": _after,
    "said": _said,
    "never_said": _never_said,
    "heard_by": _heard_by,
    "showed": _showed,
    "moods": _moods,
    "notified": _notified,
    "ran": _ran,
    "never_ran": _never_ran,
    "succeeded": _succeeded,
    "failed": _failed,
    "order": _order,
    "faults": _faults,
    "reflexes": _reflexes,
    "base": _base,
    "pose": _pose,
    "joints": _joints,
    "returns": _returns,
}
"""How each key of ``expect`` is held against what happened."""


def _ended(history: History) -> tuple[str, str]:
    result = history.result
    return ("error", "the run did not end") if result is None else (result.result, result.reason)


def _seconds(history: History) -> float:
    return math.inf if history.result is None else history.result.seconds


def _same(found: object, wanted: object) -> bool:
    if isinstance(found, int | float) and isinstance(wanted, int | float) and not isinstance(found, bool):
        return math.isclose(found, wanted, rel_tol=1e-6, abs_tol=1e-6)
    return found == wanted


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _quoted(texts: Sequence[str]) -> str:
    return ", ".join(f'"{text}"' for text in texts) or "nothing"


def _there(pose: Pose2D, place: Place) -> bool:
    if math.hypot(pose.x - place.x, pose.y - place.y) > place.within:
        return False
    turned = 0.0 if place.heading is None else math.remainder(pose.heading - place.heading, math.tau)
    return abs(turned) <= place.askew


def _at(pose: Pose2D) -> str:
    return f"[{pose.x:.2f} m, {pose.y:.2f} m], heading {math.degrees(pose.heading):.0f} deg"


LAST = 10
"""As many of the last events are told of a case that fails."""

MARGIN = "\n" + " " * 12
"""What goes between the lines of an event that has several, such as a traceback."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a case: plain data. It has passed when there are no ``misses`` and there is no ``error``.

    ``misses`` say what did not come true, ``error`` holds the traceback of what was no mission's doing. ``seconds`` and
    ``ticks`` are the run's, in simulated time; ``wall`` is how long it really took. ``nodes`` are for coverage.
    """

    case: Case
    misses: tuple[Diagnostic, ...] = ()
    error: str = ""
    result: str = ""
    reason: str = ""
    seconds: float = 0.0
    ticks: int = 0
    wall: float = 0.0
    last: tuple[str, ...] = ()
    nodes: tuple[NodeRecord, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all came true."""
        return not self.misses and not self.error


def play(case: Case, *, limits: Limits | None = None) -> Verdict:
    """Run a case to its end and judge it. Whatever goes wrong in it is part of the verdict."""
    clock, stage = SystemClock(), Stage(case, limits)
    try:
        runner = stage.run()
        verdict = replace(_judged(case, stage), nodes=stage.history.nodes(runner.root, runner.plan.tree))
    except InvalidFileError as error:  # a file has changed since it was checked
        verdict = Verdict(case, misses=error.faults)
    except Exception:
        verdict = Verdict(case, error=traceback.format_exc())
    last = () if verdict.passed else _last(stage.history)
    return replace(verdict, last=last, wall=clock.now())


def _judged(case: Case, stage: Stage) -> Verdict:
    misses = [(case.mark, text) for text in stage.wrong] + judge(case.expectations, stage.history)
    faults = tuple(Diagnostic(case.source, mark, text) for mark, text in misses)
    result = stage.history.result
    if result is None:
        return Verdict(case, faults)
    return Verdict(case, faults, result=result.result, reason=result.reason, seconds=result.seconds, ticks=result.ticks)


def _last(history: History) -> tuple[str, ...]:
    """Return the last events in words: what behaviours and parts did, what was said and logged, and the end."""
    lines = [(each.time, str(each)) for each in history.happenings if not _is_noise(each)]
    for event in history.events:
        if isinstance(event, Logged) and event.level != "voice":
            lines.append((event.t, f"{event.level}: {event.text}"))
        elif isinstance(event, Ended):
            lines.append((event.t, f"{event.mission} ends: {event.result}" + f" ({event.reason})" * bool(event.reason)))
    lines.sort(key=lambda line: line[0])
    return tuple(f"{time:8.2f} s  {text}".replace("\n", MARGIN) for time, text in lines[-LAST:])


def _is_noise(happening: Happening) -> bool:
    """Whether it says little: of composites without a name, and of every little turn of the base."""
    kind, name = happening.names[0], happening.names[-1]
    return happening.verb in BASE_VERBS or (kind in BRANCHES and kind != MISSION and name == kind)
