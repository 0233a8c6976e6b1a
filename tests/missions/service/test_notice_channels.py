"""Each way that a notice goes: what arrives there, and what counts as not delivered."""

import json
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Event, Thread, Timer

import pytest

from config.notices import CommandNotice, MqttNotice, NoticeConfig, TerminalNotice, WebhookNotice, encode_notice
from missions.plugins.tasks.notice import DeliveryError, Notice
from missions.plugins.tasks.notices import channel_of
from missions.plugins.tasks.notices.command import CommandChannel
from missions.plugins.tasks.notices.mqtt import MqttChannel
from missions.plugins.tasks.notices.webhook import WebhookChannel
from tests.missions.service.small_broker import Manners, small_broker
from tests.waiting import wait_until

NOTICE = Notice("7-1-1-done", 7, "greet", "done", "greet (task 7) is done: “ça va”", "2026-11-21T12:00:00+00:00")

AS_DICT = {
    "id": "7-1-1-done",
    "task": 7,
    "mission": "greet",
    "kind": "done",
    "text": "greet (task 7) is done: “ça va”",
    "time": "2026-11-21T12:00:00+00:00",
}


# The terminal


def test_the_terminal_shows_a_line() -> None:
    lines: list[str] = []
    channel_of(encode_notice(TerminalNotice()), lines.append)(NOTICE)
    assert lines == ["2026-11-21T12:00:00  greet (task 7) is done: “ça va”"]


# Commands


def test_command_channel_passes_json_and_literal_arguments(tmp_path: Path) -> None:
    out = tmp_path / "a b; rm *"
    program = "import sys, pathlib; pathlib.Path(sys.argv[1]).write_bytes(sys.stdin.buffer.read())"
    CommandChannel(CommandNotice((sys.executable, "-c", program, str(out))))(NOTICE)
    assert json.loads(out.read_text(encoding="utf-8")) == AS_DICT


@pytest.mark.parametrize(
    ("command", "why"),
    [
        (("not-a-program-at-all",), "not-a-program-at-all: cannot be started: .*No such file"),
        ((sys.executable, "-c", "import sys; sys.exit('no bus to send it on')"), "exit code 1: no bus to send it on"),
        (("false",), "false: ended with exit code 1$"),
    ],
)
def test_failed_command_is_not_delivered(command: tuple[str, ...], why: str) -> None:
    with pytest.raises(DeliveryError, match=why):
        CommandChannel(CommandNotice(command))(NOTICE)


def test_hung_command_is_killed_with_its_children(tmp_path: Path) -> None:
    number = tmp_path / "number"
    script = f"sleep 600 & echo $! > {number}; wait"
    with pytest.raises(DeliveryError, match="did not end within 2 s"):
        CommandChannel(CommandNotice(("sh", "-c", script)), timeout=2.0)(NOTICE)
    child = int(number.read_text(encoding="ascii"))
    wait_until(lambda: not alive(child))


def test_aborted_command_is_killed() -> None:
    command = CommandChannel(CommandNotice(("sleep", "600")))
    timer = Timer(0.2, command.abort)
    timer.start()
    with pytest.raises(DeliveryError, match="sleep: was still running when the server ended"):
        command(NOTICE)
    timer.join()


def alive(process: int) -> bool:
    """Say whether a process goes on; one that is dead and that nobody has asked about does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="ascii").split()[2] != "Z"
    except OSError:
        return False


def test_background_process_of_a_command_does_not_block() -> None:
    CommandChannel(CommandNotice(("sh", "-c", "sleep 1.5 & exit 0")), timeout=60.0)(NOTICE)


# Web servers


@dataclass
class Site:
    """A web server that answers with ``code``, and what it was sent."""

    code: int = 200
    location: str = ""
    reason: str | None = None
    port: int = 0
    posted: list[tuple[str, dict[str, str], str]] = field(default_factory=list)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/robot"


@contextmanager
def web(site: Site) -> Iterator[Site]:
    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            headers = {name.lower(): value for name, value in self.headers.items()}
            site.posted.append((self.path, headers, body.decode()))
            self.send_response(site.code, site.reason)
            if site.location:
                self.send_header("Location", site.location)
            self.end_headers()

        def do_GET(self) -> None:
            site.posted.append(("GET", {}, ""))
            self.send_response(200)
            self.end_headers()

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its name there
            del format, args

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        site.port = server.server_address[1]
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
        thread.start()
        try:
            yield site
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture(autouse=True)
def no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loopback is reached directly, whatever the machine has for the rest."""
    monkeypatch.setenv("no_proxy", "127.0.0.1")


