"""A mission whose eyes have rested waits for pictures, and is told of nothing that nobody looked for."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from behaviours.leaf import FAILURE, RUNNING
from behaviours.sight import FaceSeenLeaf
from drivers.errors import NotConnected
from missions.assembly.eyes import OnDemandSight
from missions.executive.proxy import make_proxy
from missions.executive.tick_cache import TickCache
from missions.plugins.testing.recorders.bench import LeafTestBench
from perception.api import Sight

QUESTIONS: list[Callable[[Sight], object]] = [
    lambda sight: sight.faces(),
    lambda sight: sight.things(),
    lambda sight: sight.markers(),
    lambda sight: sight.looked(),
    lambda sight: sight.scene(),
]


@pytest.mark.parametrize("question", QUESTIONS, ids=["faces", "things", "markers", "looked", "scene"])
def test_sight_query_wakes_the_eyes_and_waits(question: Callable[[Sight], object]) -> None:
    bench, asked, awake = LeafTestBench(), [], [False]

    def ask() -> bool:
        asked.append(True)
        return awake[0]

    sight = OnDemandSight(bench.sight, ask, lambda: awake[0])
    with pytest.raises(NotConnected, match="detection was paused"):
        question(sight)
    awake[0] = True
    assert question(sight) == question(bench.sight)
    assert len(asked) == 2


def test_condition_waits_for_paused_eyes() -> None:
    bench, awake = LeafTestBench(), [False]
    leaf = bench.put(FaceSeenLeaf("face_seen"))
    leaf.robot = replace(bench.robot, sight_part=OnDemandSight(bench.sight, lambda: awake[0], lambda: awake[0]))
    assert bench.tick(leaf) is RUNNING
    assert "camera: detection was paused" in leaf.feedback_message
    awake[0] = True
    assert bench.tick(leaf) is FAILURE


def test_sample_does_not_wake_the_eyes() -> None:
    bench, asked, awake = LeafTestBench(), [], [True]

    def ask() -> bool:
        asked.append(True)
        return True

    answers = TickCache()
    answers.is_recording = True
    sight = make_proxy("sight", Sight, OnDemandSight(bench.sight, ask, lambda: awake[0]), answers)
    answers.is_open = True
    answers.sample()
    assert {what: value for _, what, _, value in answers.take_answers()}["faces"] == bench.sight.faces()
    awake[0] = False
    answers.is_open = True
    answers.sample()
    assert all(isinstance(value, NotConnected) for _, _, _, value in answers.take_answers())
    assert not asked
    answers.is_open = True
    sight.faces()
    assert asked == [True]
