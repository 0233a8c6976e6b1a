"""A cookie goes to every server on the same host name, whatever its port: by itself it opens no more than the page."""

import json
from http import HTTPStatus
from urllib.parse import quote

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from drivers.clock import ManualClock
from missions.plugins.studio.access import (
    MAX_SIGN_INS,
    MAX_WRONG_TOKENS,
    ONCE_TOKEN_LIFETIME,
    WRONG_TOKEN_WINDOW,
    StudioAccess,
)
from tests.cases import each
from tests.missions.studio.serving import PATIENCE, Served

ELSEWHERE = {
    "a picture of another site": ("cross-site", "no-cors", "image"),
    "a picture of another port": ("same-site", "no-cors", "image"),
    "a frame of another site": ("cross-site", "navigate", "iframe"),
    "a script of another site": ("cross-site", "no-cors", "script"),
    "a request of another port": ("same-site", "cors", "empty"),
    "an object of another site": ("cross-site", "navigate", "object"),
}
"""Requests that pages of other servers make in a browser, by the headers in which the browser says so."""


def fetched(site: str, mode: str, dest: str) -> dict[str, str]:
    return {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": mode, "Sec-Fetch-Dest": dest}


def opened(served: Served, address: str, cookie: str) -> ClientConnection:
    """Open a websocket as a program does that has got the cookie of a browser, and tells any origin."""
    return connect(address, additional_headers={"Cookie": cookie}, origin=Origin(f"http://{served.host}"))


def refused(served: Served, address: str, cookie: str) -> int:
    with pytest.raises(InvalidStatus) as found, opened(served, address, cookie):
        pass
    return int(found.value.response.status_code)


@each("path", ["/records/none.mcap", "/reports/none.mcap", "/ws", "/other/page.js", "/ws/"])
def test_a_cookie_alone_opens_nothing_but_the_page(served: Served, path: str) -> None:
    cookie = served.cookie(served.operator)
    assert served.get(path, Cookie=cookie)[0] == HTTPStatus.UNAUTHORIZED
    assert served.get("/main.js", Cookie=cookie)[0] == HTTPStatus.OK


def test_no_websocket_opens_with_a_cookie_alone(served: Served) -> None:
    cookie, address = served.page_socket(served.operator)
    _, other = served.page_socket(served.operator)
    plain = address.partition("?")[0]
    for wrong in (
        plain,
        f"{plain}?proof=",
        f"{plain}?proof=ab",
        f"{address}0",
        other,
        address[:-1],
        f"{plain}?proof=%ff",
    ):
        assert refused(served, wrong, cookie) == HTTPStatus.UNAUTHORIZED, wrong
    with opened(served, address, cookie) as client:
        client.send('{"do": "hello", "version": "2"}')
        assert json.loads(client.recv(timeout=PATIENCE))["role"] == "operator"


def test_a_proof_alone_opens_nothing(served: Served) -> None:
    _, address = served.page_socket(served.operator)
    other = served.cookie(served.viewer)
    for cookie in ("a=b", other, f"missiontree_{served.port}=", f"missiontree_{served.port}=x"):
        assert refused(served, address, cookie) == HTTPStatus.UNAUTHORIZED


def test_the_proof_of_one_path_opens_no_other(served: Served) -> None:
    cookie, where = served.sign_in(served.operator)
    _, _, proof = where.partition("?")
    assert served.get(f"/records/none.mcap?{proof}", Cookie=cookie)[0] == HTTPStatus.UNAUTHORIZED
    cookie, where = served.sign_in(served.operator, "/records/none.mcap")
    assert served.get(where, Cookie=cookie)[0] == HTTPStatus.NOT_FOUND
    _, _, proof = where.partition("?")
    for path in ("/records/other.mcap", "/reports/none.mcap"):
        assert served.get(f"{path}?{proof}", Cookie=cookie)[0] == HTTPStatus.UNAUTHORIZED
    assert refused(served, f"ws://{served.host}/ws?{proof}", cookie) == HTTPStatus.UNAUTHORIZED


def test_second_tab_keeps_the_proof_of_the_first(served: Served) -> None:
    cookie, where = served.sign_in(served.operator, "/records/none.mcap")
    status, headers, _ = served.get(f"/?token={served.operator}", Cookie=cookie)
    assert (status, "set-cookie" in headers) == (HTTPStatus.SEE_OTHER, False)
    assert served.get(headers["location"], Cookie=cookie)[0] == HTTPStatus.OK
    assert served.get(where, Cookie=cookie)[0] == HTTPStatus.NOT_FOUND
    _, headers, _ = served.get(f"/?token={served.viewer}", Cookie=cookie)
    assert "set-cookie" in headers  # that of another role


def test_link_with_a_false_proof_is_redirected_without_proof(served: Served) -> None:
    cookie, where = served.sign_in(served.operator)
    assert served.get(where, Cookie=cookie)[0] == HTTPStatus.OK
    for wrong in ("/?proof=evil", "/?proof=", "/?a=1&proof=evil"):
        status, headers, _ = served.get(wrong, Cookie=cookie)
        assert status == HTTPStatus.SEE_OTHER
        assert "proof" not in headers["location"]


def test_cookie_of_another_port_is_ignored(served: Served) -> None:
    cookie, where = served.sign_in(served.operator)
    name, _, value = cookie.partition("=")
    assert name == f"missiontree_{served.port}"
    assert served.get(where, Cookie=f"missiontree_1={value}")[0] == HTTPStatus.UNAUTHORIZED
    # A server beside may set one of the same name: the right one still counts.
    assert served.get(where, Cookie=f"{name}=tossed; {cookie}; {name}=tossed")[0] == HTTPStatus.OK


def test_cookie_behind_a_tunnel_has_the_port_of_the_browser(served: Served) -> None:
    for host, name in (("localhost:9001", "missiontree_9001"), ("localhost", "missiontree_")):
        _, headers, _ = served.get(f"/?token={served.viewer}", Host=host)
        assert headers["set-cookie"].startswith(f"{name}=")


@each("host", ["127.0.0.1:x", "127.0.0.1:99999", "[::1", "127.0.0.1:-1", "127.0.0.1:8 0"])
def test_a_host_with_a_wrong_port_is_refused(served: Served, host: str) -> None:
    status = served.get("/", Host=host, Cookie=served.cookie(served.viewer))[0]
    assert status in (HTTPStatus.BAD_REQUEST, HTTPStatus.FORBIDDEN)


@each("who", ELSEWHERE)
def test_requests_of_foreign_pages_are_refused_and_not_counted(served: Served, who: str) -> None:
    headers = fetched(*ELSEWHERE[who])
    for number in range(2 * MAX_WRONG_TOKENS):
        assert served.get(f"/?token=wrong{number}", **headers)[0] == HTTPStatus.FORBIDDEN
    assert served.get(f"/?token={served.operator}", **headers)[0] == HTTPStatus.FORBIDDEN
    assert served.get(f"/?token={served.operator}")[0] == HTTPStatus.SEE_OTHER


@each("site", ["none", "same-origin", "same-site", "cross-site"])
def test_access_link_works_from_any_site(served: Served, site: str) -> None:
    headers = fetched(site, "navigate", "document")
    assert served.get(f"/?token={served.operator}", **headers)[0] == HTTPStatus.SEE_OTHER
    cookie, where = served.sign_in(served.operator, "/records/none.mcap")
    expected = HTTPStatus.NOT_FOUND if site in ("none", "same-origin") else HTTPStatus.FORBIDDEN
    assert served.get(where, Cookie=cookie, **headers)[0] == expected


def test_the_right_token_opens_in_the_middle_of_wrong_ones() -> None:
    access = StudioAccess(clock=ManualClock())
    for number in range(1000):
        assert access.by_token(f"wrong{number}", "1.2.3.4") is None
        assert access.by_token(access.operator, "1.2.3.4") == "operator"
        assert access.by_token(access.viewer, "1.2.3.4") == "viewer"
    assert access.has_many_wrong("1.2.3.4")
    assert not access.has_many_wrong("1.2.3.5")


def test_right_tokens_do_not_count_as_tries_and_wrong_ones_are_forgotten() -> None:
    access = StudioAccess(clock=(clock := ManualClock()))
    for _ in range(10 * MAX_WRONG_TOKENS):
        access.by_token(access.viewer, "1.2.3.4")
    assert not access.has_many_wrong("1.2.3.4")
    for _ in range(MAX_WRONG_TOKENS):
        access.by_token("wrong", "1.2.3.4")
    assert access.has_many_wrong("1.2.3.4")
    clock.advance(WRONG_TOKEN_WINDOW + 1.0)
    assert not access.has_many_wrong("1.2.3.4")


@each("token", ["", " ", "\ud800", "é" * 100, "x" * 10_000, "\0"])
def test_strange_tokens_open_nothing(token: str) -> None:
    assert StudioAccess().by_token(token, "1.2.3.4") is None


def test_once_token_expires() -> None:
    access = StudioAccess(clock=(clock := ManualClock()))
    token = access.make_once_token()
    clock.advance(ONCE_TOKEN_LIFETIME + 1.0)
    assert access.by_token(token, "1.2.3.4") is None
    assert not access.is_once_open


def test_viewer_sign_ins_do_not_evict_operators() -> None:
    access = StudioAccess()
    cookie, _ = access.sign_in("operator")
    viewers = [access.sign_in("viewer")[0] for _ in range(MAX_SIGN_INS + 1)]
    assert access.by_cookie(cookie) is not None
    assert [access.by_cookie(each) is not None for each in (viewers[0], viewers[1], viewers[-1])] == [False, True, True]


def test_new_links_end_all_proofs() -> None:
    access = StudioAccess()
    cookie, sign_in = access.sign_in("operator")
    assert sign_in.is_proved("/ws", sign_in.proof("/ws"))
    assert not sign_in.is_proved("/ws", sign_in.proof("/ws?"))
    access.renew()
    assert access.by_cookie(cookie) is None


@each(
    "name",
    [
        "a b.mcap",
        "a#b.mcap",
        "a?b.mcap",
        "100%.mcap",
        "a%23.mcap",
        '"q".mcap',
        "ä€.mcap",
        "<b>.mcap",
        "a&b=c.mcap",
        "a+b.mcap",
        "a;b'.mcap",
        "..mcap",
    ],
)
def test_proof_is_valid_for_any_record_name(served: Served, name: str) -> None:
    cookie, where = served.sign_in(served.operator, f"/records/{quote(name)}")
    assert served.get(where, Cookie=cookie)[0] == HTTPStatus.NOT_FOUND
