"""Speaking with espeak-ng and a player in processes of their own: what they do, and what follows when they die."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from subprocess import Popen
from threading import Thread

import pytest

from drivers.api import DeviceStatus, Mouth, Priority, SpeechStyle
from drivers.clock import SystemClock
from drivers.errors import NoReply, NotConnected
from drivers.sound import engines
from drivers.sound import worker_client as partner
from drivers.sound.cancel_token import CancelToken
from drivers.sound.engines import EspeakEngine
from drivers.sound.player import SoundPlayer, SoundState
from drivers.voice.speech import SpeechVoice
from tests.cases import each
from tests.waiting import wait_until

LONG = "this is a sentence that takes its time " * 4


class Room:
    """A voice, and what is seen of it from outside."""

    def __init__(self, *, device: str = "", backend: str = "null", usual: SpeechStyle | None = None) -> None:
        self.clock = SystemClock()
        self.printed: list[str] = []
        self.notices: list[DeviceStatus] = []
        usual = SpeechStyle("en-us+f2", 300) if usual is None else usual
        self.engine = EspeakEngine(self.clock, default_manner=usual, report=self.notices.append)
        self.player = SoundPlayer(self.clock, device=device, backend=backend, report=self.notices.append)
        self.voice = SpeechVoice(
            self.clock, self.engine, self.player, self.printed.append, default_style=usual, report=self.notices.append
        )

    def process(self, partner: EspeakEngine | SoundPlayer) -> "Popen[bytes]":
        wait_until(lambda: partner._worker._process)
        process = partner._worker._process
        assert process is not None
        return process

    def signal(self, partner: EspeakEngine | SoundPlayer, number: int) -> None:
        os.killpg(self.process(partner).pid, number)

    def starts(self, partner: EspeakEngine | SoundPlayer) -> int:
        return partner._worker.health().counters["starts"]

    def seconds_of(self, text: str) -> float:
        """Say something, and return how long that took from its beginning."""
        words = self.voice.say(text)
        wait_until(words.done)
        assert words.started is not None
        return self.clock.now() - words.started


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine a program starts and answers late; a test that is about that says how late it may be."""
    for module, name in ((partner, "START_TIMEOUT"), (partner, "HANG_TIMEOUT"), (engines, "SYNTHESIS_TIMEOUT")):
        monkeypatch.setattr(module, name, 60.0)


@pytest.fixture
def room() -> Iterator[Room]:
    room = Room()
    room.voice.open()
    yield room
    room.voice.close()


def test_the_mouth_moves_from_the_first_sound_to_the_last(room: Room) -> None:
    words = room.voice.say("pop music")
    assert list(words.mouth) == []
    wait_until(lambda: words.started is not None)
    shapes = list(words.mouth)
    assert [each.at for each in shapes] == sorted(each.at for each in shapes)
    assert shapes[0].shape is Mouth.CLOSED  # of the first p
    assert Mouth.OPEN in {each.shape for each in shapes}
    assert shapes[-1].shape is Mouth.CLOSED
    wait_until(words.done)
    assert words.started is not None
    assert room.clock.now() - words.started >= shapes[-1].at


def test_twice_the_speed_takes_about_half_the_time(room: Room) -> None:
    slow, quick = room.voice.say(LONG, SpeechStyle(speed=200)), room.voice.say(LONG, SpeechStyle(speed=400))
    wait_until(lambda: slow.started is not None)
    length = slow.mouth[-1].at
    slow.cancel()
    wait_until(lambda: quick.started is not None)
    assert 0.4 < quick.mouth[-1].at / length < 0.65


def test_language_changes_the_phonemes(room: Room) -> None:
    english, german = room.voice.say("die Maus"), room.voice.say("die Maus", SpeechStyle(language="de"))
    wait_until(lambda: english.started is not None)
    heard = list(english.mouth)
    wait_until(lambda: german.started is not None)
    assert heard != list(german.mouth)
    assert room.notices == []


@each("name", ["en-gb", "en-us+f3", "+m3", "EN-US", "German"])
def test_voices_go_by_their_names_and_languages(room: Room, name: str) -> None:
    wait_until(room.voice.say("so", SpeechStyle(voice=name)).done)
    assert room.notices == []


def test_missing_voice_is_reported_once_and_replaced(room: Room) -> None:
    for _ in range(2):
        wait_until(room.voice.say("so", SpeechStyle(voice="en-us+nonsense")).done)
    (notice,) = room.notices
    assert notice.message == ("voice: espeak-ng has no voice 'en-us+nonsense': speaking with 'en-us+f2' instead")
    assert "docs/speaking.md" in notice.hint
    assert room.voice.health().counters["said"] == 2


