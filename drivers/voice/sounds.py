"""Files with sounds: which they are, and how long one lasts that nobody can play here."""

import wave
from contextlib import suppress
from pathlib import Path

from drivers.errors import BadRequest
from drivers.voice.heads import playable

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
    try:
        with path.open("rb") as file:
            fits = playable(file)
            is_wav = file.seek(0) == 0 and file.read(4) == b"RIFF"
    except OSError as error:
        raise BadRequest(f"{name}: {path}: {error.strerror}") from error
    if not fits:
        raise BadRequest(
            f"{name}: {path}: is no WAV, MP3, FLAC or Ogg Vorbis file that can be played",
            hint=f"`file {path}` shows what it is",
        )
    if is_wav and length_of(path) > MAX_DURATION:
        what = f"{name}: {path}: lasts {length_of(path) / 60:.0f} min, and a sound may last {MAX_DURATION / 60:.0f}"
        raise BadRequest(what, hint=f"`ffmpeg -i {path} -t {MAX_DURATION:.0f} shorter.wav` keeps its beginning")
    return path


def length_of(path: Path) -> float:
    """Return about how many seconds a sound lasts: exactly for a WAV file, else as its size suggests.

    A WAV file that was written to a pipe says that it is longer than it is: no program knew how long it would be.
    """
    size = path.stat().st_size if path.is_file() else 0
    with suppress(OSError, EOFError, wave.Error, ZeroDivisionError), wave.open(str(path), "rb") as file:
        there = size // (file.getsampwidth() * file.getnchannels())
        return min(file.getnframes(), there) / file.getframerate()
    return size / BYTES_A_SECOND
