"""The golden files: the gallery shows each mission as it is, three in every form; else `make docs` says what to do."""

import re
from importlib.metadata import version

import cv2
import numpy as np
import pytest

from docs.dumps import GALLERY, IN_EVERY_FORM, LINKED, PAGES, ROOT, drawing, dump, dumps, is_stale, look_alike
from missions.cli.show import FORM_OF_SUFFIX, TREE_FORMS
from missions.library.shipped import shipped_missions

OF_PY_TREES = (".unicode", ".ascii", ".dot")
"""Forms that py_trees and pydot draw, each release in its own way."""


def pinned(package: str) -> str:
    """The release that constraints.txt asks for."""
    found = re.search(rf"^{package}==(\S+)", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None
    return found[1]


@pytest.mark.parametrize("suffix", [".svg", ".html", *LINKED])
def test_stored_dumps_are_up_to_date(suffix: str) -> None:
    for package in ("py-trees", "pydot") if suffix in OF_PY_TREES else ():
        if version(package) != pinned(package):
            pytest.skip(f"drawn with {package} {pinned(package)}, here is {version(package)}")
    stale = [path.name for path, make in dumps().items() if path.suffix == suffix and is_stale(path, make())]
    assert stale == [], "`make docs` dumps them anew"


@pytest.mark.parametrize("suffix", [suffix for suffix in (".html", *LINKED) if suffix != ".png"])
def test_dumps_contain_all_nodes_and_nothing_machine_specific(suffix: str) -> None:
    wrong = []
    for name in shipped_missions():
        made = str(dump(name, suffix))
        boxes = list(drawing(name).root.walk())
        lines = [box.line for box in boxes]
        if suffix != ".html":
            lines += [badge.line for box in boxes for badge in box.badges]
        told = [int(line) for line in re.findall(r'(?:\(line |"line": |\.yaml:)(\d+)', made)]
        of_here = str(ROOT) in made or re.search(r"\b20\d\d-\d\d-\d\d\b|\b0x[0-9a-f]{6,}\b", made)
        if of_here or sorted(told) != sorted(lines):
            wrong.append(name)
    assert wrong == []


def test_every_mission_is_in_the_gallery_three_in_every_form_and_nothing_else_is() -> None:
    assert {FORM_OF_SUFFIX[path.suffix] for path in dumps()} == set(TREE_FORMS)
    for name in shipped_missions():
        files = f"{name.replace('/', '-')}.*"
        there = {path.suffix for path in (*GALLERY.glob(files), *PAGES.glob(files))}
        assert there == ({".svg", ".html", *LINKED} if name in IN_EVERY_FORM else {".svg"}), name
    assert {*GALLERY.iterdir(), *PAGES.iterdir()} <= dumps().keys()


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
