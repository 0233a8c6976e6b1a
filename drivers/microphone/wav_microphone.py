"""Microphone that plays a WAV file, for tests and demonstrations without a microphone."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import BinaryIO

import numpy as np

from drivers.api import SOUND_RATE, DeviceStatus, Health, Samples, Sound, StatusCallback, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.sound.wav import A_LAW, ENCODING_NAMES, FLOAT, MU_LAW, SAMPLE_WIDTHS, BadWav, WavFormat, read_header
from drivers.transport.loop import guard_callback

PIECE_SAMPLES = 320
"""Samples per piece of sound: 20 ms."""

MAX_KEPT_PIECES = 250
"""Pieces of sound in the buffer: 5 s."""

MAX_DURATION = 300.0
"""Maximum seconds of a recording, which is read as a whole."""

RATE_LIMITS = (4_000, 384_000)
"""Minimum and maximum sample rate of a WAV file, in samples per second."""

BLOCK_FRAMES = 65_536
"""Frames decoded at once: a long recording with many channels does not fit into memory as floats."""

FrameBlocks = Iterator["np.ndarray[tuple[int, int], np.dtype[np.float64]]"]


class WavMicrophone:
    """A ``drivers.api.Microphone`` that plays the WAV file at ``path`` in real time, starting at ``open``.

    The file may have any sample rate and number of channels. After its end there is silence, unless ``loop`` repeats
    the file.
    """

    name = "microphone"

    def __init__(self, path: Path, clock: Clock, *, loop: bool = False, report: StatusCallback = ignore) -> None:
        self._path = path
        self._clock = clock
        self._loop = loop
        self._report = guard_callback(report)
        self._sound: Samples | None = None
        self._error = NotConnected(f"{self.name}: {path}: not opened yet", hint="open it first")
        self._opened_at = 0.0

    def open(self) -> None:
        """Read the file, and start playing it. A read error is reported by ``health`` and a notice."""
        if self._sound is not None:
            return
        try:
            self._sound = load_wav(self.name, self._path)
        except NotConnected as error:
            self._error = error
            self._report(DeviceStatus(self.name, "offline", str(error), error.hint))
        else:
            self._opened_at = self._clock.now()
            self._report(DeviceStatus(self.name, "online", f"{self._path} plays"))

    def rest(self) -> None:
        """Do nothing: a microphone has no actuator."""

    def close(self) -> None:
        """Stop playing; the next ``open`` starts from the beginning."""
        self._sound = None
        self._error = NotConnected(f"{self.name}: {self._path}: not opened yet", hint="open it first")

    def health(self) -> Health:
        if self._sound is not None:
            return Health(online=True, counters={"pieces": self._played_pieces()})
        return Health(online=False, detail=str(self._error), hint=self._error.hint)

    def read(self, after: int) -> list[Sound]:
        """Return the pieces played so far with a number above ``after``, from the last 5 s."""
        sound, played = self._sound, self._played_pieces()
        if sound is None:
            return []
        wanted = range(max(after + 1, played - MAX_KEPT_PIECES, 0), played)
        return [
            Sound(each, self._opened_at + each * PIECE_SAMPLES / SOUND_RATE, self._piece(sound, each))
            for each in wanted
        ]

    def _played_pieces(self) -> int:
        return int((self._clock.now() - self._opened_at) * SOUND_RATE / PIECE_SAMPLES + 1e-6)

    def _piece(self, sound: Samples, number: int) -> Samples:
        begin = number * PIECE_SAMPLES
        if self._loop and len(sound):
            return np.take(sound, range(begin, begin + PIECE_SAMPLES), mode="wrap")
        piece = sound[begin : begin + PIECE_SAMPLES]
        return np.pad(piece, (0, PIECE_SAMPLES - len(piece)))


def load_wav(name: str, path: Path) -> Samples:
    """Return the sound of a WAV file as 16-bit mono samples at ``SOUND_RATE``; ``name`` is the part in error messages.

    A size in the header that exceeds the file is reduced. Raises NotConnected for a file that ``drivers.sound.wav``
    refuses, for sample rates outside ``RATE_LIMITS``, and for more than five minutes.
    """
    hint = f"`file {path}` shows what it is; `ffmpeg -i {path} -ac 1 -ar {SOUND_RATE} new.wav` makes one that fits"
    if path.exists() and not path.is_file():
        raise NotConnected(f"{name}: {path}: cannot be read as a WAV file: not a regular file", hint=hint)
    try:
        with path.open("rb") as file:
            form = read_header(file)
            if not RATE_LIMITS[0] <= form.rate <= RATE_LIMITS[1]:
                low, high = RATE_LIMITS
                raise NotConnected(
                    f"{name}: {path}: says {form.rate} samples per second: must be {low} to {high}", hint=hint
                )
            if form.seconds > MAX_DURATION:
                what = f"{name}: {path}: lasts {form.seconds / 60:.0f} min; the limit is {MAX_DURATION / 60:.0f} min"
                cure = f"`ffmpeg -i {path} -t {MAX_DURATION:.0f} shorter.wav` keeps its beginning"
                raise NotConnected(what, hint=cure)
            sound = np.concatenate([block.mean(axis=1) for block in decode_blocks(file, form)])
    except NotConnected:
        raise
    except FileNotFoundError:
        raise NotConnected(f"{name}: {path}: no such file", hint=f"`ls {path.parent}` lists what is there") from None
    except (OSError, BadWav) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise NotConnected(f"{name}: {path}: cannot be read as a WAV file: {why}", hint=hint) from error
    return resample(sound, form.rate)


def resample(sound: np.ndarray[tuple[int], np.dtype[np.float64]], rate: int) -> Samples:
    """Return ``sound``, which has ``rate`` samples per second, resampled to ``SOUND_RATE`` as 16-bit samples.

    Frequencies above half the new rate are removed. It uses the Fourier transform of the whole sound, so it is exact,
    but too slow for a stream.
    """
    if rate != SOUND_RATE and len(sound):
        count = round(len(sound) * SOUND_RATE / rate)
        sound = np.fft.irfft(np.fft.rfft(sound)[: count // 2 + 1], count) * (count / len(sound))
    return np.asarray(np.clip(np.rint(sound), -32768, 32767), np.int16)


def decode_blocks(file: BinaryIO, form: WavFormat) -> FrameBlocks:
    """Yield the sound of a WAV file as arrays of shape (frames, channels), ``BLOCK_FRAMES`` frames at a time.

    Values are floats in the range of 16-bit integers. Raises BadWav, OSError.
    """
    if form.encoding not in SAMPLE_WIDTHS:
        raise BadWav(f"its samples are {ENCODING_NAMES[form.encoding]}, which is not decoded here")
    file.seek(form.begin)
    frame, left = form.width * form.channels, form.frames
    while left > 0 and (data := file.read(frame * min(BLOCK_FRAMES, left))):
        whole = data[: len(data) // frame * frame]
        yield _decode(whole, form).reshape(-1, form.channels)
        left -= BLOCK_FRAMES


def _decode(data: bytes, form: WavFormat) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    if form.encoding == FLOAT:
        with np.errstate(over="ignore", invalid="ignore"):
            floats = np.frombuffer(data, f"<f{form.width}").astype(np.float64) * 32768
        return np.clip(np.nan_to_num(floats), -32768, 32767)
    if form.encoding in (A_LAW, MU_LAW):
        return _expansion_table(form.encoding)[np.frombuffer(data, np.uint8)]
    if form.width == 1:
        return (np.frombuffer(data, np.uint8).astype(np.float64) - 128) * 256
    if form.width == 3:
        parts = np.frombuffer(data, np.uint8).reshape(-1, 3)
        upper = np.ascontiguousarray(parts[:, 1:]).view("<i2").ravel()
        return upper.astype(np.float64) + parts[:, 0] / 256
    scale = 256.0 ** (form.width - 2)
    return np.frombuffer(data, f"<i{form.width}").astype(np.float64) / scale


@cache
def _expansion_table(encoding: int) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    """Return the sample values of the 256 bytes of A-law or mu-law sound (ITU-T G.711), in byte order."""
    byte = np.arange(256) ^ (0x55 if encoding == A_LAW else 0xFF)
    step, exponent = byte & 15, byte >> 4 & 7
    if encoding == A_LAW:
        size = np.where(exponent == 0, 16 * step + 8, (16 * step + 264) << np.maximum(exponent - 1, 0))
        return np.where(byte & 0x80, size, -size).astype(np.float64)
    size = ((8 * step + 132) << exponent) - 132
    return np.where(byte & 0x80, -size, size).astype(np.float64)
