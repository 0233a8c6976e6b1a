"""The voice: printed words on a clock cranked by hand, and a real program that stands in for a synthesiser."""

import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from drivers.api import DeviceStatus, Priority, SpeechStyle, Voice, ignore
from drivers.clock import ManualClock, SystemClock
from drivers.errors import NotConnected
from drivers.sound.player import SoundPlayer
from drivers.sound.printed_voice import PrintedVoice
from drivers.sound.speech_programs import ProgramEngine, Synthesiser, find_synthesiser
from drivers.voice.speech import SpeechVoice
from tests.cases import each
from tests.waiting import wait_until

# Writes down its number and what it reads; then speaks until the file "hush" appears, or fails when told to.
PROGRAM = """
import os, pathlib, subprocess, sys, threading
here = pathlib.Path(sys.argv[1])
text = sys.stdin.buffer.read().decode()
helper = subprocess.Popen([sys.executable, "-c", "import sys; sys.stdin.read()"], stdin=subprocess.PIPE)
with (here / "spoken").open("a") as spoken:
    spoken.write(f"{os.getpid()} {helper.pid} {text}\\n")
if "fail" in text:
    helper.communicate()
    sys.exit("no sound card")
while "long" in text and not (here / "hush").exists():
    threading.Event().wait(0.01)
helper.communicate()
"""


