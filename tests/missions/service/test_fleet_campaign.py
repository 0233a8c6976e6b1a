"""A small campaign: robots are killed and cut off at random while they do tasks; `make fleet` is the large one."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from missions.plugins.fleet.messages import Address, KeepTask
from missions.plugins.fleet.operator import Operator
from tests.missions.service.fleet_campaign import campaign
from tests.waiting import wait_until

pytestmark = [pytest.mark.real_time, pytest.mark.long]

ROBOTS, TASKS, KILLS, CUTS, STOPS = 4, 24, 6, 4, 2


def test_campaign_of_kills_and_cuts_loses_and_repeats_no_task(tmp_path: Path) -> None:
    with campaign(tmp_path, ROBOTS) as fleet:
        fleet.begin()
        fleet.strike(KILLS, CUTS, STOPS)
        fleet.give(TASKS)
        fleet.finish(120.0)
    figures = fleet.figures
    assert (figures.kills, figures.cuts) == (KILLS, CUTS)
    assert figures.waiting == [], "lost, or never ended"
    assert sum(figures.states.values()) == TASKS
    assert [each for each in figures.once_only if figures.acts[each] > 1] == []
    assert set(figures.twice) & figures.once_only == set()
    assert figures.untold == [], "what two robots have done is told"
    assert figures.struck_unstopped == 0, "who is connected stands, whatever befalls the others"


def test_two_operators_with_equal_commands_do_not_conflict(tmp_path: Path) -> None:
    with campaign(tmp_path, 2) as fleet, ThreadPoolExecutor(2) as both:
        fleet.begin()
        fleet.strike(0, 0)
        operators = fleet.operator, fleet.stopper
        keepers = sorted(fleet.online())
        wait_until(lambda: fleet.online() == {a for a, each in fleet.stopper.members().items() if each.is_online})
        fleet.given = [f"{keepers[number % 2]}/{number:012x}" for number in range(8)]

        def give(operator: Operator) -> bool:
            wanted = [KeepTask(task=each, mission="note", params={"id": each}) for each in fleet.given]
            return all(operator.submit(each, Address.read(each.task.rpartition("/")[0])).ok for each in wanted)

        assert list(both.map(give, operators)) == [True, True]
        for answers, silent in both.map(Operator.stop, operators):
            assert (set(answers), silent) == (set(keepers), [])
            assert all(answer.ok for answer in answers.values())
        wait_until(lambda: all(each.state and each.state.stops == 2 for each in fleet.operator.members().values()))
        list(both.map(lambda each: each.release([], resume=True), operators))
        fleet.finish(60.0)
    figures = fleet.figures
    assert (figures.waiting, figures.twice) == ([], [])
    assert figures.acts == dict.fromkeys(fleet.given, 1)
