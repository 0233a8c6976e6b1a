"""What is known about instants: bounds that follow from each other, and nothing that does not."""

from itertools import product

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from missions.plugins.verify.choices import Oracle
from missions.plugins.verify.symbolic_time import (
    INITIAL_ZONE,
    UNBOUNDED,
    ZERO_BOUND,
    Instant,
    SymbolicClock,
    UnknownTime,
    Zone,
    add_bounds,
    extrapolate,
)

BOUNDS = st.tuples(st.integers(-4, 4).map(float), st.sampled_from((0, 1)))
DEMANDS = st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2), BOUNDS), max_size=5)

GRID = [place / 6 for place in range(-78, 79)]
"""Times fine and far enough to meet three instants' whole bounds of up to four seconds, strict ones too."""


def holds(times: tuple[float, ...], i: int, j: int, bound: tuple[float, int]) -> bool:
    apart = round(times[i] - times[j], 6)
    return apart < bound[0] or (apart == bound[0] and bound[1] == 1)


@given(DEMANDS, st.tuples(st.integers(0, 2), st.integers(0, 2), BOUNDS))
def test_zone_allows_exactly_the_satisfiable_constraints(
    demands: list[tuple[int, int, tuple[float, int]]], asked: tuple[int, int, tuple[float, int]]
) -> None:
    zone = Zone([[ZERO_BOUND if i == j else UNBOUNDED for j in range(3)] for i in range(3)])
    for demand in demands:
        assume(zone.allows(*demand))
        zone.constrain(*demand)
    coarse = GRID[::3] if all(bound[1] for _, _, bound in [*demands, asked]) else GRID[::2]
    solutions = (all(holds((0.0, a, b), *demand) for demand in (*demands, asked)) for a, b in product(coarse, repeat=2))
    assert zone.allows(*asked) == any(solutions)


def test_two_ways_add_up_and_are_strict_where_one_is() -> None:
    assert add_bounds((1.0, 1), (2.0, 1)) == (3.0, 1)
    assert add_bounds((1.0, 0), (2.0, 1)) == (3.0, 0)
    assert add_bounds((1.0, 1), UNBOUNDED) == UNBOUNDED


def test_advancing_a_zone_bounds_elapsed_time_from_below() -> None:
    zone = Zone(INITIAL_ZONE)
    first = Zone(zone.advance({0: 5.0}))
    assert first.allows(0, 1, (-100.0, 1))
    first.constrain(0, 1, (-5.0, 1))
    assert first.advance({0: 5.0}) == ((ZERO_BOUND, (-5.0, 1)), (UNBOUNDED, ZERO_BOUND))


def test_extrapolated_bounds_are_given_constants_and_never_tighter() -> None:
    rows = ((ZERO_BOUND, (3.0, 0), (-6.0, 1)), ((-2.0, 0), ZERO_BOUND, (11.0, 1)), (UNBOUNDED, UNBOUNDED, ZERO_BOUND))
    assert extrapolate(rows, [2.0, 5.0]) == (
        (ZERO_BOUND, (5.0, 1), (-5.0, 1)),
        ((-2.0, 0), ZERO_BOUND, UNBOUNDED),
        (UNBOUNDED, UNBOUNDED, ZERO_BOUND),
    )


def elapsed(timing: SymbolicClock) -> tuple[float, float]:
    """Two instants: one that is kept, and the one after it."""
    since = timing.now()
    timing.set(timing.zone.advance({0: 100.0}))
    return since, timing.now()


@pytest.mark.parametrize("over", [False, True])
def test_whether_a_time_is_over_is_a_choice_once_and_then_a_fact(over: bool) -> None:
    oracle = Oracle()
    timing = SymbolicClock(oracle)
    since, now = elapsed(timing)
    oracle.follow((int(over),))
    assert (now - since >= 5.0) is over
    assert (now - since >= 5.0) is over
    assert (now - since >= (4.0 if over else 6.0)) is over
    assert len(oracle.choices) == 1


def test_no_time_passes_within_a_tick() -> None:
    oracle = Oracle()
    timing = SymbolicClock(oracle)
    assert not timing.now() - timing.now() >= 0.1
    assert timing.now() - timing.now() >= 0.0
    assert timing.now() < timing.now() + 1.0
    assert oracle.choices == []


def test_unknown_time_is_a_choice_at_each_comparison() -> None:
    oracle = Oracle()
    timing = SymbolicClock(oracle)
    since, now = elapsed(timing)
    unknown = UnknownTime.of(oracle, "'wait' (line 4)")
    assert isinstance(since, Instant)
    oracle.follow((1, 0, 1))
    assert now - since >= unknown
    assert not now - since >= unknown
    assert since + unknown - now > 0


def test_instant_is_forgotten_after_its_own_limit() -> None:
    zone = Zone([[ZERO_BOUND if i == j else UNBOUNDED for j in range(3)] for i in range(3)])
    zone.constrain(0, 2, (-4.0, 1))  # both were 4 s ago, at the same moment
    zone.constrain(0, 1, ZERO_BOUND)
    zone.constrain(1, 0, ZERO_BOUND)
    kept = Zone(zone.advance({0: 3.0, 1: 5.0}))
    assert kept.bounds[0] == [ZERO_BOUND, UNBOUNDED, (-3.0, 1)]
    assert kept.bounds[1] == [UNBOUNDED, ZERO_BOUND, (-4.0, 1)]
