"""The page of `mission see`: who may look, what a browser shows, and when nothing is drawn."""

import base64
import json
from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection, HTTPResponse
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest

from drivers.api import Image
from missions.plugins.setup.camera_page.server import MAX_PICTURE_WIDTH, CameraPage
from tests.browser import Browser
from tests.waiting import wait_until

PAGE_TIMEOUT = 30.0


@pytest.fixture
def page() -> Iterator[CameraPage]:
    with closing(CameraPage()) as page:
        page.open()
        yield page


def ask(page: CameraPage, path: str) -> tuple[HTTPConnection, HTTPResponse]:
    connection = HTTPConnection("127.0.0.1", urlsplit(page.link).port, timeout=PAGE_TIMEOUT)
    connection.request("GET", path)
    return connection, connection.getresponse()


def status(page: CameraPage, path: str) -> int:
    connection, response = ask(page, path)
    with closing(connection):
        return response.status


def red(width: int) -> Image:
    return np.full((width // 2, width, 3), (0, 0, 255), np.uint8)


def test_camera_page_is_reachable_only_by_its_link(page: CameraPage) -> None:
    page.show(red(64), "nobody")
    assert status(page, urlsplit(page.link).path) == 200
    assert [status(page, path) for path in ("/", "/events", "/page.js", "/x/events")] == [404] * 4
    with closing(CameraPage()) as other:
        other.open()
        assert urlsplit(other.link).port != urlsplit(page.link).port
        assert status(other, urlsplit(page.link).path) == 404, "each has a name of its own"
    assert not page.has_viewers


def test_large_picture_is_scaled_and_the_end_is_sent(page: CameraPage) -> None:
    page.show(red(2 * MAX_PICTURE_WIDTH), "1 face")
    connection, response = ask(page, urlsplit(page.link).path + "events")
    with closing(connection):
        wait_until(lambda: page.has_viewers)
        news = json.loads(next(line for line in iter(response.readline, b"") if line.startswith(b"data: "))[6:])
        assert news["told"] == "1 face"
        image = cv2.imdecode(np.frombuffer(base64.b64decode(news["jpeg"]), np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        assert image.shape == (MAX_PICTURE_WIDTH // 2, MAX_PICTURE_WIDTH, 3)
        page.close()
        assert b'data: {"told": "the camera is closed"}' in response.read()
    assert page.link == ""


def test_browser_shows_the_picture_and_the_percepts(page: CameraPage, browser: Browser) -> None:
    tab = browser.open(page.link, size=(640, 480))
    wait_until(lambda: page.has_viewers)
    page.show(red(640), "1 face: Anna")
    wait_until(lambda: "1 face: Anna" in tab.text())
    wait_until(lambda: tab.evaluate("document.querySelector('#picture').naturalWidth") == 640)
    shot = cv2.imdecode(np.frombuffer(tab.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert shot is not None
    assert shot[200, 320].tolist() == pytest.approx([0, 0, 254], abs=4)
    assert set(tab.requests) == {page.link + name for name in ("", "page.css", "page.js", "events")}
    assert tab.errors == []
    page.close()
    wait_until(lambda: "the camera is closed" in tab.text())
