"""Files with sounds: which they are, and how long one lasts that nobody can play here."""

import wave
from contextlib import suppress
from pathlib import Path

from drivers.errors import BadRequest

SUFFIXES = (".wav", ".mp3", ".flac", ".ogg")
"""What the names of files end in that can be played."""

BYTES_A_SECOND = 16_000
"""Of compressed sound at 128 kbit/s, which is common."""


def checked(name: str, path: Path) -> Path:
    """Return ``path``, which ``name`` is to play. Raises BadRequest where there is no such file, or it is no sound."""
    if not path.is_file():
        raise BadRequest(f"{name}: {path}: no such file", hint=f"`ls {path.parent}` lists what is there")
    try:
        with path.open("rb") as file:
            begin = file.read(12)
    except OSError as error:
        raise BadRequest(f"{name}: {path}: {error.strerror}") from error
    if not _is_sound(begin):
        raise BadRequest(f"{name}: {path}: is no WAV, MP3, FLAC or Ogg file", hint=f"`file {path}` shows what it is")
    return path


def length_of(path: Path) -> float:
    """Return about how many seconds a sound lasts: exactly for a WAV file, else as its size suggests."""
    with suppress(OSError, EOFError, wave.Error), wave.open(str(path), "rb") as file:
        return file.getnframes() / file.getframerate()
    return path.stat().st_size / BYTES_A_SECOND if path.is_file() else 0.0


def _is_sound(begin: bytes) -> bool:
    """Tell a sound by its first bytes: RIFF and WAVE, fLaC, OggS, ID3, or eleven set bits where an MP3 frame begins."""
    if begin[:4] == b"RIFF":
        return begin[8:12] == b"WAVE"
    frame = len(begin) > 1 and begin[0] == 0xFF and begin[1] & 0xE0 == 0xE0
    return begin[:4] in (b"fLaC", b"OggS") or begin[:3] == b"ID3" or frame
