"""How late a camera stamps its pictures: learnt from the background, whatever people do in front of it."""

from collections.abc import Callable
from copy import deepcopy
from math import cos, radians, sin, sqrt
from random import Random

import cv2
import numpy as np
import pytest

from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from perception.api import Gaze, Image
from perception.delay import MAX_KNOWN_SPREAD, MAX_REST, PRIOR_SPREAD, CameraDelay, ExposedFrame, ExposureEstimator
from perception.delay_grid import GRID
from perception.exposure_clock import MIN_DELAY
from perception.geometry import Pinhole
from perception.levelling import level_columns
from perception.scene_motion import find_shift
from tests.perception.rendered import CAMERA, LENS

PERIOD = 0.05
"""Seconds between two pictures."""

Path = Callable[[float], float]


def swing(time: float) -> float:
    """A head that looks to and fro by 15 degrees, as when it searches."""
    return radians(15) * sin(2.0 * time)


@pytest.fixture(scope="module")
def room() -> Renderer:
    return Renderer(SimulatedWorld(), LENS)


def learnt(
    room: Renderer, late: float, *, path: Path = swing, seconds: float = 3.0, told: float = 0.0
) -> ExposureEstimator:
    """Let a camera on a head that moves along ``path`` stamp its pictures ``late`` seconds after their exposure."""
    exposures = ExposureEstimator(lambda time: Gaze(path(time), 0.0), CameraDelay(told))
    for n in range(int(seconds / PERIOD)):
        time = 10.0 + n * PERIOD
        image = room.draw(Viewpoint(0.3, 0.2, 0.7, path(time), 0.0), time)
        exposures.expose(ExposedFrame(image, time + late), CAMERA)
    return exposures


def test_the_delay_is_known_within_10_ms_after_3_s_of_looking_about(room: Renderer) -> None:
    for late in (-0.05, 0.0, 0.03, 0.06, 0.15):
        delay = learnt(room, late).delay
        assert delay.seconds == pytest.approx(late, abs=0.01)
        assert delay.spread < 0.015


def test_still_camera_learns_no_delay_and_reads_no_pixels(room: Renderer) -> None:
    exposures = learnt(room, 0.05, path=lambda _: 0.2, told=0.02)
    assert (exposures.delay.seconds, exposures.delay.spread, exposures.delay.informative_pairs) == (
        0.02,
        PRIOR_SPREAD,
        0,
    )


def test_resting_camera_asks_few_poses_and_reads_no_pixels() -> None:
    asked: list[float] = []

    def gaze(time: float) -> Gaze:
        asked.append(time)
        return Gaze(swing(min(time, 12.0)), 0.0)

    exposures, unseen = (
        ExposureEstimator(gaze, CameraDelay()),
        np.zeros((0, 0, 3), np.uint8),
    )  # which nobody could make smaller
    image: Image = np.zeros((480, 640, 3), np.uint8)
    for n in range(80):
        time = 10.0 + n * PERIOD
        if time < 12.5:
            exposures.expose(ExposedFrame(image, time), CAMERA)
            continue
        asked.clear()
        exposures.expose(ExposedFrame(unseen, time), CAMERA)
        assert len(asked) <= 3


def test_pictures_get_the_time_of_their_exposure_and_never_go_back(room: Renderer) -> None:
    exposures = learnt(room, 0.06)
    image = room.draw(Viewpoint(0.3, 0.2, 0.7, 0.0, 0.0), 0.0)
    first = exposures.expose(ExposedFrame(image, 20.06), CAMERA)
    assert first.stamp == pytest.approx(20.0, abs=0.01)
    assert first.image is image
    assert exposures.expose(ExposedFrame(image, 20.06), CAMERA).stamp > first.stamp


def test_where_the_camera_looked_is_not_known_nothing_is_learnt_and_nothing_lost() -> None:
    exposures = ExposureEstimator(lambda _: None, CameraDelay(0.04))
    image: Image = np.zeros((480, 640, 3), np.uint8)
    assert exposures.expose(ExposedFrame(image, 1.0), CAMERA).stamp == pytest.approx(0.96)


