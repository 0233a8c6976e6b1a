"""What stands for a value on the page shows it, and each number has its unit."""

import json
from pathlib import Path

import pytest

from missions.executive.events import Ended
from missions.library.shipped import load_mission
from missions.plugins.records.retention import records_folder
from missions.trees.drawing_builder import first_values
from missions.trees.value_text import value_text
from tests.browser import Browser
from tests.missions.records.report.told_record import FAILED, items, write
from tests.missions.studio.page import Page
from tests.missions.studio.running import simulated_run
from tests.missions.studio.serving import Served
from tests.waiting import wait_until

KNOWN = {"greeting": "Hello", "side": "30 cm", "n": "3", "flag": "yes", "empty": "", "größe": "20 cm", "名前": "Yuki"}

FILLED = {
    "say: ${greeting}": "say: Hello",
    "${ greeting }, ${n} times": "Hello, 3 times",
    "${side * 2}": "30 cm * 2",
    "${min(n, 4) + n}": "min(3, 4) + 3",
    "${n > 2 and flag}": "3 > 2 and yes",
    "${greeting + ' n side'}": "Hello + ' n side'",
    "${side + 10 cm}": "30 cm + 10 cm",
    "${side + 1e-5 m}": "30 cm + 1e-5 m",
    "${empty}": "",
    "${größe}, ${名前}": "20 cm, Yuki",
    "${größe * 2 + side}": "20 cm * 2 + 30 cm",
    "${unknown}": "${unknown}",
    "${n + unknown} ${n}": "${n + unknown} 3",
    "${face.name}": "${face.name}",
    "${greeting.name}": "${greeting.name}",
    "${n[0]}": "${n[0]}",
    "no hole": "no hole",
    "${": "${",
    "${constructor}": "${constructor}",
}


def test_placeholders_are_filled_if_all_values_are_known(browser: Browser, served: Served) -> None:
    tab = Page(browser, served).tab
    found = tab.evaluate(
        f"import('./values.js').then(({{ filled }}) => {json.dumps(list(FILLED))}.map((text) =>"
        f" filled(text, (name) => new Map(Object.entries({json.dumps(KNOWN)})).get(name))"
        ".map((piece) => (Array.isArray(piece) ? piece[0] : piece)).join('')))"
    )
    assert dict(zip(FILLED, found, strict=True)) == FILLED


FIGURES = {
    ("x", 1.234): "x 1.23 m",
    ("heading", 1.5707963): "heading 90°",
    ("turn", -0.00001): "turn 0°/s",
    ("speed", 0.25): "speed 0.25 m/s",
    ("battery", 80.4): "battery 80 %",
    ("hottest", 41.0): "hottest 41 °C",
    ("joints", 6): "6 joints",
    ("requested_linear", 1e9): "requested linear 1000000000 m/s",
    ("tremble", 0.000123): "tremble 0.00012",
    ("face", "happy"): "face happy",
}


def test_each_number_of_a_part_or_command_has_its_unit(browser: Browser, served: Served) -> None:
    tab = Page(browser, served).tab
    asked = json.dumps(list(FIGURES))
    found = tab.evaluate(f"import('./words.js').then(({{ sized }}) => {asked}.map((each) => sized(...each)))")
    assert dict(zip(FIGURES, found, strict=True)) == FIGURES
    times = [0.04, 59.9, 185, 3785, 90000]
    assert tab.evaluate(f"import('./words.js').then(({{ seconds }}) => {times}.map(seconds))") == [
        "0.0 s", "59.9 s", "3:05 min", "1:03:05 h", "25:00:00 h",
    ]  # fmt: skip


PART = "mission: part\nparams:\n  word: Default\n  far: 20 cm\ntree:\n  say: ${word}\n"
WHOLE = """\
mission: whole
params:
  greeting: Hello
  share: 20 %
  flag: true
  list: [one, two]
  points: [{x: 1 m, y: 0 m}, {x: 2 m, y: 1 m}]
  small: 0.00001 m
tree:
  sequence:
    - say: ${greeting}
    - mission: part.yaml
      with: {word: "${greeting} you"}
    - mission: part.yaml
    - drive: 1 cm
      if: base.docked
    - wait: 1000 s
      name: waits ${small}
      timeout: ${small * 1e9 / 1 m * 1 s}
"""


