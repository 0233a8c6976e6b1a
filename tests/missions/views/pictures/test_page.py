"""The page in a browser: what is to be seen on it, how large and in which colours; and that it asks no other host."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from missions.library.shipped import load_mission
from missions.plugins.pictures.compare import compare
from missions.plugins.pictures.page.pair import page, pair_page
from missions.plugins.pictures.svg import STYLE, svg
from missions.trees.drawing import SIGNS, Badge, NodeState, TreeBox, TreeDrawing
from missions.trees.drawing_builder import drawing_of, with_states
from tests.browser import Browser, Tab, chromium
from tests.cases import each
from tests.missions.views.pictures.drawn import HOSTILE, plan_of
from tests.waiting import wait_until

GREETING = {
    "1": NodeState("running", "", 0.0),
    "1.1": NodeState("success", "", 3.1),
    "1.1.1": NodeState("success", "a face at 12 deg", 3.1),
    "1.2": NodeState("running", "", 3.1),
    "1.2.1": NodeState("running", "off by 4 deg", 3.1),
    "1.2.2": NodeState("failure", "held for 0.3 s", 5.0),
    "1.2.2.1": NodeState("failure", "off by 7 deg", 5.0),
    "1.3.1.1.2": NodeState("skipped", "not true: polite", 5.0),
}
"""How the nodes of the mission "greet" may stand 6.25 s into a run: in all ways but suspended."""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "page.html"


def greeting() -> TreeDrawing:
    return with_states(drawing_of(load_mission("greet")), GREETING, 6.25)


def page_of(sort: str) -> str:
    """Return a page: of a mission, of a moment of its record, or of a pair of missions."""
    patrol = drawing_of(load_mission("patrol"))
    if sort == "pair":
        return pair_page(compare(greeting(), patrol))
    return page(patrol if sort == "mission" else greeting())


def shown(browser: Browser, file: Path, html: str, *, dark: bool = False, script: bool = True) -> Tab:
    file.write_text(html, encoding="utf-8")
    return browser.open(file, dark=dark, script=script)


@each("sort", ["mission", "moment", "pair"])
def test_page_loads_nothing_else(browser: Browser, file: Path, sort: str) -> None:
    tab = shown(browser, file, page_of(sort))
    assert tab.requests == [file.as_uri()]
    assert tab.errors == []


def test_missing_browser_skips_with_the_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(pytest.skip.Exception, match="apt-get install chromium"):
        chromium()


def test_the_browser_would_have_seen_a_request(browser: Browser, file: Path) -> None:
    tab = shown(browser, file, '<!doctype html><img alt="x" src="http://example.com/x.png"><script>oops()</script>')
    assert "http://example.com/x.png" in tab.requests
    assert any("ReferenceError: oops" in error for error in tab.errors)
    assert any("ERR_NAME_NOT_RESOLVED" in error for error in tab.errors)


@each(
    "attempt",
    [
        "new Image().src = 'http://example.com/x.png'",
        "fetch('http://example.com/x').catch(() => 0)",
        "document.body.append(Object.assign(document.createElement('script'), {textContent: 'window.ran = 1'}))",
        "document.body.innerHTML = '<form action=http://example.com/><button id=b></form>'; b.click()",
    ],
)
def test_the_policy_of_the_page_refuses_other_hosts_and_other_scripts(
    browser: Browser, file: Path, attempt: str
) -> None:
    tab = shown(browser, file, page(greeting()))
    tab.evaluate(f"{{{attempt}}}")
    wait_until(lambda: any("Content Security Policy" in error for error in tab.errors))
    assert tab.evaluate("window.ran") is None


def test_the_tree_is_named_and_has_an_item_for_every_node(browser: Browser, file: Path) -> None:
    patrol = drawing_of(load_mission("patrol"))
    tab = shown(browser, file, page(patrol))
    assert tab.find("tree").name == "Mission patrol"
    assert tab.find("heading").name == "Mission patrol"
    items = tab.all("treeitem")
    for item, box in zip(items, patrol.root.walk(), strict=True):
        assert item.name.startswith(box.kind)
        assert f":{box.line}" in item.name
        assert all(text in item.name for text in box.arguments.values())
    assert items[0].properties["level"] == 1
    assert {item.properties.get("expanded") for item in items} == {True, None}


def test_page_of_a_moment_shows_status_and_reason_of_each_node(browser: Browser, file: Path) -> None:
    tab = shown(browser, file, page(greeting()))
    assert "running 3.1 s off by 4 deg" in tab.find("treeitem", "track_face").name
    assert "success 3.1 s ago a face at 12 deg" in tab.find("treeitem", "find_face").name
    assert "hold 500 ms failure held for 0.3 s" in tab.find("treeitem", "face_centred").name
    assert "idle" in tab.find("treeitem", "gesture").name
    assert "state at 6.25 s" in tab.text()


@each("name", ["greet", "patrol"])
def test_fold_mark_does_not_cover_the_line_number(browser: Browser, file: Path, name: str) -> None:
    tab = shown(browser, file, page(drawing_of(load_mission(name))))
    gaps = tab.evaluate("""[...document.querySelectorAll('.spread [aria-expanded] > .box')]
        .map((box) => ['.fold', '.line'].map((part) => box.querySelector(part).getBoundingClientRect()))
        .map(([fold, line]) => fold.left - line.right)""")
    assert gaps
    assert min(gaps) >= 4


def test_a_page_counts_nodes_as_the_checker_does(browser: Browser, file: Path) -> None:
    plan = load_mission("greet")
    tab = shown(browser, file, page(drawing_of(plan)))
    assert f"greet.yaml · {sum(1 for _ in plan.tree.walk())} nodes" in tab.text()


def test_statuses_differ_in_more_than_colour(browser: Browser, file: Path) -> None:
    waiting = GREETING | {"1.2": NodeState("suspended", "waiting: the camera does not report", 3.1)}
    tab = shown(browser, file, page(with_states(drawing_of(load_mission("greet")), waiting, 6.25)))
    look = """[...document.querySelectorAll('li')].map(li => [li, getComputedStyle(li.firstElementChild)])
        .map(([li, is]) => [li.dataset.status, li.querySelector('.sign').innerText, is.borderStyle + is.borderWidth])"""
    seen = {status: (sign, border) for status, sign, border in tab.evaluate(look)}
    assert {status: sign for status, (sign, _) in seen.items()} == SIGNS
    assert len({border for _, border in seen.values()}) == len(SIGNS)


CONTRASTS = """(() => {
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const light = (colour) => {
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const parts = [...canvas.getImageData(0, 0, 1, 1).data].slice(0, 3).map((byte) => byte / 255);
    const [r, g, b] = parts.map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = (element) => {
    const colour = getComputedStyle(element).backgroundColor;
    return colour === "rgba(0, 0, 0, 0)" && element.parentElement ? ground(element.parentElement) : colour;
  };
  const speaks = (element) => [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  return [...document.querySelectorAll("main *")]
    .filter((element) => element.checkVisibility() && speaks(element))
    .map((element) => {
      const [ink, paper] = [light(getComputedStyle(element).color), light(ground(element))];
      return [(Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05), element.className, element.textContent];
    });
})()"""
"""The contrast of every text on the page to what it stands on, as WCAG 2.2 computes it."""


@each("dark", [False, True])
@each("sort", ["mission", "moment", "pair"])
def test_every_text_has_sufficient_contrast(browser: Browser, file: Path, sort: str, dark: bool) -> None:
    tab = shown(browser, file, page_of(sort), dark=dark)
    tab.evaluate("document.querySelectorAll('details').forEach(details => details.open = true)")
    contrasts = tab.evaluate(CONTRASTS)
    assert len(contrasts) > 20
    assert [faint for faint in contrasts if faint[0] < 4.5] == []


@each("dark", [False, True])
def test_the_sorts_of_nodes_have_the_colours_of_the_pictures(browser: Browser, file: Path, dark: bool) -> None:
    tab = shown(browser, file, page_of("mission"), dark=dark)
    found = tab.evaluate(
        "Object.fromEntries([...document.querySelectorAll('[data-sort]')].map(node => [node.dataset.sort,"
        " getComputedStyle(node.querySelector('.symbol')).backgroundColor]))"
    )
    drawn = {sort: re.search(rf"\.{sort} {{ fill: #(\w{{6}})", STYLE) for sort in found}
    assert found == {sort: rgb(colour[1]) for sort, colour in drawn.items() if colour}
    assert len(found) >= 3


def rgb(colour: str) -> str:
    """A colour as a browser says it."""
    return f"rgb({', '.join(str(int(colour[at : at + 2], 16)) for at in (0, 2, 4))})"


NIGHT = """(() => Object.fromEntries(["page", "card", "title", "argument"].map(kind => {
  const style = getComputedStyle(document.querySelector(`.${kind}`));
  return [kind, style.fill.match(/\\d+/g).map(Number).reduce((sum, part) => sum + part, 0) / 3];
})))()"""
"""How light four things of a picture are, 0 to 255."""


def test_a_picture_is_dark_by_night(browser: Browser, file: Path) -> None:
    picture = svg(greeting())
    by_day = shown(browser, file, picture).evaluate(NIGHT)
    assert min(by_day["page"], by_day["card"]) > 200 > max(by_day["title"], by_day["argument"])
    by_night = shown(browser, file, picture, dark=True).evaluate(NIGHT)
    assert max(by_night["page"], by_night["card"]) < 60 < min(by_night["title"], by_night["argument"])


def test_hostile_texts_stay_text(browser: Browser, file: Path) -> None:
    badge = Badge("1.1", "timeout", HOSTILE, 3, reason=HOSTILE)
    box = TreeBox("1.1.1", "say", HOSTILE, "■", HOSTILE, 3, "", {HOSTILE: HOSTILE}, (badge,), HOSTILE, HOSTILE)
    box = replace(box, reason=HOSTILE)
    root = TreeBox("1", "mission", HOSTILE, "▣", "m.yaml", 2, mission=HOSTILE, children=(box,))
    hostile = TreeDrawing(HOSTILE, HOSTILE, HOSTILE, root, 1.0)
    for html in (page(hostile), pair_page(compare(hostile, hostile))):
        tab = shown(browser, file, html)
        assert tab.errors == []
        assert tab.requests == [file.as_uri()]
        assert tab.all("image") == []
        assert tab.text().count(HOSTILE) >= 8
    tab = shown(browser, file, page(hostile))
    tab.evaluate(f"missiontree.showStates({{'1': ['failure', {json.dumps(HOSTILE)}, {json.dumps(HOSTILE)}]}})")
    assert f"failure {HOSTILE}" in tab.all("treeitem")[0].name
    assert tab.all("image") == []


def test_page_without_script_is_unfolded_and_has_no_tools(browser: Browser, file: Path) -> None:
    tab = shown(browser, file, page(greeting()), script=False)
    assert len(tab.all("treeitem")) == sum(1 for _ in greeting().root.walk())
    assert tab.all("button") == tab.all("searchbox") == []
    assert "off by 7 deg" in tab.text()


@each("sort", ["mission", "moment", "pair"])
def test_on_a_phone_nothing_is_wider_than_the_screen(browser: Browser, file: Path, sort: str) -> None:
    file.write_text(page_of(sort), encoding="utf-8")
    tab = browser.open(file, size=(390, 844))
    assert tab.evaluate("document.scrollingElement.scrollWidth") <= 390
    assert tab.evaluate("document.querySelector('.window').scrollWidth") <= 390
    wide = "[...document.querySelectorAll('main *')].filter(e => e.getBoundingClientRect().right > 390).length"
    assert tab.evaluate(wide) == 0


def test_every_control_has_a_name_and_is_large_enough_for_a_finger(browser: Browser, file: Path) -> None:
    tab = shown(browser, file, page(drawing_of(load_mission("patrol"))))
    controls = [*tab.all("button"), *tab.all("searchbox")]
    assert len(controls) >= 8
    assert all(control.name for control in controls)
    sizes = "[...document.querySelectorAll('button, input, .fold')].map(e => e.getBoundingClientRect().height)"
    tab.find("button", "Zoom to 100 %").click()
    assert min(tab.evaluate(sizes)) >= 24  # WCAG 2.2, target size


def test_two_missions_stand_side_by_side_with_a_mark_between(browser: Browser, file: Path) -> None:
    old = plan_of("  sequence:\n    - drive: {distance: 1 m, speed: 0.2 m/s}\n    - say: Hello\n")
    new = plan_of("  sequence:\n    - drive: {distance: 1 m, speed: 0.3 m/s}\n    - wait: 2 s\n    - say: Hello\n")
    tab = shown(browser, file, pair_page(compare(drawing_of(old), replace(drawing_of(new), file="new.yaml"))))
    names = [item.name for item in tab.all("treeitem")]
    assert [name.split(" ")[0] for name in names] == ["same", "changed", "added", "same"]
    assert "speed: 0.2 m/s -> 0.3 m/s" in names[1]
    assert tab.evaluate("[...document.querySelectorAll('.mark')].map(e => e.innerText[0])") == ["=", "≠", "+", "="]
    halves = tab.evaluate("[...document.querySelectorAll('.half')].map(e => e.getBoundingClientRect().left)")
    assert all(left < right for left, right in zip(halves[::2], halves[1::2], strict=True))
    tab.find("button", "Next change").click()
    assert tab.focused().name == names[1]
    tab.press("Tab")
    tab.find("button", "Next change").click()
    assert tab.focused().name == names[2]


def test_a_picture_of_the_page_is_not_empty(browser: Browser, file: Path) -> None:
    bare = shown(browser, file, "<!doctype html><title>nothing</title>").screenshot()
    assert len(shown(browser, file, page(greeting())).screenshot()) > 4 * len(bare)
