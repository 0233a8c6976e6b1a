"""A plain py_trees tree, given to our executive, does what py_trees' own tick does with it, call for call."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, ParallelPolicy, Status

import missions
from missions.api import Mission

RUNNING, SUCCESS, FAILURE, INVALID = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID

Build = Callable[[list[str]], Behaviour]
"""Builds one of two equal trees, whose leaves write their calls into the list."""


class Scripted(Behaviour):
    """Gives these outcomes in turn, for ever, and writes down every call."""

    def __init__(self, name: str, script: list[Status], calls: list[str]) -> None:
        super().__init__(name)
        self._script = script
        self._given = 0
        self._calls = calls

    def initialise(self) -> None:
        self._calls.append(f"{self.name} initialise")

    def update(self) -> Status:
        self._given += 1
        outcome = self._script[(self._given - 1) % len(self._script)]
        self._calls.append(f"{self.name} update {outcome.name}")
        return outcome

    def terminate(self, new_status: Status) -> None:
        self._calls.append(f"{self.name} terminate {new_status.name}")


def leaves() -> st.SearchStrategy[Build]:
    def leaf(name: str, script: list[Status]) -> Build:
        return lambda calls: Scripted(name, script, calls)

    scripts = st.lists(st.sampled_from([RUNNING, SUCCESS, FAILURE]), min_size=1, max_size=5)
    return st.builds(leaf, st.sampled_from("abcdefgh"), scripts)


COMPOSITES: dict[str, Callable[[list[Behaviour]], Behaviour]] = {
    "sequence": lambda children: composites.Sequence("sequence", memory=True, children=children),
    "reactive sequence": lambda children: composites.Sequence("sequence", memory=False, children=children),
    "selector": lambda children: composites.Selector("selector", memory=True, children=children),
    "reactive selector": lambda children: composites.Selector("selector", memory=False, children=children),
    "all": lambda children: composites.Parallel(
        "parallel", policy=ParallelPolicy.SuccessOnAll(synchronise=False), children=children
    ),
    "all, once each": lambda children: composites.Parallel(
        "parallel", policy=ParallelPolicy.SuccessOnAll(synchronise=True), children=children
    ),
    "one": lambda children: composites.Parallel("parallel", policy=ParallelPolicy.SuccessOnOne(), children=children),
    "the first": lambda children: composites.Parallel(
        "parallel", policy=ParallelPolicy.SuccessOnSelected(children=children[:1], synchronise=False), children=children
    ),
}

DECORATORS: dict[str, Callable[[Behaviour], Behaviour]] = {
    "inverter": lambda child: decorators.Inverter("inverter", child),
    "retry": lambda child: decorators.Retry("retry", child, num_failures=2),
    "repeat": lambda child: decorators.Repeat("repeat", child, num_success=2),
    "failure is success": lambda child: decorators.FailureIsSuccess("decorator", child),
    "failure is running": lambda child: decorators.FailureIsRunning("decorator", child),
    "success is failure": lambda child: decorators.SuccessIsFailure("decorator", child),
    "success is running": lambda child: decorators.SuccessIsRunning("decorator", child),
    "running is failure": lambda child: decorators.RunningIsFailure("decorator", child),
    "running is success": lambda child: decorators.RunningIsSuccess("decorator", child),
    "condition": lambda child: decorators.Condition("condition", child, SUCCESS),
    "count": lambda child: decorators.Count("count", child),
    "pass through": lambda child: decorators.PassThrough("pass", child),
    # Its clock is the machine's, so only what has run out before it began, and what never does, are the same twice.
    "timed out": lambda child: decorators.Timeout("timeout", child, duration=-1.0),
    "in time": lambda child: decorators.Timeout("timeout", child, duration=1e6),
    "once": lambda child: decorators.OneShot("once", child, OneShotPolicy.ON_COMPLETION),
    "once successful": lambda child: decorators.OneShot("once", child, OneShotPolicy.ON_SUCCESSFUL_COMPLETION),
}


def trees() -> st.SearchStrategy[Build]:
    def composite(kind: str, children: list[Build]) -> Build:
        return lambda calls: COMPOSITES[kind]([child(calls) for child in children])

    def decorated(kind: str, child: Build) -> Build:
        return lambda calls: DECORATORS[kind](child(calls))

    return st.recursive(
        leaves(),
        lambda inner: (
            st.builds(composite, st.sampled_from(sorted(COMPOSITES)), st.lists(inner, min_size=1, max_size=4))
            | st.builds(decorated, st.sampled_from(sorted(DECORATORS)), inner)
        ),
        max_leaves=10,
    )


class Pair:
    """The same tree twice: one that py_trees ticks, one that our executive does."""

    def __init__(self, build: Build) -> None:
        self.their_calls: list[str] = []
        self.our_calls: list[str] = []
        self.theirs = build(self.their_calls)
        self.ours = build(self.our_calls)
        self.theirs.setup_with_descendants()
        self.mission: Mission = missions.wrap(self.ours)

    def tick(self) -> None:
        self.theirs.tick_once()
        self.mission.tick()

    def halt(self) -> None:
        """Halt ours; theirs only where it runs, which is the first of the intended differences."""
        if self.theirs.status is RUNNING:
            self.theirs.stop(INVALID)
        assert self.mission.halt()

    @staticmethod
    def told(root: Behaviour) -> list[tuple[str, Status, str]]:
        """Return what each node shows, apart from the time that a time-out has left."""
        return [(node.name, node.status, node.feedback_message.partition(" [remaining")[0]) for node in root.iterate()]

    def check(self) -> None:
        assert self.our_calls == self.their_calls
        assert self.told(self.ours) == self.told(self.theirs)
        assert self.ours.tip() is None or self.told(self.ours.tip() or self.ours) == self.told(
            self.theirs.tip() or self.theirs
        )


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(trees(), st.lists(st.sampled_from(["tick"] * 6 + ["halt"]), min_size=1, max_size=15))
def test_statuses_calls_and_feedback_match_py_trees(build: Build, todo: list[str]) -> None:
    pair = Pair(build)
    for step in todo:
        if step == "tick":
            pair.tick()
            assert pair.mission.status is pair.theirs.status
        else:
            pair.halt()
        pair.check()


# --- the intended differences, one by one (the table of behaviours.py_trees_leaf.PyTreesLeaf)


def test_halt_of_an_ended_tree_calls_nothing() -> None:
    calls: list[str] = []
    mission = missions.wrap(Scripted("a", [SUCCESS], calls))
    mission.tick()
    before = list(calls)
    assert mission.halt()
    assert calls == before == ["a initialise", "a update SUCCESS", "a terminate SUCCESS"]


class Raises(Scripted):
    """Raises, the second time that it is asked."""

    def update(self) -> Status:
        if super().update() is FAILURE:
            raise RuntimeError("no more")
        return RUNNING


@pytest.mark.parametrize("script", [[FAILURE], [RUNNING, FAILURE]])
def test_raising_behaviour_is_stopped_once_and_fails(script: list[Status]) -> None:
    calls: list[str] = []
    mission = missions.wrap(composites.Sequence("s", memory=True, children=[Raises("a", script, calls)]))
    for _ in script:
        status = mission.tick()
    assert status is FAILURE
    assert mission.reason == "s: RuntimeError: no more"
    assert calls[-1] == "a terminate INVALID"
    assert calls.count("a terminate INVALID") == 1
    assert {node.status for node in mission.root.children[0].iterate()} == {INVALID}


def test_behaviour_started_beside_a_raising_one_is_stopped() -> None:
    calls: list[str] = []
    children: list[Behaviour] = [Scripted("a", [RUNNING], calls), Raises("b", [FAILURE], calls)]
    everything = ParallelPolicy.SuccessOnAll()
    inside = composites.Parallel("p", policy=everything, children=children)
    mission = missions.wrap(composites.Sequence("s", memory=True, children=[inside]))
    assert mission.tick() is FAILURE  # py_trees has not given "p" a status yet, and would leave "a" running
    assert [call for call in calls if "terminate" in call] == ["b terminate INVALID", "a terminate INVALID"]


def test_no_status_is_a_failure() -> None:
    mission = missions.wrap(Scripted("a", [INVALID], []))
    assert mission.tick() is FAILURE
    assert mission.reason == "a: returned <Status.INVALID: 'INVALID'> instead of a status"


class NeedsSetup(Behaviour):
    """Succeeds where it was set up, once."""

    ready = 0

    def setup(self, **told: Any) -> None:
        del told
        self.ready += 1

    def update(self) -> Status:
        return SUCCESS if self.ready == 1 else FAILURE


def test_wrapped_tree_is_set_up_once_before_the_first_tick() -> None:
    mission = missions.wrap(composites.Sequence("s", memory=False, children=[NeedsSetup("a"), NeedsSetup("b")]))
    assert [mission.tick() for _ in range(3)] == [SUCCESS] * 3