def test_background_shift_is_accurate_to_a_quarter_of_a_degree(room: Renderer) -> None:
    for turn in (1, 3, 6, 9, -6):
        pictures = [room.draw(Viewpoint(0.3, 0.2, 0.7, radians(yaw), 0.0), 0.0) for yaw in (20, 20 + turn)]
        moved = find_shift(*(level_columns(picture, CAMERA) for picture in pictures))
        assert moved is not None
        assert moved[0] * 60 / 160 == pytest.approx(turn, abs=0.3)


def turned(
    delay: CameraDelay,
    path: Path,
    late: float,
    *,
    start: float,
    pictures: int,
    wrong: int = 0,
    jitter: Callable[[], float] = lambda: 0.0,
) -> None:
    """Let a camera turn along ``path``, with stamps that are ``late``; each ``wrong``-th turn is seen the other way."""
    before = np.array([path(start + late - each) for each in GRID])
    delay.start_chain(before)
    for n in range(1, pictures):
        time = start + n * PERIOD
        stamp = time + late + jitter()
        yaws = np.array([path(stamp - each) for each in GRID])
        true = path(time) - path(time - PERIOD)
        delay.learn(-true if wrong and n % wrong == 0 else true, yaws - before, yaws)
        before = yaws


def test_inconsistent_pairs_have_little_weight() -> None:
    delay = CameraDelay()
    turned(delay, swing, 0.05, start=1.0, pictures=60, wrong=4)  # somebody walked by close in front
    assert delay.seconds == pytest.approx(0.05, abs=0.01)


def test_changed_delay_is_learnt_again() -> None:
    delay = CameraDelay()
    turned(delay, lambda time: radians(40) * cos(time), 0.02, start=0.0, pictures=400)
    assert delay.seconds == pytest.approx(0.02, abs=0.01)
    turned(delay, lambda time: radians(40) * cos(time), 0.08, start=20.0, pictures=400)
    assert delay.seconds == pytest.approx(0.08, abs=0.01)


def uniform(random: Random, most: float) -> Callable[[], float]:
    """Return what draws the jitter of a stamp, up to ``most`` seconds to both sides."""
    return lambda: random.uniform(-most, most)


def test_constant_turn_with_jittering_stamps_teaches_jitter_and_no_delay() -> None:
    for most in (0.0, 0.02, 0.03):
        for seed in range(12):
            random, delay = Random(seed), CameraDelay(0.03)  # noqa: S311 - noise is no secret
            turned(
                delay,
                lambda time: radians(20) * time,
                0.0,
                start=1.0,
                pictures=200,
                jitter=uniform(random, most),
            )
            assert (delay.seconds, delay.is_known) == (0.03, False)
            assert delay.jitter == pytest.approx(most / sqrt(3), abs=0.006)


def test_jitter_widens_the_spread_of_a_known_delay() -> None:
    spreads = []
    for most in (0.0, 0.03):
        random, delay = Random(7), CameraDelay()  # noqa: S311 - noise is no secret
        for n in range(20):
            turned(
                delay,
                swing,
                0.04,
                start=1.0 + n,
                pictures=20,
                jitter=uniform(random, most),
            )
            assert not delay.is_known or abs(delay.seconds - 0.04) <= 0.015
            if n == 2:
                spreads.append(delay.spread)
        assert delay.is_known == (most == 0.0)
        assert delay.seconds == pytest.approx(0.04, abs=0.015)
    assert spreads[0] < spreads[1]


def test_delay_at_an_edge_of_the_grid_or_before_any_possible_exposure_is_never_known() -> None:
    for late in (-0.2, -0.12, -0.09, 0.26, 0.35):
        delay = CameraDelay()
        turned(delay, lambda time: radians(20) * sin(6 * time), late, start=1.0, pictures=200)
        assert not delay.is_known
        assert MIN_DELAY - 0.04 <= delay.seconds <= GRID[-1] - 0.02


