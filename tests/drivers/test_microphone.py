"""Microphones: a file that stands in for one, and the sound card's."""

import os
import wave
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import DeviceStatus
from drivers.api.sensors import SOUND_RATE
from drivers.clock import ManualClock, SystemClock
from drivers.errors import NotConnected
from drivers.microphone import sound_card
from drivers.microphone.sound_card import HANG_TIMEOUT, MAX_KEPT_SECONDS, SoundCardMicrophone
from drivers.microphone.wav_microphone import PIECE_SAMPLES, WavMicrophone, load_wav, resample
from tests.waiting import wait_until


def write(path: Path, *channels: "np.ndarray[tuple[int], np.dtype[np.int16]]", rate: int = SOUND_RATE) -> Path:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(len(channels))
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(np.column_stack(channels).astype("<i2").tobytes())
    return path


def ramp(count: int) -> "np.ndarray[tuple[int], np.dtype[np.int16]]":
    return np.arange(count, dtype=np.int16)


# --- a file -----------------------------------------------------------------------------------------------------------


def test_wav_file_is_read_in_real_time(tmp_path: Path) -> None:
    clock = ManualClock(7.0)
    microphone = WavMicrophone(write(tmp_path / "a.wav", ramp(1000)), clock)
    microphone.open()
    assert microphone.read(-1) == []
    clock.advance(0.05)
    first = microphone.read(-1)
    assert [(sound.number, sound.stamp) for sound in first] == [(0, 7.0), (1, pytest.approx(7.02))]
    clock.advance(0.05)
    rest = microphone.read(1)
    assert [sound.number for sound in rest] == [2, 3, 4]
    heard = np.concatenate([sound.samples for sound in (*first, *rest)])
    assert heard.dtype == np.int16
    assert heard.tolist() == [*range(1000), *[0] * 600]
    assert rest[-1].end == pytest.approx(7.1)


def test_wav_file_is_followed_by_silence_or_repeated(tmp_path: Path) -> None:
    clock = ManualClock()
    path = write(tmp_path / "a.wav", ramp(400))
    once, again = WavMicrophone(path, clock), WavMicrophone(path, clock, loop=True)
    once.open()
    again.open()
    clock.advance(0.06)
    assert once.read(1)[0].samples.tolist() == [0] * PIECE_SAMPLES
    assert again.read(1)[0].samples.tolist() == [*range(240, 400), *range(160)]


def test_wav_buffer_is_limited_to_five_seconds(tmp_path: Path) -> None:
    clock = ManualClock()
    microphone = WavMicrophone(write(tmp_path / "a.wav", ramp(10)), clock)
    microphone.open()
    clock.advance(60)
    kept = microphone.read(-1)
    assert len(kept) == 250
    assert kept[-1].end == pytest.approx(60.0)


def test_two_channels_become_one(tmp_path: Path) -> None:
    path = write(tmp_path / "a.wav", np.full(9, 100, np.int16), np.full(9, -40, np.int16))
    assert load_wav("microphone", path).tolist() == [30] * 9


@given(st.sampled_from((8000, 11025, 22050, 44100, 48000)), st.integers(200, 3000))
def test_resampled_tone_keeps_pitch_and_strength(rate: int, pitch: int) -> None:
    tone = 1000 * np.sin(2 * np.pi * pitch * np.arange(rate) / rate)
    heard = resample(tone, rate)
    assert len(heard) == SOUND_RATE
    strength = np.abs(np.fft.rfft(heard)) / (SOUND_RATE / 2)
    assert int(strength.argmax()) == pitch
    assert strength[pitch] == pytest.approx(1000, rel=0.01)


def test_missing_wav_file_gives_a_hint(tmp_path: Path) -> None:
    notices: list[DeviceStatus] = []
    microphone = WavMicrophone(tmp_path / "none.wav", ManualClock(), report=notices.append)
    microphone.open()
    health = microphone.health()
    assert (health.online, microphone.read(-1)) == (False, [])
    assert health.detail == f"microphone: {tmp_path / 'none.wav'}: no such file"
    assert health.hint == f"`ls {tmp_path}` lists what is there"
    assert [notice.kind for notice in notices] == ["offline"]


