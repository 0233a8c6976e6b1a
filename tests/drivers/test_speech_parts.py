"""What speech is made of: manners, files, shapes of the mouth, messages, and the programs on their own."""

import json
import os
import signal
import sys
import wave
from contextlib import suppress
from functools import partial
from pathlib import Path
from random import Random
from subprocess import PIPE, Popen
from threading import Thread
from typing import Any

import miniaudio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import DEFAULT_STYLE, DeviceStatus, Mouth, MouthShape, SpeechStyle
from drivers.clock import ManualClock, SystemClock
from drivers.errors import BadRequest, DeviceFault, NoReply
from drivers.sound import espeak_worker, sound_worker
from drivers.sound.cancel_token import CancelToken
from drivers.sound.engines import EspeakEngine, PiperEngine
from drivers.sound.player import SoundEvent, SoundPlayer, SoundState
from drivers.sound.printed_voice import PrintedVoice
from drivers.sound.sound_worker import PlaybackQueue
from drivers.sound.speech_programs import (
    MAX_PIECE_BYTES,
    ProgramEngine,
    ProgramOutput,
    Speech,
    Synthesiser,
    make_request,
    parse_speech,
    run_program,
    split_sound,
)
from drivers.sound.utterances import espeak_name, fill_manner, mouth_movement, mouth_shape
from drivers.sound.wav import check_sound_file, sound_duration
from drivers.sound.worker_client import ProgramEvent, ProgramState
from drivers.transport.worker_process import Message, MessageParser, WorkerProcess, pack_message
from drivers.voice.speech import SpeechVoice, VoiceSettings, make_voice
from tests.cases import each
from tests.machines import walk
from tests.waiting import wait_until

# --- manners ----------------------------------------------------------------------------------------------------------

ROBOT = SpeechStyle("en-us+f2", 120, "en-us")


@each(
    ("asked", "name", "speed"),
    [
        (DEFAULT_STYLE, "en-us+f2", 120),
        (SpeechStyle(language="de"), "de+f2", 120),
        (SpeechStyle(voice="fr"), "fr", 120),
        (SpeechStyle(voice="+m3"), "en-us+m3", 120),
        (SpeechStyle(voice="+m3", language="de", speed=200), "de+m3", 200),
        (SpeechStyle(voice="en-gb", language="de"), "en-gb", 120),
    ],
)
def test_unset_speech_style_is_filled_in_from_the_robot(asked: SpeechStyle, name: str, speed: float) -> None:
    manner = fill_manner(asked, ROBOT)
    assert (espeak_name(manner), manner.speed) == (name, speed)


@each(
    ("asked", "usual", "name"),
    [
        (SpeechStyle("+f3"), SpeechStyle("de+f2"), "de+f3"),
        (SpeechStyle("+f3"), SpeechStyle("de"), "de+f3"),
        (SpeechStyle("+f3"), SpeechStyle("de", language="fr"), "de+f3"),
        (SpeechStyle("+f3"), SpeechStyle("", language="fr"), "fr+f3"),
        (SpeechStyle("+f3", language="fr"), SpeechStyle("de+f2"), "fr+f3"),
        (SpeechStyle("+f3"), DEFAULT_STYLE, "en+f3"),
    ],
)
def test_variant_does_not_change_the_language(asked: SpeechStyle, usual: SpeechStyle, name: str) -> None:
    assert espeak_name(fill_manner(asked, usual)) == name


def test_without_anything_the_synthesiser_chooses_and_speaks_as_people_do() -> None:
    assert fill_manner(DEFAULT_STYLE, DEFAULT_STYLE) == SpeechStyle("", 150.0, "")
    assert espeak_name(DEFAULT_STYLE) == ""
    assert espeak_name(SpeechStyle("+f2")) == "en+f2"


# --- files ------------------------------------------------------------------------------------------------------------


def riff(*chunks: tuple[bytes, bytes]) -> bytes:
    body = b"".join(name + len(data).to_bytes(4, "little") + data for name, data in chunks)
    return b"RIFF" + (len(body) + 4).to_bytes(4, "little") + b"WAVE" + body


