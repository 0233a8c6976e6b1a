"""Rules that all transition tables keep."""

from enum import Enum

import pytest

from tests.machines import Table, reachable, tables

TABLES = tables()


@pytest.fixture(params=TABLES, ids=str)
def table(request: pytest.FixtureRequest) -> Table:
    return TABLES[request.param]


def states_of(table: Table) -> type[Enum]:
    kinds = {type(state) for pair, after in table.items() for state in (pair[0], after)}
    assert len(kinds) == 1
    return kinds.pop()


def test_table_has_one_kind_of_state_and_one_of_event(table: Table) -> None:
    states_of(table)
    assert len({type(event) for _, event in table}) == 1


def test_every_state_is_reachable_from_the_first(table: Table) -> None:
    states = list(states_of(table))
    assert reachable(table, states[0]) == set(states)


def test_every_event_is_in_the_table(table: Table) -> None:
    events = {event for _, event in table}
    assert events == set(type(next(iter(events))))
