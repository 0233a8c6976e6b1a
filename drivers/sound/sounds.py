"""Files with sounds: which can be played (WAV, MP3, FLAC, or Vorbis in Ogg), and how long one lasts.

Their first bytes alone pass much that no player takes, an Ogg file with Opus in it, say.
"""

from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from drivers.errors import BadRequest
from drivers.sound.wav import BadWav, read_header

_BITRATES = {
    True: (0, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320),
    False: (0, 8, 16, 24, 32, 40, 48, 56, 64, 80, 96, 112, 128, 144, 160),
}
"""Of layer III, in kbit/s: of MPEG 1, and of 2 and 2.5."""

_RATES = {3: (44_100, 48_000, 32_000), 2: (22_050, 24_000, 16_000), 0: (11_025, 12_000, 8_000)}
"""Samples a second, by the bits that tell the version."""

_SEARCHED = 65_536
"""Bytes in which the first frame of an MP3 must begin."""


def playable(file: BinaryIO) -> bool:
    """Return whether the file begins as a sound that can be played, and has something of it.

    Raises BadWav for a WAV file that cannot be played, OSError.
    """
    file.seek(0)
    begin = file.read(64)
    if _is_wav(begin):
        return read_header(file).size > 0
    if begin[:4] == b"fLaC":
        rate = int.from_bytes(begin[18:21], "big") >> 4
        return begin[4] & 0x7F == 0 and begin[5:8] == b"\0\0\x22" and rate > 0 and len(begin) > 42
    if begin[:4] == b"OggS":
        first = 27 + begin[26] if len(begin) > 26 else len(begin)
        return begin[4:5] == b"\0" and begin[first : first + 7] == b"\x01vorbis"
    return _mp3(file, begin)


def _is_wav(begin: bytes) -> bool:
    return begin[:4] in (b"RIFF", b"RIFX", b"RF64")


def _mp3(file: BinaryIO, begin: bytes) -> bool:
    """Look for two frames in a row, behind a tag if there is one."""
    tag = 0
    if begin[:3] == b"ID3" and len(begin) >= 10:
        tag = 10 + sum(byte << shift for byte, shift in zip(begin[6:10], (21, 14, 7, 0), strict=True))
    elif not _frame(begin):
        return False
    file.seek(tag)
    data = file.read(_SEARCHED)
    return any(
        (length := _frame(data[place : place + 4])) and (place + length >= len(data) or _frame(data[place + length :]))
        for place in range(len(data) - 4 if tag else 1)
        if data[place : place + 1] == b"\xff"
    )


def _frame(head: bytes) -> int:
    """Return the length in bytes of the frame of an MP3 that begins so; 0 for none."""
    if len(head) < 4 or head[0] != 0xFF or head[1] & 0xE0 != 0xE0 or head[1] & 0x06 != 0x02:
        return 0
    version, rate, bits = head[1] >> 3 & 3, head[2] >> 2 & 3, head[2] >> 4
    if version not in _RATES or rate == 3 or bits in (0, 15):
        return 0
    first = version == 3
    return (144 if first else 72) * 1000 * _BITRATES[first][bits] // _RATES[version][rate] + (head[2] >> 1 & 1)


BYTES_A_SECOND = 16_000
"""Of compressed sound at 128 kbit/s, which is common."""


MAX_DURATION = 600.0
"""Seconds that a sound may last: it is decoded as a whole, and what is not WAV is measured where that is done."""


def checked(name: str, path: Path) -> Path:
    """Return ``path``, which ``name`` is to play. Raises BadRequest where there is no such file, or it is no sound.

    Also for a WAV file of more than ten minutes.
    """
    if not path.is_file():
        raise BadRequest(f"{name}: {path}: no such file", hint=f"`ls {path.parent}` lists what is there")
    why = ""
    try:
        with path.open("rb") as file:
            fits = playable(file)
            is_wav = file.seek(0) == 0 and _is_wav(file.read(4))
    except OSError as error:
        raise BadRequest(f"{name}: {path}: {error.strerror}") from error
    except BadWav as error:
        fits, is_wav, why = False, True, f": {error}"
    if not fits:
        raise BadRequest(
            f"{name}: {path}: is no WAV, MP3, FLAC or Ogg Vorbis file that can be played{why}",
            hint=f"`file {path}` shows what it is; `ffmpeg -i {path} new.wav` makes one that fits",
        )
    if is_wav and length_of(path) > MAX_DURATION:
        what = f"{name}: {path}: lasts {length_of(path) / 60:.0f} min, and a sound may last {MAX_DURATION / 60:.0f}"
        raise BadRequest(what, hint=f"`ffmpeg -i {path} -t {MAX_DURATION:.0f} shorter.wav` keeps its beginning")
    return path


def length_of(path: Path) -> float:
    """Return about how many seconds a sound lasts: exactly for a WAV file, else as its size suggests."""
    if not path.is_file():
        return 0.0
    with suppress(OSError, BadWav), path.open("rb") as file:
        return read_header(file).seconds
    return path.stat().st_size / BYTES_A_SECOND
