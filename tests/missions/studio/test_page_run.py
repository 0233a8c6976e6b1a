"""The list of missions on the page, while the files of the user come, change and go."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.browser import Browser
from tests.missions.studio.page import DESKTOP, PHONE, Page
from tests.missions.studio.serving import Served, studio
from tests.waiting import wait_until

BROKEN = "mission: broken\ntree:\n  sequence:\n    - say: Let us dance\n    - sya: Thank you\n"
SAYS = "mission: {}\nsummary: Say something.\nparams:\n  side: 30 cm\n  greeting: Hello\ntree:\n  say: ${{greeting}}\n"

NAMES = (
    "[...document.querySelectorAll('.missions li:not([hidden])')].map((each) => each.querySelector('b')?.textContent)"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("own")


@pytest.fixture(scope="module")
def beside(homes: object, folder: Path) -> Iterator[Served]:
    """A studio in a folder with missions of the user's."""
    del homes
    (folder / "broken.yaml").write_text(BROKEN, encoding="utf-8")
    (folder / "my dance.yaml").write_text(SAYS.format("my_dance"), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        with studio() as found:
            yield found


def test_the_list_shows_the_first_line_of_an_error_and_the_form_all_lines(browser: Browser, beside: Served) -> None:
    for size in (PHONE, DESKTOP):
        tab = (page := Page(browser, beside, size=size)).tab
        page.wait_for("unknown behaviour 'sya'")
        lines = tab.evaluate("document.querySelector('.missions li .trouble').innerText.split('\\n')")
        assert lines == ["broken.yaml:5:7: unknown behaviour 'sya'"]
        box = tab.evaluate(
            "(() => { const b = document.querySelector('.missions li .trouble').getBoundingClientRect();"
            "return [b.width, b.height] })()"
        )
        assert box[0] > 200, box  # one letter a line was 10 pixels wide
        tab.evaluate("location.hash = '#run/broken.yaml'")
        wait_until(lambda tab=tab: tab.evaluate("!!document.querySelector('.chosen p.trouble')"))  # type: ignore[misc]
        shown = tab.evaluate("document.querySelector('.chosen p.trouble').innerText.split('\\n')")
        assert shown[:2] == [*lines, "     5 |     - sya: Thank you"]


def test_own_missions_stand_first_under_their_names_and_the_list_follows_the_files(
    browser: Browser, beside: Served, folder: Path
) -> None:
    tab = (page := Page(browser, beside)).tab
    wait_until(lambda: tab.evaluate(NAMES)[:4] == [None, "broken", "my dance", None])
    page.wait_for("Your missions", "Shipped with MissionTree", "my dance.yaml")
    tab.evaluate("window.first = document.querySelector('.missions a[href*=dance]'); window.first.focus()")
    new = folder / "a new one.yaml"
    new.write_text(SAYS.format("newest"), encoding="utf-8")
    wait_until(lambda: "newest" in tab.evaluate(NAMES))
    assert tab.evaluate("document.activeElement === window.first")  # what has the keyboard keeps it
    new.unlink()
    wait_until(lambda: "newest" not in tab.evaluate(NAMES))
    assert tab.errors == []


def test_changed_mission_is_reloaded_and_entered_values_stay(browser: Browser, beside: Served, folder: Path) -> None:
    tab = (page := Page(browser, beside, view="#run/my%20dance.yaml")).tab
    wait_until(lambda: page.enabled("Run simulated"))
    tab.find("textbox", "Greeting").focus()
    tab.evaluate("document.activeElement.select()")
    tab.type("Ahoy")
    path = folder / "my dance.yaml"
    text = path.read_text(encoding="utf-8")
    try:
        path.write_text(text.replace("params:", "params:\n  further: 20 deg"), encoding="utf-8")
        wait_until(lambda: any(each.name == "Further" for each in tab.all("textbox")))
        values = tab.evaluate("[...document.querySelectorAll('.params input')].map((each) => each.value)")
        assert values == ["20", "30", "Ahoy"]
        path.unlink()
        page.wait_for("there is no mission 'my dance.yaml' here")
    finally:
        path.write_text(text, encoding="utf-8")
    wait_until(lambda: page.enabled("Run simulated"))


def test_two_hundred_missions_are_listed(browser: Browser, beside: Served, folder: Path) -> None:
    many = [folder / f"n{number:03}.yaml" for number in range(200)]
    for number, path in enumerate(many):
        path.write_text(SAYS.format(f"many_{number}"), encoding="utf-8")
    try:
        tab = Page(browser, beside).tab
        wait_until(lambda: {f"many {number}" for number in range(200)} <= set(tab.evaluate(NAMES)))
        tab.find("searchbox", "Search").focus()
        tab.type("many 199")
        wait_until(lambda: tab.evaluate(NAMES) == ["many 199"])
        many[199].unlink()
        wait_until(lambda: tab.evaluate(NAMES) == [])  # the search holds for what comes later
    finally:
        for path in many:
            path.unlink(missing_ok=True)


def test_viewer_cannot_press_the_buttons_that_start_missions(browser: Browser, beside: Served) -> None:
    page = Page(browser, beside, beside.viewer, view="#run/my%20dance.yaml")
    page.wait_for("Viewers cannot start missions.", "Run simulated")
    buttons = "[...document.querySelectorAll('.motions button, .actions .main')].every((each) => each.disabled)"
    assert page.tab.evaluate(buttons)
    assert not page.enabled("Run simulated")
