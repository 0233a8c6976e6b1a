"""The files of the studio's page: small, readable by day and by night, and closed to what a stranger may write."""

import re
from itertools import product
from pathlib import Path

from missions.plugins.studio.studio import PAGE_FOLDER
from tests.cases import each

FILES = sorted(PAGE_FOLDER.iterdir())
MOST_BYTES = 180_000


def test_the_page_is_small() -> None:
    assert sum(path.stat().st_size for path in FILES) < MOST_BYTES


@each("path", [path for path in FILES if path.suffix == ".js"])
def test_no_script_makes_markup_or_scripts_of_texts(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|srcdoc|"
        r"setAttribute\(\s*[\"']style|DOMParser|(?<![\w.])(alert|confirm|prompt)\(",
        text,
    )


def test_the_page_has_nothing_inline_and_nothing_from_elsewhere() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in FILES)
    page = (PAGE_FOLDER / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"<style|\sstyle=|\son\w+=|<script(?![^>]*src=)", page)
    assert set(re.findall(r"https?://[^\"'`\s)$]+", text)) == {"http://www.w3.org/2000/svg"}


def colours(scheme: str) -> dict[str, tuple[float, ...]]:
    text = (PAGE_FOLDER / "style.css").read_text(encoding="utf-8")
    day, _, night = text.partition("@media (prefers-color-scheme: dark)")
    found = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", day))
    if scheme == "dark":
        found |= dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", night))
    return {name: tuple(int(text[at : at + 2], 16) / 255 for at in (1, 3, 5)) for name, text in found.items()}


def luminance(colour: tuple[float, ...]) -> float:
    """Return the relative luminance of WCAG 2.2."""
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in colour]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


PAIRS = (
    *product(("ink", "soft"), ("ground", "surface", "band", "running-ground", "failure-ground", "warn-ground")),
    *product(("running", "success", "failure", "accent", "warn"), ("surface", "ground")),
    ("running", "running-ground"),
    ("success", "success-ground"),
    ("failure", "failure-ground"),
    ("on-accent", "accent"),
)


@each("scheme", ["light", "dark"])
def test_texts_are_readable_by_day_and_by_night(scheme: str) -> None:
    found = colours(scheme) | {"white": (1.0, 1.0, 1.0)}
    pairs = (*PAIRS, ("white", "red"))
    weak = {pair: round(contrast(found[pair[0]], found[pair[1]]), 2) for pair in pairs}
    assert {pair: ratio for pair, ratio in weak.items() if ratio < 4.5} == {}
