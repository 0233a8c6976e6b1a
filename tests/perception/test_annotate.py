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
