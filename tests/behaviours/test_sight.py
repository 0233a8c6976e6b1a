"""Conditions on faces, and the search with the head: what counts as seen, and where the head looks for it."""

import math
from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf
from behaviours.search import serpentine
from behaviours.sight import FaceCentred, FacesAtLeast, FaceSeenLeaf, FindFace
from drivers.api import HeadPose, Reading
from drivers.errors import DeviceFault
from missions.plugins.testing.recorders import OFFLINE_ERROR, STOP, LeafTestBench, face, good, none, stale

AHEAD = HeadPose(0.0, 0.0)


def seen(bench: LeafTestBench, *, age: float = 0.1, number: int = 1, bearing: float = 0.0, drop: float = 0.0) -> None:
    """Show a face that was seen ``age`` seconds ago, and the camera at work."""
    bench.sight.seen = [face(bench.clock.now() - age, number=number, bearing=bearing, elevation=drop)]
    bench.sight.searched = bench.clock.now()


# --- conditions ------------------------------------------------------------------------------------------------------


def test_face_seen_finds_and_stores_a_recent_face() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FaceSeenLeaf("face_seen"), output_variable="visitor")
    seen(bench)
    assert bench.tick(leaf) is SUCCESS
    assert bench.run.variables == {"visitor": bench.sight.seen[0]}


@pytest.mark.parametrize("kind", [FaceSeenLeaf, FaceCentred])
def test_sight_conditions_fail_without_a_face(kind: Callable[[str], Leaf]) -> None:
    bench = LeafTestBench()
    leaf = bench.put(kind("see"))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "no face in view"
    assert bench.run.variables == {}


@pytest.mark.parametrize("kind", [FaceSeenLeaf, FaceCentred])
@pytest.mark.parametrize(("age", "status"), [(0.3, SUCCESS), (0.9, FAILURE)])
def test_a_face_seen_too_long_ago_does_not_count(kind: Callable[[str], Leaf], age: float, status: object) -> None:
    bench = LeafTestBench()
    leaf = bench.put(kind("see"))
    seen(bench, age=age)
    assert bench.tick(leaf) is status


@pytest.mark.parametrize("kind", [FaceSeenLeaf, FaceCentred])
def test_face_conditions_are_suspended_without_pictures(kind: Callable[[str], Leaf]) -> None:
    bench = LeafTestBench()
    leaf = bench.put(kind("see"))
    for searched in (None, bench.clock.now() - 10.0):
        bench.sight.searched = searched
        assert bench.tick(leaf) is RUNNING
        assert (leaf.is_suspended, leaf.reason) == (True, "waiting: the camera does not report")


def test_the_largest_of_the_faces_seen_lately_counts() -> None:
    bench = LeafTestBench()
    now = bench.clock.now()
    bench.sight.seen = [face(now - 2.0, number=1), face(now, number=2), face(now, number=3)]
    leaf = bench.put(FaceSeenLeaf("face_seen"), output_variable="visitor")
    assert bench.tick(leaf) is SUCCESS
    assert bench.run.variables["visitor"] == bench.sight.seen[1]


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.01, 0.3))
def test_a_face_is_centred_within_an_angle_on_both_axes(bearing: float, drop: float, within: float) -> None:
    bench = LeafTestBench()
    leaf = bench.put(FaceCentred("face_centred"), within=within)
    seen(bench, bearing=bearing, drop=drop)
    centred = max(abs(bearing), abs(drop)) <= within
    assert bench.tick(leaf) is (SUCCESS if centred else FAILURE)
    assert centred or "deg off" in leaf.reason


def test_face_centred_reports_the_offset_of_the_face() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FaceCentred("face_centred"))
    seen(bench, bearing=math.radians(12), drop=math.radians(-7))
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "the face is +12, -7 deg off"


@pytest.mark.parametrize(
    ("ages", "status", "reason"),
    [
        ([0.1, 0.2, 0.3], SUCCESS, ""),
        ([0.1, 0.2], SUCCESS, ""),
        ([0.1, 0.9], FAILURE, "1 of 2 faces in view"),
        ([0.9, 0.9], FAILURE, "no face in view"),
        ([], FAILURE, "no face in view"),
    ],
)
def test_several_faces_count_when_all_were_seen_lately(ages: list[float], status: object, reason: str) -> None:
    bench = LeafTestBench()
    leaf = bench.put(FacesAtLeast("faces_at_least"), number=2, output_variable="people")
    now = bench.clock.now()
    bench.sight.seen = [face(now - age, number=number) for number, age in enumerate(ages)]
    assert bench.tick(leaf) is status
    assert leaf.reason == reason
    assert bench.run.variables.get("people") == (bench.sight.seen if status is SUCCESS else None)


def test_face_seen_within_sets_the_maximum_age() -> None:
    bench = LeafTestBench()
    leaf = bench.put(FaceSeenLeaf("face_seen"), within=2.0)
    seen(bench, age=1.8)
    assert bench.tick(leaf) is SUCCESS
    bench.clock.advance(1.0)
    assert bench.tick(leaf) is FAILURE


