"""Speaking: as long as it takes, silent when halted, and on a voice that is queued for."""

from dataclasses import replace
from pathlib import Path

from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.robot import Robot
from behaviours.voice import PlaySound, Say
from drivers.api import Mood, Priority, SpeechStyle
from drivers.errors import BadRequest, DeviceFault
from drivers.sound.printed_voice import PrintedVoice
from missions.plugins.testing.recorders import CANCEL, OFFLINE_ERROR, LeafTestBench


def saying(bench: LeafTestBench, text: str = "Hello!") -> Say:
    return bench.put(Say("say"), text=text)


def test_say_runs_until_the_speech_ends() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == 'saying "Hello!"'
    bench.voice.said[0].ended = True
    assert bench.tick(leaf) is SUCCESS
    assert bench.voice.commands == ["Hello!"]


def test_halted_say_cancels_once() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    bench.tick(leaf)
    bench.halt(leaf)
    bench.halt(leaf)
    assert bench.voice.commands == ["Hello!", CANCEL]


def test_interrupted_speech_is_repeated_once_and_then_fails() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    bench.tick(leaf)
    for number in (0, 1):
        said = bench.voice.said[number]
        said.ended = said.cancelled = True  # as by the plug, or somebody who lays it to rest
        assert bench.tick(leaf) is (FAILURE if number else RUNNING)
    assert leaf.reason == "interrupted"
    assert bench.tick(leaf) is RUNNING
    bench.halt(leaf)
    assert bench.voice.said[2].cancelled
    assert bench.voice.commands == ["Hello!", "Hello!", CANCEL, "Hello!", CANCEL]


def test_smiley_sets_the_mood_and_is_not_spoken() -> None:
    bench = LeafTestBench()
    bench.tick(saying(bench, "Hello :)"))
    assert bench.voice.commands == ["Hello"]
    assert bench.screen.commands == [Mood.HAPPY]
    leaf = saying(bench, "Goodbye :(")
    leaf.robot = replace(leaf.robot, screen_part=None)
    assert bench.tick(leaf) is RUNNING
    assert bench.voice.commands == ["Hello", "Goodbye"]


def test_say_speaks_again_at_each_start() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    bench.tick(leaf)
    bench.voice.said[0].ended = True
    assert bench.tick(leaf) is SUCCESS
    assert bench.tick(leaf) is RUNNING
    bench.halt(leaf)
    assert bench.tick(leaf) is RUNNING
    assert bench.voice.commands == ["Hello!", "Hello!", CANCEL, "Hello!"]


def test_say_waits_for_an_offline_voice_and_speaks_once() -> None:
    bench = LeafTestBench()
    bench.voice.trouble = OFFLINE_ERROR
    leaf = saying(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    bench.voice.trouble = None
    bench.tick(leaf)
    bench.tick(leaf)
    assert bench.voice.commands == ["Hello!"]


def test_halt_before_speaking_cancels_nothing() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    bench.tick(leaf)
    bench.voice.said[0].ended = True
    bench.tick(leaf)
    bench.voice.trouble = OFFLINE_ERROR
    bench.tick(leaf)
    bench.halt(leaf)
    assert bench.voice.commands == ["Hello!"]


def test_say_fails_on_a_voice_fault() -> None:
    bench = LeafTestBench()
    bench.voice.trouble = DeviceFault("voice: no sound card")
    leaf = saying(bench)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "voice: no sound card"


def test_say_lasts_as_long_as_its_words_and_those_queued_before() -> None:
    bench = LeafTestBench()
    printed: list[str] = []
    voice = PrintedVoice(bench.clock, printed.append)
    voice.open()
    first, second = saying(bench, "one two three four five"), saying(bench, "six seven eight nine ten")
    first.robot = second.robot = Robot(voice_part=voice)
    # Five words take 2 s.
    assert bench.tick(first) is RUNNING
    assert bench.tick(second, after=0.0) is RUNNING
    assert bench.tick(first, after=2.0) is SUCCESS
    assert bench.tick(second, after=0.0) is RUNNING
    assert bench.tick(second, after=2.0) is SUCCESS
    assert printed == ["one two three four five", "six seven eight nine ten"]


def test_say_passes_style_and_priority_to_the_voice() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Say("say"), text="Hallo!", voice="+f2", speed=200.0, language="de", priority="high")
    assert bench.tick(leaf) is RUNNING
    assert bench.voice.commands == [("Hallo!", SpeechStyle("+f2", 200.0, "de"), Priority.HIGH)]


def test_play_sound_runs_to_the_end_and_cancels_on_halt() -> None:
    bench = LeafTestBench()
    leaf = bench.put(PlaySound("play_sound"), sound=Path("bells/bell.wav"))
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "playing bell.wav"
    bench.voice.said[0].ended = True
    assert bench.tick(leaf) is SUCCESS
    bench.put(leaf, priority="low")
    assert bench.tick(leaf) is RUNNING
    bench.halt(leaf)
    assert bench.voice.commands == [Path("bells/bell.wav"), (Path("bells/bell.wav"), Priority.LOW), CANCEL]


def test_invalid_sound_file_fails_play_sound() -> None:
    bench = LeafTestBench()
    bench.voice.trouble = BadRequest("voice: bell.wav: is no WAV, MP3, FLAC or Ogg file")
    leaf = bench.put(PlaySound("play_sound"), sound=Path("bell.wav"))
    assert bench.tick(leaf) is FAILURE
    assert "is no WAV" in leaf.reason