def test_no_name_of_a_voice_ends_the_synthesiser(room: Room) -> None:
    for name in ("\ud800", "en\0us", "+f1+f2", "x" * 5000):
        wait_until(room.voice.say("so", SpeechStyle(voice=name)).done)
    assert (room.starts(room.engine), room.printed) == (1, [])
    assert all(len(notice.message) < 200 for notice in room.notices)


@each("text", ["...", "a\0b", "<speak>&", "[[p]]", "naïve 🤖 日本", "odd \udc80 one", "-v de", "7" * 40])
def test_any_text_is_spoken_to_its_end(room: Room, text: str) -> None:
    words = room.voice.say(text, SpeechStyle(speed=450))
    if len(text) > 20:  # digit by digit
        wait_until(lambda: words.started is not None)
        words.cancel()
    wait_until(words.done)
    assert (room.notices, room.printed) == ([], [])


@pytest.mark.real_time
def test_cancelled_player_stops_without_a_restart(room: Room) -> None:
    for _ in range(3):
        words = room.voice.say(LONG)
        wait_until(lambda: words.started is not None)  # noqa: B023 - it is waited for here
        words.cancel()
        wait_until(lambda: room.player._sound_state is SoundState.ENDED)
    assert room.starts(room.player) == 1
    assert room.notices == []


def test_unresponsive_player_is_killed_and_the_next_speech_is_played(room: Room) -> None:
    words = room.voice.say(LONG)
    wait_until(lambda: words.started is not None)
    stopped = room.process(room.player)
    room.signal(room.player, signal.SIGSTOP)
    words.cancel()
    assert words.done()
    wait_until(lambda: stopped.returncode is not None)
    again = room.voice.say("so")
    wait_until(again.done)
    assert (room.starts(room.player), room.printed) == (2, [])
    assert [notice.kind for notice in room.notices] == ["fault"]


def test_speech_of_a_dead_player_is_printed_for_its_remaining_time(room: Room) -> None:
    wait_until(room.voice.say("so").done)
    words = room.voice.say("one two three four five six")
    wait_until(lambda: words.started is not None)
    began, length = words.started, words.mouth[-1].at
    room.signal(room.player, signal.SIGKILL)
    wait_until(words.done)
    assert words.started == began
    assert began is not None
    assert room.clock.now() - began >= length
    assert room.printed == ["one two three four five six"]
    (notice,) = room.notices
    assert notice.message == "voice: sound_worker: ended with -9"
    assert room.voice.health().counters["failed"] == 1
    wait_until(room.voice.say("back again").done)
    assert room.printed == ["one two three four five six"]
    assert room.voice.health().detail == ""


def test_speech_of_a_dead_synthesiser_is_printed_and_the_next_is_spoken(room: Room) -> None:
    wait_until(room.voice.say("so").done)
    room.signal(room.engine, signal.SIGSTOP)
    asked = room.engine._number
    words = room.voice.say("one two three")
    wait_until(lambda: room.engine._number > asked)  # or else the next synthesiser is asked for them
    room.signal(room.engine, signal.SIGKILL)
    wait_until(words.done)
    assert room.printed == ["one two three"]
    wait_until(room.voice.say("back again").done)
    assert room.printed == ["one two three"]
    assert len(room.notices) == 1


