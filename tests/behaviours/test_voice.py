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


def test_say_runs_until_it_is_spoken() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == 'saying "Hello!"'
    bench.voice.said[0].ended = True
    assert bench.tick(leaf) is SUCCESS
    assert bench.voice.commands == ["Hello!"]


def test_a_halt_makes_it_fall_silent_once() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    bench.tick(leaf)
    bench.halt(leaf)
    bench.halt(leaf)
    assert bench.voice.commands == ["Hello!", CANCEL]


def test_words_that_are_broken_off_are_said_once_more_and_then_fail() -> None:
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


def test_a_smiley_is_not_spoken_and_sets_the_mood_of_a_face_where_there_is_one() -> None:
    bench = LeafTestBench()
    bench.tick(saying(bench, "Hello :)"))
    assert bench.voice.commands == ["Hello"]
    assert bench.screen.commands == [Mood.HAPPY]
    leaf = saying(bench, "Goodbye :(")
    leaf.robot = replace(leaf.robot, screen_part=None)
    assert bench.tick(leaf) is RUNNING
    assert bench.voice.commands == ["Hello", "Goodbye"]


def test_each_start_says_it_again() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    bench.tick(leaf)
    bench.voice.said[0].ended = True
    assert bench.tick(leaf) is SUCCESS
    assert bench.tick(leaf) is RUNNING
    bench.halt(leaf)
    assert bench.tick(leaf) is RUNNING
    assert bench.voice.commands == ["Hello!", "Hello!", CANCEL, "Hello!"]


def test_a_voice_that_is_not_there_yet_is_waited_for_and_speaks_once() -> None:
    bench = LeafTestBench()
    bench.voice.trouble = OFFLINE_ERROR
    leaf = saying(bench)
    assert bench.tick(leaf) is RUNNING
    assert leaf.reason == "waiting: the cable is out"
    bench.voice.trouble = None
    bench.tick(leaf)
    bench.tick(leaf)
    assert bench.voice.commands == ["Hello!"]


def test_a_halt_before_it_could_speak_cancels_nothing_of_an_earlier_run() -> None:
    bench = LeafTestBench()
    leaf = saying(bench)
    bench.tick(leaf)
    bench.voice.said[0].ended = True
    bench.tick(leaf)
    bench.voice.trouble = OFFLINE_ERROR
    bench.tick(leaf)
    bench.halt(leaf)
    assert bench.voice.commands == ["Hello!"]


def test_a_voice_that_complains_is_a_failure() -> None:
    bench = LeafTestBench()
    bench.voice.trouble = DeviceFault("voice: no sound card")
    leaf = saying(bench)
    assert bench.tick(leaf) is FAILURE
    assert leaf.reason == "voice: no sound card"


def test_it_takes_as_long_as_the_words_and_whatever_is_said_before() -> None:
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


def test_how_it_is_said_goes_to_the_voice() -> None:
    bench = LeafTestBench()
    leaf = bench.put(Say("say"), text="Hallo!", voice="+f2", speed=200.0, language="de", priority="high")
    assert bench.tick(leaf) is RUNNING
    assert bench.voice.commands == [("Hallo!", SpeechStyle("+f2", 200.0, "de"), Priority.HIGH)]


def test_a_sound_is_played_to_its_end_and_silent_when_it_is_halted() -> None:
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


def test_a_sound_that_is_none_is_a_failure() -> None:
    bench = LeafTestBench()
    bench.voice.trouble = BadRequest("voice: bell.wav: is no WAV, MP3, FLAC or Ogg file")
    leaf = bench.put(PlaySound("play_sound"), sound=Path("bell.wav"))
    assert bench.tick(leaf) is FAILURE
    assert "is no WAV" in leaf.reason
