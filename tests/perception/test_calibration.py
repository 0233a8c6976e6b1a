"""Learning a lens from pictures of a chessboard, drawn through a lens that is known."""

from math import radians

import numpy as np
import pytest

from perception.api import Image
from perception.calibration import MIN_VIEWS, BoardViews, Chessboard, calibrate, find_board
from perception.geometry import Pinhole
from tests.perception.boards import BOARD, LENS, POSES, drawn


@pytest.fixture(scope="module")
def pictures() -> list[Image]:
    return [drawn(*pose) for pose in POSES]


def test_a_known_lens_is_recovered_within_a_hundredth(pictures: list[Image]) -> None:
    views = BoardViews(BOARD)
    assert sum(views.add(picture) for picture in pictures) >= MIN_VIEWS
    found = calibrate(views)
    focal = Pinhole(640, 480, found.field_of_view).focal
    assert focal == pytest.approx(LENS.focal, rel=0.01)
    assert found.centre == pytest.approx(LENS.centre, abs=0.01)
    assert found.error < 0.3
    assert 0.3 < found.nearest < found.farthest < 0.65


def test_calibrated_directions_are_accurate_to_a_third_of_a_degree(pictures: list[Image]) -> None:
    views = BoardViews(BOARD)
    for picture in pictures:
        views.add(picture)
    found = calibrate(views)
    learnt = Pinhole(640, 480, found.field_of_view, found.centre, found.distortion)
    for pixel in ((320, 240), (100, 80), (540, 400), (100, 400)):
        # A small shift of the centre is a small turn of the camera, which calibration can't tell apart.
        assert learnt.pixel_to_angles(*pixel) == pytest.approx(LENS.pixel_to_angles(*pixel), abs=radians(0.33))


def test_the_same_view_again_teaches_nothing(pictures: list[Image]) -> None:
    views = BoardViews(BOARD)
    assert views.add(pictures[0])
    assert not views.add(drawn(*POSES[0], noise=3.0))
    assert len(views.corners) == 1


def test_a_picture_without_the_whole_board_counts_for_nothing(pictures: list[Image]) -> None:
    assert find_board(np.full((480, 640, 3), 128, np.uint8), BOARD) is None
    assert find_board(pictures[0][:, 340:], BOARD) is None


def test_too_few_views_are_counted_for_the_user(pictures: list[Image]) -> None:
    views = BoardViews(BOARD)
    views.add(pictures[0])
    with pytest.raises(ValueError, match="1 different views of the board, 8 are needed"):
        calibrate(views)


def test_pictures_of_two_sizes_are_not_of_one_lens(pictures: list[Image]) -> None:
    views = BoardViews(BOARD)
    views.add(pictures[0])
    with pytest.raises(ValueError, match="320x240 after some of 640x480"):
        views.add(pictures[0][::2, ::2])


@pytest.mark.parametrize("board", [(2, 6, 0.025), (9, 2, 0.025), (9, 6, 0.0), (9, 6, float("nan"))])
def test_an_impossible_board_is_refused(board: tuple[int, int, float]) -> None:
    with pytest.raises(ValueError, match="a board"):
        Chessboard(*board)
