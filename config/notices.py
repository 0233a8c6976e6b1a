"""The ``notices`` of a robot file: where it is told how tasks went.

A list; each entry is one way::

    notices:
      - terminal
      - command: [notify-send, Robot]
      - webhook: {url: "https://example.org/robot", headers: {Authorization: ROBOT_TOKEN}}
      - mqtt: {host: broker.local, topic: home/robot, user: robot, password: MQTT_PASSWORD}

Secrets do not stand in files: the values of headers, and ``password``, are names of environment variables. Where the
address is the secret, as with many chat services, ``url_from`` names the variable that holds it.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, field
from typing import Annotated, Literal
from urllib.parse import urlsplit

from drivers.api.fast_dataclass import dataclass
from drivers.api.keys import KeyDiagnostic, ValueConstraints, inside, key, keys


@dataclass(frozen=True, slots=True)
class TerminalNotice:
    """To the terminal of `mission task serve`."""


@dataclass(frozen=True, slots=True)
class CommandNotice:
    """To a program, as JSON on its standard input. ``command`` is its name and arguments; no shell reads them."""

    command: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class WebhookNotice:
    """To a web server, which gets JSON by POST; ``headers`` name the environment variables with their values.

    Its address is ``url``, or what the environment variable ``url_from`` holds: one of the two is empty.
    """

    url: str = ""
    headers: Mapping[str, str] = field(default_factory=dict)
    url_from: str = ""


@dataclass(frozen=True, slots=True)
class MqttNotice:
    """To a topic of an MQTT broker; ``password`` names the environment variable that holds it."""

    host: str
    topic: str
    port: int
    tls: bool
    user: str
    password: str


NoticeConfig = TerminalNotice | CommandNotice | WebhookNotice | MqttNotice

NOTICE_KINDS: Mapping[str, type[NoticeConfig]] = {
    "terminal": TerminalNotice,
    "command": CommandNotice,
    "webhook": WebhookNotice,
    "mqtt": MqttNotice,
}
"""The ways by their words."""


def encode_notice(config: NoticeConfig) -> str:
    """Return a way as one line of JSON, the same for the same way."""
    (kind,) = (word for word, each in NOTICE_KINDS.items() if type(config) is each)
    return json.dumps({kind: asdict(config)}, sort_keys=True)


def decode_notice(text: str) -> NoticeConfig:
    """Return the way that ``encode_notice`` wrote. Raises ValueError for what it never writes."""
    try:
        ((kind, values),) = json.loads(text).items()
        found = NOTICE_KINDS[kind](**values)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"no way to send notices: {text}") from error
    return CommandNotice(tuple(found.command)) if isinstance(found, CommandNotice) else found


def public_text(text: str) -> str:
    """Return a way that ``encode_notice`` wrote as people may see it, without secrets; another text as it is."""
    try:
        match decode_notice(text):
            case CommandNotice(command):
                return f"command {command[0]}"
            case WebhookNotice(url, _, variable):
                return f"webhook {site_of(url) if url else variable}"
            case MqttNotice(host, _, port):
                return f"mqtt {host}:{port}"
            case TerminalNotice():
                return "terminal"
    except ValueError:
        return text


def site_of(url: str) -> str:
    """Return the part of an address that is no secret: scheme, host and port. Raises ValueError for one that is none.

    One with a user is none, for a password would stand in it; nor is one with letters that have to be escaped.
    """
    parts = urlsplit(url)
    letters = url.isascii() and url.isprintable() and " " not in url
    if (
        not letters
        or parts.scheme not in ("http", "https")
        or not parts.hostname
        or parts.port == 0
        or "@" in parts.netloc
    ):
        raise ValueError("no address of a web server")
    return f"{parts.scheme}://{parts.netloc}"


@keys
class WebhookKeys:
    """A web server: its address, or where that is found."""

    url: str = key(default="", help="Its address.")
    url_from: str = key(default="", help="The environment variable that holds the address, where that is a secret.")
    headers: Mapping[str, str] = key(default={}, help="Headers, each with the environment variable of its value.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield no address, or two."""
        if bool(self.url) == bool(self.url_from):
            yield KeyDiagnostic("'webhook' needs either 'url' or 'url_from'", hint="url_from: ROBOT_URL")


@keys
class MqttKeys:
    """A topic of an MQTT broker."""

    host: str = key(default="localhost", help="The broker.")
    topic: str = key(default="missiontree/tasks", help="The topic.")
    port: int | None = key(default=None, low=1, high=65535, help="Its port: 1883, with `tls` 8883, if not given.")
    tls: bool = key(default=False, help="Whether it is spoken to by TLS.")
    user: str = key(default="", help="The user's name there.")
    password: str = key(default="", help="The environment variable that holds the password.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a topic that is many, and a password of nobody."""
        if any(sign in self.topic for sign in "+#"):
            message = f"'topic' names one topic, without + and #: '{self.topic}'"
            yield KeyDiagnostic(message, ("topic",), hint="home/robot", about=(("topic",),))
        if self.password and not self.user:
            yield KeyDiagnostic("'mqtt' has a password and no user", hint="user: robot")


_COMMAND = ValueConstraints(
    wrong="'{}' needs a list: a program and its arguments", hint="command: [notify-send, Robot]", blank=True
)


@keys
class NoticeKeys:
    """One way for notices to go."""

    unknown = "a notice cannot go by '{}'"

    command: Annotated[tuple[str, ...], _COMMAND] | None = key(
        default=None, help="A program and its arguments, which gets them as JSON on its standard input."
    )
    webhook: str | WebhookKeys | None = key(default=None, help="A web server, which gets them as JSON by POST.")
    mqtt: MqttKeys | None = key(default=None, help="An MQTT broker.")

    @property
    def address(self) -> WebhookKeys | None:
        """The web server."""
        return WebhookKeys(url=self.webhook) if isinstance(self.webhook, str) else self.webhook

    def config(self) -> NoticeConfig:
        """Return the way."""
        if self.command is not None:
            return CommandNotice(self.command)
        if (web := self.address) is not None:
            return WebhookNotice(web.url, web.headers, web.url_from)
        to = self.mqtt or MqttKeys()
        port = to.port or (8883 if to.tls else 1883)
        return MqttNotice(to.host, to.topic, port, to.tls, to.user, to.password)

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield no way, or two, a command without a program, and an address that is none."""
        if [self.command, self.webhook, self.mqtt].count(None) != 2:
            yield KeyDiagnostic(NO_CHANNEL_ERROR, hint=CHANNELS_HINT)
        if self.command is not None and not "".join(self.command[:1]).strip():
            yield KeyDiagnostic(
                _COMMAND.wrong.format("command"), ("command",), hint=_COMMAND.hint, about=(("command",),)
            )
        url = "" if self.address is None else self.address.url
        try:
            site_of(url or "http://localhost")
        except ValueError:
            message = f"'webhook' needs the address of a web server, got '{url}'"
            yield KeyDiagnostic(message, ("webhook",), hint="https://...", about=(("webhook",),))


NO_CHANNEL_ERROR = "a notice needs one way to go"
CHANNELS_HINT = f"one of: {', '.join(NOTICE_KINDS)}"

NoticeEntry = (
    Annotated[Literal["terminal"], inside(wrong=NO_CHANNEL_ERROR, hint=CHANNELS_HINT)]
    | Annotated[NoticeKeys, inside(each="a notice")]
)
"""An entry of the list."""


def notice_of(entry: Literal["terminal"] | NoticeKeys) -> NoticeConfig:
    """Return the way that an entry tells."""
    return TerminalNotice() if isinstance(entry, str) else entry.config()
