"""Headers of WAV files that are recorded or played, and recognition of other sound files.

Programs that write to a pipe, or are killed, leave wrong sizes in the header. Therefore a size is limited to that of
the file. A data size of 0 is refused, since the sound after it cannot be distinguished from other chunks.
"""

from contextlib import suppress
from pathlib import Path
from struct import Struct
from typing import BinaryIO

from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest

PCM, MS_ADPCM, FLOAT, A_LAW, MU_LAW, IMA_ADPCM, EXTENSIBLE = 1, 2, 3, 6, 7, 0x11, 0xFFFE
"""Encodings that a player accepts, as numbered in the format chunk."""

ENCODING_NAMES = {
    PCM: "integers", MS_ADPCM: "ADPCM", FLOAT: "floats", A_LAW: "A-law", MU_LAW: "mu-law", IMA_ADPCM: "IMA ADPCM",
    0x31: "GSM", 0x50: "MPEG", 0x55: "MP3", 0xFF: "AAC", 0x161: "Windows Media", 0x674F: "Vorbis",
}  # fmt: skip
"""Display names of the encodings of WAV files."""

SAMPLE_WIDTHS = {PCM: (1, 2, 3, 4), FLOAT: (4, 8), A_LAW: (1,), MU_LAW: (1,)}
"""Bytes per sample, by the encodings that ``drivers.microphone.wav_microphone`` decodes."""

_CHUNK, _FORMAT, _SIZES = Struct("<4sI"), Struct("<HHIIHH"), Struct("<QQ")
_GUID_TAIL = bytes.fromhex("000000001000800000aa00389b71")
_UNKNOWN_SIZE = 0xFFFFFFFF

_OTHER_FILE_TYPES = (
    (0, b"ID3", "an MP3 file"),
    (0, b"OggS", "an Ogg file"),
    (0, b"fLaC", "a FLAC file"),
    (0, b"RIFX", "a WAV file in big-endian order (RIFX)"),
    (0, b"FORM", "an AIFF file"),
    (0, b".snd", "an AU file"),
    (0, b"caff", "a CAF file"),
    (0, b"riff", "a Wave64 file"),
    (0, b"#!AMR", "an AMR file"),
    (0, b"\x1aE\xdf\xa3", "a WebM or Matroska file"),
    (4, b"ftyp", "an MP4 (M4A) file"),
    (8, b"AVI ", "a video (AVI)"),
)


class BadWav(ValueError):
    """A file that is not a WAV file or cannot be decoded; the message has the reason."""


@dataclass(frozen=True, slots=True)
class WavFormat:
    """Header of a WAV file: ``rate`` in frames/s, ``width`` in bytes per sample, ``byte_rate`` in bytes/s.

    ``encoding`` is a key of ``ENCODING_NAMES``. The sound is the ``size`` bytes from byte ``begin`` on; sizes beyond
    the end of the file are reduced.
    """

    encoding: int
    channels: int
    rate: int
    width: int
    byte_rate: int
    begin: int
    size: int

    @property
    def frames(self) -> int:
        """Number of complete frames of the sound."""
        return self.size // (self.width * self.channels)

    @property
    def seconds(self) -> float:
        """Duration of the sound in seconds. For a compressed sound it follows from the byte rate."""
        return self.frames / self.rate if self.encoding in SAMPLE_WIDTHS else self.size / self.byte_rate


def read_header(file: BinaryIO) -> WavFormat:
    """Read the header of a WAV file (RIFF or RF64). Raises BadWav, OSError."""
    end = file.seek(0, 2)
    file.seek(0)
    head = file.read(12)
    if head[:4] not in (b"RIFF", b"RF64") or head[8:12] != b"WAVE":
        raise BadWav(_describe_other(head))
    form: bytes = b""
    long_size = 0
    while len(chunk := file.read(_CHUNK.size)) == _CHUNK.size:
        name, size = _CHUNK.unpack(chunk)
        begin = file.tell()
        if name == b"data":
            return _make_format(form, begin, long_size if size == _UNKNOWN_SIZE and long_size else size, end - begin)
        body = file.read(min(size, 40))
        if name == b"fmt ":
            form = body
        elif name == b"ds64" and len(body) >= _SIZES.size:
            long_size = _SIZES.unpack_from(body)[1]
        if begin + size > end:
            raise BadWav(
                f"its chunk {name.decode('latin-1').strip()!r} declares {size} bytes, but {end - begin} follow"
            )
        file.seek(begin + size + size % 2)
    raise BadWav("it has no sound: its data chunk is missing")


def _describe_other(head: bytes) -> str:
    if not head:
        return "it is empty"
    is_mp3 = len(head) > 1 and head[0] == 0xFF and head[1] & 0xE0 == 0xE0
    names = [name for place, begin, name in _OTHER_FILE_TYPES if head[place : place + len(begin)] == begin]
    return f"it is {names[0]}" if names else "it is an MP3 file" if is_mp3 else "it does not begin with RIFF and WAVE"