@pytest.mark.parametrize("code", [200, 201, 204])
def test_a_web_server_gets_a_post_with_the_id_and_the_secrets(code: int) -> None:
    with web(Site(code)) as site:
        config = WebhookNotice(site.url, {"Authorization": "ROBOT_TOKEN"})
        WebhookChannel(config, {"ROBOT_TOKEN": "Bearer abc"})(NOTICE)
    ((path, headers, body),) = site.posted
    assert path == "/robot"
    assert json.loads(body) == AS_DICT
    assert headers["idempotency-key"] == "7-1-1-done"
    assert headers["authorization"] == "Bearer abc"
    assert headers["content-type"] == "application/json"


@pytest.mark.parametrize("code", [301, 302, 303, 307, 308])
def test_a_redirection_is_no_delivery_and_is_not_followed(code: int) -> None:
    with web(Site()) as other, web(Site(code, other.url)) as site:
        with pytest.raises(DeliveryError, match=f"the server says {code}"):
            WebhookChannel(WebhookNotice(site.url), {})(NOTICE)
        assert (len(site.posted), other.posted) == (1, [])


@pytest.mark.parametrize("code", [400, 404, 429, 500, 503])
def test_web_server_error_is_not_delivered(code: int) -> None:
    with web(Site(code)) as site, pytest.raises(DeliveryError, match=f"127.0.0.1:{site.port}: the server says {code}"):
        WebhookChannel(WebhookNotice(site.url), {})(NOTICE)


def test_missing_or_silent_web_server_is_not_delivered() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        url = f"http://127.0.0.1:{listening.getsockname()[1]}/"
        with pytest.raises(DeliveryError, match=r"no reply within 0.3 s$"):
            WebhookChannel(WebhookNotice(url), {}, timeout=0.3)(NOTICE)
    with pytest.raises(DeliveryError, match=r"cannot be reached: .*refused"):
        WebhookChannel(WebhookNotice(url), {})(NOTICE)


def test_missing_secret_variable_is_named_and_nothing_is_sent() -> None:
    with web(Site()) as site:
        with pytest.raises(DeliveryError, match="environment variable ROBOT_TOKEN"):
            WebhookChannel(WebhookNotice(site.url, {"Authorization": "ROBOT_TOKEN"}), {})(NOTICE)
        assert site.posted == []


@contextmanager
def trickle(lines: bytes, at_once: bytes = b"") -> Iterator[int]:
    """A server that says ``at_once``, and ``lines`` a byte at a time, which takes seconds; gives its port."""
    ending = Event()

    def say(listening: socket.socket) -> None:
        with suppress(OSError), listening.accept()[0] as talk:
            talk.sendall(at_once)
            for place in range(len(lines)):
                if ending.wait(0.05):
                    return
                talk.sendall(lines[place : place + 1])

    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(10.0)
        thread = Thread(target=say, args=(listening,))
        thread.start()
        try:
            yield listening.getsockname()[1]
        finally:
            ending.set()
            thread.join()


LINES = {
    "http": b"HTTP/1.1 200 OK\r\nX: " + b"x" * 100 + b"\r\n\r\n",
    "https": b"\x16\x03\x03\x40\x00" + bytes(100),  # TLS: a handshake of 16 kB is announced, which never ends
}


@pytest.mark.parametrize("scheme", ["http", "https"])
def test_slow_trickling_web_server_times_out(scheme: str) -> None:
    with trickle(LINES[scheme]) as port, pytest.raises(DeliveryError, match=r"no reply within 0.6 s$"):
        WebhookChannel(WebhookNotice(f"{scheme}://127.0.0.1:{port}/"), {}, timeout=0.6)(NOTICE)


def test_endless_headers_time_out() -> None:
    with (
        trickle(b"X: " + b"x" * 100, b"HTTP/1.1 200 OK\r\n") as port,
        pytest.raises(DeliveryError, match=r"no reply within 0.6 s$"),
    ):
        WebhookChannel(WebhookNotice(f"http://127.0.0.1:{port}/"), {}, timeout=0.6)(NOTICE)


SECRET = "/services/T0/B0/WinnieThePooh?key=abc"  # noqa: S105 - of nobody