def runs(process: int) -> bool:
    """Say whether a process is there and not just a dead one that nobody has waited for."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@dataclass
class Booth:
    """A speaker, and what is known of it."""

    folder: Path
    speaker: SpeechVoice
    printed: list[str] = field(default_factory=list)
    notices: list[DeviceStatus] = field(default_factory=list)
    changes: list[None] = field(default_factory=list)

    def spoken(self) -> list[str]:
        """What the program was told to say, in order."""
        return [line.split(" ", 2)[2] for line in self._lines()]

    def processes(self) -> list[int]:
        """The programs and their helpers."""
        return [int(number) for line in self._lines() for number in line.split(" ", 2)[:2]]

    def _lines(self) -> list[str]:
        book = self.folder / "spoken"
        return [line for line in book.read_text().split("\n") if line] if book.exists() else []


def speech(
    synthesiser: Synthesiser, printed: list[str], notices: list[DeviceStatus], changed: Callable[[], None] = ignore
) -> SpeechVoice:
    """A voice that speaks with a program; words that it prints are quick."""
    clock = SystemClock()
    return SpeechVoice(
        clock,
        ProgramEngine(synthesiser, clock),
        SoundPlayer(clock, backend="null"),
        printed.append,
        default_style=SpeechStyle(speed=1200),
        report=notices.append,
        changed=changed,
    )


@pytest.fixture
def booth(tmp_path: Path) -> Iterator[Booth]:
    before = set(threading.enumerate())
    program = tmp_path / "synthesiser.py"
    program.write_text(PROGRAM)
    printed: list[str] = []
    notices: list[DeviceStatus] = []
    changes: list[None] = []
    speaker = speech(
        Synthesiser(sys.executable, (str(program), str(tmp_path))), printed, notices, lambda: changes.append(None)
    )
    speaker.open()
    booth = Booth(tmp_path, speaker, printed, notices, changes)
    try:
        yield booth
    finally:
        speaker.close()
        wait_until(lambda: not any(runs(process) for process in booth.processes()))
        assert not {thread for thread in threading.enumerate() if thread.name.startswith("voice ")} - before


# --- the speaker ------------------------------------------------------------------------------------------------------


def test_utterances_are_spoken_in_order(booth: Booth) -> None:
    first, second = booth.speaker.say("a long word"), booth.speaker.say("and another")
    wait_until(lambda: booth.spoken() == ["a long word"])
    assert not first.done()
    assert not second.done()
    (booth.folder / "hush").touch()
    wait_until(second.done)
    assert first.done()
    assert booth.spoken() == ["a long word", "and another"]
    wait_until(lambda: len(booth.changes) == 2)
    health = booth.speaker.health()
    assert (health.online, health.detail, health.counters["said"]) == (True, "", 2)
    assert booth.printed == []


@each("text", ["--version", "$(touch pwned); `id` | x", "Grüß Gott, ç'est ça", 'say "so" \\ now'])
def test_any_text_reaches_the_program_unchanged(booth: Booth, text: str) -> None:
    wait_until(booth.speaker.say(text).done)
    assert booth.spoken()[-1] == text


def test_unencodable_text_is_spoken_with_a_question_mark(booth: Booth) -> None:
    wait_until(booth.speaker.say("odd \udc80 one").done)
    assert booth.spoken() == ["odd ? one"]


def test_cancelled_speech_kills_its_processes_and_the_next_starts(booth: Booth) -> None:
    first, second = booth.speaker.say("a long word"), booth.speaker.say("next")
    wait_until(lambda: len(booth.processes()) == 2)
    program, helper = booth.processes()
    first.cancel()
    first.cancel()
    assert first.done()
    wait_until(lambda: not runs(program) and not runs(helper))
    wait_until(second.done)
    assert booth.spoken() == ["a long word", "next"]
    assert booth.notices == []


def test_speech_cancelled_in_the_queue_is_never_spoken(booth: Booth) -> None:
    first, second, third = (booth.speaker.say(text) for text in ("a long one", "not this", "but this"))
    second.cancel()
    assert second.done()
    (booth.folder / "hush").touch()
    wait_until(third.done)
    assert first.done()
    assert booth.spoken() == ["a long one", "but this"]


def test_rest_silences_all_speech_and_the_voice_can_speak_again(booth: Booth) -> None:
    waiting = [booth.speaker.say("a long word") for _ in range(3)]
    wait_until(lambda: len(booth.spoken()) == 1)
    booth.speaker.rest()
    booth.speaker.rest()
    assert all(one.done() for one in waiting)
    wait_until(booth.speaker.say("again").done)
    assert booth.spoken() == ["a long word", "again"]


def test_closing_kills_the_program_at_once_and_may_be_done_twice(booth: Booth) -> None:
    speaking, waiting = booth.speaker.say("a long word"), booth.speaker.say("and another")
    wait_until(lambda: len(booth.processes()) == 2)
    booth.speaker.close()
    booth.speaker.close()
    assert speaking.done()
    assert waiting.done()
    wait_until(lambda: not any(runs(process) for process in booth.processes()))
    assert booth.spoken() == ["a long word"]
    assert "not opened yet" in booth.speaker.health().detail
    with pytest.raises(NotConnected, match="cannot say 'more'"):
        booth.speaker.say("more")
    booth.speaker.open()
    wait_until(booth.speaker.say("back").done)
    assert booth.spoken() == ["a long word", "back"]


def test_closed_while_the_program_is_starting_nothing_is_left(booth: Booth) -> None:
    for _ in range(5):
        words = booth.speaker.say("a long word")
        booth.speaker.close()
        assert words.done()
        booth.speaker.open()
    wait_until(lambda: not any(runs(process) for process in booth.processes()))


@each("text", ["", "  \n"])
def test_empty_text_ends_at_once(booth: Booth, text: str) -> None:
    assert booth.speaker.say(text).done()
    assert booth.spoken() == []


def test_failing_program_is_reported_and_the_text_is_printed(booth: Booth) -> None:
    wait_until(booth.speaker.say("this will fail").done)
    assert booth.printed == ["this will fail"]
    (notice,) = booth.notices
    assert (notice.device, notice.kind) == ("voice", "fault")
    assert "ended with 1: no sound card" in notice.message
    assert notice.hint.startswith("echo hello | ")
    health = booth.speaker.health()
    assert (health.online, health.detail, health.counters["failed"]) == (True, notice.message, 1)
    wait_until(booth.speaker.say("this will fail").done)
    assert len(booth.notices) == 1  # the same again is no news
    wait_until(booth.speaker.say("this works").done)
    assert booth.speaker.health().detail == ""


def test_missing_program_is_reported_and_the_text_is_printed(tmp_path: Path) -> None:
    printed: list[str] = []
    notices: list[DeviceStatus] = []
    speaker = speech(Synthesiser(str(tmp_path / "gone")), printed, notices)
    speaker.open()
    wait_until(speaker.say("hello").done)
    speaker.close()
    assert printed == ["hello"]
    assert "No such file or directory" in notices[0].message


def test_any_error_prints_the_text_and_the_next_is_spoken(booth: Booth) -> None:
    arguments = booth.speaker._engine._synthesiser.arguments if isinstance(booth.speaker._engine, ProgramEngine) else ()
    booth.speaker._engine = ProgramEngine(Synthesiser(sys.executable, (*arguments, "{voice}")), SystemClock())
    wait_until(booth.speaker.say("odd", SpeechStyle(voice="a\0b")).done)
    assert booth.printed == ["odd"]
    assert [notice.message for notice in booth.notices] == ["voice: 'odd': ValueError: embedded null byte"]
    wait_until(booth.speaker.say("even", SpeechStyle(voice="ab")).done)
    assert booth.spoken() == ["even"]


# --- which synthesiser ------------------------------------------------------------------------------------------------


def test_the_best_synthesiser_on_the_path_is_found(tmp_path: Path) -> None:
    assert find_synthesiser(str(tmp_path)) is None
    manner = SpeechStyle(speed=150)
    espeak = ["--stdin", "-s150", "-a100"]
    for name, arguments in (("say", ["-r150", "-f", "-"]), ("espeak", espeak), ("espeak-ng", espeak)):
        program = tmp_path / name
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
        found = find_synthesiser(str(tmp_path))
        assert found is not None
        assert found.command(manner) == [str(program), *arguments]


def test_file_that_is_not_executable_is_not_a_synthesiser(tmp_path: Path) -> None:
    (tmp_path / "espeak").write_text("not executable")
    assert find_synthesiser(str(tmp_path)) is None


@pytest.mark.skipif(find_synthesiser() is None, reason="no speech synthesiser is installed")
def test_installed_synthesiser_ends_or_gives_a_reason() -> None:
    synthesiser = find_synthesiser()
    assert synthesiser is not None
    printed: list[str] = []
    speaker = speech(synthesiser, printed, [])
    speaker.open()
    wait_until(speaker.say("one two").done)
    speaker.close()
    counters = speaker.health().counters
    assert (counters["said"], counters["failed"]) == (1, 0) or printed == ["one two"]  # no sound card: it may fail


def test_an_argument_of_which_nothing_is_known_is_left_out() -> None:
    synthesiser = Synthesiser("my_tts", ("--as", "-v{voice}", "-l{language}", "--pace={speed}", "{name}", "{x}"), 0.8)
    assert synthesiser.command(SpeechStyle()) == ["my_tts", "--as", "{x}"]
    spoken = synthesiser.command(SpeechStyle("+f2", 120, "de"))
    assert spoken == ["my_tts", "--as", "-v+f2", "-lde", "--pace=120", "de+f2", "{x}"]
    assert Synthesiser("my_tts", ("-a{volume}",), 0.8).command(SpeechStyle()) == ["my_tts", "-a80"]


# --- printed words ----------------------------------------------------------------------------------------------------


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(50.0)


def test_printed_words_take_as_long_as_spoken_ones(clock: ManualClock) -> None:
    printed: list[str] = []
    changes: list[None] = []
    voice: Voice = PrintedVoice(clock, printed.append, changed=lambda: changes.append(None))
    voice.open()
    words = voice.say("five words in two seconds")
    assert printed == ["five words in two seconds"]
    clock.advance(1.99)
    assert not words.done()
    clock.advance(0.02)
    assert words.done()
    assert words.done()
    assert len(changes) == 1
    assert voice.health().counters["said"] == 1


def test_printed_speech_is_queued(clock: ManualClock) -> None:
    voice = PrintedVoice(clock, lambda _: None)
    voice.open()
    first, second = voice.say("one two three four five"), voice.say("one two three four five")
    clock.advance(2.1)
    assert (first.done(), second.done()) == (True, False)
    third = voice.say("one")
    clock.advance(1.95)
    assert (second.done(), third.done()) == (True, False)
    clock.advance(10.0)
    assert third.done()
    late = voice.say("one")
    assert not late.done()


def test_printed_speech_moves_up_after_a_cancel(clock: ManualClock) -> None:
    voice = PrintedVoice(clock, lambda _: None)
    voice.open()
    first, second, third = (voice.say("one two three four five") for _ in range(3))
    clock.advance(1.0)
    first.cancel()
    second.cancel()
    second.cancel()
    assert (first.done(), second.done(), third.done()) == (True, True, False)
    clock.advance(2.01)
    assert third.done()


def test_nothing_to_print_is_done_at_once(clock: ManualClock) -> None:
    printed: list[str] = []
    voice = PrintedVoice(clock, printed.append)
    voice.open()
    assert voice.say("").done()
    assert voice.say(" \n").done()
    assert printed == []


def test_closed_printed_voice_refuses_speech_and_close_ends_all(clock: ManualClock) -> None:
    voice = PrintedVoice(clock, lambda _: None)
    voice.close()
    with pytest.raises(NotConnected, match="not open"):
        voice.say("hello")
    assert not voice.health().online
    voice.open()
    words = [voice.say("hello there"), voice.say("and again")]
    assert voice.health().online
    voice.close()
    voice.close()
    assert all(one.done() for one in words)


def test_printed_speech_lasts_according_to_its_speed(clock: ManualClock) -> None:
    voice = PrintedVoice(clock, lambda _: None, default_manner=SpeechStyle(speed=100))
    voice.open()
    slow = voice.say("one two three four five")
    clock.advance(2.9)
    assert not slow.done()
    clock.advance(0.2)
    assert slow.done()
    quick = voice.say("one two three four five", SpeechStyle(speed=300))
    clock.advance(1.05)
    assert quick.done()


def test_preempted_printed_speech_is_printed_again(clock: ManualClock) -> None:
    printed: list[str] = []
    voice = PrintedVoice(clock, printed.append)
    voice.open()
    usual, low = voice.say("one two three four five"), voice.say("six", priority=Priority.LOW)
    clock.advance(1.0)
    high = voice.say("seven eight nine ten eleven", priority=Priority.HIGH)
    assert (usual.started, high.started) == (None, 51.0)
    clock.advance(2.1)
    assert high.done()
    assert usual.started == 53.0
    clock.advance(10.0)
    assert low.done()
    assert printed == ["one two three four five", "seven eight nine ten eleven", "one two three four five", "six"]
