"""Nobody gets into the studio who has not shown a token: each route and each message is tried, and new ones fail."""

import json
import re
import socket
import ssl
from collections.abc import Iterator, Mapping
from contextlib import closing, suppress
from functools import partial
from http.client import HTTPResponse, HTTPSConnection
from pathlib import Path
from ssl import Purpose

import jsonschema
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from drivers.clock import SystemClock
from missions.control.commands import MAX_COMMAND_BYTES, MAX_REFUSED_BYTES
from missions.plugins.studio.access import StudioAccess, load_tokens, save_tokens
from missions.plugins.studio.connections import MAX_CONNECTIONS
from missions.plugins.studio.studio_commands import COMMANDS, protocol_schema
from missions.plugins.studio.web_server import routes
from tests.cases import each
from tests.missions.command import command
from tests.missions.studio.proxy import plain_port, proxy
from tests.missions.studio.running import DRIVING, run_of
from tests.missions.studio.serving import PATIENCE, Client, Served, studio
from tests.waiting import wait_until

ROUTES = {
    "/ws": "/ws",
    "/": "/",
    "/records/{name}": "/records/none.mcap",
    "/reports/{name}": "/reports/none.mcap",
    "/{name}": "/none.js",
}
"""Every route, and a path of it."""

NEEDS: Mapping[str, dict[str, object]] = {
    "mission": {"name": "greet"}, "world": {"name": "living_room"}, "start": {"mission": "greet"},
    "release": {"stop": 1}, "drive": {"n": 1, "stamp": 0, "ahead": 0, "left": 0},
    "look": {"n": 1, "stamp": 0, "left": 0, "down": 0},
    "seen": {"t": 0}, "record": {"name": "none"}, "moment": {"name": "none", "t": 0},
    "compare": {"name": "none", "other": "none"}, "add_task": {"mission": "greet"},
    "move_task": {"task": 1, "priority": 1}, "cancel_task": {"task": 1}, "approve_task": {"task": 1},
    "show_person": {"jpeg": "AAAA"}, "add_person": {"name": "Ana", "run": "1"}, "fault": {"what": "camera frozen"},
    "tune": {"name": "head.pan.trim", "value": 0.1}, "keep_tuning": {"run": "1"},
}  # fmt: skip
"""What must be there in a command beside its word."""


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with studio() as found:
        yield found


def test_all_routes_are_known_here() -> None:
    assert [getattr(route, "path", "") for route in routes()] == list(ROUTES)


@each("path", ROUTES.values())
def test_every_route_refuses_a_missing_or_wrong_token(served: Served, path: str) -> None:
    assert served.get(path)[0] == 401
    assert served.get(path, Cookie=f"missiontree_{served.port}=wrong")[0] == 401
    assert served.get(path, Authorization="Basic b3A6b3A=")[0] == 401
    assert served.get(f"{path}?token=wrong")[0] in (403, 429)


@each("path", ROUTES.values())
def test_every_route_refuses_another_host_or_origin(served: Served, path: str) -> None:
    cookie = served.cookie(served.operator)
    for host in ("evil.example", f"evil.example:{served.port}", "127.0.0.1.evil.example", f"a@{served.host}", ""):
        assert served.get(path, Host=host, Cookie=cookie)[0] in (400, 403), host
    for origin in (
        "null",
        "http://evil.example",
        f"http://{served.host}.evil.example",
        "file://",
        f"https//{served.host}",
    ):
        assert served.get(path, Origin=origin, Cookie=cookie)[0] == 403, origin


def test_nothing_but_get_is_answered(served: Served) -> None:
    connection = socket.create_connection(("127.0.0.1", served.port))
    with closing(connection):
        connection.sendall(f"POST / HTTP/1.1\r\nHost: {served.host}\r\nContent-Length: 0\r\n\r\n".encode())
        assert b"405" in connection.recv(4096).partition(b"\r\n")[0]


