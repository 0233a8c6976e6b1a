"""WAV files of every kind, written chunk by chunk, as recorders and editors leave them."""

import struct

import numpy as np

RATE, COUNT = 22_050, 4410
TONE = 0.6 * np.sin(2 * np.pi * 441 * np.arange(COUNT) / RATE)
GUID = bytes.fromhex("000000001000800000aa00389b71")
UNKNOWN = 0xFFFFFFFF

INT16 = np.rint(TONE * 32767).astype("<i2").tobytes()
INT32 = np.rint(TONE * (2**31 - 1)).astype("<i4").tobytes()
INT24 = b"".join(INT32[at + 1 : at + 4] for at in range(0, len(INT32), 4))
UINT8 = np.rint(128 + TONE * 127).astype("u1").tobytes()


def form(kind: int, bits: int, *, channels: int = 1, rate: int = RATE, rest: bytes = b"") -> bytes:
    """Return the body of a format chunk."""
    frame = channels * ((bits + 7) // 8)
    return struct.pack("<HHIIHH", kind, channels, rate, rate * frame, frame, bits) + rest


def extensible(kind: int, bits: int, valid: int = 0, *, channels: int = 1, tail: bytes = GUID) -> bytes:
    """Return that of an extensible format."""
    return form(0xFFFE, bits, channels=channels, rest=struct.pack("<HHIH", 22, valid or bits, 0, kind) + tail)


def chunk(name: bytes, body: bytes, size: int | None = None) -> bytes:
    """Return a chunk, which may lie about its size."""
    return name + struct.pack("<I", len(body) if size is None else size) + body + bytes(len(body) % 2)


def riff(*chunks: bytes, size: int | None = None, name: bytes = b"RIFF") -> bytes:
    """Return a file of these chunks."""
    body = b"WAVE" + b"".join(chunks)
    return name + struct.pack("<I", len(body) if size is None else size) + body


def plain(kind: int, bits: int, data: bytes) -> bytes:
    """Return an ordinary file."""
    return riff(chunk(b"fmt ", form(kind, bits)), chunk(b"data", data))


FMT, DATA = chunk(b"fmt ", form(1, 16)), chunk(b"data", INT16)
SIX = np.repeat(np.frombuffer(INT16, "<i2"), 6).tobytes()
DS64 = chunk(b"ds64", struct.pack("<QQQI", 0, len(INT16), COUNT, 0))

GOOD = {
    "8 bit": plain(1, 8, UINT8),
    "16 bit": plain(1, 16, INT16),
    "24 bit": plain(1, 24, INT24),
    "32 bit": plain(1, 32, INT32),
    "float": plain(3, 32, TONE.astype("<f4").tobytes()),
    "double": plain(3, 64, TONE.astype("<f8").tobytes()),
    "extensible 16": riff(chunk(b"fmt ", extensible(1, 16)), DATA),
    "extensible 24": riff(chunk(b"fmt ", extensible(1, 24)), chunk(b"data", INT24)),
    "extensible 20 in 24": riff(chunk(b"fmt ", extensible(1, 24, 20)), chunk(b"data", INT24)),
    "extensible 24 in 32": riff(chunk(b"fmt ", extensible(1, 32, 24)), chunk(b"data", INT32)),
    "extensible float": riff(chunk(b"fmt ", extensible(3, 32)), chunk(b"data", TONE.astype("<f4").tobytes())),
    "six channels": riff(chunk(b"fmt ", extensible(1, 16, channels=6)), chunk(b"data", SIX)),
    "format of 18 bytes": riff(chunk(b"fmt ", form(1, 16, rest=bytes(2))), DATA),
    "list of an odd size": riff(chunk(b"LIST", b"INFOx"), FMT, chunk(b"bext", b"abc"), DATA),
    "list behind": riff(FMT, DATA, chunk(b"LIST", b"INFO")),
    "data of an odd size": riff(FMT, chunk(b"data", INT16 + b"\1")),
    "to a pipe": riff(FMT, chunk(b"data", INT16, UNKNOWN), size=UNKNOWN),
    "to a pipe by espeak": riff(FMT, chunk(b"data", INT16, 0x7FFFF000), size=0x7FFFF024),
    "RIFF size of 0": riff(FMT, DATA, size=0),
    "RF64": riff(DS64, FMT, chunk(b"data", INT16, UNKNOWN), size=UNKNOWN, name=b"RF64"),
}
"""Files with the tone, by the name of their kind."""

MP3 = b"\xff\xfb\x90\x64" + bytes(413) + b"\xff\xfb\x90\x64" + bytes(413)

BAD = {
    "it is empty": b"",
    "it does not begin with RIFF and WAVE": b"this is no sound",
    "it is an MP3 file": MP3,
    "it is an Ogg file": b"OggS" + bytes(60),
    "it is a FLAC file": b"fLaC" + bytes(60),
    "it is an MP4 (M4A) file": b"\0\0\0 ftypM4A " + bytes(20),
    "it is a video (AVI)": b"RIFF\0\0\0\0AVI " + bytes(20),
    "it is a WAV file in big-endian order (RIFX)": b"RIFX" + riff(FMT, DATA)[4:],
    "its header declares no sound (0 bytes)": riff(FMT, chunk(b"data", b"")),
    f"0 bytes): the recorder was interrupted, since {len(INT16)} bytes": riff(FMT, chunk(b"data", INT16, 0)),
    f"interrupted, since {len(INT16)} bytes follow": riff(FMT, chunk(b"data", INT16, 0), size=UNKNOWN),
    "it has no sound: it ends after its header": riff(FMT) + b"data" + struct.pack("<I", UNKNOWN),
    "it has no sound: its data chunk is missing": riff(FMT, chunk(b"LIST", b"INFO")),
    "its format chunk is missing": riff(DATA, FMT),
    "its format chunk is too short": riff(chunk(b"fmt ", form(1, 16)[:14]), DATA),
    "declares 4294967295 bytes, but": riff(chunk(b"fmt ", form(1, 16), UNKNOWN), DATA),
    "its samples are MP3, which is not decoded": riff(chunk(b"fmt ", form(0x55, 16)), DATA),
    "its samples are of kind 0x1234": riff(chunk(b"fmt ", form(0x1234, 16)), DATA),
    "its sample format is unknown (extensible)": riff(
        chunk(b"fmt ", extensible(1, 16, tail=bytes(14))), DATA
    ),
    "its header declares 0 channels": riff(chunk(b"fmt ", form(1, 16, channels=0)), DATA),
    "its header declares 1 channels and 0 samples a second": riff(chunk(b"fmt ", form(1, 16, rate=0)), DATA),
    "its header declares 64 bits in 8 bytes for 1 channels of integers": plain(1, 64, bytes(80)),
    "its header declares 16 bits in 2 bytes for 1 channels of floats": plain(3, 16, INT16),
    "its header declares 32 bits in 2 bytes": riff(
        chunk(b"fmt ", struct.pack("<HHIIHH", 1, 1, RATE, 2 * RATE, 2, 32)), DATA
    ),
}  # fmt: skip
"""Files that are refused, by words of the reason."""
