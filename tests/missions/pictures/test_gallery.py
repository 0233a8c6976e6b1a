"""The golden files: every dump of every shipped mission is as it was, or `make docs` has to say why not."""

import re
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np
import pytest

from docs.dumps import GALLERY, LINKED, PAGES, ROOT, dumps, is_stale, look_alike
from missions.library import shipped_missions
from missions.pictures.forms import FORMS, SUFFIXES

OF_PY_TREES = (".unicode", ".ascii", ".dot")
"""Forms that py_trees and pydot draw, each release in its own way."""

DUMPS = dumps()


def pinned(package: str) -> str:
    """The release that constraints.txt asks for."""
    found = re.search(rf"^{package}==(\S+)", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None
    return found[1]


@pytest.mark.parametrize("path", DUMPS, ids=lambda path: path.name)
def test_a_dump_is_the_golden_one_and_tells_nothing_of_the_machine_or_the_day(path: Path) -> None:
    for package in ("py-trees", "pydot") if path.suffix in OF_PY_TREES else ():
        if version(package) != pinned(package):
            pytest.skip(f"drawn with {package} {pinned(package)}, here is {version(package)}")
    made = DUMPS[path]()
    assert not is_stale(path, made), "`make docs` dumps it anew"
    if isinstance(made, str) and path.name != "tree.schema.json":
        assert str(ROOT) not in made
        assert not re.search(r"\b20\d\d-\d\d-\d\d\b|\b0x[0-9a-f]{6,}\b", made)


def test_every_mission_is_there_in_every_format_and_nothing_else_is() -> None:
    assert {SUFFIXES[path.suffix] for path in DUMPS} == set(FORMS)
    for name in shipped_missions():
        files = f"{name.replace('/', '-')}.*"
        there = {path.suffix for path in (*GALLERY.glob(files), *PAGES.glob(files))}
        assert there - {".png"} == {".svg", ".html", *LINKED} - {".png"}
    assert {*GALLERY.iterdir(), *PAGES.iterdir()} <= DUMPS.keys()


def test_pngs_are_compared_by_eye() -> None:
    image = np.full((40, 60, 3), 255, np.uint8)
    one, lighter = (cv2.imencode(".png", each)[1].tobytes() for each in (image, image - 1))
    cv2.rectangle(image, (5, 5), (20, 20), (0, 0, 0), -1)
    other, smaller = (cv2.imencode(".png", each)[1].tobytes() for each in (image, image[1:]))
    assert look_alike(one, lighter) is False  # a grey level everywhere is no longer the same
    assert look_alike(one, one)
    assert not look_alike(one, other)
    assert not look_alike(other, smaller)
    assert not look_alike(one, b"no picture")
