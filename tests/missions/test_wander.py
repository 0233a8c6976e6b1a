"""Wandering on the whole simulated robot: it bumps into nothing hard, and comes about.

How far it comes in ten minutes from twenty places: ``python -m tests.benchmarks``.
"""

import pytest

from tests.benchmarks.wandering import wander


@pytest.mark.parametrize(
    ("world", "minutes", "least"), [("living_room", 2.0, 0.15), ("obstacles", 1.0, 0.08), ("corridor", 1.0, 0.15)]
)
def test_wander_avoids_hard_bumps_between_furniture(world: str, minutes: float, least: float) -> None:
    walk = wander(1, minutes=minutes, world=world)
    assert walk.result == "success"
    assert max(walk.bumps, default=0.0) <= 0.1
    assert walk.visited >= least


def test_wander_without_a_range_finder_bumps_gently() -> None:
    walk = wander(2, minutes=1.0, world="obstacles", robot="turtlebot2_arm")
    assert walk.result == "success"
    assert walk.bumps
    assert max(walk.bumps) <= 0.1
    assert walk.visited >= 0.03


def test_wander_avoids_stairs() -> None:
    walk = wander(3, minutes=1.0, world="stairs")
    assert walk.result == "success"
    assert not walk.fell
    assert max(walk.bumps, default=0.0) <= 0.1
