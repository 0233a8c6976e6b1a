"""Notice channels: terminal, command, webhook and MQTT, as configured in the robot file."""

import os
from collections.abc import Callable, Mapping

from config.notices import CommandNotice, MqttNotice, TerminalNotice, WebhookNotice, decode_notice
from missions.plugins.tasks.notice import Channel, TerminalChannel
from missions.plugins.tasks.notices.command import CommandChannel
from missions.plugins.tasks.notices.mqtt import MqttChannel
from missions.plugins.tasks.notices.webhook import WebhookChannel


def channel_of(text: str, print_line: Callable[[str], None], environment: Mapping[str, str] = os.environ) -> Channel:
    """Return the channel of a ``text`` written by ``config.notices.encode_notice``.

    ``print_line`` prints a line on the terminal; ``environment`` holds the secrets. Raises ValueError for an unknown
    text.
    """
    match decode_notice(text):
        case TerminalNotice():
            return TerminalChannel(print_line)
        case CommandNotice() as config:
            return CommandChannel(config)
        case WebhookNotice() as config:
            return WebhookChannel(config, environment)
        case MqttNotice() as config:
            return MqttChannel(config, environment)
