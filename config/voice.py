"""The ``voice`` section of a robot file: what the robot speaks with, and how."""

import re
import shlex
from dataclasses import dataclass

from config.fields import Fields

DRIVERS = ("auto", "espeak", "program", "piper", "command", "print")
"""What may speak, as drivers.voice.choose knows them."""

NEEDED = {"piper": ("model", "model: en_US-amy-medium.onnx"), "command": ("command", 'command: "my_tts --stdin"')}
"""What a driver cannot do without, and how that is written."""

FILLED = ("voice", "language", "name", "speed", "volume")
"""What stands in braces in a command and is filled in, as drivers.voice.synthesiser knows it."""


@dataclass(frozen=True, slots=True)
class VoiceConfig:
    """How the robot speaks.

    ``driver`` is ``espeak`` (the wheel), ``program`` (an installed synthesiser), ``piper`` with the voice in the file
    ``model``, ``command`` (a command line that speaks its standard input), ``print``, or ``auto``: the first of espeak,
    program and print that there is. ``voice``, ``speed`` (words per minute) and ``language`` are for what a mission
    says without them; ``volume`` is 1 for the sound as it comes; ``device`` a part of the loudspeaker's name.
    """

    driver: str = "auto"
    voice: str = ""
    speed: float = 150.0
    language: str = ""
    volume: float = 1.0
    device: str = ""
    model: str = ""
    command: str = ""


def read_voice(fields: Fields | None) -> VoiceConfig | None:
    """Read the section."""
    if fields is None:
        return None
    voice = VoiceConfig(
        driver=fields.choice("driver", DRIVERS, "auto"),
        voice=fields.text("voice", ""),
        speed=fields.number("speed", 150.0, low=80, high=450),
        language=fields.text("language", ""),
        volume=fields.quantity("volume", "share", 1.0, low=0.0, high=2.0),
        device=fields.text("device", ""),
        model=fields.text("model", ""),
        command=fields.text("command", ""),
    )
    key, example = NEEDED.get(voice.driver, ("", ""))
    if key and not getattr(voice, key):
        fields.fault(fields.node.mark, f"a voice with 'driver: {voice.driver}' needs '{key}'", example)
    _check_command(fields, voice.command)
    fields.done()
    return voice


def _check_command(fields: Fields, command: str) -> None:
    node = fields.node_of("command") or fields.node
    try:
        shlex.split(command)
    except ValueError as error:
        fields.fault(node.mark, f"'command' cannot be taken apart as a shell would: {error}")
    hint = f"{', '.join(f'{{{each}}}' for each in FILLED)} are; the text comes on standard input"
    for word in re.findall(r"\{(\w+)\}", command):
        if word not in FILLED:
            fields.fault(node.mark, f"'command': {{{word}}} is not filled in", hint)
