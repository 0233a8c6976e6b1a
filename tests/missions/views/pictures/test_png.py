"""PNG pictures: as large as they should be, and with text on them, without any font of the machine."""

import sys

import cv2
import numpy as np
import pytest

from missions.library.shipped import load_mission
from missions.plugins.pictures.layout import lay_out
from missions.plugins.pictures.png import MAX_PIXELS, png
from missions.plugins.pictures.svg import HEADER, MARGIN, svg
from missions.trees.drawing_builder import drawing_of
from perception.api import Image


def pixels(data: bytes) -> Image:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return image.astype(np.uint8)


def test_png_text_is_drawn_at_its_layout_position() -> None:
    drawing = drawing_of(load_mission("greet"))
    image = pixels(png(svg(drawing), zoom=2.0))
    for placed in lay_out(drawing).cards:
        for line in placed.lines:
            x, y = MARGIN + placed.x + line.x, HEADER + placed.y + line.y
            around = image[2 * (y - 11) : 2 * (y + 4), 2 * x : 2 * (x + line.width)]
            assert int(around.max()) - int(around.min()) > 60, (placed.box.title, line.text)


def test_png_has_the_requested_size() -> None:
    picture = svg(drawing_of(load_mission("wave")))
    height, width = pixels(png(picture, zoom=1.0)).shape[:2]
    assert f'viewBox="0 0 {width} {height}"' in picture
    assert pixels(png(picture, zoom=2.0)).shape[:2] == (2 * height, 2 * width)


def test_a_huge_picture_is_drawn_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MAX_PIXELS >= 2000 * 4000
    monkeypatch.setattr("missions.plugins.pictures.png.MAX_PIXELS", 90_000)
    huge = '<svg xmlns="http://www.w3.org/2000/svg" width="1000" height="9000"></svg>'
    assert pixels(png(huge)).shape[:2] == (900, 100)


@pytest.mark.parametrize("missing", ["resvg_py", "matplotlib"])
def test_png_without_its_extra_raises_an_import_error(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ImportError):
        png("<svg/>")
