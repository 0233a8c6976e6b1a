"""Is it dark, and does something move: judged by the newest picture."""

import pytest

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.scene import Dark, MotionSeenLeaf
from missions.plugins.testing.recorders import LeafTestBench
from perception.api import Scene


def show(bench: LeafTestBench, *, brightness: float = 100.0, motion: float | None = 0.0, age: float = 0.1) -> None:
    bench.sight.shown = Scene(bench.clock.now() - age, brightness, 40.0, motion)


@pytest.mark.parametrize(("brightness", "status"), [(20.0, SUCCESS), (80.0, FAILURE)])
def test_dark_is_a_picture_below_a_share_of_white(brightness: float, status: object) -> None:
    bench = LeafTestBench()
    leaf = bench.put(Dark("dark"))
    show(bench, brightness=brightness)
    assert bench.tick(leaf) is status
    assert leaf.reason == f"the picture has a brightness of {brightness / 255:.0%}"


@pytest.mark.parametrize(("motion", "status"), [(0.01, SUCCESS), (0.001, FAILURE), (0.005, SUCCESS)])
def test_motion_seen_compares_the_moving_share_of_the_picture(motion: float, status: object) -> None:
    bench = LeafTestBench()
    leaf = bench.put(MotionSeenLeaf("motion_seen"))
    show(bench, motion=motion)
    assert bench.tick(leaf) is status
    assert leaf.reason == f"{motion:.1%} of the picture moves"


def test_motion_seen_fails_while_motion_detection_is_off() -> None:
    bench = LeafTestBench()
    leaf = bench.put(MotionSeenLeaf("motion_seen"))
    show(bench, motion=None)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "motion detection is off"


@pytest.mark.parametrize("leaf", [Dark("dark"), MotionSeenLeaf("motion_seen")])
def test_scene_conditions_suspend_without_a_recent_picture(leaf: Leaf) -> None:
    bench = LeafTestBench()
    bench.put(leaf)
    assert bench.tick(leaf) is RUNNING
    show(bench, age=3.0)
    assert bench.tick(leaf) is RUNNING
    assert (leaf.is_suspended, leaf.reason) == (True, "waiting: the camera does not report")
    show(bench)
    assert bench.tick(leaf) is not RUNNING
