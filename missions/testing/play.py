"""Plays one case of a test file in simulated time, and says whether all was as it expects."""

import traceback
from dataclasses import dataclass, replace

from config.faults import Diagnostic, InvalidFileError
from drivers.clock import SystemClock
from missions.executive.events import Ended, Logged
from missions.executive.watchdog import Limits
from missions.language.nodes import BRANCHES, MISSION
from missions.testing.history import History, NodeRecord
from missions.testing.judge import judge
from missions.testing.moments import BASE_VERBS, Happening
from missions.testing.stage import Stage
from missions.testing.suite import Case

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
