"""The report in a browser: read by role and name, moved through time as a person does, and closed to other hosts."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.plugins.records.report.page import report_page
from missions.plugins.records.report.summary import RecordStudy, study_record
from missions.request import RunRequest
from missions.trees.drawing import SIGNS
from tests.browser import Browser, Tab
from tests.cases import each
from tests.missions.records.replay.written import record_of
from tests.missions.views.pictures.drawn import HOSTILE
from tests.missions.views.pictures.test_document import Reader
from tests.waiting import wait_until


@pytest.fixture(scope="module")
def file(found: RecordStudy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report_page(found), encoding="utf-8")
    return path


@pytest.fixture
def tab(browser: Browser, file: Path) -> Tab:
    return browser.open(file)


def root(tab: Tab) -> str:
    """Return how the mission stands, in the word that a screen reader says of the first node."""
    (status,) = {status for status in SIGNS if status in tab.all("treeitem")[0].name.split()}
    return status


def moment(tab: Tab) -> object:
    """Return what a screen reader says of the slider; Chromium's protocol has the bare number there."""
    tab.find("slider", "Time")
    return tab.evaluate("document.querySelector('input[aria-label=Time]').getAttribute('aria-valuetext')")


def person(tab: Tab) -> str:
    """Return the row of the mission's variable "person", its first words."""
    return " ".join(str(tab.evaluate("document.querySelectorAll('.variables tr')[2].innerText")).split())


def test_report_page_loads_nothing_else_and_has_no_errors(tab: Tab, file: Path) -> None:
    tab.find("slider", "Time").focus()
    tab.press("Home", "ArrowRight", "End")
    assert tab.requests == [file.resolve().as_uri()]
    assert tab.errors == []


def test_report_page_has_its_headings(tab: Tab) -> None:
    assert tab.find("heading", "Mission m").name == f"Mission m {SIGNS['failure']} failure"
    assert [heading.name for heading in tab.all("heading")[1:]] == [
        "State",
        "Variables, in SI units",
        "Timeline",
        "Pictures and percepts",
        "Head and base",
        "Faults and reflexes",
        "Speech and log",
        "About this record",
    ]
    tab.find("tree", "Mission m")
    tab.find("image", "drive: 1 time, 1.00 s in total; 1 failure")
    tab.find("image", "Speed, setpoint 0 to 0.2 m/s, measured 0 to 0.2 m/s")
    tab.find("image", "Path of the base from above, 0.2 m long")
    assert "Cause of the failure: drive (m.yaml, line 2), at 5.00 s" in tab.text()


