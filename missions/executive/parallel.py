"""Composites that tick all their children: parallel and race."""

from collections.abc import Mapping, Sequence
from typing import Self

from py_trees import composites
from py_trees.common import ParallelPolicy, Status

from behaviours.node import Node, Suspension
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Composite
from missions.language.expressions import ExpressionError, Value
from missions.language.parallel_counts import ParallelDecision, decide_parallel
from missions.language.plan import Step


class Parallel(Composite, composites.Parallel):
    """Ticks all children until enough have ended (see ``missions.language.parallel_counts``), then halts the rest.

    Without ``counts``, it succeeds when all children have succeeded, and fails at the first failure.
    """

    run_state = ("_settings", "_decision", "_lost")
    _settings: tuple[tuple[str, object], ...] = ()
    _decision = ParallelDecision(1, 1)
    _lost: Suspension | None = None  # suspension of a child that has failed since its part was disconnected

    def __init__(self, name: str) -> None:
        composites.Parallel.__init__(self, name, policy=ParallelPolicy.SuccessOnAll(synchronise=True))
        self.counts: Mapping[str, Value] = {}

    @classmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        parallel = super().from_step(step, children, inner)
        parallel.counts = step.arguments
        return parallel

    def on_start(self) -> str:
        super().on_start()
        self._lost = None
        settings = {}
        for word, value in self.counts.items():
            try:
                settings[word] = value.resolve(self.scope)
            except (ExpressionError, ValueError) as error:
                return f"{word}: {error}"
        self._settings = tuple(settings.items())
        self._decision = decide_parallel(len(self.members), settings)
        return ""

    def on_running(self) -> Status:
        # Children that ended at earlier ticks are counted first, wherever they are in the list.
        statuses = [child.status for child in self.members]
        succeeded, failed = statuses.count(SUCCESS), statuses.count(FAILURE)
        skipped = self._count_skipped() if succeeded else 0
        suspended = True  # until a running child is not suspended
        for child, before in zip(self.members, statuses, strict=True):
            if before is SUCCESS or before is FAILURE:
                continue
            status = child.execute_tick()
            if status is RUNNING:
                suspended = suspended and child.suspension is not None
                continue
            succeeded += status is SUCCESS
            failed += status is FAILURE
            skipped += status is SUCCESS and child.is_skipped
            self._lost = self._lost or child.suspension
            result = self._result(succeeded, failed, skipped)
            if result is not RUNNING:
                return self.end(result)
        if suspended:
            self.suspension = shared_suspension(self.members)
        return RUNNING

    def _count_skipped(self) -> int:
        return sum(child.is_skipped for child in self.members if child.status is SUCCESS)

    def _result(self, succeeded: int, failed: int, skipped: int) -> Status:
        """Return the status for these numbers of children; the ``skipped`` ones are among the ``succeeded``."""
        count = len(self.members) - skipped
        if count == 0:
            return self.skip(self.members[-1].feedback_message)
        decision = decide_parallel(count, dict(self._settings)) if skipped else self._decision
        if succeeded + failed == len(self.members) or not decision.waits_for_all:
            if failed >= decision.failures:
                return self._fail_with_all_reasons(failed, count, decision.successes)
            if succeeded - skipped >= decision.successes:
                return SUCCESS
        return RUNNING

    def _fail_with_all_reasons(self, failed: int, count: int, needed: int) -> Status:
        """Return a failure with the reasons of all failed children.

        If none has failed, the reason is that too many children were skipped.
        """
        blamed = [child for child in self.members if child.status is FAILURE]
        number = f"{failed} of {count} failed: " if failed > 1 else ""
        self.feedback_message = number + "; ".join(dict.fromkeys(child.feedback_message for child in blamed))
        if not blamed:
            self.feedback_message = f"{needed} must succeed, and only {count} of {len(self.members)} are not skipped"
        self.suspension = self._lost
        return FAILURE

    def members_stand_still(self) -> Status:
        for child in self.members:
            if child.status is RUNNING:
                child.pass_time()
                self._lost = self._lost if child.status is RUNNING else self._lost or child.suspension
        statuses = [child.status for child in self.members]
        self.suspension = None
        result = self._result(statuses.count(SUCCESS), statuses.count(FAILURE), self._count_skipped())
        return RUNNING if result is RUNNING else self.end(result)


class Race(Composite, composites.Parallel):
    """Ticks all children; ends with the first that ends, and halts the others."""

    def __init__(self, name: str) -> None:
        composites.Parallel.__init__(self, name, policy=ParallelPolicy.SuccessOnOne())

    def on_running(self) -> Status:
        suspended = True  # until a child is not suspended
        skipped = 0
        for child in self.members:
            if child.status is SUCCESS:  # it was skipped at an earlier tick
                skipped += 1
                continue
            status = child.execute_tick()
            if status is SUCCESS and child.is_skipped:
                skipped += 1
            elif status is not RUNNING:
                return self.end(self.adopt_failure(child) if status is FAILURE else status)
            else:
                suspended = suspended and child.suspension is not None
        if skipped == len(self.members):
            return self.skip(child.feedback_message)
        if suspended:
            self.suspension = shared_suspension(self.members)
        return RUNNING

    def member_ended(self, member: Node, status: Status) -> Status:
        return self.end(super().member_ended(member, status))


def shared_suspension(members: Sequence[Node]) -> Suspension | None:
    """Return a suspension of one of the running ``members``, or None if none of them is suspended.

    A suspension whose sensor timeout has passed takes precedence.
    """
    found = [member.suspension for member in members if member.status is RUNNING and member.suspension is not None]
    return max(found, key=lambda suspension: suspension.timed_out, default=None)