def test_access_link_becomes_a_protected_cookie(served: Served) -> None:
    status, headers, _ = served.get(f"/?token={served.operator}&a=1")
    assert status == 303
    assert re.fullmatch(r"/\?a=1&proof=[0-9a-f]{64}", headers["location"])
    assert {"HttpOnly", "SameSite=lax", "Path=/"} <= set(headers["set-cookie"].split("; "))
    assert headers["referrer-policy"] == "no-referrer"
    assert served.operator not in str(headers)
    assert served.get(f"//evil.example/?token={served.operator}")[1]["location"].startswith("/evil.example/?proof=")


def test_every_response_has_security_headers(served: Served) -> None:
    for path in ROUTES.values():
        headers = served.get(path)[1]
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in headers


def test_websocket_requires_a_cookie_and_the_own_origin(served: Served) -> None:
    cookie, address = served.page_socket(served.viewer)
    own = f"http://{served.host}"
    tries: list[tuple[dict[str, str], str | None]] = [
        ({}, own), ({"Cookie": cookie}, None), ({"Cookie": cookie}, "null"), ({"Cookie": cookie}, "http://evil.example"),
        ({"Cookie": "a=b"}, own), ({"Authorization": "Bearer wrong"}, None),
    ]  # fmt: skip
    for headers, origin in tries:
        named = None if origin is None else Origin(origin)
        with pytest.raises(InvalidStatus) as refused, connect(address, additional_headers=headers, origin=named):
            pass
        assert refused.value.response.status_code in (401, 403)
    with connect(address, additional_headers={"Cookie": cookie}, origin=Origin(own)) as client:
        client.send('{"do": "hello", "version": "2"}')
        assert json.loads(client.recv(timeout=PATIENCE))["role"] == "viewer"


def test_after_many_wrong_tokens_the_right_one_still_opens() -> None:
    with studio() as served:
        cookie = served.cookie(served.operator)
        tried = [served.get(f"/?token=wrong{number}")[0] for number in range(12)]
        assert tried == [403] * 9 + [429] * 3
        assert served.get(f"/?token={served.operator}")[0] == 303
        assert served.get("/none.js", Cookie=cookie)[0] == 404


def test_new_links_shut_out_whoever_came_by_the_former_ones() -> None:
    with studio() as served, served.client(served.operator) as asks, served.client(served.viewer) as viewer:
        former, cookie = (served.operator, served.viewer), served.cookie(served.operator)
        answer = asks.ask("revoke")
        jsonschema.validate(answer, protocol_schema())
        new = answer["result"]
        with pytest.raises(ConnectionClosed):
            viewer.hear(lambda told: told["say"] == "answer")
        assert served.get("/", Cookie=cookie)[0] == 401
        assert [served.get(f"/?token={token}")[0] for token in former] == [403, 403]
        assert asks.ask("tasks")["ok"]
        assert [served.get("/", Cookie=served.cookie(new[role]))[0] for role in ("operator", "viewer")] == [200, 200]
        with served.client(new["viewer"]) as again:
            assert again.ask("revoke")["error"] == "not_allowed"


def test_a_viewer_sees_and_stops_and_nothing_else(served: Served) -> None:
    schema = protocol_schema()
    with served.client(served.viewer) as client:
        jsonschema.validate(client.welcome, schema)
        for word, kind in COMMANDS.items():
            if word == "hello":
                continue
            answer = client.ask(word, **NEEDS.get(word, {}))
            jsonschema.validate(answer, schema)
            assert (answer.get("error") == "not_allowed") == (kind.role == "operator"), word
    for path in ("/records/none.mcap", "/reports/none.mcap"):
        for token, expected in ((served.viewer, 403), (served.operator, 404)):
            cookie, where = served.sign_in(token, path)
            assert served.get(where, Cookie=cookie)[0] == expected


def test_before_hello_no_command_is_done(served: Served) -> None:
    for word in COMMANDS:
        if word != "hello":
            with served.client(served.operator, hello=False) as client:
                client.send(do=word, **NEEDS.get(word, {}))
                assert client.hear(lambda told: told["say"] == "answer")["error"] == "hello_first"
                with pytest.raises(ConnectionClosed):
                    client.socket.recv(timeout=PATIENCE)