def test_implausible_wav_header_is_not_trusted(tmp_path: Path) -> None:
    path = write(tmp_path / "a.wav", ramp(10))
    whole = path.read_bytes()
    for rate in (1, 3999, 384_001, 2**32 - 1):
        path.write_bytes(whole[:24] + rate.to_bytes(4, "little") + whole[28:])
        with pytest.raises(NotConnected, match=rf"a\.wav: says {rate} samples per second: must be 4000 to 384000"):
            load_wav("microphone", path)
    path.write_bytes(whole[:40] + (0xFFFFFFF0).to_bytes(4, "little") + whole[44:])
    assert load_wav("microphone", path).tolist() == ramp(10).tolist(), "as much as is there"
    path.write_bytes(whole[:16] + (0xFFFFFFFF).to_bytes(4, "little") + whole[20:])
    os.mkfifo(path.with_name("fifo.wav"))
    for each in (path, path.with_name("fifo.wav"), Path("/dev/zero")):
        with pytest.raises(NotConnected, match="cannot be read as a WAV file"):
            load_wav("microphone", each)


def test_too_long_recording_is_refused_with_a_hint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.microphone.wav_microphone.MAX_DURATION", 60.0)
    path = write(tmp_path / "a.wav", np.zeros(16_000 * 180, np.int16))
    with pytest.raises(NotConnected, match="lasts 3 min; the limit is 1 min") as raised:
        load_wav("microphone", path)
    assert "ffmpeg" in raised.value.hint


def test_closed_microphone_is_silent_and_restarts_once_opened(tmp_path: Path) -> None:
    clock = ManualClock()
    microphone = WavMicrophone(write(tmp_path / "a.wav", ramp(400)), clock)
    microphone.close()
    microphone.open()
    clock.advance(5)
    microphone.rest()
    microphone.close()
    assert (microphone.read(-1), microphone.health().online) == ([], False)
    microphone.open()
    clock.advance(0.03)
    assert [sound.samples.tolist() for sound in microphone.read(-1)] == [[*range(PIECE_SAMPLES)]]


# --- the sound card ---------------------------------------------------------------------------------------------------


@pytest.fixture
def notices() -> list[DeviceStatus]:
    return []


@pytest.fixture
def silent(notices: list[DeviceStatus]) -> Iterator[SoundCardMicrophone]:
    """A microphone on miniaudio's null backend, which records silence in real time."""
    pytest.importorskip("miniaudio")
    microphone = SoundCardMicrophone(SystemClock(), backend="null", report=notices.append)
    yield microphone
    microphone.close()


@pytest.mark.real_time
def test_sound_arrives_piece_by_piece_in_order_and_without_gaps(
    silent: SoundCardMicrophone, notices: list[DeviceStatus]
) -> None:
    assert not silent.health().online
    silent.open()
    wait_until(lambda: silent.health().counters["pieces"] >= 20)
    sounds = silent.read(-1)
    assert all(len(sound.samples) > 0 and not sound.samples.any() for sound in sounds)
    for before, after in pairwise(sounds):
        assert after.number > before.number
        if after.number == before.number + 1:
            assert after.stamp == pytest.approx(before.end, abs=0.01)
    assert silent.read(sounds[-1].number - 1)[0].number == sounds[-1].number
    assert silent.health().online
    assert [notice.kind for notice in notices] == ["online"]


def test_missing_microphone_lists_the_available_ones(notices: list[DeviceStatus]) -> None:
    pytest.importorskip("miniaudio")
    microphone = SoundCardMicrophone(SystemClock(), device="golden ear", backend="null", report=notices.append)
    microphone.open()
    try:
        wait_until(lambda: notices)
        health = microphone.health()
    finally:
        microphone.close()
    assert "no microphone 'golden ear'; available: 'NULL Capture Device'" in notices[0].message
    assert (health.online, "arecord -l" in health.hint) == (False, True)


HANGING = """import json, sys
sys.stdout.buffer.write(json.dumps({"bytes": 2}).encode() + b"\\n\\0\\0")
sys.stdout.flush()
sys.stdin.read()
"""


