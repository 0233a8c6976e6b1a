"""WAV files: the one reader of headers, for recordings that are listened to and sounds that are played.

Programs that write to a pipe, or are killed, leave wrong sizes in the header; so a size counts only as far as the file
goes. A data size of 0 is refused: whether a sound follows it cannot be told from other chunks.
"""

from struct import Struct
from typing import BinaryIO

from drivers.api.quick import dataclass

PCM, MS_ADPCM, FLOAT, A_LAW, MU_LAW, IMA_ADPCM, EXTENSIBLE = 1, 2, 3, 6, 7, 0x11, 0xFFFE
"""The encodings that a player takes, as the format chunk numbers them."""

NAMES = {
    PCM: "integers", MS_ADPCM: "ADPCM", FLOAT: "floats", A_LAW: "A-law", MU_LAW: "mu-law", IMA_ADPCM: "IMA ADPCM",
    0x31: "GSM", 0x50: "MPEG", 0x55: "MP3", 0xFF: "AAC", 0x161: "Windows Media", 0x674F: "Vorbis",
}  # fmt: skip
"""Names of encodings, for people."""

SAMPLE_WIDTHS = {PCM: (1, 2, 3, 4), FLOAT: (4, 8), A_LAW: (1,), MU_LAW: (1,)}
"""Bytes a sample may have, by the encodings that are decoded to be listened to (``drivers.microphone.wav``)."""

_CHUNK, _FORMAT, _SIZES = Struct("<4sI"), Struct("<HHIIHH"), Struct("<QQ")
_GUID_TAIL = bytes.fromhex("000000001000800000aa00389b71")
_UNKNOWN_SIZE = 0xFFFFFFFF

_OTHERS = (
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
    """A file that is not a WAV file, or one that cannot be decoded; the text says what it is."""


@dataclass(frozen=True, slots=True)
class WavFormat:
    """What the header of a WAV file says: ``rate`` in frames a second, ``width`` in bytes a sample.

    ``size`` bytes of sound begin at byte ``begin`` of the file, as many as are there. ``byte_rate`` is bytes a second.
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
        """The number of whole frames."""
        return self.size // (self.width * self.channels)

    @property
    def seconds(self) -> float:
        """How long the sound lasts; as its header says where it is compressed."""
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
            raise BadWav(f"its chunk {name.decode('latin-1').strip()!r} says {size} bytes, and {end - begin} follow")
        file.seek(begin + size + size % 2)
    raise BadWav("it has no sound: its data chunk is missing")


def _describe_other(head: bytes) -> str:
    if not head:
        return "it is empty"
    is_mp3 = len(head) > 1 and head[0] == 0xFF and head[1] & 0xE0 == 0xE0
    names = [name for place, begin, name in _OTHERS if head[place : place + len(begin)] == begin]
    return f"it is {names[0]}" if names else "it is an MP3 file" if is_mp3 else "it does not begin with RIFF and WAVE"


def _make_format(form: bytes, begin: int, size: int, there: int) -> WavFormat:
    if len(form) < _FORMAT.size:
        raise BadWav("its format chunk is missing" if not form else "its format chunk is too short")
    encoding, channels, rate, byte_rate, frame, bits = _FORMAT.unpack_from(form)
    if encoding == EXTENSIBLE:
        if len(form) < 40 or form[26:40] != _GUID_TAIL:
            raise BadWav("its samples are of a kind that is not known (extensible)")
        encoding = int.from_bytes(form[24:26], "little")
    if encoding not in (*SAMPLE_WIDTHS, MS_ADPCM, IMA_ADPCM):
        raise BadWav(f"its samples are {NAMES.get(encoding, f'of kind {encoding:#x}')}, which is not decoded")
    if not channels or not rate:
        raise BadWav(f"its format says {channels} channels and {rate} samples a second")
    width = frame // channels
    if encoding in SAMPLE_WIDTHS and (
        width not in SAMPLE_WIDTHS[encoding] or frame % channels or not 0 < bits <= 8 * width
    ):
        raise BadWav(f"its format says {bits} bits in {frame} bytes for {channels} channels of {NAMES[encoding]}")
    if encoding not in SAMPLE_WIDTHS and not byte_rate:
        raise BadWav("its format says 0 bytes a second")
    if size == 0:
        tail = f": its program did not end as it should, for {there} bytes follow" if there > 0 else ""
        raise BadWav(f"its header says that it has no sound (0 bytes){tail}")
    if there <= 0 or min(size, there) < frame:
        raise BadWav("it has no sound: it ends behind its header")
    return WavFormat(encoding, channels, rate, max(width, 1), byte_rate, begin, min(size, there))
