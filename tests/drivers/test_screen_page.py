"""The face as a page: who may ask for it, what a browser shows of it, and what becomes of it when the robot goes."""

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from http.client import HTTPConnection, HTTPResponse
from threading import Event
from threading import enumerate as enumerate_threads
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.api import DeviceStatus, Image, Mood, ScreenContent
from drivers.clock import SystemClock
from drivers.screen.drawing import draw_face, face_image
from drivers.screen.expression import face_expression
from drivers.screen.pages import PageScreen, shape_numbers
from drivers.screen.server import MAX_CONNECTIONS, MAX_LISTENERS, Connections
from tests.browser import Browser, Tab
from tests.cases import each
from tests.waiting import wait_until

PAGE_TIMEOUT = 30.0
SIZE = (640, 480)


@pytest.fixture
def screen() -> Iterator[PageScreen]:
    screen = PageScreen(SystemClock())
    screen.open()
    yield screen
    screen.close()


def port_of(screen: PageScreen) -> int:
    return int(screen.address.rstrip("/").rpartition(":")[2])


def ask(
    screen: PageScreen, path: str, *, host: str = "127.0.0.1", method: str = "GET", **headers: str
) -> tuple[HTTPResponse, str]:
    with closing(HTTPConnection("127.0.0.1", port_of(screen), timeout=PAGE_TIMEOUT)) as connection:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, headers={"Host": host, **named})
        response = connection.getresponse()
        return response, response.read().decode()


class Listener:
    """A page that listens, without a browser."""

    def __init__(self, screen: PageScreen, **headers: str) -> None:
        self._connection = HTTPConnection("127.0.0.1", port_of(screen), timeout=PAGE_TIMEOUT)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        self._connection.request("GET", "/events", headers=named)
        self._response = self._connection.getresponse()
        self.status = self._response.status

    def next(self) -> dict[str, Any]:
        """Return the next news; an empty dictionary once there will be no more."""
        while line := self._response.readline():
            if line.startswith(b"data: "):
                news: dict[str, Any] = json.loads(line.removeprefix(b"data: "))
                return news
        return {}

    def until(self, label: str) -> dict[str, Any]:
        """Read until the news say this, and return them."""
        while (news := self.next())["label"] != label:
            pass
        return news

    def close(self) -> None:
        self._response.close()
        self._connection.close()


# --- the server -------------------------------------------------------------------------------------------------------


@each(
    ("path", "kind"),
    [
        ("/", "text/html"),
        ("/?kiosk", "text/html"),
        ("/page.js", "text/javascript"),
        ("/page.css", "text/css"),
        ("/face.svg", "image/svg+xml"),
    ],
)
def test_page_may_only_request_its_own_server(screen: PageScreen, path: str, kind: str) -> None:
    response, text = ask(screen, path)
    assert (response.status, response.getheader("Content-Type")) == (200, f"{kind}; charset=utf-8")
    policy = str(response.getheader("Content-Security-Policy"))
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert response.getheader("Cross-Origin-Resource-Policy") == "same-origin"
    assert "://" not in text.replace("http://www.w3.org/2000/svg", "")


def test_the_page_has_the_face_at_first_sight(screen: PageScreen) -> None:
    screen.mood(Mood.SAD)
    screen.show("</svg><script>alert('no')</script>")
    _, text = ask(screen, "/")
    assert "sad face" in text
    assert "<script>alert" not in text
    assert "$" not in text


@each("host", ["localhost", "localhost:8321", "127.0.0.1:1", "[::1]:8321", "192.168.1.7"])
def test_local_host_name_is_accepted(screen: PageScreen, host: str) -> None:
    assert ask(screen, "/", host=host)[0].status == 200


@each("host", ["robot.example", "localhost.example:8321", "", "[", "127.0.0.1.example", "robot.example@localhost"])
@each("path", ["/", "/events"])
def test_rebound_host_name_is_refused(screen: PageScreen, host: str, path: str) -> None:
    assert ask(screen, path, host=host)[0].status == 403