# --- the search ------------------------------------------------------------------------------------------------------


class Search:
    """A search whose head is where it was told to be, and whose camera shows an empty room."""

    def __init__(self, **arguments: object) -> None:
        self.bench = LeafTestBench()
        self.leaf = self.bench.put(FindFace("find_face"), **arguments)

    def tick(self, *, arrives: bool = True) -> object:
        """Let one tick pass; the picture that it sees was taken 0.1 s before."""
        self.bench.sight.searched = self.bench.clock.now() - 0.05
        status = self.bench.tick(self.leaf)
        poses = self.poses
        if arrives and poses:
            self.bench.head.reading = good(poses[-1])
        return status

    def run(self, ticks: int) -> object:
        """Tick so often, or until it ends."""
        status: object = RUNNING
        for _ in range(ticks):
            status = self.tick()
            if status is not RUNNING:
                break
        return status

    @property
    def poses(self) -> list[HeadPose]:
        """Where the head was told to look, one after another."""
        told = [command for command in self.bench.head.commands if isinstance(command, HeadPose)]
        return [pose for n, pose in enumerate(told) if n == 0 or pose != told[n - 1]]


SMALL = {"pan": (-0.4, 0.4), "tilt": (-0.2, 0.1), "step": 0.4}
SMALL_ROUTE = list(serpentine((-0.4, 0.4), (-0.2, 0.1), 0.4))


def test_search_visits_the_current_pose_and_then_the_route_repeatedly() -> None:
    search = Search(**SMALL)
    assert search.run(160) is RUNNING
    assert len(SMALL_ROUTE) == 6
    assert search.poses[: 1 + 2 * 6] == [AHEAD, *SMALL_ROUTE, *SMALL_ROUTE]
    assert search.leaf.reason == "no face found"


def test_search_dwells_for_the_pause_by_picture_stamps() -> None:
    search = Search(**SMALL, pause=0.5)
    search.run(100)
    told = [(command, at) for command, at in zip(search.bench.head.commands, search.bench.head.times, strict=True)]
    starts = [told[0][1]] + [after[1] for before, after in pairwise(told) if before[0] != after[0]]
    # The pause, the picture's lag of 0.1 s, and at most two ticks: one to arrive, one to see it.
    assert all(0.6 - 1e-9 <= after - before <= 0.7 + 1e-9 for before, after in pairwise(starts[1:]))


def test_search_does_not_continue_without_new_pictures() -> None:
    search = Search(**SMALL)
    for _ in range(100):
        search.bench.sight.searched = 90.0
        search.bench.tick(search.leaf)
    assert search.poses == [AHEAD]
    assert search.leaf.reason == "no pictures from the camera"


def test_search_does_not_continue_before_the_head_arrives() -> None:
    search = Search(**SMALL)
    search.bench.head.reading = good(HeadPose(1.0, 0.0))
    search.tick(arrives=False)
    search.bench.head.reading = good(AHEAD)
    for _ in range(50):
        search.tick(arrives=False)
    assert search.poses == [HeadPose(1.0, 0.0)]


def test_search_succeeds_at_a_face_and_stops_the_head() -> None:
    search = Search(**SMALL, output_variable="visitor")
    search.run(20)
    seen(search.bench, age=0.05)
    assert search.bench.tick(search.leaf) is SUCCESS
    assert search.bench.head.commands[-1] == STOP
    assert search.bench.run.variables == {"visitor": search.bench.sight.seen[0]}
    assert search.leaf.reason == ""


def test_search_ignores_faces_from_before_its_start() -> None:
    search = Search(**SMALL)
    bench = search.bench
    before = bench.clock.now()
    bench.sight.seen = [face(before, number=1)]
    assert search.run(2) is RUNNING
    bench.sight.seen = [face(before, number=1), face(bench.clock.now(), number=2)]
    assert search.tick() is SUCCESS
    assert search.leaf.result == bench.sight.seen[1]


@pytest.mark.parametrize(("scans", "reason"), [(1, "no face found in 1 scan"), (2, "no face found in 2 scans")])
def test_search_fails_after_its_scans_and_stops_the_head(scans: int, reason: str) -> None:
    search = Search(**SMALL, scans=scans)
    assert search.run(1000) is FAILURE
    assert search.leaf.reason == reason
    assert search.poses == [AHEAD, *SMALL_ROUTE * scans]
    assert search.bench.head.commands[-1] == STOP


def test_places_beyond_the_limits_are_looked_at_from_the_limits() -> None:
    search = Search(pan=(-3.0, 3.0), tilt=(0.0, 0.0), step=3.0, scans=1)
    assert search.run(1000) is FAILURE
    assert [pose.pan for pose in search.poses] == [0.0, -1.4, 0.0, 1.4]