def test_hanging_capture_process_is_killed_and_restarted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "hanging.py"
    program.write_text(HANGING)
    monkeypatch.setattr(sound_card, "WORKER_PROGRAM", program)
    clock = ManualClock()
    microphone = SoundCardMicrophone(clock)
    microphone.open()
    try:
        wait_until(lambda: len(microphone.read(-1)) == 1)
        clock.advance(HANG_TIMEOUT - 0.1)
        assert [microphone.read(0), microphone.health().counters["starts"]] == [[], 1]
        clock.advance(0.2)
        microphone.read(0)
        wait_until(lambda: microphone.read(0))
        assert microphone.health().counters["starts"] == 2
    finally:
        microphone.close()
    clock.advance(2 * HANG_TIMEOUT)
    assert microphone.read(-1) == []


def test_recording_ends_without_sound_or_reader() -> None:
    worker = pytest.importorskip("drivers.microphone.capture_worker", exc_type=ImportError)
    orders, robot = os.pipe()
    try:
        assert "no sound for 0.01 s" in worker.SoundForwarder().wait_for_end(orders, 0.01)
        os.close(robot)
        assert worker.SoundForwarder().wait_for_end(orders, 60.0) == ""
    finally:
        os.close(orders)


def test_missing_sound_card_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    worker = pytest.importorskip("drivers.microphone.capture_worker", exc_type=ImportError)

    def failing(**_: object) -> None:
        raise worker.miniaudio.MiniaudioError("failed to init device", -401)

    monkeypatch.setattr(worker.miniaudio, "CaptureDevice", failing)
    monkeypatch.setattr("sys.argv", ["capture_worker.py", "", "null"])
    with pytest.raises(SystemExit, match=r"^no sound card for recording: failed to init device$"):
        worker.main()


def test_recording_continues_while_sound_arrives(capsysbinary: pytest.CaptureFixture[bytes]) -> None:
    worker = pytest.importorskip("drivers.microphone.capture_worker", exc_type=ImportError)
    forwarder = worker.SoundForwarder()
    sounds = forwarder.receive_sound()
    next(sounds)
    looks = []

    def look(*_: object) -> tuple[list[int], list[int], list[int]]:
        looks.append(forwarder.piece_count)
        if len(looks) < 4:
            sounds.send(b"\1\2")
        return [], [], []

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worker.select, "select", look)
        assert forwarder.wait_for_end(0, 2.0)
    assert looks == [0, 1, 2, 3]
    assert capsysbinary.readouterr().out == 3 * b'{"bytes": 2}\n\1\2'


def test_lost_sound_shows_in_the_numbers() -> None:
    clock = ManualClock()
    microphone = SoundCardMicrophone(clock)
    piece = np.ones(PIECE_SAMPLES, "<i2").tobytes()
    for _ in range(3):
        clock.advance(0.02)
        microphone.on_message({}, piece)
    clock.advance(1.0)
    microphone.on_message({}, piece)
    sounds = microphone.read(-1)
    assert [sound.number for sound in sounds] == [0, 1, 2, 4]
    assert [sound.stamp for sound in sounds] == [pytest.approx(each) for each in (0, 0.02, 0.04, 1.04)]
    assert microphone.health().counters["gaps"] == 1


@given(st.lists(st.floats(0.0, 0.03), min_size=100, max_size=100))
def test_stamps_are_steady_though_sound_arrives_unsteadily(delays: list[float]) -> None:
    clock = ManualClock()
    microphone = SoundCardMicrophone(clock)
    for number, delay in enumerate(delays, 1):
        clock.advance_to(number * 0.02 + delay)
        microphone.on_message({}, np.ones(PIECE_SAMPLES, "<i2").tobytes())
    sounds = microphone.read(-1)
    assert [sound.number for sound in sounds] == list(range(100))
    steps = np.diff([sound.stamp for sound in sounds])
    assert np.allclose(steps, 0.02, atol=0.001)


def test_microphone_buffer_is_limited() -> None:
    clock = ManualClock()
    microphone = SoundCardMicrophone(clock)
    for _ in range(500):
        clock.advance(0.02)
        microphone.on_message({}, np.ones(PIECE_SAMPLES, "<i2").tobytes())
    sounds = microphone.read(-1)
    assert sounds[-1].end - sounds[0].stamp == pytest.approx(MAX_KEPT_SECONDS, abs=0.05)
    assert sounds[-1].number == 499
