"""Removal of steps that a mission never reaches, and of modifiers without effect.

BehaviorTree.CPP accepts such nodes, although they change nothing. `mission check` would refuse them.
"""

from collections.abc import Callable, Mapping

from behaviours.leaf import Leaf
from missions.language.nodes import (
    BOTH_ENDS,
    COMPOSITES,
    FAILURE,
    FOR_EACH,
    IN_TURN,
    MISSION,
    MODIFIERS,
    RESTART,
    SKIPPED,
    SUCCESS,
    SWITCHES,
    Ends,
    ModifierKind,
)
from missions.plugins.interchange.mission_text import MissionStep, Verbatim
from missions.plugins.interchange.report import LOST, ImportReport
from missions.plugins.interchange.xml_reader import Element

EndsOfMission = Callable[[MissionStep], Ends]
"""Function that returns the possible results of the mission that a ``mission`` step runs."""


class DeadStepRemover:
    """Removes steps that are never reached from one mission, and finds the results with which the mission can end.

    ``instant_stubs`` are the tags of stub leaves that end at the tick in which they start.
    """

    def __init__(
        self,
        leaves: Mapping[str, type[Leaf]],
        instant_stubs: frozenset[str],
        ends_of_mission: EndsOfMission,
        report: ImportReport,
    ) -> None:
        self._leaves, self._instant_stubs, self._ends_of_mission = leaves, instant_stubs, ends_of_mission
        self._report = report

    def clean(self, step: MissionStep) -> Ends:
        """Remove the steps below ``step`` that are never reached; return the possible results of ``step``.

        The results are empty if the step never ends.
        """
        ends = self._ends_of_word(step)
        for key, value in list(step.keys.items()):
            kind = MODIFIERS.get(key)
            if isinstance(value, MissionStep):
                self.clean(value)
            if kind is None:
                continue
            if (kind.relevant_end and kind.relevant_end not in ends) or (
                key in ("timeout", "on_running") and self._is_instant(step, key)
            ):
                del step.keys[key]
                self._note(step, f"'{key}' has no effect here")
                continue
            ends = _after_modifier(kind, ends, forever=value in ("forever", Verbatim("forever")))
        return ends

    def _is_instant(self, step: MissionStep, key: str) -> bool:
        """Return whether a step is a leaf that ends at its first tick, without other modifiers before ``key``.

        ``key`` is one of the step's modifiers; each wraps those before it.
        """
        before = list(step.keys)[: list(step.keys).index(key)]
        if any(each in MODIFIERS for each in before):
            return False
        leaf = self._leaves.get(step.word)
        return step.word in self._instant_stubs or (leaf is not None and leaf.instant and not leaf.needs)

    def _ends_of_word(self, step: MissionStep) -> Ends:
        if step.word == MISSION:
            return self._ends_of_mission(step)
        composite = COMPOSITES.get(step.word)
        if composite is not None and composite.order == "in order":
            if IN_TURN not in step.keys:
                return self._clean_in_order(step, composite.passes)
            return _all_or_one([self.clean(child) for child in step.branches], composite.passes)
        below = [self.clean(child) for child in step.branches]
        if step.word in SWITCHES:
            return frozenset().union(*below) | (frozenset() if step.has_all_cases else {FAILURE})
        if step.word == FOR_EACH:
            return below[0] | {SUCCESS}
        if composite is None:
            leaf = self._leaves.get(step.word)
            return BOTH_ENDS if leaf is None else leaf.ends
        if not composite.passes:
            return frozenset().union(*below) - {SKIPPED}
        if step.keys.keys() & {"success_count", "failure_count", "wait_for_all"}:
            self._drop_unreachable_count(step, sum(SUCCESS in each for each in below))
            return BOTH_ENDS
        return _all_or_one(below, composite.passes)

    def _drop_unreachable_count(self, step: MissionStep, successes: int) -> None:
        """Remove a ``success_count`` that a parallel cannot reach, where its first failure ends it all the same.

        ``successes`` is the number of children that can succeed.
        """
        needed = step.keys.get("success_count")
        if isinstance(needed, int) and needed > successes and not step.keys.keys() & {"failure_count", "wait_for_all"}:
            del step.keys["success_count"]
            self._note(step, f"'success_count: {needed}' has no effect here, since only {successes} children succeed")

    def _clean_in_order(self, step: MissionStep, passes: str) -> Ends:
        """Remove the children of a sequence or selector that stand behind a child which always ends it.

        ``passes`` is the result of a child after which the next child runs. Return the possible results of the
        composite.
        """
        below, children = list[Ends](), step.branches
        for number, child in enumerate(children):
            below.append(self.clean(child))
            if below[-1].isdisjoint({passes, SKIPPED}) and number + 1 < len(children):
                if isinstance(step.value, list):
                    step.value = children[: number + 1]
                for dead in children[number + 1 :]:
                    self._note(dead, "is never reached")
                break
        return _all_or_one(below, passes)

    def _note(self, step: MissionStep, text: str) -> None:
        origin = next((each.origin for each in step.walk() if isinstance(each.origin, Element)), None)
        if origin is not None:
            self._report.add(LOST, origin, text)


def _after_modifier(kind: ModifierKind, ends: Ends, *, forever: bool) -> Ends:
    ways = {SUCCESS: kind.success, FAILURE: kind.failure, SKIPPED: frozenset({SKIPPED})}
    passed = (ways[end] - {RESTART} for end in ends if not (forever and kind.without_limit(end)))
    return kind.early_ends.union(*passed)


def _all_or_one(below: list[Ends], passes: str) -> Ends:
    """Return the possible results of a composite that ends with the result ``passes`` only if all its children do.

    ``below`` has the possible results of each child. If one child ends otherwise, so does the composite.
    """
    other = FAILURE if passes == SUCCESS else SUCCESS
    found = {other} if any(other in each for each in below) else set[str]()
    if not any(each.isdisjoint({passes, SKIPPED}) for each in below):
        found |= {passes} if any(passes in each for each in below) else set()
        found |= {SKIPPED} if all(SKIPPED in each for each in below) else set()
    return frozenset(found)
