"""Declarations and keys of the voices."""

import re
import shlex
from collections.abc import Iterator

from drivers.api.driver import Driver
from drivers.api.keys import KeyDiagnostic, key, keys
from drivers.api.sections import VoiceKeys

PLACEHOLDERS = ("voice", "language", "name", "speed", "volume")
"""Names that may stand in braces in the key ``command`` of a voice, as in ``drivers.sound.speech_programs``."""


@keys
class SpeechKeys(VoiceKeys):
    """Keys of a voice that speaks."""

    model: str = key(default="", help="File of a voice of Piper, for `piper`.")
    command: str = key(
        default="",
        help="Command line that speaks its standard input, for `command`: "
        "`{voice}`, `{language}`, `{name}`, `{speed}` and `{volume}` are filled in.",
    )

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic for an invalid command line or an unknown placeholder in the key ``command``."""
        try:
            shlex.split(self.command)
        except ValueError as error:
            yield KeyDiagnostic(f"'command' is not a valid shell command line: {error}", ("command",))
        hint = f"{', '.join(f'{{{each}}}' for each in PLACEHOLDERS)} are known; the text comes on standard input"
        for word in re.findall(r"\{(\w+)\}", self.command):
            if word not in PLACEHOLDERS:
                yield KeyDiagnostic(f"'command': {{{word}}} is not a placeholder", ("command",), hint=hint)


@keys
class PiperKeys(SpeechKeys):
    """Keys of a voice that uses Piper."""

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic if ``model`` is missing, and the diagnostics of ``SpeechKeys``."""
        if not self.model:
            yield KeyDiagnostic("a voice with 'driver: piper' needs 'model'", hint="model: en_US-amy-medium.onnx")
        yield from SpeechKeys.diagnostics(self)


@keys
class CommandKeys(SpeechKeys):
    """Keys of a voice that uses a command."""

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield a diagnostic if ``command`` is missing, and the diagnostics of ``SpeechKeys``."""
        if not self.command:
            yield KeyDiagnostic("a voice with 'driver: command' needs 'command'", hint='command: "my_tts --stdin"')
        yield from SpeechKeys.diagnostics(self)


AUTO = Driver(
    "auto",
    "voice",
    "The first available of espeak, program and print.",
    SpeechKeys,
    make="drivers.voice.speech:auto",
    checkup="drivers.voice.checkup:checkup",
    extra="speak",
)
ESPEAK = Driver(
    "espeak",
    "voice",
    "The wheel of espeak-ng.",
    SpeechKeys,
    make="drivers.voice.speech:espeak",
    extra="speak",
)
PROGRAM = Driver(
    "program",
    "voice",
    "An installed synthesiser.",
    SpeechKeys,
    make="drivers.voice.speech:program",
    extra="speak",
)
PIPER = Driver(
    "piper",
    "voice",
    "Piper, with the voice in a file.",
    PiperKeys,
    make="drivers.voice.speech:piper",
    extra="speak",
)
COMMAND = Driver(
    "command",
    "voice",
    "A command line that speaks its standard input.",
    CommandKeys,
    make="drivers.voice.speech:command",
    extra="speak",
)
PRINT = Driver(
    "print",
    "voice",
    "Text on the terminal.",
    SpeechKeys,
    make="drivers.voice.speech:printed",
)
