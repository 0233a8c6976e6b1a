"""The page at work: fold, keys, search, layout and zoom, statuses shown by a script, and all that with 300 nodes."""

from itertools import combinations
from pathlib import Path

import pytest

from missions.plugins.pictures.page.document import document, join
from missions.plugins.pictures.page.pair import page
from missions.plugins.pictures.page.tree import tools, tree
from missions.trees.drawing import TreeBox, TreeDrawing
from tests.browser import Browser, Tab


def leaf(key: str, kind: str, text: str) -> TreeBox:
    return TreeBox(key, kind, kind, "■", "m.yaml", int(key[-1]), text, {"text": text})


SMALL = TreeDrawing(
    "m",
    "",
    "m.yaml",
    TreeBox(
        "1", "sequence", "sequence", "→", "m.yaml", 1,
        children=(
            leaf("1.1", "say", "Hello"),
            TreeBox(
                "1.2", "mission", "nod", "▣", "m.yaml", 2, mission="nod",
                children=(leaf("1.2.1", "gesture", "nod"), leaf("1.2.2", "wait", "2 s")),
            ),
            TreeBox("1.3", "selector", "selector", "?", "m.yaml", 3, children=(leaf("1.3.1", "drive", "1 m"),)),
        ),
    ),
    time=0.0,
)  # fmt: skip


def large(depth: int = 3, width: int = 7, key: str = "1") -> TreeBox:
    """Return a tree of 1 + 7 + 49 + 343 nodes; every second of the lowest but one is a sub-mission."""
    if not depth:
        return leaf(key, "say", f"I am {key}")
    children = tuple(large(depth - 1, width, f"{key}.{place}") for place in range(1, width + 1))
    mission = "greet" if depth == 1 and int(key[-1]) % 2 else ""
    kind = "mission" if mission else "sequence"
    return TreeBox(
        key, kind, mission or kind, "▣" if mission else "→", "large.yaml", 1, mission=mission, children=children
    )


LARGE = TreeDrawing("large", "", "large.yaml", large())
NODES, FOLDED = 1 + 7 + 49 + 343, 28 * 7
"""How many nodes LARGE has, and how many of them are in sub-missions."""


def opened(browser: Browser, tmp_path: Path, html: str) -> Tab:
    file = tmp_path / "page.html"
    file.write_text(html, encoding="utf-8")
    return browser.open(file)


@pytest.fixture
def small(browser: Browser, tmp_path: Path) -> Tab:
    """Open the small tree, and put the keyboard on its first node."""
    tab = opened(browser, tmp_path, page(SMALL))
    tab.find("treeitem", "sequence").focus()
    return tab


def at(tab: Tab) -> str:
    """Return the first words of the node that has the keyboard."""
    return " ".join(tab.focused().name.split()[:2])


def kinds(tab: Tab) -> list[str]:
    return [item.name.split()[0] for item in tab.all("treeitem")]


def test_arrow_keys_follow_the_aria_tree_pattern(small: Tab) -> None:
    def after(*keys: str) -> str:
        small.press(*keys)
        return at(small)

    assert after("ArrowDown") == "say Hello"
    assert after("ArrowDown") == "mission nod"
    assert after("ArrowRight") == "gesture nod"
    assert after("ArrowLeft") == "mission nod"
    assert after("ArrowUp") == "say Hello"
    assert after("ArrowUp", "ArrowUp") == "sequence m.yaml"
    assert after("End") == "drive 1"
    assert after("ArrowDown") == "drive 1"
    assert after("Home") == "sequence m.yaml"


def test_left_folds_and_right_unfolds(small: Tab) -> None:
    small.press("ArrowDown", "ArrowDown", "ArrowLeft")
    assert small.focused().properties["expanded"] is False
    assert kinds(small) == ["sequence", "say", "mission", "selector", "drive"]
    small.press("ArrowDown")
    assert at(small) == "selector m.yaml"
    small.press("ArrowUp", "ArrowRight")
    assert small.focused().properties["expanded"] is True
    assert kinds(small) == ["sequence", "say", "mission", "gesture", "wait", "selector", "drive"]