def test_hanging_synthesiser_is_reported_and_restarted(room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    wait_until(room.voice.say("so").done)
    room.signal(room.engine, signal.SIGSTOP)
    with monkeypatch.context() as hurried:
        hurried.setattr(engines, "SYNTHESIS_TIMEOUT", 0.2)
        wait_until(room.voice.say("one two three").done)
    assert room.printed == ["one two three"]
    assert "voice: espeak-ng did not finish the text 'one two three' in 0.2 s, and is restarted" in [
        notice.message for notice in room.notices
    ]
    wait_until(room.voice.say("back again").done)
    assert room.printed == ["one two three"]


@pytest.fixture
def stuck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[EspeakEngine]:
    """A synthesiser that never gets ready."""
    program = tmp_path / "stuck.py"
    program.write_text("import sys; sys.stdin.read()")
    monkeypatch.setattr(engines, "WORKER_PROGRAM", program)
    engine = EspeakEngine(SystemClock(), default_manner=SpeechStyle())
    engine.open()
    yield engine
    engine.close()


def test_program_hanging_at_its_start_is_reported_and_restarted(
    stuck: EspeakEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(partner, "START_TIMEOUT", 0.1)
    with pytest.raises(NotConnected):
        stuck.speak("so", SpeechStyle(speed=150), CancelToken())
    monkeypatch.setattr(partner, "HANG_TIMEOUT", 0.1)
    wait_until(lambda: stuck._worker.health().online)
    with pytest.raises(NoReply, match="voice: its program hangs while it starts"):
        stuck.speak("so", SpeechStyle(speed=150), CancelToken())
    wait_until(lambda: stuck._worker.health().counters["starts"] == 2)


def test_close_during_the_start_ends_the_wait(stuck: EspeakEngine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(partner, "START_TIMEOUT", 60.0)
    raised: list[Exception] = []

    def speak() -> None:
        try:
            stuck.speak("so", SpeechStyle(speed=150), CancelToken())
        except NotConnected as error:
            raised.append(error)

    thread = Thread(target=speak)
    thread.start()
    wait_until(lambda: stuck._worker.health().online)
    stuck.close()
    wait_until(lambda: not thread.is_alive(), 5.0)
    assert len(raised) == 1


def test_hanging_loudspeaker_is_reported(room: Room) -> None:
    wait_until(room.voice.say("so").done)
    words = room.voice.say("so")
    wait_until(lambda: words.started is not None)
    room.signal(room.player, signal.SIGSTOP)
    wait_until(words.done)
    assert any("the loudspeaker hangs" in notice.message for notice in room.notices)


def test_missing_sound_card_prints_speech_at_its_speed_with_one_notice() -> None:
    room, heard = Room(device="no such loudspeaker"), Room()
    for one in (room, heard):
        one.voice.open()
    try:
        length = heard.seconds_of("five words in some seconds")
        assert room.seconds_of("five words in some seconds") == pytest.approx(length, abs=0.5)
        room.seconds_of("again")
        words = room.voice.say(LONG)
        wait_until(lambda: len(room.printed) == 3)
        words.cancel()
        assert room.printed == ["five words in some seconds", "again", LONG]
        (notice,) = room.notices
        assert (notice.device, notice.kind) == ("voice", "fault")
        assert "no loudspeaker 'no such loudspeaker'" in notice.message
        health = room.voice.health()
        assert (health.online, health.detail) == (True, notice.message)
    finally:
        room.voice.close()
        heard.voice.close()


def test_preempted_speech_without_a_sound_card_is_printed_again() -> None:
    room = Room(device="no such loudspeaker")
    room.voice.open()
    usual = room.voice.say("one two")
    wait_until(lambda: room.printed)
    wait_until(room.voice.say("stop", priority=Priority.HIGH).done)
    wait_until(usual.done)
    room.voice.close()
    assert room.printed == ["one two", "stop", "one two"]


def test_undecodable_sound_is_reported_and_ends(room: Room, tmp_path: Path) -> None:
    path = tmp_path / "bell.ogg"
    path.write_bytes(b"OggS\0\x02" + bytes(20) + b"\x01\x1e\x01vorbis" + bytes(100))
    wait_until(room.voice.play(path).done)
    (notice,) = room.notices
    assert f"{path}: failed to decode" in notice.message
    assert notice.hint == f"`file {path}` shows what it is"


def test_too_long_sound_is_refused_without_waiting(room: Room, tmp_path: Path) -> None:
    path, rate, frames = tmp_path / "song.flac", 44_100, 44_100 * 60 * 40
    about = (rate << 44 | 15 << 36 | frames).to_bytes(8, "big")  # 16 bits a sample, one channel
    path.write_bytes(b"fLaC\x80\0\0\x22" + b"\x10\0\x10\0" + bytes(6) + about + bytes(16) + bytes(1_000_000))
    words = room.voice.play(path)
    wait_until(words.done)
    (notice,) = room.notices
    assert notice.message == f"voice: {path}: lasts 40 min; the limit is 10 min"
    assert room.printed == []


def test_missing_library_is_reported_once_and_speech_is_printed(room: Room) -> None:
    wait_until(room.voice.say("so").done)
    for _ in range(2):
        room.engine.on_message({"absent": "No module named 'espeakng_loader'"}, b"")
    room.engine.on_exit("it ends")
    wait_until(room.voice.say("one two three").done)
    assert room.printed == ["one two three"]
    (notice,) = room.notices
    assert notice.message == "voice: No module named 'espeakng_loader'"
    assert "driver: print" in notice.hint
    health = room.voice.health()
    assert (health.online, health.detail) == (False, notice.message)


def test_voice_closed_in_mid_speech_leaves_no_process_and_reopens(room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    # What is said while its program starts for longer than this is printed: on a busy machine it does.
    monkeypatch.setattr("drivers.sound.worker_client.START_TIMEOUT", 60.0)
    words = room.voice.say(LONG)
    wait_until(lambda: words.started is not None)
    processes = [room.process(room.engine), room.process(room.player)]
    room.voice.close()
    assert all(process.returncode is not None for process in processes)
    assert words.done()
    room.voice.open()
    wait_until(room.voice.say("so").done)
    assert (room.printed, room.notices) == ([], [])
