"""Faces by name: conditions, the search, identifying, following, and whom the robot has met."""

from dataclasses import replace
from typing import Any

import pytest

from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.sight import (
    FACE_TIMEOUT,
    NAME_TIMEOUT,
    FaceCentred,
    FacesAtLeast,
    FaceSeenLeaf,
    FindFace,
    Identify,
    Meeting,
    is_same_person,
    may_be_same_person,
)
from behaviours.tracking.track import TrackFace
from drivers.api import Pose2D
from missions.executive.state import state_of
from missions.plugins.testing.recorders import LeafTestBench, face
from perception.api import UNKNOWN, Face

HOME = Pose2D(0.0, 0.0, 0.0)


def named(bench: LeafTestBench, name: str, *, number: int = 1, yaw: float = 0.0, distance: float = 1.5) -> Face:
    """Return a face that is seen now."""
    bench.sight.searched = bench.clock.now()
    return replace(face(bench.clock.now() + 0.05, number=number, yaw=yaw), name=name, distance=distance)


@pytest.mark.parametrize(("whose", "found"), [("", 1), ("Anna", 2), ("ANNA", 2), (UNKNOWN, 3), ("Chidi", None)])
def test_face_seen_matches_names_case_insensitively(whose: str, found: int | None) -> None:
    bench = LeafTestBench()
    faces = [named(bench, "Ben"), named(bench, "Anna", number=2), named(bench, UNKNOWN, number=3)]
    bench.sight.seen = [*faces, named(bench, "", number=4)]
    leaf = bench.put(FaceSeenLeaf("face_seen"), person_name=whose)
    assert bench.tick(leaf) is (FAILURE if found is None else SUCCESS)
    assert (None if leaf.result is None else getattr(leaf.result, "id", None)) == found
    assert found is not None or leaf.reason == "no face of Chidi in view"


def test_face_seen_reports_a_missing_stranger() -> None:
    bench = LeafTestBench()
    bench.sight.seen = [named(bench, "Ben")]
    leaf = bench.put(FaceSeenLeaf("face_seen"), person_name=UNKNOWN)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "no face of a stranger in view"


@pytest.mark.parametrize(("nearer", "status"), [(None, SUCCESS), (2.0, SUCCESS), (1.2, FAILURE)])
def test_face_seen_checks_the_distance(nearer: float | None, status: object) -> None:
    bench = LeafTestBench()
    bench.sight.seen = [named(bench, "Ben", distance=1.5)]
    assert bench.tick(bench.put(FaceSeenLeaf("face_seen"), nearer=nearer)) is status


def test_faces_are_counted_and_centred_by_name() -> None:
    bench = LeafTestBench()
    bench.sight.seen = [named(bench, UNKNOWN, number=1), named(bench, "Ben", number=2), named(bench, UNKNOWN, number=3)]
    count = bench.put(FacesAtLeast("faces_at_least"), number=2, person_name=UNKNOWN)
    assert bench.tick(count) is SUCCESS
    centred = bench.put(FaceCentred("face_centred"), person_name="Ben")
    assert bench.tick(centred) is SUCCESS
    assert centred.result == bench.sight.seen[1]


def test_node_name_is_independent_of_the_person_name() -> None:
    leaf = FaceSeenLeaf("wait for Anna")
    assert (leaf.name, leaf.person_name) == ("wait for Anna", "")
    assert FaceSeenLeaf.arguments["name"].attribute == "person_name"
    assert {"pan", "scans", "new", "name"} <= set(FindFace.arguments)


def test_search_stays_on_a_face_until_identified() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FindFace("find_face"), person_name="Anna", pause=0.2)
    for _ in range(round(NAME_TIMEOUT / 0.05) - 4):
        bench.sight.seen = [named(bench, "")]
        assert bench.tick(leaf) is RUNNING
    assert len(set(map(str, bench.head.commands))) == 1, "the head has stayed where it was"
    bench.sight.seen = [named(bench, "Anna")]
    assert bench.tick(leaf) is SUCCESS


def test_search_continues_past_unidentified_and_other_faces() -> None:
    for name, seconds in (("", NAME_TIMEOUT + 0.5), ("Ben", 0.5)):
        bench = LeafTestBench()
        leaf = bench.put(FindFace("find_face"), person_name="Anna", pause=0.2)
        for _ in range(round(seconds / 0.05)):
            bench.sight.seen = [named(bench, name)]
            assert bench.tick(leaf) is RUNNING
        assert len(set(map(str, bench.head.commands))) > 1, name


def test_identify_waits_for_a_decision_and_stores_the_face() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Identify("identify"))
    bench.sight.seen = [named(bench, "")]
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "not decided yet who that is"
    bench.sight.seen = [named(bench, UNKNOWN)]
    assert bench.tick(leaf) is SUCCESS
    assert leaf.result == bench.sight.seen[0]


def test_identify_fails_when_the_face_is_gone() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Identify("identify"), face=named(bench, "", number=1))
    ticks = 0
    while bench.tick(leaf) is RUNNING:
        bench.sight.seen = [named(bench, "Ben", number=2)]
        ticks += 1
    assert ticks * 0.05 == pytest.approx(FACE_TIMEOUT, abs=0.15)
    assert leaf.reason == "no face in view"


@pytest.mark.parametrize(
    ("name", "kept", "same", "possible"),
    [
        ("Anna", "Anna", True, True),
        ("Ben", "Anna", False, False),
        (UNKNOWN, "Anna", False, False),
        ("", "Anna", False, True),
        ("Ben", "", False, True),
        (UNKNOWN, UNKNOWN, False, True),
        ("", "", False, True),
    ],
)
def test_a_name_outlasts_the_id_of_a_face(name: str, kept: str, same: bool, possible: bool) -> None:
    bench = LeafTestBench()
    now, before = named(bench, name, number=2), named(bench, kept, number=1)
    assert (is_same_person(now, before), may_be_same_person(now, before)) == (same, possible)
    assert is_same_person(replace(now, id=1), before)


def test_meeting_compares_names_before_directions() -> None:
    bench = LeafTestBench()
    meeting = Meeting.of(named(bench, "Anna", yaw=0.0), HOME)
    assert meeting.is_with(named(bench, "Anna", number=2, yaw=2.0), HOME)
    assert not meeting.is_with(named(bench, "Ben", number=3, yaw=0.0), HOME), "somebody else stands there now"
    assert meeting.is_with(named(bench, UNKNOWN, number=4, yaw=0.0), HOME)
    assert meeting.is_with(named(bench, "", number=5, yaw=0.0), HOME)
    assert not meeting.is_with(named(bench, "", number=5, yaw=1.0), HOME)


def test_track_face_rejects_faces_with_another_name() -> None:
    leaf = TrackFace("track_face")
    bench = LeafTestBench()
    anna, ben, somebody = (named(bench, name, number=n) for n, name in enumerate(("Anna", "Ben", ""), start=1))
    assert not leaf.may_be_target(ben, anna)
    assert leaf.may_be_target(somebody, anna)
    assert leaf.may_be_target(ben, somebody)


def test_expressions_read_the_name_of_the_largest_face() -> None:
    bench = LeafTestBench()
    state: Any = state_of(bench.robot, bench.clock)["face"]
    assert (state.name, state.undecided) == (None, False)
    bench.sight.seen = [named(bench, "Anna"), named(bench, "", number=2)]
    assert (state.name, state.undecided) == ("Anna", True)
    bench.sight.seen = bench.sight.seen[:1]
    assert not state.undecided