def test_enter_and_space_fold_and_asterisk_unfolds_all_siblings(small: Tab) -> None:
    small.press("ArrowDown", "ArrowDown", "Enter", "ArrowDown", " ")
    assert kinds(small) == ["sequence", "say", "mission", "selector"]
    small.press("*")
    assert len(kinds(small)) == 7


def test_letters_jump_to_the_next_matching_node(small: Tab) -> None:
    small.press("s")
    assert at(small) == "say Hello"
    small.type("el")
    assert at(small) == "selector m.yaml"


def test_only_one_node_is_a_stop_for_the_tabulator(small: Tab) -> None:
    small.press("ArrowDown", "ArrowDown")
    assert small.evaluate("[...document.querySelectorAll('li')].filter(li => li.tabIndex === 0).length") == 1
    assert small.evaluate("document.querySelector('li[tabindex=\"0\"]').dataset.key") == "1.2"


def test_clicking_the_fold_mark_keeps_the_focus(small: Tab) -> None:
    small.press("ArrowDown")
    left, top, right, bottom = small.evaluate(
        "(({left, top, right, bottom}) => [left, top, right, bottom])"
        "(document.querySelector('[data-key=\"1.2\"] .fold').getBoundingClientRect())"
    )
    small.click((left + right) / 2, (top + bottom) / 2)
    assert kinds(small) == ["sequence", "say", "mission", "selector", "drive"]
    assert at(small) == "say Hello"


def test_sub_missions_fold_and_all_unfolds_by_button(small: Tab) -> None:
    small.find("treeitem", "wait").focus()
    small.find("button", "Fold sub-missions").click()
    assert kinds(small) == ["sequence", "say", "mission", "selector", "drive"]
    assert small.evaluate("document.querySelector('li[tabindex=\"0\"]').dataset.key") == "1.2"
    small.find("button", "Unfold all").click()
    assert len(kinds(small)) == 7


def status(tab: Tab) -> str:
    return str(tab.evaluate("document.querySelector('[role=status]').innerText"))


def test_search_counts_matches_unfolds_them_and_enter_advances(small: Tab) -> None:
    small.find("button", "Fold sub-missions").click()
    small.find("treeitem", "sequence").focus()
    small.press("/")
    small.type("NOD")
    assert small.focused().role == "searchbox"
    assert status(small) == "1 of 2"
    small.press("Enter")
    assert status(small) == "2 of 2"
    assert "gesture" in kinds(small)
    small.press("Escape")
    assert at(small) == "gesture nod"


def test_every_word_of_a_search_counts_and_lines_are_found_too(small: Tab) -> None:
    small.press("/")
    small.type("nod gesture")
    assert status(small) == "1 of 1"
    small.press("/")  # it is a letter while one types
    assert status(small) == "nothing found"
    small.find("searchbox").focus()
    small.evaluate("document.querySelector('input').select()")
    small.type("m.yaml:3")
    assert status(small) == "1 of 1"


def box_of(tab: Tab, key: str) -> list[float]:
    """Return where the card of a node is: left, top, right, bottom."""
    rect = f"document.getElementById('node-{key}').getBoundingClientRect()"
    return [float(side) for side in tab.evaluate(f"(r => [r.left, r.top, r.right, r.bottom])({rect})")]


def test_zoom_scales_the_tree_and_fit_shows_its_whole_width(small: Tab) -> None:
    def width() -> float:
        left, _, right, _ = box_of(small, "1.1")
        return right - left

    before = width()
    small.find("button", "Zoom in").click()
    assert width() == pytest.approx(1.25 * before, rel=0.05)
    small.find("button", "Zoom out").click()
    small.find("treeitem", "say").focus()
    small.press("-")
    assert width() < 0.9 * before
    small.press("0")
    assert width() == pytest.approx(before, rel=0.01)
    small.press(*"+++++")
    small.find("button", "Zoom to fit").click()
    assert small.evaluate("(w => w.scrollWidth - w.clientWidth)(document.querySelector('.window'))") == 0


