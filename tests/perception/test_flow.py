"""Carrying a box from frame to frame."""

from typing import TYPE_CHECKING

import numpy as np
import pytest

from perception.api import Box
from perception.face_finder import track_box
from perception.image_preparation import GreyImage, to_grey

if TYPE_CHECKING:
    from tests.perception.conftest import Scene


@pytest.mark.parametrize("step", [(2.0, 0.0), (-20.0, 5.0), (45.0, -20.0)])
def test_face_is_carried_by_its_motion(scene: "Scene", step: tuple[float, float]) -> None:
    before, (box,) = scene((300, 240))
    after, (there,) = scene((300 + step[0], 240 + step[1]))
    carried = track_box(to_grey(before), to_grey(after), box)
    assert carried is not None
    assert carried.centre == pytest.approx(there.centre, abs=2.0)


def test_approaching_face_gets_a_larger_box(scene: "Scene") -> None:
    before, (box,) = scene((300, 240))
    after, (there,) = scene((300, 240), size=1.06)
    carried = track_box(to_grey(before), to_grey(after), box)
    assert carried is not None
    assert carried.width == pytest.approx(there.width, rel=0.03)


def test_vanished_face_is_not_carried(scene: "Scene") -> None:
    before, (box,) = scene((300, 240))
    noise = np.random.default_rng(1).integers(0, 255, (480, 640), dtype=np.uint8)
    assert track_box(to_grey(before), noise, box) is None


def test_a_blank_patch_has_nothing_to_follow() -> None:
    blank: GreyImage = np.full((480, 640), 90, dtype=np.uint8)
    assert track_box(blank, blank, Box(100, 100, 80, 80)) is None


def test_pictures_of_two_sizes_do_not_follow_each_other(scene: "Scene") -> None:
    before, (box,) = scene((300, 240))
    assert track_box(to_grey(before), to_grey(before)[:240], box) is None


def test_a_box_outside_the_picture_is_not_carried(scene: "Scene") -> None:
    before, _ = scene((300, 240))
    assert track_box(to_grey(before), to_grey(before), Box(-400, 0, 60, 60)) is None
