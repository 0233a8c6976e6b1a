"""The ``notices`` of a robot file."""

import pytest

from config.diagnostics import InvalidFileError, SourceText
from config.notices import (
    CommandNotice,
    MqttNotice,
    NoticeConfig,
    TerminalNotice,
    WebhookNotice,
    decode_notice,
    encode_notice,
    public_text,
)
from missions.library.drivers import parse_robot


def notices(text: str) -> tuple[NoticeConfig, ...]:
    return parse_robot(SourceText("robot.yaml", f"robot: mine\nnotices:\n{text}")).notices


def test_each_way_is_read() -> None:
    assert notices(
        """
  - terminal
  - command: [notify-send, Robot]
  - webhook: https://example.org/robot
  - webhook: {url: "http://home:8123/api", headers: {Authorization: TOKEN}}
  - webhook: {url_from: CHAT_URL}
  - mqtt: {host: broker.local, topic: home/robot, tls: true, user: robot, password: MQTT_PASSWORD}
  - mqtt: {}
"""
    ) == (
        TerminalNotice(),
        CommandNotice(("notify-send", "Robot")),
        WebhookNotice("https://example.org/robot"),
        WebhookNotice("http://home:8123/api", {"Authorization": "TOKEN"}),
        WebhookNotice(url_from="CHAT_URL"),
        MqttNotice("broker.local", "home/robot", 8883, True, "robot", "MQTT_PASSWORD"),
        MqttNotice("localhost", "missiontree/tasks", 1883, False, "", ""),
    )


def test_notices_default_to_none() -> None:
    assert parse_robot(SourceText("robot.yaml", "robot: mine")).notices == ()


@pytest.mark.parametrize(
    ("text", "fault", "hint"),
    [
        ("  - pigeon: {}", "unknown channel of notices: 'pigeon'", "known are: command, mqtt, webhook"),
        ("  - webhok: x", "unknown channel of notices: 'webhok'", "did you mean 'webhook'?"),
        ("  - webhook", "a notice needs exactly one channel", "one of: terminal"),
        ("  - {webhook: 'https://x', command: [x]}", "a notice needs exactly one channel", ""),
        ("  - {terminal: , command: [x]}", "unknown channel of notices: 'terminal'", ""),
        ("  - command: notify-send Robot", "'command' needs a list", "command: [notify-send, Robot]"),
        ("  - command: []", "'command' needs a list", ""),
        ("  - command: [['a']]", "'command' needs a list", ""),
        ("  - webhook: file:///etc/passwd", "'webhook' needs the address of a web server", "https://..."),
        ("  - webhook: https://", "'webhook' needs the address of a web server", ""),
        ("  - webhook: https://x:99999/", "'webhook' needs the address of a web server", ""),
        ("  - webhook: https://me:word@x/", "'webhook' needs the address of a web server", ""),
        ("  - webhook: https://x/ä", "'webhook' needs the address of a web server", ""),
        ("  - webhook: {headers: {}}", "'webhook' needs either 'url' or 'url_from'", "url_from: ROBOT_URL"),
        ("  - webhook: {url: 'https://x', url_from: X}", "'webhook' needs either 'url' or 'url_from'", ""),
        ("  - webhook: {url: 'https://x', header: {}}", "'webhook' has no key 'header'", "did you mean 'headers'?"),
        ("  - mqtt: {topic: home/#}", "'topic' names one topic", ""),
        ("  - mqtt: {port: 70000}", "'port' must be at most 65535", ""),
        ("  - mqtt: {password: X}", "'mqtt' has a password but no user", ""),
        ("  terminal", "'notices' needs a list", ""),
    ],
)
def test_notice_faults_are_reported_with_position(text: str, fault: str, hint: str) -> None:
    with pytest.raises(InvalidFileError) as raised:
        notices(text)
    (found, *_) = raised.value.diagnostics
    assert fault in found.message
    assert hint in found.suggestion
    assert found.mark.line == 3


WAYS: list[NoticeConfig] = [
    TerminalNotice(),
    CommandNotice(("sh", "-c", "cat > 'a b'")),
    WebhookNotice("https://x/y?z", {"B": "1", "A": "2"}),
    WebhookNotice(url_from="CHAT_URL"),
    MqttNotice("h", "t", 1, True, "u", "p"),
]


@pytest.mark.parametrize("way", WAYS, ids=lambda way: type(way).__name__)
def test_encoded_notice_round_trips(way: NoticeConfig) -> None:
    assert decode_notice(encode_notice(way)) == way


def test_public_text_hides_secrets() -> None:
    assert [public_text(encode_notice(way)) for way in WAYS] == [
        "terminal", "command sh", "webhook https://x", "webhook CHAT_URL", "mqtt h:1",
    ]  # fmt: skip
    assert public_text("an old way") == "an old way"


def test_old_encoding_of_a_webhook_is_read() -> None:
    assert decode_notice('{"webhook": {"headers": {}, "url": "https://x"}}') == WebhookNotice("https://x")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"terminal": {"x": 1}}', '{"terminal": {}, "command": {}}', "null"])
def test_invalid_notice_encoding_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="no way to send notices"):
        decode_notice(text)