PLAIN = (b"fmt ", bytes.fromhex("0100 0100 803e0000 007d0000 0200 1000"))
FRAME = b"\xff\xfb\x90\x64".ljust(417, b"\0")  # of an MP3: 128 kbit/s, 44.1 kHz
FLAC = b"fLaC\x80\0\0\x22" + bytes(10) + b"\x0a\xc4\x42" + bytes(60)
OGG = b"OggS\0\x02" + bytes(20) + b"\x01\x1e"
SOUNDS = (
    riff(PLAIN, (b"data", bytes(20))),
    riff((b"LIST", bytes(26)), PLAIN, (b"fact", bytes(4)), (b"data", bytes(20))),
    FLAC,
    OGG + b"\x01vorbis" + bytes(23),
    2 * FRAME,
    b"ID3\x03\0\0\0\0\0\x0a" + bytes(10) + 2 * FRAME,
)
NO_SOUNDS = (
    b"", b"RIFF\0\0\0\0AVI ", b"\xff\x00", b"hello", b"\x89PNG",
    riff(PLAIN), riff((b"data", bytes(20))), riff(PLAIN, (b"data", b"")),
    riff((b"fmt ", b"\x55" + PLAIN[1][1:]), (b"data", bytes(20))), riff(PLAIN) + b"data\xff",
    FLAC[:30], b"fLaC" + bytes(60), OGG + b"OpusHead" + bytes(23), OGG, b"OggS\0" + bytes(20),
    FRAME + b"text", b"\xff\xfb\xf0\x64" + bytes(500), b"ID3\x03\0\0\0\0\0\x0a" + bytes(500), b"ID3",
)  # fmt: skip


def test_sound_format_is_recognised_by_its_first_bytes(tmp_path: Path) -> None:
    path = tmp_path / "sound"
    for data in SOUNDS:
        path.write_bytes(data)
        assert check_sound_file("voice", path) == path, data[:40]


def test_unplayable_file_is_refused_by_its_first_bytes(tmp_path: Path) -> None:
    path, wrong = tmp_path / "sound", []
    for data in NO_SOUNDS:
        path.write_bytes(data)
        try:
            check_sound_file("voice", path)
        except BadRequest as error:
            if "not a playable WAV, MP3, FLAC or Ogg Vorbis file" in str(error):
                continue
        wrong.append(data[:40])
    assert wrong == []
    for data in SOUNDS:  # cut off anywhere
        for length in range(0, len(data), 7):
            path.write_bytes(data[:length])
            with suppress(BadRequest):
                check_sound_file("voice", path)


def test_folder_is_refused_as_a_sound(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="no such file"):
        check_sound_file("voice", tmp_path)


def test_sound_duration_is_from_the_wav_header_or_the_file_size(tmp_path: Path) -> None:
    path = tmp_path / "sound"
    with wave.open(str(path), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(bytes(4 * 6000))
    assert sound_duration(path) == 0.75
    path.write_bytes(b"OggS" + bytes(31_996))
    assert sound_duration(path) == 2.0
    assert sound_duration(tmp_path / "none") == 0.0


def test_wrong_wav_header_is_replaced_by_the_data_size(tmp_path: Path) -> None:
    path = tmp_path / "piped.wav"
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, 16_000, 0, "NONE", ""))
        file.writeframes(bytes(32_000))
    whole = path.read_bytes()
    path.write_bytes(whole[:40] + (0x7FFFF000).to_bytes(4, "little") + whole[44:])  # as espeak-ng --stdout says
    assert sound_duration(path) == pytest.approx(1.0, abs=0.01)
    path.write_bytes(whole[:24] + bytes(4) + whole[28:])  # no samples in a second
    assert sound_duration(path) == pytest.approx(2.0, abs=0.01)


def test_a_wav_file_of_more_than_ten_minutes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "song.wav"
    for minutes in (10, 11):
        with wave.open(str(path), "wb") as file:
            file.setparams((1, 1, 1000, 0, "NONE", ""))
            file.writeframes(bytes(60_000 * minutes))
        if minutes == 10:
            assert check_sound_file("voice", path) == path
    with pytest.raises(BadRequest, match=r"song\.wav: lasts 11 min; the limit is 10 min") as raised:
        check_sound_file("voice", path)
    assert raised.value.hint == f"`ffmpeg -i {path} -t 600 shorter.wav` keeps its beginning"


# --- the mouth --------------------------------------------------------------------------------------------------------


