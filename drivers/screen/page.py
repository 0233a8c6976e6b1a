"""The page that shows the face: it only draws, and moves what it has drawn towards the newest numbers."""

import hashlib
import json
from functools import cache, lru_cache
from importlib.resources import files
from string import Template

from drivers.api import Mood, Shown
from drivers.screen.drawing import draw
from drivers.screen.expression import Expression, expression
from drivers.screen.svg import numbers, svg
from drivers.screen.words import plain

HERE = files(__name__.rpartition(".")[0])
"""The folder of ``page.html``, ``page.js`` and ``page.css``."""


@cache
def asset(name: str) -> str:
    """Return the text of a file beside this one."""
    return (HERE / name).read_text(encoding="utf-8")


@cache
def edition() -> str:
    """Return what tells this page from those of other releases: a page that is out of date loads itself again."""
    shapes = [(shape.fill, shape.line, len(shape.points)) for shape in draw(expression(Shown(), 0.0)).shapes]
    parts = (asset("page.html"), asset("page.js"), asset("page.css"), repr(shapes))
    return hashlib.sha256("".join(parts).encode()).hexdigest()[:12]


def page(shown: Shown, time: float) -> str:
    """Return the whole page, with the face as it is at ``time`` (seconds), so that it is there at first sight."""
    asleep = news(Shown(Mood.ASLEEP), 1.0)
    return Template(asset("page.html")).substitute(face=picture(shown, time), edition=edition(), asleep=asleep)


def picture(shown: Shown, time: float, size: tuple[int, int] | None = None) -> str:
    """Return the face at ``time`` as SVG; ``size`` as for ``svg``."""
    return svg(expression(shown, time), shown.text, size, label=label(shown))


def news(shown: Shown, time: float) -> str:
    """Return a line of JSON: everything that the page needs to show the face at ``time``."""
    return _told(expression(shown, time), shown.text, label(shown))


@lru_cache(maxsize=4)  # a face is still for most of the time, and all pages show the same
def _told(face: Expression, text: str, label: str) -> str:
    drawing = draw(face, text)
    told = {
        "edition": edition(),
        "label": label,
        "shapes": [numbers(shape) for shape in drawing.shapes],
        "lines": drawing.words.lines,
        "size": round(drawing.words.size, 1),
        "feet": [round(foot, 1) for foot in drawing.words.feet],
    }
    return json.dumps(told, separators=(",", ":"))


def label(shown: Shown) -> str:
    """Return in words what is shown, for those who do not see it."""
    text = plain(shown.text)
    return f"{shown.mood} face: {text}" if text else f"{shown.mood} face"
