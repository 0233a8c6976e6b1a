"""Asking whether the camera shows anything: which picture is asked about, and what is answered."""

import pytest
from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.scene import SceneUniform
from missions.plugins.testing.recorders import LeafTestBench
from perception.api import Scene


def asking(bench: LeafTestBench, **arguments: object) -> SceneUniform:
    return bench.put(SceneUniform("scene_uniform"), **arguments)


def show(bench: LeafTestBench, contrast: float, *, age: float = 0.0) -> None:
    bench.sight.shown = Scene(bench.clock.now() - age, 120.0, contrast)


@pytest.mark.parametrize(
    ("contrast", "status", "reason"),
    [
        (1.0, SUCCESS, "the picture is uniform, with a brightness of 120 of 255"),
        (6.0, SUCCESS, "the picture is uniform, with a brightness of 120 of 255"),
        (23.0, FAILURE, "the picture is not uniform: its contrast is 23"),
    ],
)
def test_a_picture_without_edges_is_uniform(contrast: float, status: Status, reason: str) -> None:
    bench = LeafTestBench()
    leaf = asking(bench)
    show(bench, contrast)
    assert bench.tick(leaf) is status
    assert leaf.reason == reason


def test_scene_uniform_contrast_is_an_argument() -> None:
    bench = LeafTestBench()
    show(bench, 23.0)
    assert bench.tick(asking(bench, contrast=30.0)) is SUCCESS


def test_scene_uniform_suspends_without_a_recent_picture() -> None:
    bench = LeafTestBench()
    leaf = asking(bench)
    assert bench.tick(leaf) is RUNNING
    assert (leaf.is_suspended, leaf.reason) == (True, "waiting: the camera does not report")
    show(bench, 1.0, age=3.0)
    assert bench.tick(leaf) is RUNNING
    show(bench, 1.0)
    assert bench.tick(leaf) is SUCCESS


def test_scene_uniform_within_zero_ignores_earlier_pictures() -> None:
    bench = LeafTestBench()
    leaf = asking(bench, within=0.0)
    show(bench, 1.0)
    assert bench.tick(leaf) is RUNNING, "taken before it began"
    show(bench, 40.0)
    assert bench.tick(leaf) is FAILURE
