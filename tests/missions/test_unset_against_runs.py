"""Variables that may be unset after a composite whose children run at once or in any order, against all short runs."""

from collections.abc import Iterator
from random import Random

import pytest

from behaviours.leaf import SUCCESS
from config.diagnostics import InvalidFileError
from missions.language import document
from missions.language.definite_assignment import find_unset_reads
from missions.language.plan import Plan
from tests.missions.testing.verify.exploring import plan_of
from tests.missions.testing.verify.taped_runs import taped_runs
from tests.tries import tries

TREES = tries(80, most=3_000)
TICKS = 2
RUNS = 2_000
"""Maximum number of runs of one tree; a tree with more is replaced by another."""

NAMES = ("a", "b")
CHILDREN = (
    "scene_uniform: 1 s",
    "face_seen: 1 s, as: NAME",
    "face_seen: 1 s, as: NAME",
    "face_seen: 1 s, as: NAME, on_failure: succeed",
    "face_seen: 1 s, as: NAME, invert: true",
    "face_seen: 1 s, as: NAME, if: face.seen",
    "set: {NAME: 1}",
    "set: {NAME: 1}, if: face.seen",
    "set: {NAME: 1}, on_success: fail",
    "sequence: [{set: {NAME: 1}}, {scene_uniform: 1 s}]",
    "sequence: [{scene_uniform: 1 s}, {set: {NAME: 1}}]",
    "selector: [{scene_uniform: 1 s}, {set: {NAME: 1}}]",
)


def random_composite(random: Random) -> str:
    """Return a composite of two to four children, most often a parallel with counts."""
    children = [random.choice(CHILDREN).replace("NAME", random.choice(NAMES)) for _ in range(random.randint(2, 4))]
    if random.random() < 0.3:
        inner = ", ".join(f"{{{child}}}" for child in children[:2])
        children[:2] = [f"{random.choice(('race', 'parallel'))}: [{inner}]"]
    word = random.choice(("parallel",) * 6 + ("race", "random_sequence", "random_selector", "selector"))
    beside = ["in_turn: true"] if word == "selector" else []
    counts = (*range(1, len(children) + 1), "all")
    if word == "parallel":
        beside += [
            f"{key}: {random.choice(counts)}" for key in ("success_count", "failure_count") if random.randint(0, 2)
        ]
        beside += ["wait_for_all: true"] if random.random() < 0.4 else []
    if word == "random_selector" and random.random() < 0.5:
        beside.append(f"weights: [{', '.join(['1', *(random.choice('01') for _ in children[1:])])}]")
    if random.random() < 0.5:
        beside.append("invert: true")
    return ", ".join([f"{word}: [{', '.join(f'{{{child}}}' for child in children)}]", *beside])


def unset_after_each_run(plan: Plan) -> Iterator[frozenset[str]]:
    """Yield the names in NAMES that each run of at most TICKS ticks leaves unset; none if it does not succeed."""
    for run, status in taped_runs(plan, (0.05,) * TICKS):
        yield frozenset(NAMES).difference(run.variables) if status is SUCCESS else frozenset()


def unset_in_runs(tree: str) -> frozenset[str] | None:
    """Return the names of the tree that a successful run leaves unset.

    None if the tree has more than RUNS runs, or a count without effect.
    """
    found: frozenset[str] = frozenset()
    try:
        plan = plan_of(f"{{{tree}}}")
    except InvalidFileError:
        return None
    for number, unset in enumerate(unset_after_each_run(plan)):
        if number == RUNS:
            return None
        found |= unset & plan.tree.variables
    return found


def unset_in_check(tree: str) -> frozenset[str]:
    """Return the names that the checker reports if a step after the tree reads them."""
    names = plan_of(f"{{{tree}}}").tree.variables
    plan = plan_of(f"sequence: [{{{tree}}}, {{log: '{' '.join(f'${{{name}}}' for name in names)}'}}]")
    return frozenset(read.name for read in find_unset_reads(plan.tree, NAMES, {}))


def test_checker_reports_the_variables_that_runs_leave_unset(monkeypatch: pytest.MonkeyPatch) -> None:
    for check in ("check_assignments", "check_outcomes"):
        monkeypatch.setattr(document, check, lambda *_: None)
    missed, in_vain, reported = dict[str, frozenset[str]](), dict[str, frozenset[str]](), 0
    compared, random = 0, Random(71)  # noqa: S311 - a draw is no secret
    while compared < TREES:
        tree = random_composite(random)
        expected = unset_in_runs(tree)
        if expected is None:
            continue
        compared += 1
        found = unset_in_check(tree)
        reported += bool(found)
        missed |= {tree: expected - found} if expected - found else {}
        in_vain |= {tree: found - expected} if found - expected else {}
    assert missed == {}
    # The checker does not know that `in_turn` starts with the first child, nor that a child which succeeds at once may
    # prevent each failure of the others.
    assert len(in_vain) <= TREES / 10, in_vain
    assert TREES / 4 < reported < TREES
