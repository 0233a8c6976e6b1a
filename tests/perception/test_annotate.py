"""Drawing on pictures."""

import numpy as np
import pytest

from perception.annotate import INK, annotate
from perception.api import Box


def test_a_box_is_drawn_on_a_copy() -> None:
    picture = np.full((240, 320, 3), 128, dtype=np.uint8)
    drawn = annotate(picture, [(Box(100, 80, 60, 50), "")])
    assert np.all(picture == 128)
    assert {tuple(drawn[80, x]) for x in range(100, 161)} == {INK}
    assert tuple(drawn[105, 130]) == (128, 128, 128)


def test_a_label_is_written_above_the_box() -> None:
    picture = np.full((240, 320, 3), 128, dtype=np.uint8)
    plain, labelled = (annotate(picture, [(Box(100, 80, 60, 50), label)]) for label in ("", "1"))
    changed = np.argwhere(np.any(plain != labelled, axis=2))
    assert len(changed) > 0
    assert changed[:, 0].max() <= 80
    assert changed[:, 1].min() >= 100


@pytest.mark.parametrize("box", [Box(-40, -40, 60, 60), Box(300, 220, 90, 90), Box(900, 900, 10, 10)])
def test_labels_stay_inside_the_picture(box: Box) -> None:
    picture = np.full((240, 320, 3), 128, dtype=np.uint8)
    plain, labelled = (annotate(picture, [(box, label)]) for label in ("", "face 12, 2.3 m"))
    assert np.count_nonzero(np.any(plain != labelled, axis=2)) > 500


@pytest.mark.parametrize("far", [float("inf"), float("-inf"), float("nan"), 3e9, -1e308])
def test_a_box_beyond_all_pictures_is_cut_off_or_left_out(far: float) -> None:
    image = np.zeros((40, 60, 3), np.uint8)
    for box in (Box(far, 5.0, 9.0, 9.0), Box(5.0, 5.0, far, 9.0), Box(5.0, 5.0, 9.0, far), Box(far, far, far, far)):
        assert annotate(image, [(box, "someone")]).shape == image.shape


def test_half_a_letter_in_a_label_is_a_question_mark() -> None:
    image = np.zeros((60, 200, 3), np.uint8)
    box = Box(20.0, 40.0, 9.0, 9.0)
    assert (annotate(image, [(box, "A\ud800")]) == annotate(image, [(box, "A?")])).all()
