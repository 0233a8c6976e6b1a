"""What missions say and play: from the file to the voice, how it is told of, and given out again from a record."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from behaviours.voice import Say
from config.diagnostics import InvalidFileError
from drivers.api import MouthShape, Priority, SpeechStyle
from drivers.clock import ManualClock
from drivers.sound.printed_voice import PrintedVoice
from missions.executive.proxied_robot import robot_for, voice_proxy, with_proxies
from missions.executive.tick_cache import TickCache
from missions.library.shipped import load_mission
from missions.plugins.records.replay.recorded_answers import RecordedAnswers
from missions.plugins.records.replay.rerun import ReplayedVoice
from missions.plugins.testing.recorders import LeafTestBench


def arguments(folder: Path, step: str) -> Mapping[str, object]:
    file = folder / "mission.yaml"
    file.write_text(f"mission: sounds\nparams: {{which: bell, how: high}}\ntree: {{{step}}}\n", encoding="utf-8")
    return {name: value.constant for name, value in load_mission(str(file)).tree.arguments.items()}


def test_sounds_are_found_from_the_folder_of_the_mission(tmp_path: Path) -> None:
    (tmp_path / "sounds").mkdir()
    bell = tmp_path / "sounds" / "bell.wav"
    bell.touch()
    for step in ("play_sound: sounds/bell.wav", "play_sound: 'sounds/${which}.wav'", f"play_sound: {bell}"):
        assert arguments(tmp_path, step) == {"sound": bell}
    with pytest.raises(InvalidFileError, match=f"names a file that does not exist: {tmp_path / 'gong.wav'}"):
        arguments(tmp_path, "play_sound: gong.wav")


def test_arguments_of_say_are_checked(tmp_path: Path) -> None:
    step = "say: {text: Hi, voice: +f2, speed: 200, language: de, priority: '${how}'}"
    found = arguments(tmp_path, step)
    assert found == {"text": "Hi", "voice": "+f2", "speed": 200.0, "language": "de", "priority": "high"}
    with pytest.raises(InvalidFileError, match="must be between 80 and 450"):
        arguments(tmp_path, "say: {text: Hi, speed: 20}")
    with pytest.raises(InvalidFileError, match="needs one of low, normal, high, got 'urgent'"):
        arguments(tmp_path, "say: {text: Hi, priority: urgent}")


def test_say_reports_its_non_default_arguments() -> None:
    bench = LeafTestBench()
    told: list[Mapping[str, object]] = []
    leaf = bench.put(Say("say"), text="Hi")
    voice = robot_for(
        leaf, with_proxies(bench.robot, TickCache()), lambda *command: told.append({**command[2], "to": command[0]})
    ).voice
    voice.say("Hi")
    voice.say("Stop", SpeechStyle(speed=200), Priority.HIGH)
    voice.play(Path("bell.wav"), Priority.LOW)
    assert told == [
        {"say": "Hi", "to": "voice"},
        {"say": "Stop", "speed": 200, "priority": "high", "to": "voice"},
        {"play": "bell.wav", "priority": "low", "to": "voice"},
    ]
    assert bench.voice.commands == [
        "Hi",
        ("Stop", SpeechStyle(speed=200), Priority.HIGH),
        (Path("bell.wav"), Priority.LOW),
    ]
    heard = voice.speaking()
    assert heard is not None
    assert not heard.done()
    bench.voice.said[0].ended = True
    assert heard.done()


def test_recorded_speech_is_replayed(tmp_path: Path) -> None:
    clock, answers = ManualClock(10.0), TickCache()
    bell = tmp_path / "bell.wav"
    bell.write_bytes((b"OggS\0\x02" + bytes(20) + b"\x01\x1e\x01vorbis").ljust(16_000, b"\0"))  # a second of it
    device = PrintedVoice(clock, lambda _: None)
    device.open()
    voice = voice_proxy(device, answers)
    answers.is_recording = answers.is_open = True
    first, second = voice.say("one two three four five"), voice.play(bell, Priority.LOW)
    heard = voice.speaking()
    assert heard is not None
    then = (heard.started, tuple(heard.mouth), first.done(), second.started, second.done())
    assert then == (10.0, (), False, None, False)
    third = voice.say("Stop", SpeechStyle(speed=200), Priority.HIGH)
    third.cancel()
    assert (third.cancelled, second.cancelled) == (True, False)
    said = answers.take_answers()
    assert said[0][:3] == ("voice", "say", ("one two three four five", None, None))

    differences: list[object] = []
    memory = RecordedAnswers(
        on_unanswered=differences.append, on_different_command=lambda *what: differences.append(what)
    )
    memory.begin_tick(said)
    again = ReplayedVoice(memory, clock.now)
    first, second = again.say("one two three four five"), again.play(bell, Priority.LOW)
    heard = again.speaking()
    assert heard is not None
    assert (heard.started, tuple(heard.mouth), first.done(), second.started, second.done()) == then
    third = again.say("Stop", SpeechStyle(speed=200), Priority.HIGH)
    third.cancel()
    assert (third.cancelled, second.cancelled) == (True, False)
    memory.end_tick()
    assert differences == []
    guessed = again.play(bell)
    assert (guessed.done(), guessed.started) == (False, 10.0)
    shapes: tuple[MouthShape, ...] = tuple(guessed.mouth)
    assert shapes == ()
    clock.advance(1.5)
    guessed.cancel()
    assert (guessed.done(), guessed.cancelled) == (True, False)
    assert len(differences) == 1
