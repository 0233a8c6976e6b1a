"""Keyframes as motion: through every keyframe, smooth, and never faster than a joint can go."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.playing import PEAK, Playing, slowed
from drivers.api import Keyframe

JOINTS = ("shoulder", "elbow", "wrist")
SPEEDS = {"shoulder": 0.8, "elbow": 2.0, "wrist": 5.0}

angles = st.floats(-2.5, 2.5)


@st.composite
def gestures(draw: st.DrawFn) -> list[Keyframe]:
    """Keyframes in rising order of time, each with some of the joints."""
    times = sorted(draw(st.lists(st.floats(0.0, 6.0), min_size=1, max_size=6)))
    some = st.dictionaries(st.sampled_from(JOINTS), angles, min_size=1)
    return [Keyframe(time, draw(some)) for time in times]


starts = st.fixed_dictionaries(dict.fromkeys(JOINTS, angles))
paces = st.floats(0.1, 2.0)


def sampled(playing: Playing, count: int = 400) -> list[tuple[float, Mapping[str, float]]]:
    times = [playing.duration * n / count for n in range(count + 1)]
    return [(time, playing.at(time)) for time in times]


@given(starts, gestures(), paces)
def test_no_joint_is_ever_asked_to_go_faster_than_it_can(
    start: Mapping[str, float], keyframes: Sequence[Keyframe], pace: float
) -> None:
    samples = sampled(slowed(start, keyframes, SPEEDS, pace=pace))
    for (before, here), (after, there) in pairwise(samples):
        for joint in JOINTS:
            assert abs(there[joint] - here[joint]) <= SPEEDS[joint] * (after - before) * (1 + 1e-6) + 1e-9


@given(starts, gestures(), paces)
def test_it_passes_through_every_keyframe_no_earlier_than_recorded(
    start: Mapping[str, float], keyframes: Sequence[Keyframe], pace: float
) -> None:
    playing = slowed(start, keyframes, SPEEDS, pace=pace)
    expected = dict(start)
    for frame, time in zip(keyframes, playing.times[1:], strict=True):
        expected |= frame.positions
        assert time >= frame.time / pace - 1e-9
    assert playing.at(playing.duration) == expected
    assert playing.at(0.0) == start


@given(starts, gestures(), st.floats(-1.0, 1.2))
def test_it_never_leaves_the_range_between_two_keyframes(
    start: Mapping[str, float], keyframes: Sequence[Keyframe], share: float
) -> None:
    playing = slowed(start, keyframes, SPEEDS)
    at = playing.at(share * playing.duration)
    for joint in JOINTS:
        stops = [start[joint], *(frame.positions[joint] for frame in keyframes if joint in frame.positions)]
        assert min(stops) - 1e-9 <= at[joint] <= max(stops) + 1e-9


def test_a_gesture_that_the_joints_can_follow_keeps_its_times() -> None:
    keyframes = [Keyframe(1.0, {"elbow": 0.5}), Keyframe(3.0, {"elbow": 0.0})]
    assert slowed({"elbow": 0.0}, keyframes, SPEEDS).times == (0.0, 1.0, 3.0)
    assert slowed({"elbow": 0.0}, keyframes, SPEEDS, pace=0.5).times == (0.0, 2.0, 6.0)


def test_only_the_segments_that_are_too_fast_are_slowed_and_the_rest_follows_later() -> None:
    keyframes = [Keyframe(0.1, {"elbow": 1.6}), Keyframe(1.1, {"elbow": 1.5})]
    needed = PEAK * 1.6 / SPEEDS["elbow"]
    assert slowed({"elbow": 0.0}, keyframes, SPEEDS).times == pytest.approx((0.0, needed, needed + 1.0))


def test_the_slowest_joint_sets_the_time_of_a_segment() -> None:
    playing = slowed({"shoulder": 0.0, "wrist": 0.0}, [Keyframe(0.1, {"shoulder": 0.8, "wrist": 0.8})], SPEEDS)
    assert playing.duration == pytest.approx(PEAK)
    assert playing.at(PEAK / 2) == pytest.approx({"shoulder": 0.4, "wrist": 0.4})


def test_it_starts_and_ends_each_segment_at_rest_and_is_fastest_in_the_middle() -> None:
    playing = slowed({"wrist": 0.0}, [Keyframe(2.0, {"wrist": 1.0})], SPEEDS)
    step = 1e-4

    def speed(time: float) -> float:
        return (playing.at(time + step)["wrist"] - playing.at(time - step)["wrist"]) / (2 * step)

    assert speed(step) == pytest.approx(0.0, abs=1e-3)
    assert speed(2.0 - step) == pytest.approx(0.0, abs=1e-3)
    assert speed(1.0) == pytest.approx(PEAK / 2.0, rel=1e-4)


def test_a_joint_that_a_keyframe_does_not_name_stays() -> None:
    playing = slowed(
        {"elbow": 0.3, "wrist": 0.0}, [Keyframe(1.0, {"wrist": 1.0}), Keyframe(2.0, {"elbow": 0.0})], SPEEDS
    )
    assert playing.at(0.7)["elbow"] == 0.3
    assert playing.at(1.7)["wrist"] == 1.0


def test_before_the_start_and_after_the_end_it_stands_still() -> None:
    playing = slowed({"wrist": 0.2}, [Keyframe(1.0, {"wrist": 1.0})], SPEEDS)
    assert playing.at(-math.inf) == {"wrist": 0.2}
    assert playing.at(math.inf) == {"wrist": 1.0}


def test_keyframes_at_the_same_time_and_place_take_no_time() -> None:
    playing = slowed({"wrist": 0.2}, [Keyframe(0.0, {"wrist": 0.2}), Keyframe(0.0, {"wrist": 0.2})], SPEEDS)
    assert playing.duration == 0.0
    assert playing.at(0.0) == {"wrist": 0.2}