def titles(page: Page) -> list[str]:
    return [
        str(each)
        for each in page.tab.evaluate("[...document.querySelectorAll('.node .title')].map((each) => each.textContent)")
    ]


def test_the_tree_shows_values_and_their_names_where_the_mouse_rests(
    browser: Browser, served: Served, tmp_path: Path
) -> None:
    (tmp_path / "part.yaml").write_text(PART, encoding="utf-8")
    with simulated_run(tmp_path, WHOLE):
        page = Page(browser, served, view="#live")
        wait_until(lambda: "say: Hello you" in titles(page))
        assert titles(page) == [
            "sequence", "say: Hello", "mission: part", "say: Hello you", "mission: part", "say: Default",
            "drive: 1 cm", "wait: waits 0.00001 m",
        ]  # fmt: skip
        hover = page.tab.evaluate("[...document.querySelectorAll('.filled')].map((each) => each.title)")
        assert hover[:2] == ["${greeting}", "${greeting}"]
        assert any("say: Hello:" in each.name for each in page.tab.all("treeitem"))
        page.wait_for("share: 20 %", "flag: yes", "list: one, two", "small: 0.00001 m")
        page.wait_for("points: {x: 1 m, y: 0 m}, {x: 2 m, y: 1 m}")
        sign = "(each) => [each.title, getComputedStyle(each, '::before').content.trim()]"
        skipped = f"[...document.querySelectorAll('.badge.skipped')].map({sign})"
        wait_until(lambda: page.tab.evaluate(skipped))
        assert page.tab.evaluate(skipped) == [["not true: base.docked", '"»\u00a0"']]
        page.wait_for("turn 0°/s", "battery 100 %")
        wait_until(lambda: page.says("part: word"))  # by its mission, not by the key of a node
        assert page.tab.errors == []


def test_initial_values_include_all_submissions(tmp_path: Path) -> None:
    (tmp_path / "part.yaml").write_text(PART, encoding="utf-8")
    (tmp_path / "whole.yaml").write_text(WHOLE, encoding="utf-8")
    found = {
        name: value_text(value) for name, value in first_values(load_mission(str(tmp_path / "whole.yaml"))).items()
    }
    assert found == {
        "greeting": "Hello", "share": "20 %", "flag": "yes", "list": "one, two", "small": "0.00001 m",
        "points": "{x: 1 m, y: 0 m}, {x: 2 m, y: 1 m}",
        "1.2 word": "Hello you", "1.2 far": "20 cm", "1.3 word": "Default", "1.3 far": "20 cm",
    }  # fmt: skip


def test_preview_follows_entered_values(browser: Browser, served: Served) -> None:
    page = Page(browser, served, view="#run/greet")
    wait_until(lambda: page.enabled("Run simulated"))
    if not page.tab.evaluate("!!document.querySelector('.preview:not(.folded) .title')"):
        page.press("Tree")
    page.tab.find("textbox", "Greeting").focus()
    page.tab.evaluate("document.activeElement.select()")
    page.tab.type("Ahoy!")
    wait_until(lambda: any("Ahoy!" in title for title in titles(page)))
    assert not any("${greeting}" in title for title in titles(page))


def test_a_success_does_not_count_failures(browser: Browser, served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(served.state))
    folder = records_folder()
    folder.mkdir(parents=True, exist_ok=True)
    told = [each for each in items() if not isinstance(each, Ended)]
    ended = Ended(FAILED + 1.0, "m", "success", "", FAILED + 1.0, 119)
    path = write(folder / "went_on.mcap", [*told, ended])
    try:
        page = Page(browser, served, view="#records/went_on.mcap")
        page.wait_for("✓ success", "3 nodes failed, and the mission went on")
        assert not page.says(" failure")
        page.press("Next failed node")
        page.wait_for("No node failed after this moment.")
    finally:
        path.unlink()
