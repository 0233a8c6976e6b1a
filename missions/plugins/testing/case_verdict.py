"""Runs one test case in simulated time, and compares the run with the case's expectations."""

import math
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from config.diagnostics import Diagnostic, InvalidFileError, Mark
from drivers.api import Pose2D
from drivers.clock import SystemClock
from missions.executive.event_reporter import OVERRIDE_SOURCES
from missions.executive.events import CommandSent, Ended, Logged
from missions.executive.watchdog import WatchdogLimits
from missions.language.expressions import format_value
from missions.language.nodes import BRANCHES, MISSION
from missions.plugins.testing.case_history import CaseHistory, NodeRecord
from missions.plugins.testing.case_runner import CaseRunner
from missions.plugins.testing.event_specs import BASE_VERBS, EventSpec, ObservedEvent
from missions.plugins.testing.expectations import Expectation, PoseTarget
from missions.plugins.testing.suite import Case

# Whether a run was as a test file expects: what was seen instead, at the place of each expectation.

Miss = tuple[Mark, str]
"""An unmet expectation: its position in the test file, and the observed value."""


def check_expectations(expectations: Sequence[Expectation], history: CaseHistory) -> list[Miss]:
    """Return the unmet expectations, in the file's order."""
    misses = [miss for each in expectations for miss in CHECKS[each.key](each, history)]
    return sorted(misses, key=lambda miss: miss[0])


