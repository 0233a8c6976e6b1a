"""Every mission that ships has tests, for its success and for its failure, passes them, and decides each again alike.

A case is played once, for both: what was told of the run is what it is decided again from.
"""

from dataclasses import replace
from functools import cache

import pytest

from config.library import DEFAULT_ROBOT, find_file
from missions.library.drivers import load_robot
from missions.library.shipped import shipped_missions
from missions.plugins.records.replay.rerun import rerun
from missions.plugins.testing.mocks import MockSubstitution
from missions.plugins.testing.report import failure_text
from missions.plugins.testing.suite import Case, load_suite, suite_file_of
from tests.missions.records.replay.past import Past, past_of_case

SHARE = 4
"""Cases that one item plays: some take seconds, and items are what runs beside each other."""

INTERRUPTED = 3.0
"""Seconds after which a run is interrupted, for its halting to be decided again."""


def shares() -> list[tuple[str, int, int]]:
    """Return of each mission its name, and of each share of its cases the first case and the step to the next."""
    found = []
    for name, path in shipped_missions().items():
        count = -(-suite_file_of(path).read_text(encoding="utf-8").count("- case:") // SHARE)
        found += [(name, first, count) for first in range(count)]
    return found


@cache
def cases_of(name: str) -> tuple[Case, ...]:
    """Return the cases of a mission, which are read once for all shares."""
    return load_suite(suite_file_of(shipped_missions()[name]))


def decided_again(case: Case, past: Past) -> str:
    """Decide a case again from what was told of its run; return what is not as it was then."""
    config = load_robot(find_file("robots", case.robot or DEFAULT_ROBOT))
    again = rerun(past, past.runner.plan, config, seed=case.seed, substitute=MockSubstitution(case.mocks))
    whole = again.ticks == len({moment.tick for moment in past.tick_records})
    alike = (
        again.is_identical and again.reworded_count == 0 and again.nodes == sum(1 for _ in past.runner.plan.tree.walk())
    )
    return "" if whole and alike else f"{case}: decided again, {again}"


@pytest.mark.parametrize(("name", "first", "step"), shares())
def test_shipped_missions_pass_their_tests_and_rerun_identically(
    name: str, first: int, step: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = []
    for case in cases_of(name)[first::step]:
        verdict, past = past_of_case(case, monkeypatch)
        wrong.append(decided_again(case, past) if verdict.passed else failure_text(verdict))
    assert wrong
    assert not any(wrong), "\n".join(wrong)


@pytest.mark.parametrize("name", shipped_missions())
def test_interrupted_shipped_missions_rerun_identically(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    case = max(cases_of(name), key=lambda case: case.timeout)
    _, past = past_of_case(replace(case, timeout=INTERRUPTED, eyes="truth"), monkeypatch)
    assert decided_again(case, past) == ""


def test_no_mission_ships_without_tests_for_success_and_for_failure() -> None:
    for name in shipped_missions():
        wanted = (each for case in cases_of(name) for each in case.expectations if each.key == "result")
        assert {"success", "failure"} <= {item.value for each in wanted for item in each.items}, name