def test_the_tree_grows_to_the_right_and_as_an_outline_downwards(small: Tab) -> None:
    parent, child = box_of(small, "1"), box_of(small, "1.1")
    assert child[0] > parent[2]
    small.find("button", "Outline").click()
    assert small.find("button", "Outline").properties["pressed"] == "true"
    parent, child = box_of(small, "1"), box_of(small, "1.1")
    assert child[1] >= parent[3]


def test_a_script_shows_other_states_and_names_follow(small: Tab) -> None:
    small.evaluate("missiontree.showStates({'1': ['running', 'at work', '2.0 s'], '1.1': ['failure', 'no voice']})")
    assert "running 2.0 s at work" in small.find("treeitem", "sequence").name
    assert "failure no voice" in small.find("treeitem", "say").name
    assert "idle" in small.find("treeitem", "drive").name
    small.evaluate("missiontree.showStates({'1': ['success']})")
    names = [item.name for item in small.all("treeitem")]
    assert "success" in names[0]
    assert not any("no voice" in name or "at work" in name for name in names)


def test_script_can_show_a_node_receive_node_events_and_read_data(browser: Browser, tmp_path: Path) -> None:
    script = tmp_path / "more.js"
    script.write_text("const heard = []; document.addEventListener('node', (event) => heard.push(event.detail.key));")
    body = join(tools(SMALL), tree(SMALL, label="m"))
    tab = opened(browser, tmp_path, document("m", body, data={"changes": {"1": [[0.5, "</script>"]]}}, assets=[script]))
    tab.find("button", "Fold sub-missions").click()
    tab.evaluate("missiontree.showNode('1.2.2')")
    assert at(tab) == "wait 2"
    assert tab.evaluate("heard") == ["1.2.2"]
    assert tab.evaluate("missiontree.data.changes['1'][0]") == [0.5, "</script>"]


@pytest.fixture
def big(browser: Browser, tmp_path: Path) -> Tab:
    return opened(browser, tmp_path, page(LARGE))


def test_large_tree_opens_with_folded_submissions(big: Tab) -> None:
    visible = "[...document.querySelectorAll('[role=treeitem]')].filter(item => item.checkVisibility()).length"
    assert big.evaluate(visible) == NODES - FOLDED
    big.find("button", "Unfold all").click()
    assert big.evaluate(visible) == NODES


def test_cards_of_a_large_tree_do_not_overlap(big: Tab) -> None:
    big.find("button", "Unfold all").click()
    rects = "[...document.querySelectorAll('.box')].map(e => e.getBoundingClientRect())"
    boxes = big.evaluate(f"{rects}.map(r => [r.left, r.top, r.right, r.bottom])")
    assert len(boxes) == NODES
    assert all(right - left > 50 and bottom - top > 20 for left, top, right, bottom in boxes)
    for one, other in combinations(boxes, 2):
        beside = one[2] <= other[0] or other[2] <= one[0]
        assert beside or one[3] <= other[1] or other[3] <= one[1]


def test_search_scrolls_to_a_folded_node_of_a_large_tree(big: Tab) -> None:
    big.press("/")
    big.type("1.5.5.6")
    assert status(big) == "1 of 1"
    left, top, right, bottom = box_of(big, "1.5.5.6")
    assert left >= 0
    assert top >= 0
    assert right <= 1280
    assert bottom <= 800


def test_ancestors_of_a_node_stay_visible_while_scrolling(big: Tab) -> None:
    big.find("button", "Unfold all").click()
    big.press("/")
    big.type("1.6.6.6")
    for key in ("1", "1.6", "1.6.6"):
        _, top, _, bottom = box_of(big, key)
        assert 0 <= top < bottom <= 800