@each(
    ("phoneme", "shape"),
    [
        ("p", Mouth.CLOSED),
        ("_:", Mouth.CLOSED),
        ("", Mouth.CLOSED),
        ("'oU", Mouth.ROUND),
        ("tS", Mouth.ROUND),
        ("t", Mouth.NARROW),
        ("v", Mouth.TEETH),
        (",i:", Mouth.WIDE),
        ("'aI", Mouth.OPEN),
        ("@", Mouth.NARROW),
    ],
)
def test_phonemes_have_mouth_shapes(phoneme: str, shape: Mouth) -> None:
    assert mouth_shape(phoneme) is shape


def test_mouth_movement_merges_equal_shapes_and_ends_closed() -> None:
    moved = mouth_movement([(0.0, "t"), (0.1, "s"), (0.2, "'i:"), (0.3, "m"), (0.4, "_")], 0.6)
    assert moved == (
        MouthShape(0.0, Mouth.NARROW),
        MouthShape(0.2, Mouth.WIDE),
        MouthShape(0.3, Mouth.CLOSED),
    )
    assert mouth_movement([], 0.5) == (MouthShape(0.5, Mouth.CLOSED),)


# --- messages ---------------------------------------------------------------------------------------------------------


@given(st.integers(0, 3 * MAX_PIECE_BYTES).map(lambda count: 2 * count))
def test_a_sound_is_sent_in_pieces_of_which_only_the_last_is_the_last(size: int) -> None:
    sound = Speech(bytes(size), 22_050)
    sent = list(split_sound(7, sound))
    assert b"".join(body for _, body in sent) == sound.samples
    assert [head["last"] for head, _ in sent] == [False] * (len(sent) - 1) + [True]
    assert all(head["play"] == 7 and head["rate"] == 22_050 and len(body) <= MAX_PIECE_BYTES for head, body in sent)


def test_synthesiser_reply_is_validated() -> None:
    good: dict[str, Any] = {"rate": 22_050, "phonemes": [[120, "'oU"]], "trouble": ""}
    assert parse_speech(good, bytes(5)).phonemes == ((0.12, "'oU"),)
    assert parse_speech(good, bytes(22_050)).seconds == 0.5
    with pytest.raises(ValueError, match="not a rate"):
        parse_speech({**good, "rate": 0}, b"")
    with pytest.raises(KeyError):
        parse_speech({"rate": 1}, b"")


class Slow(WorkerProcess):
    """A player's program that takes a piece whenever a test says so."""

    def __init__(self) -> None:
        super().__init__("voice", Path("none.py"), SystemClock())
        self.player: SoundPlayer | None = None
        self.sent: list[Message] = []
        self.heard: list[int] = []
        self.begun: list[float] = []

    def send(self, message: Message, body: bytes = b"", *, timeout: float = 1.0) -> None:
        del body, timeout
        assert self.player is not None
        self.sent.append(message)
        self.heard.append(len(self.begun))
        self.player.on_message({"taken": message["play"]}, b"")
        if len(self.sent) == 1:
            self.player.on_message({"started": message["play"], "seconds": 0.1}, b"")
        if message["last"]:
            self.player.on_message({"ended": message["play"]}, b"")


def test_start_of_a_long_sound_is_reported_before_all_is_sent() -> None:
    slow, player = Slow(), SoundPlayer(SystemClock())
    slow.player, player._worker = player, slow
    player._handle_program(ProgramEvent.OPEN)
    player.on_message({"ready": "Null"}, b"")
    assert player.play(
        Speech(bytes(5 * MAX_PIECE_BYTES), 22_050), CancelToken(), lambda _, seconds: slow.begun.append(seconds)
    )
    assert slow.heard == [0, 1, 1, 1, 1]
    assert slow.begun == [pytest.approx(5 * MAX_PIECE_BYTES / 2 / 22_050)]


# --- breaking off -----------------------------------------------------------------------------------------------------


def test_random_messages_take_every_transition(monkeypatch: pytest.MonkeyPatch) -> None:
    def send(player: SoundPlayer, _: Random) -> None:
        player._handle_sound(SoundEvent.SEND)

    def receive(player: SoundPlayer, chance: Random) -> None:
        kind = chance.choice(("started", "ended", "refused", "taken"))
        player.on_message({kind: chance.choice((0, 0, 7)), "seconds": 1.0, "why": "no sound"}, b"")
        assert player._sound_state is not SoundState.REFUSED or player._refusal

    table = walk(monkeypatch, "drivers.sound.player.TRANSITIONS", lambda: SoundPlayer(ManualClock()), [send, receive])
    assert table.visited == set(table)