def test_old_page_must_reload(served: Served) -> None:
    with served.client(served.operator, hello=False) as client:
        client.send(do="hello", version="0123456789abcdef")
        assert client.hear(bool)["error"] == "old_page"


@each(
    ("message", "error", "number"),
    [
        ("{", "no_json", None),
        ("[]", "no_json", None),
        ('{"id": 70,', "no_json", 70),
        ('{"run": ' + "[" * 5000 + ', "id": 70}', "no_json", None),
        ('{"id": 70, "run": ' + "[" * 5000 + "}", "no_json", 70),
        ('{"do": "fly"}', "unknown_command", None),
        ('{"do": "fly", "id": 70}', "unknown_command", 70),
        ('{"do": ["fly"], "id": 70}', "unknown_command", 70),
        ('{"id": 70}', "unknown_command", 70),
        ('{"do": "tasks", "x": 1}', "bad_field", None),
        ('{"do": "tasks", "x": 1, "id": 70}', "bad_field", 70),
        ('{"do": "release", "run": "1", "id": 70}', "bad_field", 70),
        ('{"do": "stop", "run": 5, "id": 70}', "bad_field", 70),
        ('{"do": "moment", "name": "x", "t": NaN, "id": 70}', "bad_field", 70),
        ('{"do": "tasks", "id": "70"}', "bad_field", None),
        ('{"do": "hello", "id": 70, "version": "' + "x" * MAX_COMMAND_BYTES + '"}', "too_large", 70),
        (b'{"do": "fly", "id": 70}', "unknown_command", 70),
        (b'{"do": "fly", "id": 70, "x": "\xff"}', "unknown_command", 70),
    ],
)
def test_invalid_command_is_answered_with_error_name_and_id(
    served: Served, message: str | bytes, error: str, number: int | None
) -> None:
    with served.client(served.operator) as client:
        client.socket.send(message)
        answer = client.hear(lambda told: told["say"] == "answer")
        assert (answer["error"], answer.get("id")) == (error, number)
        assert client.ask("stop")["ok"]


@each(
    ("message", "error"),
    [
        ('{"do": "tasks", "id": 70}', "hello_first"),
        ('{"do": "hello", "version": "old", "id": 70}', "old_page"),
        ('{"do": "hello", "id": 70}', "bad_field"),
        ('{"id": 70', "no_json"),
    ],
)
def test_first_message_other_than_hello_is_answered_with_its_id(served: Served, message: str, error: str) -> None:
    with served.client(served.operator, hello=False) as client:
        client.socket.send(message)
        answer = client.hear(lambda told: told["say"] == "answer")
        assert (answer["error"], answer.get("id")) == (error, 70)


@pytest.mark.real_time
def test_size_and_rate_of_messages_are_limited(served: Served) -> None:
    with served.client(served.operator) as client, served.client(served.viewer) as other:
        client.socket.send("x" * (MAX_COMMAND_BYTES + 1))
        assert client.hear(lambda told: told["say"] == "answer")["error"] == "too_large"
        client.socket.send("x" * (MAX_REFUSED_BYTES + 1))
        with pytest.raises(ConnectionClosed):
            client.hear(lambda told: told["say"] == "answer")
        for _ in range(400):
            other.send(do="pause", run="1")
        answers = [other.hear(lambda told: told["say"] == "answer")["error"] for _ in range(400)]
        assert set(answers) == {"not_allowed", "too_many"}
        assert other.ask("stop")["ok"]