def _check_result(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    result, reason = _result_and_reason(history)
    for item in expectation.items:
        if item.value != result:
            yield item.mark, f"the result was {result}" + (f": {reason}" if reason else "")


def _check_reason(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    reason = _result_and_reason(history)[1]
    for item in expectation.items:
        if item.value not in reason:
            yield item.mark, f"the reason was '{reason}'" if reason else "there was no reason"


def _check_within(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    for item in expectation.items:
        if _run_seconds(history) > item.value:
            yield item.mark, f"it took {_run_seconds(history):.2f} s"


def _check_after(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    for item in expectation.items:
        if _run_seconds(history) < item.value:
            yield item.mark, f"it took only {_run_seconds(history):.2f} s"


def _check_said(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    yield from _check_sequence("said", history.said, expectation)


def _check_sequence(did: str, texts: Sequence[str], expectation: Expectation) -> Iterator[Miss]:
    """Yield a miss unless the observed ``texts`` contain the expected partial texts, in order.

    If no text is expected, none may be observed. An expected empty text matches only an empty text. ``did`` is the verb
    of the message, such as "said".
    """
    if texts and not expectation.items:
        yield expectation.mark, f"it {did} {_quote_list(texts)}"
    left, before = iter(texts), ""
    for item in expectation.items:
        if not any(item.value in text if item.value else not text for text in left):
            yield item.mark, f'it never {did} "{item.value}"{before}; it {did} {_quote_list(texts)}'
            return
        before = f' after "{item.value}"'


def _check_never_said(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    for item in expectation.items:
        found = next((text for text in history.said if item.value in text), None)
        if found is not None:
            yield item.mark, f'it said "{found}"'


def _check_heard_by(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    """Yield a miss for each person who did not hear the expected texts in order.

    An empty list requires that the person has heard nothing.
    """
    for item in expectation.items:
        person, texts = item.value
        utterances = history.heard_by.get(person, [])
        left = iter(utterances)
        if (utterances and not texts) or not all(any(text in each for each in left) for text in texts):
            yield item.mark, f"{person} heard {_quote_list(utterances)}"


def _check_showed(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    """Compare the expected texts with those that the screen showed; an empty text matches only a cleared screen."""
    words = history.showed if expectation.items else [text for text in history.showed if text]
    yield from _check_sequence("showed", words, expectation)


def _check_moods(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    yield from _check_sequence("looked", history.moods, expectation)


def _check_ran(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    for item in expectation.items:
        name, count = item.value
        starts = history.starts(name)
        if starts == 0 and count != 0:
            yield item.mark, _never_ran(name, history)
        elif count is not None and starts != count:
            yield item.mark, f"'{name}' started {_times(starts)}"


def _never_ran(name: str, history: CaseHistory) -> str:
    reason = history.left_out.get(name)
    return f"'{name}' never ran" + (f": {reason}" if reason else "")


def _check_never_ran(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    for item in expectation.items:
        starts = [each for each in history.observed_events if each.verb == "starts" and item.value in each.names]
        if starts:
            yield item.mark, f"'{item.value}' started {_times(len(starts))}, first at {starts[0].time:.2f} s"


def _check_succeeded(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    yield from _check_ends("succeeds", expectation, history)


def _check_failed(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    yield from _check_ends("fails", expectation, history)


def _check_ends(verb: str, expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    words = {"starts": "started", "succeeds": "succeeded", "fails": "failed", "halts": "was halted"}
    for item in expectation.items:
        outcomes = history.outcomes(item.value)
        if not outcomes:
            yield item.mark, _never_ran(item.value, history)
        elif verb not in outcomes:
            did = ", ".join(f"{words[each]} {_times(count)}" for each, count in outcomes.items())
            yield item.mark, f"'{item.value}' {did}"


def _check_order(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    left, before = iter(history.observed_events), ""
    for item in expectation.items:
        moment: EventSpec = item.value
        found = next((each for each in left if moment.matches(each)), None)
        if found is None:
            earlier = [each for each in history.observed_events if moment.matches(each)]
            when = f"'{moment}' happened only before, at {earlier[-1].time:.2f} s" if earlier else ""
            yield item.mark, when or (f"after '{before}' it never happened" if before else "it never happened")
            return
        before = f"{found}"


def _check_faults(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    """Require that each expected text is part of a fault notice, and that each notice contains one of the texts."""
    verbs = ("disconnects", "complains")
    notices = [f"{each.names[0]} {each.verb}: {each.text}" for each in history.observed_events if each.verb in verbs]
    for item in expectation.items:
        if not any(item.value in notice for notice in notices):
            yield item.mark, f"the notices were {_quote_list(notices)}"
    strange = [notice for notice in notices if not any(item.value in notice for item in expectation.items)]
    if strange:
        yield expectation.mark, f"unexpected notices: {_quote_list(strange)}"


def _check_reflexes(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    """Require that each expected text is part of the message of a reflex that fired."""
    fired = [f"{each.names[0]} {each.text}".strip() for each in history.observed_events if each.verb == "fires"]
    if fired and not expectation.items:
        yield expectation.mark, f"these reflexes fired: {_quote_list(fired)}"
    for item in expectation.items:
        if not any(item.value in each for each in fired):
            yield item.mark, f"the reflexes that fired were {_quote_list(fired)}"


def _check_base(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    commands = (event for event in history.events if isinstance(event, CommandSent) and event.to == "base")
    velocities = [event.values for event in commands if event.source not in OVERRIDE_SOURCES]
    stopped = bool(velocities) and velocities[-1].get("linear") == velocities[-1].get("angular") == 0.0
    for item in expectation.items:
        if history.is_moving and not stopped:
            yield item.mark, "the base was still moving when the mission ended"


def _check_pose(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    pose = history.pose
    for item in expectation.items:
        if pose is None:
            yield item.mark, "the robot has no base"
        elif not _is_at(pose, item.value):
            yield item.mark, f"the base was at {_pose_text(pose)}"


def _check_joints(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    for item in expectation.items:
        joint, angle, either = item.value
        found = history.joints.get(joint)
        if found is None:
            yield item.mark, "the arm was offline"
        elif abs(found - angle) > either:
            yield item.mark, f"'{joint}' was at {math.degrees(found):.1f} deg"


def _check_notified(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    yield from _check_sequence("notified", history.notified, expectation)


def _check_returns(expectation: Expectation, history: CaseHistory) -> Iterator[Miss]:
    for item in expectation.items:
        name, value = item.value
        found = history.returns.get(name)
        if not _is_equal(found, value):
            yield item.mark, f"'{name}' was {format_value(found)}"


CHECKS: Mapping[str, Callable[[Expectation, CaseHistory], Iterator[Miss]]] = {
    "result": _check_result,
    "reason": _check_reason,
    "within": _check_within,
    "after": _check_after,
    "said": _check_said,
    "never_said": _check_never_said,
    "heard_by": _check_heard_by,
    "showed": _check_showed,
    "moods": _check_moods,
    "notified": _check_notified,
    "ran": _check_ran,
    "never_ran": _check_never_ran,
    "succeeded": _check_succeeded,
    "failed": _check_failed,
    "order": _check_order,
    "faults": _check_faults,
    "reflexes": _check_reflexes,
    "base": _check_base,
    "pose": _check_pose,
    "joints": _check_joints,
    "returns": _check_returns,
}
"""Function that checks each key of ``expect`` in a test file."""


def _result_and_reason(history: CaseHistory) -> tuple[str, str]:
    result = history.result
    return ("error", "the run did not end") if result is None else (result.result, result.reason)


def _run_seconds(history: CaseHistory) -> float:
    return math.inf if history.result is None else history.result.seconds


def _is_equal(found: object, expectation: object) -> bool:
    if isinstance(found, int | float) and isinstance(expectation, int | float) and not isinstance(found, bool):
        return math.isclose(found, expectation, rel_tol=1e-6, abs_tol=1e-6)
    if isinstance(found, list) and isinstance(expectation, list) and len(found) == len(expectation):
        return all(map(_is_equal, found, expectation))
    if isinstance(found, dict) and isinstance(expectation, dict) and found.keys() == expectation.keys():
        return all(_is_equal(found[name], value) for name, value in expectation.items())
    return found == expectation


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _quote_list(texts: Sequence[str]) -> str:
    return ", ".join(f'"{text}"' for text in texts) or "nothing"


def _is_at(pose: Pose2D, target: PoseTarget) -> bool:
    if math.hypot(pose.x - target.x, pose.y - target.y) > target.max_distance:
        return False
    turned = 0.0 if target.heading is None else math.remainder(pose.heading - target.heading, math.tau)
    return abs(turned) <= target.max_angle


def _pose_text(pose: Pose2D) -> str:
    return f"[{pose.x:.2f} m, {pose.y:.2f} m], heading {math.degrees(pose.heading):.0f} deg"


MAX_LAST_EVENTS = 10
"""Number of last events reported for a failed case."""

CONTINUATION = "\n" + " " * 12
"""Prefix of the continuation lines of a multi-line event, such as a traceback."""


@dataclass(frozen=True, slots=True)
class CaseVerdict:
    """Result of a test case: plain data. It has passed if there are no ``misses`` and no ``error``.

    ``misses`` are the unmet expectations, ``error`` the traceback of an error outside the mission. ``seconds`` and
    ``ticks`` are in simulated time, ``wall_seconds`` in real time. ``nodes`` are for coverage.
    """

    case: Case
    misses: tuple[Diagnostic, ...] = ()
    error: str = ""
    result: str = ""
    reason: str = ""
    seconds: float = 0.0
    ticks: int = 0
    wall_seconds: float = 0.0
    last_events: tuple[str, ...] = ()
    nodes: tuple[NodeRecord, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all expectations are met, and no error has occurred."""
        return not self.misses and not self.error


def play(case: Case, *, limits: WatchdogLimits | None = None) -> CaseVerdict:
    """Run a test case to its end and return its verdict, which includes any error."""
    clock, stage = SystemClock(), CaseRunner(case, limits)
    try:
        runner = stage.run()
        verdict = replace(_make_verdict(case, stage), nodes=stage.history.nodes(runner.root, runner.plan.tree))
    except InvalidFileError as error:  # a file has changed since it was checked
        verdict = CaseVerdict(case, misses=error.diagnostics)
    except Exception:
        verdict = CaseVerdict(case, error=traceback.format_exc())
    last = () if verdict.passed else _last_events(stage.history)
    return replace(verdict, last_events=last, wall_seconds=clock.now())


def _make_verdict(case: Case, stage: CaseRunner) -> CaseVerdict:
    misses = [(case.mark, text) for text in stage.violations] + check_expectations(case.expectations, stage.history)
    if misses:
        unused = [(mock, reason) for mock in case.mocks if (reason := stage.history.left_out.get(mock.target))]
        misses += [(mock.mark, f"the mock of '{mock.target}' is not used: {reason}") for mock, reason in unused]
    faults = tuple(Diagnostic(case.source, mark, text) for mark, text in misses)
    result = stage.history.result
    if result is None:
        return CaseVerdict(case, faults)
    return CaseVerdict(
        case, faults, result=result.result, reason=result.reason, seconds=result.seconds, ticks=result.ticks
    )


def _last_events(history: CaseHistory) -> tuple[str, ...]:
    """Return texts of the last events: behaviours, parts, utterances, logs, and the end."""
    lines = [(each.time, str(each)) for each in history.observed_events if not _is_noise(each)]
    for event in history.events:
        if isinstance(event, Logged) and event.level != "voice":
            lines.append((event.t, f"{event.level}: {event.text}"))
        elif isinstance(event, Ended):
            lines.append((event.t, f"{event.mission} ends: {event.result}" + f" ({event.reason})" * bool(event.reason)))
    lines.sort(key=lambda line: line[0])
    return tuple(f"{time:8.2f} s  {text}".replace("\n", CONTINUATION) for time, text in lines[-MAX_LAST_EVENTS:])


def _is_noise(happening: ObservedEvent) -> bool:
    """Return whether an event has little information: unnamed composites, and small turns of the base."""
    kind, name = happening.names[0], happening.names[-1]
    return happening.verb in BASE_VERBS or (kind in BRANCHES and kind != MISSION and name == kind)
