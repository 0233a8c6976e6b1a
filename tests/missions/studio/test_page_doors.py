"""The doors of the studio in a browser: what its page keeps, and what pages of other servers get at."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from missions.plugins.records.retention import records_folder
from missions.plugins.studio.access import MAX_WRONG_TOKENS
from tests.browser import Browser, Tab
from tests.missions.records.report.told_record import items, write
from tests.missions.studio.attacks import ATTACKS, attack
from tests.missions.studio.neighbour import Neighbour, neighbour
from tests.missions.studio.page import Page
from tests.missions.studio.serving import Served, studio
from tests.waiting import wait_until

NAMES = (
    "a b.mcap",
    "a#b.mcap",
    "a?b=c.mcap",
    "100%.mcap",
    "a%23b.mcap",
    "'q\".mcap",
    "ä€ö.mcap",
    "<i>x.mcap",
    "a&b+c;d.mcap",
)

TRIES_OF_ANOTHER_PAGE = """(async () => {{
  const made = (tag, more) => new Promise((done) => {{
    const node = document.createElement(tag);
    node.onload = () => done(true);
    node.onerror = () => done(false);
    Object.assign(node, more);
    document.body.append(node);
  }});
  const there = "http://{host}";
  const readable = async (path) => {{
    const found = await fetch(there + path, {{credentials: "include"}}).catch(() => null);
    return found !== null && (await found.text()).length > 0;
  }};
  const socket = (path) => new Promise((done) => {{
    const found = new WebSocket("ws://{host}" + path);
    found.onopen = () => done(true);
    found.onerror = () => done(false);
  }});
  return {{
    fetch: await readable("/"),
    record: await readable("/records/none.mcap"),
    script: await made("script", {{src: there + "/main.js"}}),
    style: await made("link", {{rel: "stylesheet", href: there + "/style.css"}}),
    picture: await made("img", {{src: there + "/"}}),
    socket: await socket("/ws"),
    guessed: await socket("/ws?proof=0"),
  }};
}})()"""


@pytest.fixture
def beside() -> Iterator[Neighbour]:
    with neighbour() as found:
        yield found


def told(tab: Tab) -> str:
    """Return what the page says of its link; nothing while it is loading."""
    return str(tab.evaluate("document.getElementById('link')?.textContent ?? ''"))


def signed_in(tab: Tab) -> bool:
    return "operator" in told(tab)


def test_page_stores_but_does_not_show_its_proof(browser: Browser, served: Served) -> None:
    tab = (page := Page(browser, served, view="#records")).tab
    assert tab.evaluate("location.href") == f"http://{served.host}/#records"
    assert len(tab.evaluate("localStorage.getItem('proof')")) == 64
    assert tab.evaluate("document.cookie") == ""
    tab.ask("Page.reload")
    wait_until(lambda: signed_in(tab))
    tab.go(f"http://{served.host}/?a=1#tasks")
    wait_until(lambda: signed_in(tab))
    assert tab.evaluate("location.href") == f"http://{served.host}/?a=1#tasks"
    assert "proof" not in page.tab.text()


def test_page_without_its_proof_says_which_link_to_open(browser: Browser, served: Served) -> None:
    tab = Page(browser, served).tab
    tab.evaluate("localStorage.removeItem('proof')")
    tab.ask("Page.reload")
    wait_until(lambda: "open the link that mission studio printed" in told(tab))
    tab.go(f"http://{served.host}/?token={served.operator}")
    wait_until(lambda: signed_in(tab))


def test_browser_without_storage_is_signed_in_until_reload(browser: Browser, served: Served) -> None:
    tab = Page(browser, served).tab
    source = "Object.defineProperty(window, 'localStorage', {get() { throw new DOMException('no', 'SecurityError') }})"
    tab.ask("Page.addScriptToEvaluateOnNewDocument", source=source)
    tab.go(f"http://{served.host}/?token={served.operator}")
    wait_until(lambda: signed_in(tab))


def test_cookie_stolen_by_another_port_grants_no_access(browser: Browser, served: Served, beside: Neighbour) -> None:
    tab = Page(browser, served).tab
    tab.go(beside.address)
    stolen = next(cookie for cookie in beside.cookies if "missiontree_" in cookie)
    assert served.get("/records/none.mcap", Cookie=stolen)[0] == 401
    with (
        pytest.raises(InvalidStatus, match="401"),
        connect(
            f"ws://{served.host}/ws", origin=Origin(f"http://{served.host}"), additional_headers={"Cookie": stolen}
        ),
    ):
        pass
    assert tab.evaluate("localStorage.getItem('proof')") is None  # that is of another origin


def test_a_page_beside_reads_nothing_and_opens_nothing(browser: Browser, served: Served, beside: Neighbour) -> None:
    tab = Page(browser, served).tab
    tab.go(beside.address)
    assert set(tab.evaluate(TRIES_OF_ANOTHER_PAGE.format(host=served.host)).values()) == {False}
    tab.go(f"http://{served.host}/")
    wait_until(lambda: signed_in(tab))


def test_images_with_wrong_tokens_do_not_lock_the_user_out(browser: Browser, served: Served, beside: Neighbour) -> None:
    pictures = "".join(f'<img src="http://{served.host}/?token=w{each}">' for each in range(3 * MAX_WRONG_TOKENS))
    frames = f'<iframe src="http://{served.host}/?token=f"></iframe>' * 3
    beside.page = f"<!doctype html><title>storm</title>{pictures}{frames}"
    tab = browser.open(beside.address)
    # They are refused before they are looked at: one more wrong one is not told to wait.
    assert served.get("/?token=wrong")[0] == 403
    tab.go(f"http://{served.host}/?token={served.operator}")
    wait_until(lambda: signed_in(tab))


def test_stop_works_while_foreign_pages_try_tokens(browser: Browser, served: Served, beside: Neighbour) -> None:
    storm = f"new Image().src = 'http://{served.host}/?token=' + Math.random()"
    beside.page = f"<!doctype html><script>setInterval(() => {{ {storm} }}, 2)</script>"
    tab = browser.open(beside.address)
    with served.client(served.viewer) as client:
        for _ in range(5):
            assert client.ask("stop")["ok"]
    tab.go(f"http://{served.host}/?token={served.viewer}")
    page = Page(browser, served)
    page.stop.click()
    page.wait_for("No runs; nothing to stop.")


@pytest.mark.parametrize("what", ["say nothing", "ask with a wrong token"])
def test_page_opens_and_stop_works_during_an_attack(browser: Browser, what: str) -> None:
    with studio() as served:
        before = Page(browser, served)
        with attack(served, ATTACKS[what]):
            before.stop.click()
            before.wait_for("No runs; nothing to stop.")
            page = Page(browser, served, view="#tasks")
            page.stop.click()
            page.wait_for("No runs; nothing to stop.")


def test_link_on_another_page_signs_in(browser: Browser, served: Served, beside: Neighbour) -> None:
    beside.page = f'<!doctype html><a href="http://{served.host}/?token={served.operator}#tasks">studio</a>'
    tab = browser.open(beside.address)
    tab.find("link", "studio").click()
    wait_until(lambda: signed_in(tab))
    assert tab.evaluate("location.hash") == "#tasks"


def test_file_with_a_redirect_signs_in(browser: Browser, served: Served, tmp_path: Path) -> None:
    path = tmp_path / "lead.html"
    link = f"http://{served.host}/?token={served.operator}"
    path.write_text(f'<!doctype html><meta http-equiv="refresh" content="0; url={link}">', encoding="utf-8")
    tab = browser.open(path)
    wait_until(lambda: tab.evaluate("location.protocol") == "http:" and signed_in(tab))


@pytest.mark.parametrize("proof", ["proof=evil", "proof="])
def test_link_with_a_false_proof_keeps_the_sign_in(
    browser: Browser, served: Served, beside: Neighbour, proof: str
) -> None:
    tab = Page(browser, served).tab
    before = tab.evaluate("localStorage.getItem('proof')")
    beside.page = f'<!doctype html><a href="http://{served.host}/?{proof}">studio</a>'
    tab.go(beside.address)
    tab.find("link", "studio").click()
    wait_until(lambda: tab.evaluate("location.port") == str(served.port) and signed_in(tab))
    assert tab.evaluate("localStorage.getItem('proof')") == before


def test_two_studios_of_one_computer_are_open_at_the_same_time(browser: Browser, served: Served) -> None:
    with studio() as other:
        tab = Page(browser, served).tab
        tab.go(f"http://{other.host}/?token={other.viewer}")
        wait_until(lambda: "viewer" in told(tab))
        tab.go(f"http://{served.host}/")
        wait_until(lambda: signed_in(tab))


@pytest.fixture
def strange(served: Served, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Path]]:
    """Have records of strange names for the studio that tests share, until the test is over."""
    monkeypatch.setenv("XDG_STATE_HOME", str(served.state))
    found: list[Path] = []

    def keep(name: str) -> Path:
        records_folder().mkdir(parents=True, exist_ok=True)
        found.append(write(records_folder() / name, items()))
        return found[-1]

    yield keep
    for path in found:
        path.unlink()


@pytest.mark.parametrize("name", NAMES)
def test_a_record_of_any_name_is_opened_reported_and_downloaded(
    browser: Browser, served: Served, strange: Callable[[str], Path], name: str
) -> None:
    path = strange(name)
    tab = (page := Page(browser, served, view="#records")).tab
    wait_until(lambda: tab.evaluate("!!document.querySelector('.record-list a')"))
    tab.evaluate("document.querySelector('.record-list a').click()")
    wait_until(lambda: any(each.name == "Report" for each in tab.all("link")))
    href = "[...document.querySelectorAll('a.button')].find((each) => each.textContent === '{}').href"
    fetched = (
        f"fetch({href.format('Download')}).then(async (answer) => [answer.status, (await answer.blob()).size,"
        "answer.headers.get('content-disposition')])"
    )
    status, size, said = tab.evaluate(fetched)
    assert (status, size) == (200, path.stat().st_size)
    assert said.startswith("attachment; filename")
    assert tab.evaluate(f"fetch({href.format('Report')}).then((answer) => answer.status)") == 200
    tab.ask("Page.reload")  # the address has the name in it
    wait_until(lambda: any(each.name == "Report" for each in tab.all("link")))
    assert page.tab.errors == []


def test_record_name_typed_unescaped_into_the_address_opens(
    browser: Browser, served: Served, strange: Callable[[str], Path]
) -> None:
    strange("100%.mcap")
    tab = Page(browser, served, view="#records/100%.mcap").tab
    wait_until(lambda: any(each.name == "Report" for each in tab.all("link")))