def test_random_events_of_a_program_take_every_transition_and_none_revives_a_closed_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def happen(player: SoundPlayer, chance: Random) -> None:
        was_closed = player._program_state is ProgramState.CLOSED
        events = (
            player.on_started,
            lambda: player.on_message({"ready": "Null"}, b""),
            lambda: player.on_exit("killed"),
            player.close,
        )
        chance.choice(events)()
        assert not was_closed or player._program_state is ProgramState.CLOSED

    def open_it(player: SoundPlayer, _: Random) -> None:
        if player._program_state is ProgramState.CLOSED:
            player._handle_program(ProgramEvent.OPEN)

    player_of = partial(SoundPlayer, ManualClock())
    table = walk(monkeypatch, "drivers.sound.worker_client.TRANSITIONS", player_of, [happen, happen, open_it])
    assert table.visited == set(table)


def test_cancel_callback_is_called_once_while_active() -> None:
    cut, told = CancelToken(), list[str]()
    with cut.on_cancel(lambda: told.append("early")):
        pass
    with cut.on_cancel(lambda: told.append("now")):
        cut.cancel()
    cut.cancel()
    with cut.on_cancel(lambda: told.append("late")):
        pass
    assert (told, cut.is_cancelled, cut.wait(9.0)) == (["now", "late"], True, True)


# --- the programs -----------------------------------------------------------------------------------------------------


class Told(sound_worker.MessagePipe):
    def __init__(self) -> None:
        super().__init__()
        self.said: list[dict[str, object]] = []

    def send(self, **message: object) -> None:
        self.said.append(message)


def test_playback_queue_fills_gaps_with_silence_and_reports_the_end() -> None:
    pipe = Told()
    queue = PlaybackQueue(pipe)
    device = queue.generate_samples()
    assert next(device) == b""
    assert device.send(2) == bytes(4)
    queue.add(1, 1000, b"abcdef", is_complete=False)
    assert device.send(2) == b"abcd"
    assert device.send(2) == b"ef\0\0"
    assert device.send(2) == bytes(4)
    queue.add(1, 1000, b"gh", is_complete=True)
    assert device.send(2) == b"gh\0\0"
    assert pipe.said == [{"started": 1, "seconds": 0.003}]
    assert device.send(2) == bytes(4)
    assert pipe.said[1:] == [{"ended": 1, "seconds": 0.004}]


def test_dropped_sound_is_no_longer_played() -> None:
    pipe = Told()
    queue = PlaybackQueue(pipe)
    device = queue.generate_samples()
    next(device)
    queue.add(1, 1000, bytes(range(1, 9)), is_complete=True)
    device.send(1)
    queue.drop(2)
    queue.drop(1)
    queue.drop(1)
    assert device.send(4) == bytes(8)
    queue.add(3, 1000, b"ab", is_complete=True)
    device.send(1)
    queue.drop(3)  # the device has it all, and has not said yet that it is over
    device.send(1)
    assert [message for message in pipe.said if "ended" in message] == [
        {"ended": 1, "seconds": 0.001},
        {"ended": 3, "seconds": 0.001},
    ]


@pytest.mark.parametrize(
    ("program", "arguments", "missing"),
    [(espeak_worker, (), "espeakng_loader"), (sound_worker, ("", "null", "1.0"), "miniaudio")],
)
def test_worker_reports_its_missing_library_and_ends_with_its_input(
    program: Any, arguments: tuple[str, ...], missing: str
) -> None:
    command = [sys.executable, "-I", "-S", program.__file__, *arguments]
    with Popen(command, stdin=PIPE, stdout=PIPE) as process:
        said, _ = process.communicate(timeout=30)
    assert json.loads(said) == {"absent": f"No module named '{missing}'"}
    assert process.returncode == 0


