"""Who counts as met: the same id, or the same place, from wherever the robot stands now."""

import math
from dataclasses import replace

import pytest
from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.sight import FaceCentred, FindFace, Meeting
from drivers.api import BaseState, HeadPose, Pose2D, Velocity
from missions.plugins.testing.recorders import LeafTestBench, face, good

HOME = Pose2D(0.0, 0.0, 0.0)


def test_meeting_recognises_a_face_by_id_in_any_direction() -> None:
    meeting = Meeting.of(face(1.0, number=3, yaw=0.0), HOME)
    assert meeting.is_with(face(2.0, number=3, yaw=2.0), HOME)


@pytest.mark.parametrize(("degrees", "same"), [(0, True), (14, True), (-14, True), (16, False), (90, False)])
def test_meeting_recognises_a_face_with_a_new_id_by_direction(degrees: float, same: bool) -> None:
    meeting = Meeting.of(face(1.0, number=1, yaw=math.pi), HOME)
    found = face(9.0, number=2, yaw=math.pi + math.radians(degrees) - math.tau)
    assert meeting.is_with(found, HOME) is same


def test_the_place_holds_when_the_robot_has_moved() -> None:
    ahead = replace(face(1.0, number=1, yaw=0.0), distance=2.0)
    meeting = Meeting.of(ahead, HOME)
    aside = Pose2D(2.0, -2.0, 0.0)
    assert meeting.is_with(face(9.0, number=2, yaw=math.pi / 2), aside)
    assert not meeting.is_with(face(9.0, number=2, yaw=0.0), aside)


def see(bench: LeafTestBench, leaf: FindFace, *, number: int, yaw: float) -> Status:
    """Start to look, with one face in view from then on; return what comes of it."""
    bench.tick(leaf)
    bench.sight.seen = [face(bench.clock.now() + 0.05, number=number, yaw=yaw)]
    return bench.tick(leaf)


def test_find_face_with_new_finds_each_person_once() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FindFace("find_face"), new=True)
    assert see(bench, leaf, number=1, yaw=0.0) is SUCCESS
    assert see(bench, leaf, number=2, yaw=0.0) is RUNNING, "the same person under another id"
    assert bench.halt(leaf)
    assert see(bench, leaf, number=3, yaw=1.0) is SUCCESS


def test_find_face_with_new_waits_while_the_head_turns() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FindFace("find_face"), new=True)
    bench.tick(leaf)
    bench.head.reading = good(HeadPose(0.5, 0.0))
    assert see(bench, leaf, number=1, yaw=0.6) is RUNNING, "where it is cannot be told"
    bench.head.reading = good(HeadPose(0.0, 0.0))
    assert see(bench, leaf, number=1, yaw=0.6) is SUCCESS


def test_find_face_knows_the_place_from_where_the_base_is_now() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FindFace("find_face"), new=True)
    assert see(bench, leaf, number=1, yaw=0.0) is SUCCESS
    bench.base.reading = good(BaseState(Pose2D(1.5, -1.5, 0.0), Velocity(0.0, 0.0)))
    assert see(bench, leaf, number=2, yaw=math.pi / 2) is RUNNING
    assert see(bench, leaf, number=3, yaw=0.0) is SUCCESS


def test_find_face_without_new_finds_a_person_again() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FindFace("find_face"))
    for _ in range(2):
        assert see(bench, leaf, number=1, yaw=0.0) is SUCCESS


def test_face_centred_checks_only_the_named_face() -> None:
    bench = LeafTestBench()
    now = bench.clock.now()
    aside, centred = face(now, number=1, bearing=0.4), face(now, number=2)
    bench.sight.seen = [aside, centred]
    leaf = bench.put(FaceCentred("face_centred"))
    assert bench.tick(leaf) is FAILURE
    assert bench.tick(bench.put(leaf, face=centred)) is SUCCESS
    assert leaf.result == centred
    bench.sight.seen = [face(now, number=3)]
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "no face in view"


def test_argument_that_is_not_a_face_is_refused() -> None:
    bench = LeafTestBench()
    bench.sight.seen = [face(bench.clock.now())]
    leaf = bench.put(FaceCentred("face_centred"), face="Anna")
    assert bench.tick(leaf) is FAILURE
    assert "'face' needs a face that a behaviour has found" in leaf.reason
