"""A first visit to the studio, as a person makes it: by the link, a mission from its form, and its record."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

from missions.control.commands import BadMessage
from missions.executive.events import NodeChanged
from missions.library.folders import checkup_file, state_folder
from missions.plugins.records.retention import records_folder
from missions.plugins.studio import library, record_queries
from tests.browser import Browser
from tests.missions.records.report.told_record import FAILED, WHERE, items, write
from tests.missions.studio.page import DESKTOP, PHONE, VIEWS, Page
from tests.missions.studio.serving import Served, studio
from tests.missions.views.pictures.drawn import HOSTILE
from tests.waiting import wait_until


def test_page_shows_that_missions_are_loading_until_they_are_read(browser: Browser, served: Served) -> None:
    page = Page(browser, served)
    told = "view.node.querySelector('.chosen').textContent"
    said = page.tab.evaluate(
        "import('./run.js').then(async ({ Run }) => {"
        "  let refuse;"
        "  const link = { welcome: {}, library: () => new Promise((_, no) => { refuse = no; }) };"
        "  const view = new Run({ link, watcher: {}, stop: null });"
        "  const shown = view.show('');"
        f" const before = {told}; refuse(new Error('no link')); await shown;"
        f" return [before, {told}];"
        "})"
    )
    assert said == ["Loading the missions…", ""]


@pytest.mark.real_time
def test_greet_is_started_watched_and_replayed_on_the_page(browser: Browser, served: Served) -> None:
    page = Page(browser, served, size=PHONE)
    tab = page.tab
    assert tab.evaluate("location.search") == ""  # the token is not to be seen any more
    page.wait_for("Look for a face, track it, greet it.")
    assert tab.evaluate("!!document.querySelector('a[href$=greet] .sketch path').getAttribute('d')")
    page.click("link", "Greet")
    wait_until(lambda: page.enabled("Run simulated"))
    greeting = tab.find("textbox", "Greeting")
    greeting.focus()
    tab.evaluate("document.activeElement.select()")
    tab.type("Ahoy!")
    page.press("Run simulated")
    # The view changes to the run, and shows what it does.
    wait_until(lambda: tab.evaluate("location.hash") == "#live")
    page.wait_for("turtlebot2 arm", "living room", "greeting: Ahoy!")
    wait_until(lambda: any("find_face: running" in each.name for each in tab.all("treeitem")))
    wait_until(lambda: tab.evaluate("!!document.querySelector('.node.visited')"))
    page.wait_for("tick ", " late")
    tab.evaluate("document.querySelector('studio-camera').scrollIntoView()")
    wait_until(lambda: any("sees face" in each.name for each in tab.all("image")))
    page.wait_for("“Ahoy!”")
    wait_until(lambda: any("find_face: success" in each.name for each in tab.all("treeitem")))
    page.wait_for("✓ success")
    # And its record says the same.
    page.go("Records")
    wait_until(lambda: tab.evaluate("!!document.querySelector('.record-list a')"))
    tab.evaluate("document.querySelector('.record-list a').click()")
    wait_until(lambda: any(each.name.startswith("sequence: success") for each in tab.all("treeitem")))
    wait_until(
        lambda: tab.evaluate(
            "!!document.querySelector('.record .battery') && !!document.querySelector('.record .joints td')"
        )
    )
    slider = tab.find("slider", "Time")
    slider.focus()
    tab.press("Home")
    wait_until(lambda: all(": idle" in each.name or ": running" in each.name for each in tab.all("treeitem")))
    tab.press("End")
    wait_until(lambda: any(each.name.startswith("sequence: success") for each in tab.all("treeitem")))
    assert tab.errors == []
    assert {url.split("/")[2] for url in tab.requests} == {served.host}


def test_the_report_of_a_strangers_record_is_read_and_is_no_part_of_the_studio(
    browser: Browser, tmp_path: Path
) -> None:
    records = tmp_path / "of others"
    records.mkdir()
    stranger = write(records / "stranger.mcap", items())
    (records / "broken.mcap").write_bytes(b"no record")
    with studio("--records", str(records)) as served:
        page = Page(browser, served, view="#records")
        page.wait_for("broken.mcap", str(records))
        bearer = {"Authorization": f"Bearer {served.operator}"}
        refused, _, words = served.get("/reports/broken.mcap", **bearer)
        assert (refused, b"broken.mcap" in words) == (422, True)
        assert served.get("/reports/stranger.mcap", **bearer)[1]["content-security-policy"].startswith("sandbox ")
        tab = Page(browser, served, view=f"#records/{stranger.name}").tab
        wait_until(lambda: any(each.name == "Report" for each in tab.all("link")))
        assert tab.evaluate("document.querySelector('a[href^=\"/reports\"]').target") == "_blank"
        tab.evaluate("document.querySelector('a[href^=\"/reports\"]').target = ''")  # here, and not in a tab of its own
        tab.find("link", "Report").click()
        wait_until(lambda: tab.evaluate("document.querySelector('.tools')?.hidden === false"))  # its script runs
        assert tab.text().count(HOSTILE.strip()) >= 6
        assert tab.evaluate("document.querySelectorAll('img[onerror]').length") == 0
        tab.ask("Page.reload")
        wait_until(lambda: tab.evaluate("document.querySelector('.tools')?.hidden === false"))
        assert tab.evaluate("self.origin") == "null"
        assert (
            tab.evaluate("(() => { try { return document.cookie } catch (error) { return error.name } })()")
            == "SecurityError"
        )
        log = (state_folder() / "studio.log").read_text(encoding="utf-8").splitlines()
    told = [each for each in map(json.loads, log) if each.get("do") == "report"]
    assert [(each["name"], each["outcome"]) for each in told[-4:]] == [
        ("broken.mcap", "bad_record"), *[("stranger.mcap", "ok")] * 3,
    ]  # fmt: skip


@pytest.fixture
def kept(served: Served, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Path], Path]]:
    """Have files for the studio that tests share, until the test is over."""
    monkeypatch.setenv("XDG_STATE_HOME", str(served.state))
    found: list[Path] = []

    def keep(path: Path) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        found.append(path)
        return path

    yield keep
    for path in found:
        path.unlink()


def test_two_records_are_compared_and_one_slider_moves_both(
    browser: Browser, served: Served, kept: Callable[[Path], Path]
) -> None:
    one, other = items(), [each for each in items() if each.t < FAILED or not isinstance(each, NodeChanged)]
    write(kept(records_folder() / "monday.mcap"), one)
    write(kept(records_folder() / "tuesday.mcap"), other, head=replace(WHERE, seed=4711))
    tab = (page := Page(browser, served, view="#records/monday.mcap/tuesday.mcap")).tab
    page.wait_for("First different decision: drive, line 2.", "did not reach it", "5.0 s: failure", "4711")
    wait_until(lambda: len(tab.all("slider")) == 1)
    slider = tab.find("slider", "Time")
    clocks = "[...document.querySelectorAll('.record .clock')].map((each) => each.textContent.split(' of ')[0])"
    slider.focus()
    tab.press("Home")
    wait_until(lambda: tab.evaluate(clocks) == ["0.0 s", "0.0 s"])
    page.press("Show it")
    wait_until(lambda: tab.evaluate(clocks) == ["5.0 s", "5.0 s"])
    wait_until(lambda: tab.evaluate("document.querySelectorAll('.record .node.failure').length") == 2)
    with served.client(served.viewer) as viewer:
        assert viewer.ask("compare", name="monday.mcap", other="none")["error"] == "no_such_record"
    assert tab.errors == []


def test_record_too_large_for_a_report_gives_a_command_as_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    records = records_folder()
    records.mkdir(parents=True, exist_ok=True)
    write(records / "long.mcap", items())
    monkeypatch.setattr(record_queries, "MAX_WHOLE_BYTES", 100)
    with pytest.raises(BadMessage, match=r"long\.mcap: .* too much for this") as refused:
        record_queries.render_report("long.mcap")
    assert refused.value.hint.startswith("mission record report ")


def test_a_task_is_added_and_cancelled(browser: Browser, served: Served) -> None:
    page = Page(browser, served, view="#run/greet")
    tab = page.tab
    page.press("Schedule")
    at = tab.find("textbox", "At")
    at.focus()
    tab.type("18:00")
    page.press("Add to the queue")
    page.go("Tasks")
    page.wait_for("greet", "waiting")
    page.press("Cancel")
    page.press("Press again to cancel")
    page.wait_for("The queue is empty.")


def test_a_task_that_needs_approval_is_approved(browser: Browser, served: Served) -> None:
    page = Page(browser, served, view="#run/greet")
    wait_until(lambda: page.enabled("Schedule"))
    if not page.tab.all("switch"):  # else it is unfolded, as somebody has left it
        page.press("Schedule")
    page.click("switch", "Needs approval before it begins")
    page.press("Add to the queue")
    page.go("Tasks")
    page.wait_for("greet", "needs approval")
    page.press("Approve")
    page.press("Press again to approve")
    wait_until(lambda: not page.says("needs approval"))
    page.wait_for("approved by operator")
    page.press("Cancel")
    page.press("Press again to cancel")
    page.wait_for("The queue is empty.")


def test_last_doctor_findings_are_shown_beside_the_missions(
    browser: Browser, served: Served, kept: Callable[[Path], Path]
) -> None:
    what = f"10.1 V is little {HOSTILE}"
    ailing = {"part": "arm", "about": "elbow", "message": what, "verdict": "warning", "fix": "charge the battery"}
    kept(checkup_file()).write_text(
        json.dumps({"at": "2026-11-23T14:05:09", "robot": "my_kit", "ailing": [ailing]}), encoding="utf-8"
    )
    page = Page(browser, served)
    page.wait_for("mission doctor, 2026-11-23 14:05, my kit:", "warning: arm, elbow", "10.1 V is little")
    page.wait_for("<img src=x", "Try: charge the battery")


def test_unreadable_checkup_is_reported() -> None:
    assert library._last_checkup() is None
    checkup_file().parent.mkdir(parents=True, exist_ok=True)
    checkup_file().write_text("{", encoding="utf-8")
    found = library._last_checkup()
    assert found is not None
    assert "cannot be read" in str(found["ailing"])


def test_adding_a_person_needs_a_name_and_a_run_with_camera(browser: Browser, served: Served) -> None:
    page = Page(browser, served, view="#run")
    page.press("Add with the robot's camera")
    page.wait_for("Enter a name first.")
    page.tab.find("textbox", "Name").focus()
    page.tab.type("Ana")
    page.press("Add with the robot's camera")
    page.wait_for("The robot's camera needs a run")


def test_run_on_a_robot_needs_confirmations(browser: Browser, served: Served) -> None:
    page = Page(browser, served, view="#run/greet")
    wait_until(lambda: page.enabled("Run simulated"))
    page.click("radio", "On the robot")
    page.press("Run on the robot")
    page.wait_for("Choose the robot first.")
    page.tab.evaluate("document.querySelector('.target select').value = 'turtlebot2'")
    page.press("Run on the robot")
    page.wait_for("Confirm first that the robot has room and that you can reach its emergency stop.")


def test_each_view_has_stop_in_sight_and_nothing_too_wide(browser: Browser, served: Served) -> None:
    for size in (PHONE, DESKTOP):
        page = Page(browser, served, size=size)
        for view in VIEWS:
            page.go(view)
            what = (view, size)
            left, top, right, bottom = page.stop.box
            assert min(left, top) >= 0, what
            assert right <= size[0], what
            assert bottom <= size[1], what
            x, y = (left + right) / 2, (top + bottom) / 2
            assert page.tab.evaluate(f"!!document.elementFromPoint({x}, {y}).closest('.stop')"), what
            assert page.tab.evaluate("document.documentElement.scrollWidth") <= size[0], what
            assert page.tab.evaluate("document.querySelectorAll('[aria-current=page]').length") == 1, what


def test_outdated_page_requests_a_reload_and_can_stop(browser: Browser, served: Served) -> None:
    page = Page(browser, served)
    older = (
        "new MutationObserver(() => { const meta = document.querySelector('meta[name=version]');"
        "if (meta) meta.content = 'older'; }).observe(document, {childList: true, subtree: true})"
    )
    page.tab.ask("Page.addScriptToEvaluateOnNewDocument", source=older)
    page.tab.ask("Page.reload")
    wait_until(lambda: "reload it" in page.link)
    assert page.enabled("Reload")
    page.stop.click()
    page.wait_for("nothing to stop")


def test_page_without_connection_warns_that_stop_does_not_reach(browser: Browser) -> None:
    with studio() as lost:
        page = Page(browser, lost)
    wait_until(lambda: "connection lost" in page.link)
    page.wait_for("STOP does not reach the robot")
    page.stop.click()
    page.wait_for("NOT STOPPED")


LARGE = """(async () => {
  await import('/tree.js');
  const node = (number) => (
    {key: `1.${number}`, title: 'wait', symbol: '', arguments: {}, modifiers: [], children: []});
  const tree = document.createElement('studio-tree');
  document.querySelector('main').append(tree);
  const clock = performance.now;
  let ms = 0;
  performance.now = () => ++ms; // whatever this machine does, each look at the clock is a millisecond later
  const drawing = {...node(0), key: '1', children: [...Array(300).keys()].map(node)};
  tree.draw({mission: 'large', tree: drawing});
  tree.show({'1.299': ['running', '', 0]}, 0);
  const there = [tree.querySelectorAll('li').length];
  while (!tree.querySelector('li li.running')) {
    await new Promise(requestAnimationFrame);
    there.push(tree.querySelectorAll('li').length);
  }
  performance.now = clock;
  tree.remove();
  return there;
})()"""


def test_large_tree_is_drawn_in_pieces_without_blocking(browser: Browser, served: Served) -> None:
    there = Page(browser, served, view="#tasks").tab.evaluate(LARGE)
    assert there[-1] == 301
    assert max(after - before for before, after in pairwise([0, *there])) <= 12


def test_failsafe_page_steps_through_the_reactions_of_the_base(browser: Browser, served: Served) -> None:
    page = Page(browser, served, served.viewer, view="#failsafe")
    tab = page.tab
    now = "document.querySelector('.steps [aria-current]')?.textContent ?? ''"

    def said(words: str) -> bool:
        return words in str(tab.evaluate(now))

    for at, word, words in (
        (2, "bumper left", "backing off: bumper left"),
        (4, "latch", "stands until it is enabled: bumper left"),
        (2, "unplugged for 2 s", "gets no commands"),
    ):
        wait_until(lambda: tab.evaluate("document.querySelectorAll('.failsafe select').length") == 5)
        chosen = f"(() => {{ const e = document.querySelectorAll('.failsafe select')[{at}]; e.value = '{word}';"
        tab.evaluate(f"{chosen} e.dispatchEvent(new Event('change')) }})()")
        wait_until(partial(said, words))
    page.press("Previous")
    wait_until(lambda: str(tab.evaluate(now)).startswith("-"))
    assert tab.errors == []


def test_unknown_failsafe_choice_is_refused_with_a_suggestion(served: Served) -> None:
    with served.client(served.viewer) as client:
        answer = client.ask("failsafe", fault="bumper lift")
        assert (answer["error"], answer["hint"]) == ("bad_field", "did you mean 'bumper left'?")