def test_webhook_address_may_come_from_the_environment() -> None:
    with web(Site()) as site:
        WebhookChannel(WebhookNotice(url_from="CHAT_URL"), {"CHAT_URL": f"http://127.0.0.1:{site.port}{SECRET}\n"})(
            NOTICE
        )
    assert [path for path, _, _ in site.posted] == [SECRET]


@pytest.mark.parametrize(
    ("environment", "why"),
    [
        ({}, "the environment variable CHAT_URL, named in the robot file, is not set"),
        ({"CHAT_URL": "ntfy.sh/secret"}, "the environment variable CHAT_URL is not the address of a web server$"),
        ({"CHAT_URL": "https://me:secret@ntfy.sh/"}, "is not the address of a web server$"),
        ({"CHAT_URL": "https://ntfy.sh:secret/"}, "is not the address of a web server$"),
    ],
)
def test_variable_without_an_address_is_named_without_its_value(environment: dict[str, str], why: str) -> None:
    with pytest.raises(DeliveryError, match=why) as raised:
        WebhookChannel(WebhookNotice(url_from="CHAT_URL"), environment)(NOTICE)
    assert "secret" not in str(raised.value)


def test_errors_do_not_contain_secrets() -> None:
    with web(Site(404, reason=f"nobody at {SECRET}")) as site:
        url = f"http://127.0.0.1:{site.port}"
        with pytest.raises(DeliveryError, match=rf"{url}: the server says 404 nobody at \.\.\.$"):
            WebhookChannel(WebhookNotice(url + SECRET), {})(NOTICE)
        told = []
        for wrong, word in (
            (url, "pass\nword"),
            (url, "passwörd\u20ac"),
            (url.replace("http", "https"), "pass"),
            ("http://nobody.invalid", "pass"),
        ):
            with pytest.raises(DeliveryError) as raised:
                WebhookChannel(WebhookNotice(wrong + SECRET, {"Authorization": "WORD"}), {"WORD": word})(NOTICE)
            told.append(str(raised.value))
    assert not any(secret in line for line in told for secret in ("Winnie", "abc", "pass"))


# MQTT


def mqtt(port: int, **values: str) -> MqttNotice:
    options = {"host": "127.0.0.1", "topic": "home/robot", "user": "", "password": ""} | values
    return MqttNotice(port=port, tls=False, **options)


def test_a_broker_gets_the_notice_once_at_least_and_a_goodbye() -> None:
    with small_broker() as broker:
        MqttChannel(mqtt(broker.port, user="robot", password="MQTT_WORD"), {"MQTT_WORD": "secret"})(NOTICE)  # noqa: S106
        wait_until(lambda: broker.goodbyes == 1)
    ((topic, body, quality),) = broker.published
    assert (topic, quality) == ("home/robot", 1)
    assert json.loads(body) == AS_DICT
    assert broker.users == [("robot", "secret")]


@pytest.mark.parametrize(
    ("manners", "why"),
    [
        ("refuses", "the broker refuses: Not authorized"),
        ("hangs up", "the broker disconnected"),
        ("silent", "the broker did not acknowledge within 1 s"),
    ],
)
def test_broker_without_acknowledgement_is_not_delivered(manners: Manners, why: str) -> None:
    with small_broker(manners) as broker, pytest.raises(DeliveryError, match=f"mqtt 127.0.0.1:{broker.port}: {why}"):
        MqttChannel(mqtt(broker.port), {}, timeout=1.0 if manners == "silent" else 20.0)(NOTICE)


def test_missing_broker_is_not_delivered() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
    with pytest.raises(DeliveryError, match="refused"):
        MqttChannel(mqtt(port), {})(NOTICE)


def test_missing_mqtt_extra_gives_the_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "paho.mqtt.client", None)
    with pytest.raises(DeliveryError, match=r"pip install 'missiontree\[mqtt\]'"):
        MqttChannel(mqtt(1), {})(NOTICE)


# All of them


@pytest.mark.parametrize(
    ("config", "kind"),
    [
        (CommandNotice(("true",)), CommandChannel),
        (WebhookNotice("https://example.org/", {"A": "B"}), WebhookChannel),
        (mqtt(1883), MqttChannel),
    ],
)
def test_channel_is_created_from_its_outbox_entry(config: NoticeConfig, kind: type) -> None:
    channel = channel_of(encode_notice(config), print, os.environ)
    assert isinstance(channel, kind)
    assert channel_of(encode_notice(config), print) is not channel


def test_unknown_channel_is_refused() -> None:
    with pytest.raises(ValueError, match="no way to send notices"):
        channel_of('{"pigeon": {}}', print)