def test_occasional_200_ms_stamp_errors_are_harmless() -> None:
    random, delay = Random(3), CameraDelay()  # noqa: S311 - noise is no secret
    turned(
        delay,
        lambda time: radians(20) * sin(4 * time),
        0.03,
        start=1.0,
        pictures=300,
        jitter=lambda: random.choice((-0.2, 0.2)) if random.random() < 0.05 else 0.0,
    )
    assert delay.is_known
    assert delay.seconds == pytest.approx(0.03, abs=0.01)


def test_changed_delay_is_doubted_within_a_few_pictures_of_a_turn() -> None:
    delay = CameraDelay()
    path: Path = lambda time: radians(20) * sin(6 * time)  # noqa: E731
    turned(delay, path, 0.0, start=0.0, pictures=100)
    turned(delay, path, 0.0, start=10.0, pictures=6)
    assert delay.doubt < radians(1.5)
    for change in (0.08, -0.08):
        doubts = []
        for pictures in range(2, 8):
            changed = deepcopy(delay)
            turned(changed, path, change, start=10.0, pictures=pictures)
            doubts.append(changed.doubt)
        assert max(doubts) > radians(2)
        assert changed.seconds == pytest.approx(change, abs=0.03)
        assert not changed.is_known, "it is to be confirmed first"


def test_contradicted_delay_is_reported() -> None:
    delay = CameraDelay(0.12)
    assert not delay.contradicts(0.12)
    turned(delay, swing, 0.0, start=0.0, pictures=60)
    assert delay.contradicts(0.12)
    assert not delay.contradicts(0.0)


def sweep(time: float) -> float:
    """A head that goes to and fro by 10 degrees at 60 degrees/s, and waits a little at each end."""
    phase = time % 1.0
    return radians(10) * min(max(6 * min(phase, 1.0 - phase) - 1, -1.0), 1.0)


def swept(exposures: ExposureEstimator, late: float, *, start: float, seconds: float) -> int:
    """Let a camera on a sweeping head stamp its pictures ``late``; return from how many pairs something was learnt."""
    strip = cv2.GaussianBlur(np.random.default_rng(3).integers(0, 256, (120, 480, 3), np.uint8), (0, 0), 3)
    camera, before = Pinhole(160, 120, radians(20)), exposures.delay.informative_pairs
    for n in range(int(seconds / PERIOD)):
        time = start + n * PERIOD
        left = 160 - round(sweep(time) / radians(20) * 160)
        image: Image = np.asarray(strip[:, left : left + 160], np.uint8)
        exposures.expose(ExposedFrame(image, time + late), camera)
    return exposures.delay.informative_pairs - before


def test_known_delay_is_checked_rarely() -> None:
    exposures = ExposureEstimator(lambda time: Gaze(sweep(time), 0.0), CameraDelay())
    swept(exposures, 0.03, start=10.0, seconds=10.0)
    pairs = swept(exposures, 0.03, start=20.0, seconds=20.0)
    assert exposures.delay.seconds == pytest.approx(0.03, abs=0.005)
    assert exposures.delay.spread <= MAX_KNOWN_SPREAD
    assert 0 < pairs < 20.0 / PERIOD / 4


def test_changed_known_delay_is_learnt_within_seconds() -> None:
    exposures = ExposureEstimator(lambda time: Gaze(sweep(time), 0.0), CameraDelay())
    swept(exposures, 0.03, start=10.0, seconds=20.0)
    swept(exposures, 0.07, start=30.0, seconds=MAX_REST + 6.0)
    assert exposures.delay.seconds == pytest.approx(0.07, abs=0.01)


def test_changed_delay_ends_the_rest_with_the_next_turn() -> None:
    exposures = ExposureEstimator(lambda time: Gaze(sweep(time), 0.0), CameraDelay())
    swept(exposures, 0.03, start=10.0, seconds=10.0)
    swept(exposures, 0.11, start=20.0, seconds=2.0)
    assert exposures.delay.seconds == pytest.approx(0.11, abs=0.015)


def test_clock_set_back_does_not_end_the_learning() -> None:
    exposures = ExposureEstimator(lambda time: Gaze(sweep(time), 0.0), CameraDelay())
    swept(exposures, 0.03, start=1000.0, seconds=10.0)
    assert swept(exposures, 0.03, start=10.0, seconds=3.0) > 0
