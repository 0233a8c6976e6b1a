"""Every shipped mission decides the same again when it is told the same again: in all cases of its tests."""

from dataclasses import replace
from pathlib import Path

import pytest

from config.library import find
from missions.library.drivers import load_robot
from missions.library.shipped import shipped_missions
from missions.order import DEFAULT_ROBOT
from missions.records.replay.rerun import rerun
from missions.testing.mocks import Cast
from missions.testing.suite import beside, load_suite
from tests.missions.records.replay.past import past_of_case

TESTED = {name: beside(path) for name, path in shipped_missions().items() if beside(path).is_file()}


MAX_REPLAYED = 12.0
"""Seconds of a case that are decided again; then it is interrupted, which is decided again too."""


def test_every_shipped_mission_has_cases_to_decide_again() -> None:
    assert set(TESTED) == set(shipped_missions())


@pytest.mark.parametrize("tests", TESTED.values(), ids=TESTED)
def test_a_shipped_mission_decides_the_same_again(tests: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for case in load_suite(tests):
        past = past_of_case(replace(case, timeout=min(case.timeout, MAX_REPLAYED)), monkeypatch)
        config = load_robot(find("robots", case.robot or DEFAULT_ROBOT))
        again = rerun(past, past.runner.plan, config, seed=case.seed, substitute=Cast(case.mocks))
        assert again.same, f"{case}: {again}"
        assert again.words == 0, f"{case}: {again.reworded}"
        assert again.ticks == len({moment.tick for moment in past.moments})
        assert again.nodes == sum(1 for _ in past.runner.plan.tree.walk())
