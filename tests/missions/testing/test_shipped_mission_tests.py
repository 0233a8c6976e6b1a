"""Every mission that ships has tests, for its success and for its failure; ``mission test`` plays them."""

import pytest

from missions.library import shipped_missions
from missions.testing.many import cores, play_all
from missions.testing.report import failure
from missions.testing.suite import Case, beside, load_suite


def shipped_cases(name: str) -> tuple[Case, ...]:
    return load_suite(beside(shipped_missions()[name]))


@pytest.mark.parametrize("name", list(shipped_missions()))
def test_every_shipped_mission_is_tested_for_success_and_for_failure(name: str) -> None:
    wanted = {
        item.value
        for case in shipped_cases(name)
        for expectation in case.expectations
        for item in expectation.items
        if expectation.key == "result"
    }
    assert {"success", "failure"} <= wanted


def test_all_shipped_missions_pass_their_tests() -> None:
    cases = [case for name in shipped_missions() for case in shipped_cases(name)]
    assert len(cases) > 80
    for verdict in play_all(cases, jobs=cores()):
        assert verdict.passed, failure(verdict)
