"""A small campaign: robots are killed and cut off at random while they do tasks; `make fleet` is the large one."""

from pathlib import Path

import pytest

from tests.missions.service.fleet_campaign import campaign

pytestmark = pytest.mark.real_time

ROBOTS, TASKS, KILLS, CUTS = 4, 24, 6, 4


def test_robots_that_are_killed_and_cut_off_lose_no_task_and_do_none_twice_that_may_not_be(tmp_path: Path) -> None:
    with campaign(tmp_path, ROBOTS) as fleet:
        fleet.begin()
        fleet.strike(KILLS, CUTS)
        fleet.give(TASKS)
        fleet.finish(120.0)
    figures = fleet.figures
    assert (figures.kills, figures.cuts) == (KILLS, CUTS)
    assert figures.waiting == [], "lost, or never ended"
    assert sum(figures.states.values()) == TASKS
    assert [each for each in figures.once_only if figures.acts[each] > 1] == []
    assert set(figures.twice) & figures.once_only == set()
    assert figures.untold == [], "what two robots have done is told"