def test_a_place_just_looked_at_is_not_looked_at_again() -> None:
    search = Search(pan=(1.4, 3.0), tilt=(0.0, 0.0), step=0.1, scans=1)
    search.run(1000)
    # Ahead and at the limit it looks for the pause, some 10 ticks each; the 16 places beyond it take a tick each.
    assert len(search.bench.head.times) < 50


def test_a_halt_stops_the_head_once() -> None:
    search = Search(**SMALL)
    search.run(3)
    assert search.bench.halt(search.leaf)
    assert search.bench.halt(search.leaf)
    assert search.bench.head.commands.count(STOP) == 1


@pytest.mark.parametrize("reading", [none(), stale(HeadPose(0.7, 0.0))])
def test_offline_head_does_not_skip_the_route(reading: Reading[HeadPose]) -> None:
    search = Search(**SMALL, scans=1)
    search.bench.head.reading = reading
    search.bench.head.trouble = OFFLINE_ERROR
    for _ in range(50):
        assert search.tick() is RUNNING
    assert search.leaf.reason == "waiting: the cable is out"
    search.bench.head.trouble = None
    assert search.run(1000) is FAILURE
    assert search.poses[-6:] == SMALL_ROUTE


def test_pose_is_sent_again_after_a_head_disconnect() -> None:
    search = Search(**SMALL, scans=1)
    while len(search.poses) < 3:
        search.tick()
    goal = search.poses[-1]
    search.bench.head.reading = stale(AHEAD)
    search.bench.head.trouble = OFFLINE_ERROR
    for _ in range(50):
        search.tick(arrives=False)
    search.bench.head.trouble = None
    search.bench.head.commands.clear()
    assert search.run(1000) is FAILURE
    assert search.poses == SMALL_ROUTE[SMALL_ROUTE.index(goal) :]


def test_search_fails_on_a_head_fault() -> None:
    search = Search(**SMALL)
    search.bench.head.trouble = DeviceFault("head: servo 1 stalls")
    assert search.tick() is FAILURE
    assert search.leaf.reason == "head: servo 1 stalls"
    assert search.bench.head.commands == [STOP]


def test_second_search_dwells_at_the_current_pose_again() -> None:
    search = Search(**SMALL, pause=0.5)
    search.run(5)
    search.bench.halt(search.leaf)
    search.bench.clock.advance(60.0)
    search.bench.head.commands.clear()
    search.run(9)
    assert search.poses == [AHEAD]


@pytest.mark.parametrize("ending", ["found", "gave up", "halted"])
def test_second_search_starts_at_the_current_head_pose(ending: str) -> None:
    search = Search(**SMALL, scans=1)
    search.run(20)
    if ending == "found":
        seen(search.bench, age=0.05)
        assert search.tick() is SUCCESS
    elif ending == "gave up":
        assert search.run(1000) is FAILURE
    else:
        assert search.bench.halt(search.leaf)
    here = search.bench.head.reading.value
    search.bench.head.commands.clear()
    search.bench.sight.seen = ()
    assert search.run(1000) is FAILURE
    assert search.poses == [pose for n, pose in enumerate([here, *SMALL_ROUTE]) if n != 1 or pose != here]


# --- the route -------------------------------------------------------------------------------------------------------

spans = st.tuples(st.integers(-90, 90), st.integers(-90, 90)).map(
    lambda degrees: (math.radians(min(degrees)), math.radians(max(degrees)))
)


@given(spans, spans, st.floats(0.1, 1.0))
def test_search_route_covers_the_area_with_small_enough_steps(
    pan: tuple[float, float], tilt: tuple[float, float], step: float
) -> None:
    route = list(serpentine(pan, tilt, step))
    assert len(set(route)) == len(route)
    for values, (low, high) in (({pose.pan for pose in route}, pan), ({pose.tilt for pose in route}, tilt)):
        places = sorted(values)
        assert (places[0], places[-1]) == (low, high)
        assert all(after - before <= step + 1e-6 for before, after in pairwise(places))
    assert len(route) == len({pose.pan for pose in route}) * len({pose.tilt for pose in route})


@given(spans, spans, st.floats(0.1, 1.0))
def test_the_route_goes_from_place_to_neighbouring_place_and_from_below_upwards(
    pan: tuple[float, float], tilt: tuple[float, float], step: float
) -> None:
    route = list(serpentine(pan, tilt, step))
    assert (route[0].pan, route[0].tilt) == (pan[0], tilt[1])
    for before, after in pairwise(route):
        assert (before.pan == after.pan) != (before.tilt == after.tilt)
        assert abs(after.pan - before.pan) <= step + 1e-6
        assert 0 <= before.tilt - after.tilt <= step + 1e-6


def test_a_span_without_width_is_one_row() -> None:
    assert list(serpentine((-0.5, 0.5), (0.1, 0.1), 0.5)) == [HeadPose(pan, 0.1) for pan in (-0.5, 0.0, 0.5)]
    assert list(serpentine((0.2, 0.2), (0.1, 0.1), 0.5)) == [HeadPose(0.2, 0.1)]
