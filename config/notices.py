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
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from urllib.parse import urlsplit

from config.faults import one_of
from config.fields import Fields
from config.marked import Listing, Node, Scalar
from config.marked import Mapping as MarkedMapping


@dataclass(frozen=True, slots=True)
class TerminalNotice:
    """To the terminal of `mission serve`."""


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

KINDS: Mapping[str, type[NoticeConfig]] = {
    "terminal": TerminalNotice,
    "command": CommandNotice,
    "webhook": WebhookNotice,
    "mqtt": MqttNotice,
}
"""The ways by their words."""


def written(config: NoticeConfig) -> str:
    """Return a way as one line of JSON, the same for the same way."""
    (kind,) = (word for word, each in KINDS.items() if type(config) is each)
    return json.dumps({kind: asdict(config)}, sort_keys=True)


def read_written(text: str) -> NoticeConfig:
    """Return the way that ``written`` wrote. Raises ValueError for what it never writes."""
    try:
        ((kind, values),) = json.loads(text).items()
        found = KINDS[kind](**values)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"no way to send notices: {text}") from error
    return CommandNotice(tuple(found.command)) if isinstance(found, CommandNotice) else found


def named(text: str) -> str:
    """Return a way that ``written`` wrote as people may see it, without secrets; another text as it is."""
    try:
        match read_written(text):
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


def read_notices(fields: Fields) -> tuple[NoticeConfig, ...]:
    """Read the list under ``notices``."""
    found = (_read(fields, node) for node in fields.items("notices"))
    return tuple(each for each in found if each is not None)


def _read(fields: Fields, node: Node) -> NoticeConfig | None:
    if isinstance(node, Scalar) and node.text == "terminal":
        return TerminalNotice()
    if not isinstance(node, MarkedMapping) or len(node.entries) != 1:
        fields.fault(node.mark, "a notice needs one way to go", f"one of: {', '.join(KINDS)}")
        return None
    ((word, value),) = node.entries
    entry = Fields(fields.source, node, fields.faults, what="a notice")
    readers: Mapping[str, Callable[[Fields, Node], NoticeConfig | None]] = {
        "command": _command,
        "webhook": _webhook,
        "mqtt": _mqtt,
    }
    if word.text not in readers:
        fields.fault(word.mark, f"a notice cannot go by '{word.text}'", one_of(word.text, KINDS))
        return None
    return readers[word.text](entry, value)


def _command(entry: Fields, node: Node) -> CommandNotice | None:
    words = [item.text for item in node.items if isinstance(item, Scalar)] if isinstance(node, Listing) else []
    if not isinstance(node, Listing) or not words or len(words) != len(node.items) or not words[0].strip():
        entry.fault(node.mark, "'command' needs a list: a program and its arguments", "command: [notify-send, Robot]")
        return None
    return CommandNotice(tuple(words))


def _webhook(entry: Fields, node: Node) -> WebhookNotice | None:
    headers: dict[str, str] = {}
    if isinstance(node, Scalar):
        url, variable = node.text, ""
    else:
        fields = Fields(entry.source, node, entry.faults, what="'webhook'")
        url, variable, section = fields.text("url", ""), fields.text("url_from", ""), fields.section("headers")
        if section is not None:
            headers = {name.text: section.text(name.text) for name, _ in section.entries()}
        fields.done()
        if bool(url) == bool(variable):
            entry.fault(node.mark, "'webhook' needs either 'url' or 'url_from'", "url_from: ROBOT_URL")
            return None
    if url:
        try:
            site_of(url)
        except ValueError:
            entry.fault(node.mark, f"'webhook' needs the address of a web server, got '{url}'", "https://...")
            return None
    return WebhookNotice(url, headers, variable)


def _mqtt(entry: Fields, node: Node) -> MqttNotice:
    fields = Fields(entry.source, node, entry.faults, what="'mqtt'")
    tls = fields.flag("tls", default=False)
    topic_at = fields.node_of("topic") or node
    found = MqttNotice(
        host=fields.text("host", "localhost"),
        topic=fields.text("topic", "missiontree/tasks"),
        port=fields.integer("port", 8883 if tls else 1883, low=1, high=65535),
        tls=tls,
        user=fields.text("user", ""),
        password=fields.text("password", ""),
    )
    fields.done()
    if any(sign in found.topic for sign in "+#"):
        entry.fault(topic_at.mark, f"'topic' names one topic, without + and #: '{found.topic}'", "home/robot")
    if found.password and not found.user:
        entry.fault(node.mark, "'mqtt' has a password and no user", "user: robot")
    return found
