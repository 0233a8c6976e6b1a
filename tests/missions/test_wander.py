"""Wandering on the whole simulated robot: it bumps into nothing hard, and comes about.

All twenty seeds for ten minutes: ``python -m tests.benchmarks``.
"""

import pytest

from tests.benchmarks.wandering import wander


@pytest.mark.parametrize("seed", range(3))
def test_in_a_living_room_it_bumps_into_nothing_hard_and_sees_half_of_the_floor(seed: int) -> None:
    walk = wander(seed, minutes=10.0)
    assert walk.result == "success"
    assert max(walk.bumps, default=0.0) <= 0.1
    assert walk.visited >= 0.5


@pytest.mark.parametrize(("world", "least"), [("obstacles", 0.2), ("corridor", 0.3)])
def test_between_furniture_it_bumps_into_nothing_hard(world: str, least: float) -> None:
    walk = wander(1, minutes=4.0, world=world)
    assert walk.result == "success"
    assert max(walk.bumps, default=0.0) <= 0.1
    assert walk.visited >= least


def test_without_a_range_finder_it_goes_by_its_bumpers_and_gently() -> None:
    walk = wander(2, minutes=4.0, world="obstacles", robot="turtlebot2_arm")
    assert walk.result == "success"
    assert walk.bumps
    assert max(walk.bumps) <= 0.1
    assert walk.visited >= 0.1


def test_it_keeps_off_the_stairs() -> None:
    walk = wander(3, minutes=4.0, world="stairs")
    assert walk.result == "success"
    assert not walk.fell
    assert max(walk.bumps, default=0.0) <= 0.1