def test_the_slider_moves_the_tree_the_variables_the_picture_and_the_charts(tab: Tab) -> None:
    def state() -> tuple[object, ...]:
        readout = tab.evaluate("document.querySelector('[data-line=\"pan/1\"]').textContent")
        picture = tab.evaluate("document.querySelector('#seen figcaption').textContent.split(':')[0]")
        robot = tab.evaluate("document.querySelector('.robot').getAttribute('transform')")
        mark = float(tab.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--at')"))
        return moment(tab), root(tab), person(tab), readout, picture, robot, round(mark, 3)

    tab.find("slider", "Time").focus()
    tab.press("End")
    assert state() == (
        "6.00 s, tick 119", "failure", "person face 1, 1.5 m, 11° left", "17.2", "5.00 s",
        "translate(0 -0.2) rotate(0)", 1.0,
    )  # fmt: skip
    tab.press("Home", *["ArrowRight"] * 19)
    assert state()[:2] == ("1.05 s, tick 20", "running")
    assert state()[2] == "person"
    assert "not set yet" in tab.evaluate("getComputedStyle(document.querySelector('.unset > td'), '::before').content")
    assert state()[4:] == ("1.00 s", "translate(0 0) rotate(0)", 0.161)
    tab.press("Home")
    assert state()[:2] == ("0.10 s, tick 1", "running")  # before that it got ready


def test_report_page_plays_from_start_to_end(tab: Tab) -> None:
    assert moment(tab) == "0.10 s, tick 1"
    assert root(tab) == "running"
    tab.evaluate("document.querySelector('#speed').value = '20'")
    tab.find("button", "Play").click()
    wait_until(lambda: moment(tab) == "6.00 s, tick 119")
    wait_until(lambda: playing(tab) == "Play")
    tab.evaluate("document.querySelector('#speed').value = '1'")
    tab.find("button", "Play").click()  # once more, from the beginning
    wait_until(lambda: moment(tab) not in {"6.00 s, tick 119", "0.10 s, tick 1"})
    tab.find("button", "Pause").click()
    assert playing(tab) == "Play"
    assert moment(tab) != "6.00 s, tick 119"


def playing(tab: Tab) -> str:
    """Return what the button says that it would do."""
    return str(tab.evaluate("document.querySelector('#play').textContent")).split()[-1]


def test_failure_buttons_jump_to_failures_and_name_the_node(tab: Tab) -> None:
    slider = tab.find("slider", "Time")
    slider.focus()
    tab.press("Home")
    tab.find("button", "Next failure").click()
    assert moment(tab) == "5.00 s, tick 99"
    assert tab.find("button", "drive failed").name == f"{SIGNS['failure']} drive failed: {HOSTILE}"
    tab.find("button", "Next failure").click()
    assert moment(tab) == "6.00 s, tick 119"
    tab.find("button", "Next failure").click()
    assert "No later failure." in tab.text()
    tab.find("button", "Previous failure").click()
    assert moment(tab) == "5.00 s, tick 99"
    tab.find("button", "drive failed").click()
    assert "drive" in tab.focused().name
    slider.focus()
    tab.press("ArrowRight")
    assert "drive failed" not in tab.text()


def test_times_pictures_and_timeline_jump_to_their_time(tab: Tab) -> None:
    tab.find("button", "4.50 s").click()
    assert moment(tab) == "4.50 s, tick 89"
    tab.find("button", "Picture").click()
    assert moment(tab) == "1.00 s, tick 19"
    left, top, right, bottom = tab.find("image", "drive: 1 time").box
    tab.click(left + (right - left) * 0.747, (top + bottom) / 2)
    assert moment(tab) == "4.50 s, tick 89"


def test_a_node_of_the_timeline_is_shown_in_the_tree(tab: Tab) -> None:
    tab.find("button", "drive").click()
    assert tab.focused().name.startswith("drive")
    assert tab.evaluate("document.querySelector('tr.current').dataset.row") == "1.3.1"


def test_report_page_shows_its_pictures(tab: Tab) -> None:
    sizes = tab.evaluate("[...document.images].map((image) => image.naturalWidth)")
    assert sizes == [320] * 4


def test_hostile_text_is_shown_and_never_more(tab: Tab, file: Path) -> None:
    assert tab.text().count(HOSTILE.strip()) >= 6
    assert tab.evaluate("document.querySelectorAll('img[onerror]').length") == 0
    read = Reader(file.read_text(encoding="utf-8"))
    assert sum(HOSTILE in text for text in read.texts) >= 10
    assert sum(tag == "script" for tag, _ in read.tags) == 3


def test_without_a_script_the_end_of_the_run_is_to_be_read(browser: Browser, file: Path) -> None:
    tab = browser.open(file, script=False)
    assert root(tab) == "failure"
    assert person(tab) == "person face 1, 1.5 m, 11° left"
    assert not tab.all("slider")


@each(("size", "dark"), [((390, 844), False), ((768, 1024), False), ((1600, 1000), True), ((390, 844), True)])
def test_report_page_fits_phones_and_desktops_light_and_dark(
    browser: Browser, file: Path, size: tuple[int, int], dark: bool
) -> None:
    tab = browser.open(file, size=size, dark=dark)
    assert tab.evaluate("document.documentElement.scrollWidth") <= size[0]
    assert tab.evaluate("(view => view.scrollWidth <= view.clientWidth)(document.querySelector('.window'))")
    image = cv2.imdecode(np.frombuffer(tab.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    assert (np.median(image) < 60) == dark
    assert image.std() > 10
    tab.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    tab._settle()
    assert tab.find("slider", "Time").box[1] < 100
    assert tab.find("button", "Next failure").box[3] < 120


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A real run of greet: nobody was there."""
    path = tmp_path_factory.mktemp("records") / "alone.mcap"
    return record_of(RunRequest("greet", {"patience": "2 s"}, simulate="fast", world="empty", eyes="truth"), path)


def test_a_real_run_is_reported(browser: Browser, alone: RunRecord, tmp_path: Path) -> None:
    path = tmp_path / "alone.html"
    path.write_text(report_page(study_record(open_record(alone.path))), encoding="utf-8")
    tab = browser.open(path)
    assert tab.errors == []
    assert root(tab) == "running"
    tab.find("slider", "Time").focus()
    tab.press("End")
    assert "no face found (timed out after 2 s)" in tab.all("treeitem")[0].name
    tab.press("Home")
    tab.find("button", "Next failure").click()
    assert root(tab) == "failure"
    tab.find("image", "Plan of the world empty")
    assert "Pictures and percepts" not in [heading.name for heading in tab.all("heading")]