@each(
    "headers",
    [
        {"Origin": "https://robot.example", "Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},  # another port of this computer
        {"Origin": "http://127.0.0.1:1"},
        {"Origin": "null"},
    ],
)
def test_pages_from_elsewhere_may_not_listen_and_take_no_place(screen: PageScreen, headers: dict[str, str]) -> None:
    for _ in range(MAX_LISTENERS):
        assert ask(screen, "/events", **headers)[0].status == 403
    assert screen.health().counters == {"pages": 0}


@each("site", ["same-origin", "none"])
def test_same_origin_page_may_listen(screen: PageScreen, site: str) -> None:
    with closing(Listener(screen, Sec_Fetch_Site=site, Origin=screen.address.rstrip("/"))) as page:
        assert page.status == 200


@each("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_write_methods_are_refused(screen: PageScreen, method: str) -> None:
    assert ask(screen, "/", method=method)[0].status == 501


def test_unknown_path_is_not_found(screen: PageScreen) -> None:
    assert ask(screen, "/../expression.py")[0].status == 404


def test_news_are_sent_when_the_face_changes_and_once_a_second_besides(screen: PageScreen) -> None:
    screen.mood(Mood.HAPPY)
    with closing(Listener(screen)) as page:
        usual = page.next()
        assert usual == page.next()  # a happy face is still
        screen.show("hello")
        assert page.until("happy face: hello")["lines"] == ["hello"]
        screen.mouth(1.0)
        shut = [
            shape_numbers(shape)
            for shape in draw_face(face_expression(ScreenContent(Mood.HAPPY, "hello"), 0.0), "hello").shapes
        ]
        while page.next()["shapes"] == shut:
            pass
        while page.next()["shapes"] != shut:  # 0.3 s later, by itself
            pass


def test_four_pages_may_listen_and_the_next_when_one_has_gone(screen: PageScreen) -> None:
    screen.mood(Mood.LISTENING)  # moves, so it is soon seen that one has gone
    pages = [Listener(screen) for _ in range(MAX_LISTENERS)]
    assert [page.status for page in pages] == [200] * MAX_LISTENERS
    assert screen.health().counters == {"pages": MAX_LISTENERS}
    with closing(Listener(screen)) as late:
        assert late.status == 503
    pages.pop().close()
    wait_until(lambda: screen.health().counters == {"pages": MAX_LISTENERS - 1})
    pages.append(Listener(screen))
    assert pages[-1].next()["label"] == "listening face"
    for page in pages:
        page.close()


def test_page_shows_a_sleeping_face_when_the_screen_closes(screen: PageScreen) -> None:
    with closing(Listener(screen)) as page:
        page.until("neutral face")
        screen.close()
        page.until("asleep face")
        while page.next():
            pass


def test_silent_and_slow_browsers_do_not_delay_close(screen: PageScreen) -> None:
    screen.mood(Mood.ASLEEP)
    with socket.create_connection(("127.0.0.1", port_of(screen))) as silent, socket.socket() as slow:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        slow.connect(silent.getpeername())
        slow.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        wait_until(lambda: screen.health().counters == {"pages": 1})
        for number in range(100):  # more than its buffers take
            screen.show("much too much " * 5000 + str(number))
            Event().wait(0.01)
        screen.close()
        assert screen.address == ""
    # The threads have ended: a fixture looks.


@pytest.mark.real_time
def test_many_silent_browsers_do_not_delay_close_further(screen: PageScreen) -> None:
    with ExitStack() as browsers:
        for _ in range(20):
            browsers.enter_context(socket.create_connection(("127.0.0.1", port_of(screen))))
        wait_until(lambda: len([thread for thread in enumerate_threads() if thread.name == "page talk"]) == 20)
        clock = SystemClock()
        screen.close()
        assert clock.now() < 2.0  # with 0.2 s for each it would be 4 s


def test_a_crowd_of_silent_browsers_is_hung_up_on_and_makes_room(
    screen: PageScreen, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.screen.server.REQUEST_TIMEOUT", 0.3)
    page = Listener(screen)
    with ExitStack() as browsers:
        for _ in range(3 * MAX_CONNECTIONS):
            browsers.enter_context(socket.create_connection(("127.0.0.1", port_of(screen))))
        talks = [thread for thread in enumerate_threads() if thread.name == "page talk"]
        assert len(talks) <= MAX_CONNECTIONS
        wait_until(lambda: sum(thread.is_alive() for thread in talks) <= 1)  # that of who listens, whichever it is
        assert ask(screen, "/")[0].status == 200
        assert page.next(), "who listens has time"
    page.close()


def test_idle_connections_shut_no_browser_out(screen: PageScreen) -> None:
    with ExitStack() as browsers:
        for number in range(3 * MAX_CONNECTIONS):
            browsers.enter_context(socket.create_connection(("127.0.0.1", port_of(screen))))
            if number % 16 == 0:
                assert ask(screen, "/")[0].status == 200
        assert ask(screen, "/")[0].status == 200


def test_one_address_cannot_take_all_listener_places() -> None:
    talks = Connections()
    places = [socket.socketpair() for _ in range(MAX_LISTENERS + 3)]
    try:
        ends = [pair[0] for pair in places]
        for end in ends[:MAX_LISTENERS]:
            assert talks.listen(end, "192.0.2.1")
        assert not talks.listen(ends[MAX_LISTENERS], "192.0.2.1")
        assert talks.listen(ends[MAX_LISTENERS + 1], "127.0.0.1")
        assert ends[0] not in talks.listeners
        assert places[0][1].recv(1) == b""
        assert talks.listen(ends[MAX_LISTENERS + 2], "127.0.0.1")
        assert not talks.listen(ends[0], "127.0.0.1")
        assert sorted(talks.listeners.values()) == ["127.0.0.1"] * 2 + ["192.0.2.1"] * 2
    finally:
        for pair in places:
            for end in pair:
                end.close()


def test_browser_with_a_slow_request_is_disconnected(screen: PageScreen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.screen.server.REQUEST_TIMEOUT", 0.3)
    clock, pause = SystemClock(), Event()
    with socket.create_connection(("127.0.0.1", port_of(screen))) as slow, suppress(ConnectionError):
        slow.sendall(b"GET / HTTP/1.1\r\n")
        while clock.now() < PAGE_TIMEOUT:
            slow.sendall(b"X")
            pause.wait(0.05)
    assert clock.now() < PAGE_TIMEOUT / 2


def test_two_robots_on_one_computer_take_two_ports(screen: PageScreen) -> None:
    other = PageScreen(SystemClock())
    other.open()
    assert other.health().online
    assert other.address not in ("", screen.address)
    other.close()


def test_busy_port_is_retried_and_the_screen_stays_usable(screen: PageScreen) -> None:
    told: list[DeviceStatus] = []
    port = port_of(screen)
    other = PageScreen(SystemClock(), port=port, report=told.append)
    other.open()
    assert (other.health().online, other.address) == (True, "")
    assert f"127.0.0.1 port {port}" in other.health().detail
    assert [notice.kind for notice in told] == ["fault"]
    assert "ss -ltnp" in told[0].hint
    other.mood(Mood.HAPPY)
    screen.close()
    wait_until(lambda: other.address)
    assert other.health().detail == ""
    assert "happy face" in ask(other, "/")[1]
    wait_until(lambda: len(told) == 2)
    assert (told[1].kind, other.address in told[1].message) == ("online", True)
    other.close()


def test_screen_waiting_for_its_port_can_be_closed(screen: PageScreen) -> None:
    other = PageScreen(SystemClock(), port=port_of(screen))
    other.open()
    other.close()
    assert other.health().detail == "screen: not opened yet"


# --- the page ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def tab(browser: Browser, screen: PageScreen) -> Tab:
    return browser.open(screen.address, size=SIZE)


def seen(tab: Tab) -> Image:
    image = cv2.imdecode(np.frombuffer(tab.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return image.astype(np.uint8)


def unlike(one: Image, other: Image) -> float:
    """Return by how much two pictures differ, in grey levels on average."""
    return float(np.abs(one.astype(int) - other).mean())


def label(tab: Tab) -> str:
    return next((image.name for image in tab.all("image")), "")  # none while the page is loaded


def mouth(tab: Tab) -> float:
    """Return how far the mouth is open on the page, in units of its sheet."""
    height = tab.evaluate("document.querySelectorAll('path[fill=\"#7c1f35\"]')[0].getBBox().height")
    return float(height)


def test_page_requests_only_its_server_without_errors(tab: Tab, screen: PageScreen) -> None:
    screen.show("hello")
    wait_until(lambda: "hello" in tab.text())
    names = ("", "page.css", "page.js", "events")
    assert set(tab.requests) == {screen.address + name for name in names}
    assert tab.errors == []


@pytest.mark.parametrize("mood", [mood for mood in Mood if mood is not Mood.SPEAKING])
def test_a_mood_is_to_be_seen(tab: Tab, screen: PageScreen, mood: Mood) -> None:
    screen.mood(mood)
    wait_until(lambda: label(tab) == f"{mood} face")
    drawn = face_image(face_expression(ScreenContent(mood), 2.3), "", SIZE)
    wait_until(lambda: unlike(seen(tab), drawn) < 3.5)  # whatever blinks and moves comes past this now and then


def test_page_shows_text_literally_and_clears_text(tab: Tab, screen: PageScreen) -> None:
    screen.mood(Mood.HAPPY)
    still = face_image(face_expression(ScreenContent(Mood.HAPPY), 0.0), "", SIZE)
    wait_until(lambda: unlike(seen(tab), still) < 3)
    screen.show("Hello <b>Anna</b> & Zoë")
    wait_until(lambda: label(tab) == "happy face: Hello <b>Anna</b> & Zoë")
    assert " ".join(tab.text().split()) == "Hello <b>Anna</b> & Zoë"
    above = face_image(face_expression(ScreenContent(Mood.HAPPY), 0.0), "Hello <b>Anna</b> & Zoë", SIZE)
    wait_until(lambda: unlike(seen(tab)[:320], above[:320]) < 3)
    assert (seen(tab)[330:].max(axis=2) > 128).mean() > 0.05
    screen.show("")
    wait_until(lambda: label(tab) == "happy face")
    assert tab.text().strip() == ""
    wait_until(lambda: unlike(seen(tab), still) < 3)


def test_page_mouth_moves_with_speech_and_closes(tab: Tab, screen: PageScreen) -> None:
    assert mouth(tab) < 10

    def speak() -> bool:
        screen.mouth(1.0)
        return mouth(tab) > 30

    wait_until(speak)
    wait_until(lambda: mouth(tab) < 10)


def test_the_face_does_not_jump_from_mood_to_mood(tab: Tab, screen: PageScreen) -> None:
    screen.mood(Mood.ASLEEP)
    wait_until(lambda: label(tab) == "asleep face")
    tab.evaluate("""
        globalThis.heights = [];
        new MutationObserver(() => heights.push(document.querySelectorAll('path[fill="#7c1f35"]')[0].getBBox().height))
            .observe(document.querySelector("#face"), {subtree: true, attributes: true, attributeFilter: ["d"]});
    """)
    screen.mood(Mood.SURPRISED)
    wait_until(lambda: mouth(tab) > 30)
    heights = tab.evaluate("heights")
    assert any(heights[0] + 1 < height < heights[-1] - 1 for height in heights)


def test_page_sleeps_after_three_seconds_without_news(tab: Tab, screen: PageScreen) -> None:
    screen.show("help")
    wait_until(lambda: label(tab) == "neutral face: help")
    clock = SystemClock()
    with screen._lock:  # as if the robot hung
        wait_until(lambda: label(tab) == "asleep face")
        assert clock.now() > 1.8  # the last news were up to a second old
        wait_until(
            lambda: unlike(seen(tab), face_image(face_expression(ScreenContent(Mood.ASLEEP), 1.0), "", SIZE)) < 3.5
        )
        assert tab.text().strip() == ""
    wait_until(lambda: label(tab) == "neutral face: help")
    wait_until(lambda: tab.text().strip() == "help")


def test_open_page_shows_the_next_run(tab: Tab, screen: PageScreen) -> None:
    port = port_of(screen)
    screen.close()
    wait_until(lambda: label(tab) == "asleep face")
    other = PageScreen(SystemClock(), port=port)
    other.open()
    other.mood(Mood.HAPPY)
    wait_until(lambda: label(tab) == "happy face")
    other.close()


def test_page_of_another_release_reloads(tab: Tab, screen: PageScreen) -> None:
    tab.evaluate("document.documentElement.dataset.edition = 'old'; globalThis.old = true; 0")
    screen.mood(Mood.HAPPY)
    wait_until(lambda: not tab.evaluate("globalThis.old ?? false"))
    wait_until(lambda: label(tab) == "happy face")


def test_page_fills_any_screen_with_a_centred_face(browser: Browser, screen: PageScreen) -> None:
    screen.mood(Mood.HAPPY)
    for size in ((800, 480), (480, 800)):
        image = seen(browser.open(screen.address, size=size))
        assert image.shape == (size[1], size[0], 3)
        bright = image.max(axis=2) > 128
        rows, columns = np.nonzero(bright)
        assert (columns.min() + columns.max()) / 2 == pytest.approx(size[0] / 2, abs=3)
        assert abs((rows.min() + rows.max()) / 2 - size[1] / 2) < 0.1 * size[1]
        assert np.ptp(columns) > 0.6 * min(size)
        corners = image[[0, 0, -1, -1], [0, -1, 0, -1]]
        assert (corners == corners[0]).all()


def test_http_server_is_imported_only_for_browsers() -> None:
    program = "import drivers.screen.pages, sys; print('http.server' in sys.modules)"
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert told.strip() == "False"
