"""Keyframes as motion: through every keyframe, smooth, and never faster than a joint can go."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from behaviours.keyframe_playback import PEAK_SPEED_FACTORS, KeyframeMotion, lay_out
from drivers.api import Interpolation, Keyframe

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
ways = st.sampled_from(list(PEAK_SPEED_FACTORS))


def sampled(playing: KeyframeMotion, count: int = 400) -> list[tuple[float, Mapping[str, float]]]:
    times = [playing.duration * n / count for n in range(count + 1)]
    return [(time, playing.at(time)) for time in times]


@given(starts, gestures(), paces, ways)
def test_gesture_never_exceeds_joint_speeds(
    start: Mapping[str, float],
    keyframes: Sequence[Keyframe],
    pace: float,
    way: Interpolation,
) -> None:
    samples = sampled(lay_out(start, keyframes, SPEEDS, pace=pace, interpolation=way))
    for (before, here), (after, there) in pairwise(samples):
        for joint in JOINTS:
            assert abs(there[joint] - here[joint]) <= SPEEDS[joint] * (after - before) * (1 + 1e-6) + 1e-9


@given(starts, gestures(), paces, ways)
def test_gesture_passes_every_keyframe_no_earlier_than_recorded(
    start: Mapping[str, float],
    keyframes: Sequence[Keyframe],
    pace: float,
    way: Interpolation,
) -> None:
    playing = lay_out(start, keyframes, SPEEDS, pace=pace, interpolation=way)
    expected = dict(start)
    for frame, time in zip(keyframes, playing.times[1:], strict=True):
        expected |= frame.positions
        assert time >= frame.time / pace - 1e-9
        if time > playing.times[0] and playing.times.count(time) == 1:
            assert playing.at(time) == pytest.approx(expected)
    assert playing.at(playing.duration) == expected
    assert playing.at(0.0) == start


@given(starts, gestures(), st.floats(-1.0, 1.2), ways)
def test_gesture_stays_within_the_range_of_adjacent_keyframes(
    start: Mapping[str, float],
    keyframes: Sequence[Keyframe],
    share: float,
    way: Interpolation,
) -> None:
    playing = lay_out(start, keyframes, SPEEDS, interpolation=way)
    at = playing.at(share * playing.duration)
    for joint in JOINTS:
        stops = [start[joint], *(frame.positions[joint] for frame in keyframes if joint in frame.positions)]
        assert min(stops) - 1e-9 <= at[joint] <= max(stops) + 1e-9


def test_feasible_gesture_keeps_its_times() -> None:
    keyframes = [Keyframe(1.0, {"elbow": 0.5}), Keyframe(3.0, {"elbow": 0.0})]
    assert lay_out({"elbow": 0.0}, keyframes, SPEEDS).times == (0.0, 1.0, 3.0)
    assert lay_out({"elbow": 0.0}, keyframes, SPEEDS, pace=0.5).times == (0.0, 2.0, 6.0)


def test_only_too_fast_segments_are_stretched() -> None:
    keyframes = [Keyframe(0.1, {"elbow": 1.6}), Keyframe(1.1, {"elbow": 1.5})]
    needed = PEAK_SPEED_FACTORS["minimum_jerk"] * 1.6 / SPEEDS["elbow"]
    assert lay_out({"elbow": 0.0}, keyframes, SPEEDS).times == pytest.approx((0.0, needed, needed + 1.0))


def test_the_slowest_joint_sets_the_time_of_a_segment() -> None:
    playing = lay_out({"shoulder": 0.0, "wrist": 0.0}, [Keyframe(0.1, {"shoulder": 0.8, "wrist": 0.8})], SPEEDS)
    assert playing.duration == pytest.approx(PEAK_SPEED_FACTORS["minimum_jerk"])
    assert playing.at(playing.duration / 2) == pytest.approx({"shoulder": 0.4, "wrist": 0.4})


def test_minimum_jerk_segments_start_and_end_at_rest() -> None:
    playing = lay_out({"wrist": 0.0}, [Keyframe(2.0, {"wrist": 1.0})], SPEEDS)
    step = 1e-4

    def speed(time: float) -> float:
        return (playing.at(time + step)["wrist"] - playing.at(time - step)["wrist"]) / (2 * step)

    assert speed(step) == pytest.approx(0.0, abs=1e-3)
    assert speed(2.0 - step) == pytest.approx(0.0, abs=1e-3)
    assert speed(1.0) == pytest.approx(PEAK_SPEED_FACTORS["minimum_jerk"] / 2.0, rel=1e-4)


def test_joint_without_a_keyframe_does_not_move() -> None:
    playing = lay_out(
        {"elbow": 0.3, "wrist": 0.0}, [Keyframe(1.0, {"wrist": 1.0}), Keyframe(2.0, {"elbow": 0.0})], SPEEDS
    )
    assert playing.at(0.7)["elbow"] == 0.3
    assert playing.at(1.7)["wrist"] == 1.0


def test_gesture_is_constant_before_its_start_and_after_its_end() -> None:
    playing = lay_out({"wrist": 0.2}, [Keyframe(1.0, {"wrist": 1.0})], SPEEDS)
    assert playing.at(-math.inf) == {"wrist": 0.2}
    assert playing.at(math.inf) == {"wrist": 1.0}


def test_keyframes_at_the_same_time_and_place_take_no_time() -> None:
    playing = lay_out({"wrist": 0.2}, [Keyframe(0.0, {"wrist": 0.2}), Keyframe(0.0, {"wrist": 0.2})], SPEEDS)
    assert playing.duration == 0.0
    assert playing.at(0.0) == {"wrist": 0.2}


# --- through the keyframes instead of halting at them ----------------------------------------------------------------


def slope(playing: KeyframeMotion, time: float, joint: str = "wrist", step: float = 1e-4) -> float:
    return (playing.at(time + step)[joint] - playing.at(time - step)[joint]) / (2 * step)


RISE = [Keyframe(0.1 * n, {"wrist": 0.05 * n}) for n in range(1, 11)]


def test_cubic_interpolation_is_even_through_collinear_keyframes() -> None:
    playing = lay_out({"wrist": 0.05}, RISE, SPEEDS, interpolation="cubic")
    assert [slope(playing, time) for time in playing.times[2:-1]] == pytest.approx([0.5] * 8, rel=1e-3)


def test_cubic_rests_at_the_start_at_the_first_keyframe_and_in_the_end() -> None:
    playing = lay_out({"wrist": 0.3}, RISE, SPEEDS, interpolation="cubic")
    for time in (1e-4, playing.times[1], playing.duration - 1e-4):
        assert slope(playing, time) == pytest.approx(0.0, abs=0.02)


def test_cubic_is_smooth_at_every_keyframe() -> None:
    turns = [Keyframe(0.5 * n, {"wrist": angle}) for n, angle in enumerate([0.1, 0.4, 0.5, 0.2, 0.2, 0.9], 1)]
    playing = lay_out({"wrist": 0.0}, turns, SPEEDS, interpolation="cubic")
    for time in playing.times[1:-1]:
        assert slope(playing, time - 2e-4) == pytest.approx(slope(playing, time + 2e-4), abs=0.02)


def test_cubic_interpolation_with_one_keyframe_ends_at_rest() -> None:
    playing = lay_out({"wrist": 0.0}, [Keyframe(1.0, {"wrist": 1.0})], SPEEDS, interpolation="cubic")
    assert playing.at(0.5) == pytest.approx({"wrist": 0.5})
    assert slope(playing, 0.5) == pytest.approx(PEAK_SPEED_FACTORS["cubic"], rel=1e-3)


def test_linear_interpolation_is_straight_and_speed_limited() -> None:
    throw = [Keyframe(1.0, {"wrist": 1.0}), Keyframe(1.1, {"wrist": 0.0})]
    playing = lay_out({"wrist": 0.0}, throw, SPEEDS, interpolation="linear")
    assert playing.times == pytest.approx((0.0, 1.0, 1.0 + 1.0 / SPEEDS["wrist"]))
    assert [slope(playing, time) for time in (0.1, 0.9, 1.01)] == pytest.approx([1.0, 1.0, -SPEEDS["wrist"]])


@given(starts, gestures(), ways, st.floats(0.1, 2.0))
def test_the_run_in_is_slow_and_the_rest_is_not(
    start: Mapping[str, float],
    keyframes: Sequence[Keyframe],
    way: Interpolation,
    run_in: float,
) -> None:
    usual = lay_out(start, keyframes, SPEEDS, interpolation=way)
    slow = lay_out(start, keyframes, SPEEDS, interpolation=way, run_in=run_in)
    later = slow.times[1] - usual.times[1]
    assert slow.times[1:] == pytest.approx([time + later for time in usual.times[1:]])
    count = 200
    samples = [slow.at(slow.times[1] * n / count) for n in range(count + 1)]
    for here, there in pairwise(samples):
        for joint in JOINTS:
            assert abs(there[joint] - here[joint]) <= run_in * slow.times[1] / count * (1 + 1e-6) + 1e-9
