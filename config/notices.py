"""Section ``notices`` of a robot file: channels for notices about tasks."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, field
from typing import Annotated, Literal
from urllib.parse import urlsplit

from drivers.api.fast_dataclass import dataclass
from drivers.api.keys import KeyDiagnostic, ValueConstraints, inside, key, keys


@dataclass(frozen=True, slots=True)
class TerminalNotice:
    """Channel to the terminal of `mission task serve`."""


@dataclass(frozen=True, slots=True)
class CommandNotice:
    """Channel to a program, as JSON on its standard input. ``command`` is its argument list; no shell reads it."""

    command: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class WebhookNotice:
    """Channel to a web server, as JSON by POST.

    ``headers`` names, for each header, the environment variable with its value. ``url_from`` names the environment
    variable with the address if ``url`` is empty.
    """

    url: str = ""
    headers: Mapping[str, str] = field(default_factory=dict)
    url_from: str = ""


@dataclass(frozen=True, slots=True)
class MqttNotice:
    """Channel to a topic of an MQTT broker; ``password`` names the environment variable that holds it."""

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
"""Types of notice channels by their keys in a robot file."""


def encode_notice(config: NoticeConfig) -> str:
    """Return a channel as one line of JSON; equal channels give equal lines."""
    (kind,) = (word for word, each in NOTICE_KINDS.items() if type(config) is each)
    return json.dumps({kind: asdict(config)}, sort_keys=True)


def decode_notice(text: str) -> NoticeConfig:
    """Return the channel that ``encode_notice`` wrote. Raises ValueError for other texts."""
    try:
        ((kind, values),) = json.loads(text).items()
        found = NOTICE_KINDS[kind](**values)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"no way to send notices: {text}") from error
    return CommandNotice(tuple(found.command)) if isinstance(found, CommandNotice) else found


def public_text(text: str) -> str:
    """Return an encoded channel as text without secrets; other texts are unchanged."""
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
    """Return scheme, host and port of an address. Raises ValueError for an invalid address.

    An address with a user is invalid, since it could hold a password, and so is one with characters that need escaping.
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
        raise ValueError("not the address of a web server")
    return f"{parts.scheme}://{parts.netloc}"


@keys
class WebhookKeys:
    """Keys of a notice channel to a web server: its address, or the environment variable that holds the address."""

    url: str = key(default="", help="Address.")
    url_from: str = key(default="", help="Environment variable with the address, if it is secret.")
    headers: Mapping[str, str] = key(default={}, help="Headers, each with the environment variable of its value.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for a missing address, or for two addresses."""
        if bool(self.url) == bool(self.url_from):
            yield KeyDiagnostic("'webhook' needs either 'url' or 'url_from'", hint="url_from: ROBOT_URL")


@keys
class MqttKeys:
    """Keys of a notice channel to a topic of an MQTT broker."""

    host: str = key(default="localhost", help="Broker.")
    topic: str = key(default="missiontree/tasks", help="Topic.")
    port: int | None = key(default=None, low=1, high=65535, help="Port; by default 1883, or 8883 with `tls`.")
    tls: bool = key(default=False, help="Connect with TLS.")
    user: str = key(default="", help="User name.")
    password: str = key(default="", help="Environment variable with the password.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for a topic with wildcards, and for a password without a user."""
        if any(sign in self.topic for sign in "+#"):
            message = f"'topic' names one topic, without + and #: '{self.topic}'"
            yield KeyDiagnostic(message, ("topic",), hint="home/robot", about=(("topic",),))
        if self.password and not self.user:
            yield KeyDiagnostic("'mqtt' has a password but no user", hint="user: robot")


_COMMAND = ValueConstraints(
    wrong="'{}' needs a list: a program and its arguments", hint="command: [notify-send, Robot]", blank=True
)


@keys
class NoticeKeys:
    """Keys of one channel in the section ``notices`` of a robot file."""

    unknown = "unknown channel of notices: '{}'"

    command: Annotated[tuple[str, ...], _COMMAND] | None = key(
        default=None, help="Program and its arguments; it gets notices as JSON on its standard input."
    )
    webhook: str | WebhookKeys | None = key(default=None, help="Web server; it gets notices as JSON by POST.")
    mqtt: MqttKeys | None = key(default=None, help="MQTT broker.")

    @property
    def address(self) -> WebhookKeys | None:
        """Keys of the web server of this channel, or None for another kind of channel."""
        return WebhookKeys(url=self.webhook) if isinstance(self.webhook, str) else self.webhook

    def config(self) -> NoticeConfig:
        """Return the channel (program, web server or MQTT topic) that these keys declare."""
        if self.command is not None:
            return CommandNotice(self.command)
        if (web := self.address) is not None:
            return WebhookNotice(web.url, web.headers, web.url_from)
        to = self.mqtt or MqttKeys()
        port = to.port or (8883 if to.tls else 1883)
        return MqttNotice(to.host, to.topic, port, to.tls, to.user, to.password)

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for no or several channels, for a command without a program, and for an invalid address."""
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


NO_CHANNEL_ERROR = "a notice needs exactly one channel"
CHANNELS_HINT = f"one of: {', '.join(NOTICE_KINDS)}"

NoticeEntry = (
    Annotated[Literal["terminal"], inside(wrong=NO_CHANNEL_ERROR, hint=CHANNELS_HINT)]
    | Annotated[NoticeKeys, inside(each="a notice")]
)
"""Entry of the list ``notices`` in a robot file."""


def notice_of(entry: Literal["terminal"] | NoticeKeys) -> NoticeConfig:
    """Return the notice channel that an entry of ``notices`` declares."""
    return TerminalNotice() if isinstance(entry, str) else entry.config()