def _make_format(form: bytes, begin: int, size: int, there: int) -> WavFormat:
    if len(form) < _FORMAT.size:
        raise BadWav("its format chunk is missing" if not form else "its format chunk is too short")
    encoding, channels, rate, byte_rate, frame, bits = _FORMAT.unpack_from(form)
    if encoding == EXTENSIBLE:
        if len(form) < 40 or form[26:40] != _GUID_TAIL:
            raise BadWav("its sample format is unknown (extensible)")
        encoding = int.from_bytes(form[24:26], "little")
    if encoding not in (*SAMPLE_WIDTHS, MS_ADPCM, IMA_ADPCM):
        raise BadWav(f"its samples are {ENCODING_NAMES.get(encoding, f'of kind {encoding:#x}')}, which is not decoded")
    if not channels or not rate:
        raise BadWav(f"its header declares {channels} channels and {rate} samples a second")
    width = frame // channels
    if encoding in SAMPLE_WIDTHS and (
        width not in SAMPLE_WIDTHS[encoding] or frame % channels or not 0 < bits <= 8 * width
    ):
        raise BadWav(
            f"its header declares {bits} bits in {frame} bytes for {channels} channels of {ENCODING_NAMES[encoding]}"
        )
    if encoding not in SAMPLE_WIDTHS and not byte_rate:
        raise BadWav("its header declares 0 bytes a second")
    if size == 0:
        tail = f": the recorder was interrupted, since {there} bytes follow" if there > 0 else ""
        raise BadWav(f"its header declares no sound (0 bytes){tail}")
    if there <= 0 or min(size, there) < frame:
        raise BadWav("it has no sound: it ends after its header")
    return WavFormat(encoding, channels, rate, max(width, 1), byte_rate, begin, min(size, there))


# Files with sounds: which can be played (WAV, MP3, FLAC, or Vorbis in Ogg), and how long one lasts.
#
# Their first bytes alone pass much that no player takes, an Ogg file with Opus in it, say.

_MP3_BITRATES = {
    True: (0, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320),
    False: (0, 8, 16, 24, 32, 40, 48, 56, 64, 80, 96, 112, 128, 144, 160),
}
"""Bit rates of MP3 (layer III) in kbit/s by the bits in the header. True: MPEG 1; False: MPEG 2 and 2.5."""

_MP3_SAMPLE_RATES = {3: (44_100, 48_000, 32_000), 2: (22_050, 24_000, 16_000), 0: (11_025, 12_000, 8_000)}
"""Sample rates of MP3 by the version bits in the header, then by the rate bits."""

_MP3_SEARCH_BYTES = 65_536
"""Bytes within which the first frame of an MP3 must begin."""


def is_playable(file: BinaryIO) -> bool:
    """Return whether the file starts like a playable sound and has content.

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
    return _is_mp3(file, begin)


def _is_wav(begin: bytes) -> bool:
    return begin[:4] in (b"RIFF", b"RIFX", b"RF64")


def _is_mp3(file: BinaryIO, begin: bytes) -> bool:
    """Return whether the file has two consecutive MP3 frames, at its start or after an ID3 tag.

    ``begin`` are the first bytes of the file.
    """
    tag = 0
    if begin[:3] == b"ID3" and len(begin) >= 10:
        tag = 10 + sum(byte << shift for byte, shift in zip(begin[6:10], (21, 14, 7, 0), strict=True))
    elif not _mp3_frame_length(begin):
        return False
    file.seek(tag)
    data = file.read(_MP3_SEARCH_BYTES)
    return any(
        (length := _mp3_frame_length(data[place : place + 4]))
        and (place + length >= len(data) or _mp3_frame_length(data[place + length :]))
        for place in range(len(data) - 4 if tag else 1)
        if data[place : place + 1] == b"\xff"
    )


def _mp3_frame_length(head: bytes) -> int:
    """Return the length in bytes of the MP3 frame with this header; 0 if it is not one."""
    if len(head) < 4 or head[0] != 0xFF or head[1] & 0xE0 != 0xE0 or head[1] & 0x06 != 0x02:
        return 0
    version, rate, bits = head[1] >> 3 & 3, head[2] >> 2 & 3, head[2] >> 4
    if version not in _MP3_SAMPLE_RATES or rate == 3 or bits in (0, 15):
        return 0
    first = version == 3
    return (144 if first else 72) * 1000 * _MP3_BITRATES[first][bits] // _MP3_SAMPLE_RATES[version][rate] + (
        head[2] >> 1 & 1
    )


TYPICAL_BYTES_PER_SECOND = 16_000
"""Bytes per second of compressed sound at 128 kbit/s, a common bit rate."""


MAX_DURATION = 600.0
"""Maximum seconds of a sound, which is decoded as a whole; sound files other than WAV are checked by the sound worker.
"""


def check_sound_file(name: str, path: Path) -> Path:
    """Return ``path`` of a sound file. Raises BadRequest if it is missing or cannot be played.

    ``name`` is the part in the message. A WAV file must not exceed ten minutes.
    """
    if not path.is_file():
        raise BadRequest(f"{name}: {path}: no such file", hint=f"`ls {path.parent}` lists what is there")
    why = ""
    try:
        with path.open("rb") as file:
            fits = is_playable(file)
            is_wav = file.seek(0) == 0 and _is_wav(file.read(4))
    except OSError as error:
        raise BadRequest(f"{name}: {path}: {error.strerror}") from error
    except BadWav as error:
        fits, is_wav, why = False, True, f": {error}"
    if not fits:
        raise BadRequest(
            f"{name}: {path}: not a playable WAV, MP3, FLAC or Ogg Vorbis file{why}",
            hint=f"`file {path}` shows what it is; `ffmpeg -i {path} new.wav` makes one that fits",
        )
    if is_wav and sound_duration(path) > MAX_DURATION:
        what = f"{name}: {path}: lasts {sound_duration(path) / 60:.0f} min; the limit is {MAX_DURATION / 60:.0f} min"
        raise BadRequest(what, hint=f"`ffmpeg -i {path} -t {MAX_DURATION:.0f} shorter.wav` keeps its beginning")
    return path


def sound_duration(path: Path) -> float:
    """Return the seconds of a sound: exact for a WAV file, else estimated from its size."""
    if not path.is_file():
        return 0.0
    with suppress(OSError, BadWav), path.open("rb") as file:
        return read_header(file).seconds
    return path.stat().st_size / TYPICAL_BYTES_PER_SECOND
