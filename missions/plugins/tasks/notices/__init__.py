"""The ways that notices go, by what a robot file says of them."""

import os
from collections.abc import Callable, Mapping

from config.notices import CommandNotice, MqttNotice, TerminalNotice, WebhookNotice, read_written
from missions.plugins.tasks.notice import Channel, Terminal
from missions.plugins.tasks.notices.command import Command
from missions.plugins.tasks.notices.mqtt import Mqtt
from missions.plugins.tasks.notices.webhook import Webhook


def channel_of(text: str, print_line: Callable[[str], None], environment: Mapping[str, str] = os.environ) -> Channel:
    """Return the channel that ``config.notices.written`` wrote; ``print_line`` is the terminal.

    Raises ValueError for one that is not known.
    """
    match read_written(text):
        case TerminalNotice():
            return Terminal(print_line)
        case CommandNotice() as config:
            return Command(config)
        case WebhookNotice() as config:
            return Webhook(config, environment)
        case MqttNotice() as config:
            return Mqtt(config, environment)
