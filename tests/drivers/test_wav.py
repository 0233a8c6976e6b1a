"""WAV files: every kind that recorders write is decoded alike by microphone and player, or refused with its reason."""

import struct
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import miniaudio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import BadRequest, NotConnected
from drivers.microphone.wav_microphone import BLOCK_FRAMES, decode_blocks, load_wav, resample
from drivers.sound import sound_worker
from drivers.sound.wav import BadWav, check_sound_file, read_header, sound_duration
from tests.drivers.wavs import BAD, COUNT, FMT, GOOD, INT16, MP3, RATE, TONE, chunk, form, plain, riff


def written(folder: Path, data: bytes) -> Path:
    path = folder / "sound.wav"
    path.write_bytes(data)
    return path


@pytest.fixture(autouse=True)
def player(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sound_worker, "miniaudio", miniaudio, raising=False)  # which it loads as a program


@pytest.mark.parametrize("kind", GOOD)
def test_wav_formats_are_read_and_played_alike(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path, GOOD[kind])
    wanted = TONE * 32768
    heard = load_wav("microphone", path)
    coarse = 400 if kind == "8 bit" else 3
    assert np.abs(heard - resample(wanted, RATE)).max() < coarse
    assert sound_duration(check_sound_file("voice", path)) == pytest.approx(COUNT / RATE)
    played = np.frombuffer(sound_worker._decode_file(str(path), RATE), np.int16)
    assert np.abs(played - wanted).max() < coarse


@pytest.mark.parametrize("why", BAD)
def test_invalid_wav_file_is_refused_with_a_reason(tmp_path: Path, why: str) -> None:
    path = written(tmp_path, BAD[why])
    with pytest.raises(NotConnected) as refused:
        load_wav("microphone", path)
    assert why in str(refused.value)
    assert "\n" not in str(refused.value)
    if path.read_bytes()[:3] == b"RIF":  # others may be sounds of another kind
        with pytest.raises(BadRequest) as unplayed:
            check_sound_file("voice", path)
        assert why in str(unplayed.value)


@pytest.mark.parametrize("encoding", [6, 7])
def test_companded_samples_match_the_player(tmp_path: Path, encoding: int) -> None:
    path = written(tmp_path, plain(encoding, 8, bytes(range(256))))
    with path.open("rb") as file:
        ours = np.concatenate([*decode_blocks(file, read_header(file))]).ravel()
    played = np.frombuffer(sound_worker._decode_file(str(path), RATE), np.int16)
    assert np.abs(ours - played).max() <= 1


def test_truncated_wav_file_is_read_as_far_as_possible(tmp_path: Path) -> None:
    path = written(tmp_path, riff(FMT, chunk(b"data", INT16))[:-1001])
    assert sound_duration(path) == pytest.approx((COUNT - 501) / RATE)
    assert len(load_wav("microphone", path)) == round((COUNT - 501) * 16_000 / RATE)


def test_different_channels_are_mixed(tmp_path: Path) -> None:
    both = struct.pack("<hh", 100, -40) * (2 * BLOCK_FRAMES + 3)  # more than one block
    path = written(tmp_path, riff(chunk(b"fmt ", form(1, 16, channels=2, rate=16_000)), chunk(b"data", both)))
    heard = load_wav("microphone", path)
    assert (len(heard), {*heard.tolist()}) == (2 * BLOCK_FRAMES + 3, {30})


def test_floats_beyond_the_range_and_none_at_all_are_clipped(tmp_path: Path) -> None:
    floats = np.array([np.nan, np.inf, -np.inf, 3e38, -2.0, 0.5], "<f4").tobytes()
    path = written(tmp_path, riff(chunk(b"fmt ", form(3, 32, rate=16_000)), chunk(b"data", floats)))
    assert load_wav("microphone", path).tolist() == [0, 32767, -32768, 32767, -32768, 16384]


def test_compressed_samples_are_played_but_not_read(tmp_path: Path) -> None:
    ima = struct.pack("<HHIIHHHH", 0x11, 1, RATE, 11_100, 1024, 4, 2, 2041)
    path = written(tmp_path, riff(chunk(b"fmt ", ima), chunk(b"data", bytes(11_100))))
    assert sound_duration(check_sound_file("voice", path)) == pytest.approx(1.0)
    with pytest.raises(NotConnected, match="its samples are IMA ADPCM, which is not decoded here"):
        load_wav("microphone", path)


@given(st.sampled_from(sorted(GOOD)), st.data())
def test_no_damage_does_more_than_refuse(kind: str, data: st.DataObject) -> None:
    damaged = bytearray(GOOD[kind][:400])
    for _ in range(data.draw(st.integers(0, 6))):
        damaged[data.draw(st.integers(0, min(len(damaged) - 1, 90)))] = data.draw(st.integers(0, 255))
    file = BytesIO(bytes(damaged[: data.draw(st.integers(0, len(damaged)))]))
    with suppress(BadWav):
        header = read_header(file)
        assert 0 < header.size <= 400
        assert sum(len(block) for block in decode_blocks(file, header)) == header.frames


def test_file_is_measured_by_its_content_not_its_name(tmp_path: Path) -> None:
    path = written(tmp_path, MP3 * 100)  # an MP3 that is called sound.wav
    assert sound_worker._file_duration(str(path)) > 1.0
