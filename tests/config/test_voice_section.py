"""The ``voice`` section of a robot file: all that it may say, and what is wrong with one."""

import pytest

from config.diagnostics import InvalidFileError, SourceText
from drivers.api import SpeechStyle
from drivers.clock import SystemClock
from drivers.sound.speech_programs import Synthesiser
from drivers.table import BUILT_IN_DRIVERS
from drivers.voice.declared import PLACEHOLDERS, PiperKeys, SpeechKeys
from drivers.voice.speech import VoiceSettings, make_voice
from missions.library.drivers import parse_robot


def voice(*lines: str) -> SpeechKeys:
    found = parse_robot(SourceText("r.yaml", "robot: r\nvoice:\n" + "".join(f"  {line}\n" for line in lines))).keys(
        SpeechKeys
    )
    assert found is not None
    return found


def mistake(*lines: str) -> str:
    with pytest.raises(InvalidFileError) as caught:
        voice(*lines)
    (fault,) = caught.value.diagnostics
    return f"{fault.message} | {fault.suggestion}"


def test_voice_section_is_read() -> None:
    assert voice(
        "driver: piper",
        "voice: en-us+f2",
        "speed: 170",
        "language: en-us",
        "volume: 80 %",
        "device: USB",
        "model: amy.onnx",
    ) == PiperKeys(voice="en-us+f2", speed=170.0, language="en-us", volume=0.8, device="USB", model="amy.onnx")
    assert voice("driver: command", "command: my_tts --stdin").command == "my_tts --stdin"


def test_voice_section_has_defaults() -> None:
    assert voice("driver: auto") == SpeechKeys(
        voice="", speed=150.0, language="", volume=1.0, device="", model="", command=""
    )


def test_every_driver_makes_a_voice() -> None:
    for driver in BUILT_IN_DRIVERS["voice"]:
        made = make_voice(VoiceSettings(driver, model="amy.onnx", command="my_tts"), SystemClock(), print)
        assert not made.health().online


def test_voice_command_placeholders_are_filled_in() -> None:
    line = "my_tts " + " ".join(f"{{{each}}}" for each in PLACEHOLDERS)
    assert voice("driver: command", f'command: "{line}"').command == line
    said = Synthesiser("my_tts", tuple(line.split()[1:])).command(SpeechStyle("Anna", 150.0, "de"))
    assert said == ["my_tts", "Anna", "de", "Anna", "150", "100"]
    assert voice("driver: command", "command: my_tts '{ print }'").command == "my_tts '{ print }'"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (("driver: piper",), "a voice with 'driver: piper' needs 'model' | model: en_US-amy-medium.onnx"),
        (("driver: command",), "a voice with 'driver: command' needs 'command'"),
        (("driver: command", "command: my_tts 'a"), "'command' is not a valid shell command line"),
        (
            ("driver: command", "command: my_tts {text} --as={voice} --pace={speed}"),
            (
                "'command': {text} is not a placeholder"
                " | {voice}, {language}, {name}, {speed}, {volume} are known; the text"
            ),
        ),
        (("driver: command", "command: my_tts --pace={pace}"), "{pace} is not a placeholder"),
        (("driver: espeek",), "'driver' cannot be 'espeek' | did you mean 'espeak'?"),
        (("speed: 20",), "'speed' must be at least 80"),
        (("speed: 150 wpm",), "'speed' needs a plain number"),
        (("volume: 300 %",), "'volume' must be at most 200"),
        (("pitch: 3",), "has no key 'pitch'"),
    ],
)
def test_voice_section_fault_is_reported(lines: tuple[str, ...], words: str) -> None:
    assert words in mistake(*lines)