def test_synthesis_of_a_superseded_text_is_abandoned() -> None:
    texts = ("The quick brown fox jumps over the lazy dog. " * 200, "Stop!")
    asked = b"".join(pack_message(make_request(number, text, "", "", 150)) for number, text in enumerate(texts))
    with Popen([sys.executable, "-I", espeak_worker.__file__], stdin=PIPE, stdout=PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(asked)
        process.stdin.flush()
        unframer, said = MessageParser(), list[Any]()
        while not said or said[-1].get("id") != 1:
            data = os.read(process.stdout.fileno(), 65_536)
            assert data
            said += [head for head, _ in unframer.feed(data)]
        process.stdin.close()
    assert [message.get("id") for message in said] == [None, 1]


def test_idle_sound_device_stops_and_plays_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sound_worker, "miniaudio", miniaudio, raising=False)
    monkeypatch.setattr(sound_worker, "IDLE_TIMEOUT", 0.05)
    pipe = Told()
    player = sound_worker.SoundCardPlayer("", "null", 1.0, pipe)
    try:
        for number, rate in enumerate((22_050, 22_050, 16_000)):
            wait_until(lambda: not player._device.running)
            player.handle_message({"play": number, "rate": rate, "last": True}, bytes(2 * rate // 10))
            wait_until(lambda: any("ended" in said for said in pipe.said))
            assert sorted(key for said in pipe.said for key in said if key != "seconds") == [
                "ended",
                "started",
                "taken",
            ]
            pipe.said.clear()
    finally:
        player.close()


def test_reopened_device_restarts_its_idle_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sound_worker, "miniaudio", miniaudio, raising=False)
    player = sound_worker.SoundCardPlayer("", "null", 1.0, Told())
    try:
        with player._lock:
            player._queue._silent_bytes = long = 10**12
            player._reopen_device(22_050)
            assert player._queue._silent_bytes < long
    finally:
        player.close()


def test_the_volume_makes_louder_and_softer_up_to_the_full_range() -> None:
    class Loud(sound_worker.SoundCardPlayer):
        def __init__(self, volume: float) -> None:
            self._volume = volume

    samples = b"".join(value.to_bytes(2, "little", signed=True) for value in (0, 100, -100, 30_000, -30_000))
    assert Loud(1.0)._apply_volume(samples) == samples
    louder = Loud(2.0)._apply_volume(samples)
    values = [int.from_bytes(louder[at : at + 2], "little", signed=True) for at in range(0, 10, 2)]
    assert values == [0, 200, -200, 32_767, -32_768]


# --- programs of others -----------------------------------------------------------------------------------------------


def shell(script: str, cut: CancelToken, limit: float = 30.0) -> ProgramOutput | None:
    return run_program("voice", ["sh", "-c", script], "hello", cut, SystemClock(), timeout=limit, keep_output=True)


def test_program_that_never_ends_is_killed() -> None:
    with pytest.raises(NoReply, match="voice: sh: timed out after 0 s") as raised:
        shell("sleep 100", CancelToken(), limit=0.3)
    assert raised.value.hint.startswith("echo hello | sh -c 'sleep 100'")


@pytest.mark.parametrize("ends", [True, False])
def test_orphaned_child_processes_are_not_waited_for(tmp_path: Path, ends: bool) -> None:
    left, cut = tmp_path / "left", CancelToken()
    alone = f"setsid sh -c 'echo $$ > {left}.new; mv {left}.new {left}; exec sleep 900'"
    script = f"{alone} & cat; echo oh >&2{'' if ends else '; sleep 900'}"
    found: list[ProgramOutput | None] = []
    thread = Thread(target=lambda: found.append(shell(script, cut)))
    thread.start()
    try:
        wait_until(left.exists)
        if not ends:
            cut.cancel()
        wait_until(lambda: not thread.is_alive())
        assert found == [ProgramOutput(b"hello", "oh") if ends else None]
    finally:
        os.kill(int(left.read_text()), signal.SIGKILL)  # it still runs
        thread.join()


@pytest.mark.parametrize(
    ("script", "heard"), [("echo 'no card' >&2", False), ("echo hm >&2; sleep 0.5", True), (":", True)]
)
def test_failing_speech_program_has_not_spoken(script: str, heard: bool) -> None:
    clock, printed, notices = SystemClock(), list[str](), list[DeviceStatus]()
    # A shell that ends at once takes its time on a busy machine: on its own clock it takes none.
    engine = ProgramEngine(Synthesiser("sh", ("-c", f"cat; {script}")), clock if heard else ManualClock())
    player = SoundPlayer(clock, backend="null")
    voice = SpeechVoice(
        clock, engine, player, printed.append, default_style=SpeechStyle(speed=200), report=notices.append
    )
    voice.open()
    for _ in range(2):
        began = clock.now()
        wait_until(voice.say("one two three").done)  # 0.9 s
        assert heard or clock.now() - began > 0.85
    voice.close()
    assert printed == [] if heard else ["one two three"] * 2
    assert [notice.message for notice in notices] == [] if heard else ["voice: sh: ended before it had spoken: no card"]


# --- Piper ------------------------------------------------------------------------------------------------------------

PIPER = """#!{python}
import pathlib, sys
text = sys.stdin.read()
pathlib.Path(__file__).with_suffix(".said").write_text(" ".join(sys.argv[1:]) + "|" + text)
if "fail" in text:
    sys.exit("no such model")
sys.stdout.buffer.write(bytes(2 * 1600) + b"?")
"""


@pytest.fixture
def piper(tmp_path: Path) -> Path:
    """A program that stands in for Piper, with a model beside it."""
    program = tmp_path / "piper"
    program.write_text(PIPER.format(python=sys.executable))
    program.chmod(0o755)
    (tmp_path / "amy.onnx.json").write_text('{"audio": {"sample_rate": 16000}}')
    return program


def test_piper_returns_sound_at_the_rate_of_its_model(piper: Path) -> None:
    model = piper.with_name("amy.onnx")
    engine = PiperEngine(model, SystemClock(), program=str(piper))
    engine.open()
    found = engine.speak("two\nlines", SpeechStyle(speed=300), CancelToken())
    engine.close()
    assert found is not None
    assert (found.rate, found.seconds) == (16_000, 0.1)
    said = piper.with_suffix(".said").read_text()
    assert said == f"--model {model} --output-raw --length-scale 0.500|two lines"


def test_failing_piper_gives_a_hint(piper: Path) -> None:
    engine = PiperEngine(piper.with_name("amy.onnx"), SystemClock(), program=str(piper))
    with pytest.raises(DeviceFault, match="ended with 1: no such model") as raised:
        engine.speak("fail", SpeechStyle(speed=150), CancelToken())
    assert raised.value.hint.startswith("echo hello | ")
    with pytest.raises(DeviceFault, match=r"bob.onnx.json: cannot be read"):
        PiperEngine(piper.with_name("bob.onnx"), SystemClock(), program=str(piper)).speak(
            "so", SpeechStyle(speed=150), CancelToken()
        )


# --- which voice ------------------------------------------------------------------------------------------------------


def test_voice_drivers_have_their_engines() -> None:
    def engine(wish: VoiceSettings) -> object:
        voice = make_voice(wish, SystemClock(), print)
        return voice._engine if isinstance(voice, SpeechVoice) else voice

    assert isinstance(engine(VoiceSettings("espeak")), EspeakEngine)
    assert isinstance(engine(VoiceSettings("auto")), EspeakEngine)  # the wheels are installed for the tests
    assert isinstance(engine(VoiceSettings("program")), ProgramEngine)
    assert isinstance(engine(VoiceSettings("piper", model="amy.onnx")), PiperEngine)
    assert isinstance(engine(VoiceSettings("command", command="my_tts --stdin")), ProgramEngine)
    assert isinstance(engine(VoiceSettings("print")), PrintedVoice)


def test_without_the_wheel_an_installed_program_speaks_else_words_are_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.voice.speech.find_spec", lambda _: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert isinstance(make_voice(VoiceSettings("auto"), SystemClock(), print), PrintedVoice)
    printed, notices = list[str](), list[DeviceStatus]()
    voice = make_voice(
        VoiceSettings("program", style=SpeechStyle(speed=450)), SystemClock(), printed.append, report=notices.append
    )
    voice.open()
    wait_until(voice.say("hello").done)
    voice.close()
    assert printed == ["hello"]
    assert "espeak-ng: " in notices[0].message
    program = tmp_path / "espeak"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    assert isinstance(make_voice(VoiceSettings("auto"), SystemClock(), print), SpeechVoice)


def test_custom_speech_command_gets_its_placeholders(tmp_path: Path) -> None:
    program, said = tmp_path / "tts.py", tmp_path / "said"
    program.write_text(f"import sys; open({str(said)!r}, 'w').write(' '.join(sys.argv[1:]) + '|' + sys.stdin.read())")
    command = f"{sys.executable} {program} --pace={{speed}} --as={{voice}}"
    voice = make_voice(VoiceSettings("command", SpeechStyle(speed=120), command=command), SystemClock(), print)
    voice.open()
    wait_until(voice.say("hello there").done)
    voice.close()
    assert said.read_text() == "--pace=120|hello there"