@pytest.mark.real_time
def test_connection_floods_leave_room_and_do_not_disturb_a_run(served: Served, tmp_path: Path) -> None:
    with run_of(tmp_path, DRIVING) as (run, base), served.client(served.viewer) as client:
        wait_until(lambda: base.seen().top > 0.1)
        memory, idle = _kilobytes(served), []
        try:
            for _ in range(1000):
                connection = socket.create_connection(("127.0.0.1", served.port))
                connection.settimeout(PATIENCE)
                idle.append(connection)
            for connection in idle[: MAX_CONNECTIONS // 2]:
                connection.send(b"GET / HTTP/1.1\r\nHost: ")
            assert client.ask("tasks")["ok"]
            wait_until(lambda: _answers(served), 60.0)
            for connection in idle:
                assert _ended(connection)
        finally:
            for connection in idle:
                connection.close()
        with served.client(served.operator) as floods:
            assert _refused_after(floods.socket.socket, 100_000_000) < 10_000_000
            with pytest.raises(ConnectionClosed, match="1009"):
                floods.hear(lambda told: told["say"] == "answer")
        assert _kilobytes(served) - memory < 50_000
        wait_until(lambda: base.seen().moving)  # a busy machine holds up a tick by 0.3 s now and then, and it stands
        stopped = client.ask("stop")["result"]["stopped"]
        assert stopped[str(run.process.pid)]["parts"] == ["base"]
        wait_until(lambda: not base.seen().moving)


def _kilobytes(served: Served) -> int:
    """Return the most memory that the studio has had."""
    told = Path(f"/proc/{served.process.process.pid}/status").read_text(encoding="utf-8")
    return int(re.findall(r"VmHWM:\s+(\d+) kB", told)[0])


def _refused_after(connection: socket.socket, size: int) -> int:
    """Send one message of so many bytes over a websocket; return how many went before the other side hung up."""
    sent, piece = 0, bytes(1 << 20)
    with suppress(OSError):
        connection.sendall(b"\x81\xff" + size.to_bytes(8, "big") + bytes(4))
        while sent < size:
            sent += connection.send(piece)
    return sent


@pytest.mark.real_time
def test_a_second_request_has_no_longer_than_the_first(served: Served) -> None:
    with socket.create_connection(("127.0.0.1", served.port), timeout=PATIENCE) as connection:
        token = f"Authorization: Bearer {served.viewer}"  # without one, it is answered once
        connection.sendall(f"HEAD / HTTP/1.1\r\nHost: {served.host}\r\n{token}\r\n\r\n".encode())
        assert connection.recv(4096).startswith(b"HTTP/1.1 200")
        connection.sendall(b"GET / HT")
        while connection.recv(4096):  # a TimeoutError where it is held on
            pass


@pytest.mark.real_time
def test_malicious_cookie_is_parsed_quickly(served: Served) -> None:
    clock = SystemClock()
    cookie = served.cookie(served.viewer)
    for _ in range(10):  # each took 3.5 s
        assert served.get("/", Cookie='a="' + "\\" * 15_000 + f'"; {cookie}')[0] == 200
    assert clock.now() < 15.0


def test_once_token_works_once() -> None:
    access = StudioAccess()
    token = access.make_once_token()
    assert token not in (access.operator, access.viewer)
    assert [access.by_token(token, "1.2.3.4") for _ in range(2)] == ["operator", None]
    assert access.by_token(access.operator, "1.2.3.4") == "operator"


def test_overlong_file_name_is_not_found(served: Served) -> None:
    assert served.get(f"/{'a' * 4000}.js", Cookie=served.cookie(served.viewer))[0] == 404


def _answers(served: Served) -> bool:
    """Whether there is room for one more connection."""
    try:
        return served.get("/none.js")[0] == 401
    except OSError:
        return False


def _ended(connection: socket.socket) -> bool:
    """Wait until the other side has hung up."""
    try:
        while connection.recv(4096):
            pass
    except OSError:
        pass
    return True


def test_studio_behind_a_tls_proxy_accepts_its_configured_name(certificate: tuple[Path, Path]) -> None:
    trusting, speaks = (
        ssl.create_default_context(cafile=certificate[0]),
        ssl.create_default_context(Purpose.CLIENT_AUTH),
    )
    speaks.load_cert_chain(*certificate)
    with (
        studio("--name", "robot.example") as served,
        proxy(served.port, speaks) as port,
        plain_port(port, trusting, "robot.example") as plain,
    ):

        def get(path: str, **headers: str) -> HTTPResponse:
            with closing(HTTPSConnection("127.0.0.1", port, context=trusting, timeout=PATIENCE)) as connection:
                connection.request("GET", path, headers={"Host": "robot.example", **headers})
                return connection.getresponse()

        assert get("/").status == 401
        entry = get(f"/?token={served.viewer}")
        assert entry.status == 303
        proof = entry.headers["location"].removeprefix("/?")
        cookie = entry.headers["set-cookie"].partition(";")[0]
        own = "https://robot.example"
        assert get("/none.js", Origin=own, Cookie=cookie).status == 404
        assert get("/none.js", Origin="https://other.example", Cookie=cookie).status == 403
        assert get("/none.js", Host="other.example", Cookie=cookie).status == 403

        def page(origin: str) -> ClientConnection:
            way = socket.create_connection(("127.0.0.1", plain))
            headers = {"Cookie": cookie}
            address = f"ws://robot.example/ws?{proof}"
            return connect(address, sock=way, origin=Origin(origin), additional_headers=headers)

        with pytest.raises(InvalidStatus, match="403"):
            page("https://other.example")
        with page(own) as browser:
            browser.send('{"do": "hello", "version": "2"}')
            assert json.loads(browser.recv(timeout=PATIENCE))["role"] == "viewer"
            client = Client(browser)
            assert client.ask("stop")["ok"]
            assert client.ask("mission", name="greet")["result"]["drawing"]


def test_forged_proxy_headers_grant_no_access(served: Served) -> None:
    forged = {"X-Forwarded-For": "127.0.0.1", "X-Forwarded-Host": served.host, "Forwarded": "for=127.0.0.1"}
    assert served.get("/", **forged)[0] == 401
    assert served.get("/", Host="other.example", **{"X-Forwarded-Host": served.host})[0] == 403


# The TLS client drops its socket once it has said that it is closed, and Python calls that unclosed.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_studio_with_certificate_uses_tls_and_a_secure_cookie(certificate: tuple[Path, Path]) -> None:
    trusting = ssl.create_default_context(cafile=certificate[0])
    with studio("--certificate", str(certificate[0]), "--key", str(certificate[1]), trusting=trusting) as served:
        assert "https://" in served.process.lines[0]
        connection = HTTPSConnection("127.0.0.1", served.port, context=trusting, timeout=PATIENCE)
        with closing(connection):
            connection.request("GET", f"/?token={served.operator}")
            with connection.getresponse() as response:  # unread, it would keep the socket open
                assert "Secure" in (response.getheader("set-cookie") or "")
                response.read()
        with served.client(served.operator) as client:
            assert client.welcome["role"] == "operator"


def test_studio_that_cannot_listen_gives_the_reason(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        refused = command(capsys, "studio", "--port", str(port))
        assert refused.code == 2
        assert f"127.0.0.1 port {port}: in use" in refused.err
        assert "try: mission studio --port 0" in refused.err
    # An address for documentation (RFC 5737), which is nobody's.
    assert "try: another --host" in command(capsys, "studio", "--host", "192.0.2.1").err
    wrong = tmp_path / "cert.pem"
    wrong.write_text("no certificate", encoding="utf-8")
    assert str(wrong) in command(capsys, "studio", "--port", "0", "--certificate", str(wrong)).err
    assert "--key needs --certificate" in command(capsys, "studio", "--key", str(wrong)).err


def test_tokens_are_stored_privately_and_replaced_if_exposed(tmp_path: Path) -> None:
    path = tmp_path / "studio.tokens"
    tokens = load_tokens(path)
    assert load_tokens(path) == tokens
    path.chmod(0o644)  # somebody may have read them
    assert set(load_tokens(path)).isdisjoint(tokens)
    access = StudioAccess(*load_tokens(path), save=partial(save_tokens, path=path))
    access.renew()
    assert load_tokens(path) == (access.operator, access.viewer)
    path.write_text("[]", encoding="utf-8")
    assert set(load_tokens(path)).isdisjoint(tokens)
    assert path.stat().st_mode & 0o077 == 0
