"""Every mission that ships has tests, for its success and for its failure, and passes them."""

from functools import cache

import pytest

from missions.library.shipped import shipped_missions
from missions.testing.play import play
from missions.testing.report import failure
from missions.testing.stage import IN_PROCESS
from missions.testing.suite import Case, beside, load_suite

SHARE = 6
"""Cases that one item plays: some take seconds, and items are what runs beside each other."""


def shares() -> list[tuple[str, int, int]]:
    """Return of each mission its name, and of each share of its cases the first case and the step to the next."""
    found = []
    for name, path in shipped_missions().items():
        count = -(-beside(path).read_text(encoding="utf-8").count("- case:") // SHARE)
        found += [(name, first, count) for first in range(count)]
    return found


@cache
def cases_of(name: str) -> tuple[Case, ...]:
    """Return the cases of a mission, which are read once for all shares."""
    return load_suite(beside(shipped_missions()[name]))


@pytest.mark.parametrize(("name", "first", "step"), shares())
def test_every_shipped_mission_passes_its_tests_for_success_and_for_failure(name: str, first: int, step: int) -> None:
    cases = cases_of(name)
    items = (item for case in cases for each in case.expectations if each.key == "result" for item in each.items)
    assert {"success", "failure"} <= {item.value for item in items}
    verdicts = [play(case, limits=IN_PROCESS) for case in cases[first::step]]
    assert verdicts
    assert all(verdict.passed for verdict in verdicts), "\n".join(failure(each) for each in verdicts if not each.passed)


def test_no_mission_ships_without_tests() -> None:
    assert {name for name, _, _ in shares()} == set(shipped_missions())
