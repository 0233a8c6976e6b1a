"""Worker process that plays sound with miniaudio, because ALSA prints errors from C.

``sound_worker.py DEVICE BACKEND VOLUME``: part of a device name, or empty for the system's default; a miniaudio backend
such as ``null``, or empty for any; a factor, 1 for unchanged. The messages are described in
``drivers.sound.speech_programs``. Without a sound card, sounds take their usual time in silence. The worker imports
nothing of ours, and ends with its input.
"""

import json
import sys
from array import array
from collections import deque
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Lock, Thread
from types import ModuleType
from typing import Any

BUFFER_MS = 20
"""Milliseconds of sound per buffer of the sound card; a stop cannot take back its three buffers."""

IDLE_TIMEOUT = 10.0
"""Seconds of silence after which the sound card is stopped, since it requests silence 50 times per second."""

MAX_DURATION = 600.0
"""Maximum seconds of a sound file, which is decoded as a whole. WAV files are checked before they are sent."""

DEFAULT_RATE = 22_050
"""Sample rate at which the sound card is opened at the start: that of espeak-ng, so speech needs no reopening."""


@dataclass(slots=True)
class QueuedSound:
    """A sound to play: its samples so far, whether they are complete, and the position of the next byte."""

    number: int
    rate: int
    samples: bytearray = field(default_factory=bytearray)
    is_complete: bool = False
    position: int = 0


class MessagePipe:
    """Output pipe to the robot; used by two threads."""

    def __init__(self) -> None:
        self._lock = Lock()

    def send(self, **message: object) -> None:
        """Send a message."""
        with self._lock:
            sys.stdout.buffer.write(json.dumps(message).encode() + b"\n")
            sys.stdout.buffer.flush()


class PlaybackQueue:
    """Sounds to play, in order. The device's thread takes samples, the main thread adds them.

    ``rate`` is the sample rate of the device. ``idle`` is set once the device has played silence for ``IDLE_TIMEOUT``.
    """

    def __init__(self, pipe: MessagePipe, rate: int = DEFAULT_RATE) -> None:
        self.rate = rate
        self.idle = Event()
        self._silent_bytes = 0  # bytes of it, since something was played
        self._pipe = pipe
        self._lock = Lock()
        self._sounds: deque[QueuedSound] = deque()
        self._draining: QueuedSound | None = None  # the device has the last of it, and not yet played that

    def on_device_opened(self, rate: int) -> None:
        """Set the sample rate of a newly opened device; its time of silence begins at 0."""
        with self._lock:
            self.rate, self._silent_bytes = rate, 0

    def add(self, number: int, rate: int, samples: bytes, *, is_complete: bool) -> None:
        """Append ``samples`` to the sound ``number``, or start it; ``is_complete`` marks its last samples."""
        with self._lock:
            sound = next((sound for sound in self._sounds if sound.number == number), None)
            if sound is None:
                sound = QueuedSound(number, rate)
                self._sounds.append(sound)
            sound.samples += samples
            sound.is_complete = is_complete
            self._silent_bytes = 0
            self.idle.clear()

    def drop(self, number: int) -> None:
        """Remove a sound."""
        with self._lock:
            sounds = [*self._sounds] if self._draining is None else [self._draining, *self._sounds]
            for sound in sounds:
                if sound.number == number:
                    self._sounds = deque(other for other in self._sounds if other is not sound)
                    self._draining = None if self._draining is sound else self._draining
                    self._report_end(sound)

    def start_generator(self) -> Generator[bytes, int, None]:
        """Return a generator of samples for a device, on which ``next`` was called once."""
        playing = self.generate_samples()
        next(playing)
        return playing

    def generate_samples(self) -> Generator[bytes, int, None]:
        """Yield as many samples as the device requests by ``send``.

        The first result is empty, as miniaudio requires.
        """
        wanted = yield b""
        while True:
            wanted = yield self._take_samples(2 * wanted)

    def _take_samples(self, size: int) -> bytes:
        taken = bytearray()
        with self._lock:
            if self._draining is not None:
                self._report_end(self._draining)
                self._draining = None
            while self._sounds and len(taken) < size and self._draining is None:
                sound = self._sounds[0]
                if sound.position == 0:
                    self._pipe.send(started=sound.number, seconds=len(sound.samples) / 2 / sound.rate)
                more = sound.samples[sound.position : sound.position + size - len(taken)]
                taken += more
                sound.position += len(more)
                if sound.position < len(sound.samples) or not sound.is_complete:
                    break
                self._draining = self._sounds.popleft()
            self._silent_bytes = 0 if self._sounds or self._draining is not None else self._silent_bytes + size
            if self._silent_bytes >= 2 * self.rate * IDLE_TIMEOUT:
                self.idle.set()
        return bytes(taken.ljust(size, b"\0"))

    def _report_end(self, sound: QueuedSound) -> None:
        self._pipe.send(ended=sound.number, seconds=sound.position / 2 / sound.rate)


class SoundCardPlayer:
    """Player of queued sounds on the sound card, opened at the sample rate of the current sound.

    ``name`` is part of the device's name; ``pipe`` is the connection to the robot. The sound card is stopped after
    ``IDLE_TIMEOUT``.
    """

    def __init__(self, name: str, backend: str, volume: float, pipe: MessagePipe) -> None:
        self._name = name
        self._backends = [miniaudio.Backend[backend.upper()]] if backend else None
        self._volume = volume
        self._pipe = pipe
        self._queue = PlaybackQueue(pipe)
        self._lock = Lock()  # over the device, which is stopped on a thread of its own
        self._device = self._open_device(DEFAULT_RATE)
        self._closed = False
        self._idler = Thread(target=self._stop_when_idle, name="idle", daemon=True)
        self._idler.start()

    def handle_message(self, message: dict[str, Any], body: bytes) -> None:
        """Execute a message of the robot."""
        match message:
            case {"play": number, "rate": rate, "last": last}:
                self._play_samples(number, rate, body, is_complete=last)
                self._pipe.send(taken=number)
            case {"file": number, "path": path}:
                self._decode(number, path)
            case {"stop": number}:
                self._queue.drop(number)

    def _decode(self, number: int, path: str) -> None:
        rate = self._device.sample_rate
        minutes = _file_duration(path) / 60
        if minutes > MAX_DURATION / 60:
            why = f"lasts {minutes:.0f} min; the limit is {MAX_DURATION / 60:.0f} min"
            self._pipe.send(refused=number, why=why)
            return
        try:
            samples = _decode_file(path, rate)
        except miniaudio.MiniaudioError as error:
            self._pipe.send(refused=number, why=str(error.args[0]))
        else:
            self._play_samples(number, rate, samples, is_complete=True)

    def _play_samples(self, number: int, rate: int, samples: bytes, *, is_complete: bool) -> None:
        """Add samples to a sound, on a device that is opened again if it has another sample ``rate``."""
        with self._lock:
            if rate != self._device.sample_rate or not self._ensure_running():
                self._reopen_device(rate)
            self._queue.add(number, rate, self._apply_volume(samples), is_complete=is_complete)

    def _ensure_running(self) -> bool:
        """Start the device if it was stopped; return whether it runs."""
        with suppress(miniaudio.MiniaudioError):
            if not self._device.running:
                self._device.start(self._queue.start_generator())
        return bool(self._device.running)

    def _reopen_device(self, rate: int) -> None:
        self._device.close()
        self._device = self._open_device(rate)

    def _stop_when_idle(self) -> None:
        while self._queue.idle.wait():
            with self._lock:
                if self._closed:
                    return
                if self._queue.idle.is_set():
                    self._queue.idle.clear()
                    try:
                        self._device.stop()
                    except miniaudio.MiniaudioError:
                        self._reopen_device(self._device.sample_rate)

    def _apply_volume(self, samples: bytes) -> bytes:
        if self._volume == 1.0:
            return samples
        values = array("h", samples)
        return array("h", (min(max(int(value * self._volume), -32768), 32767) for value in values)).tobytes()

    def _open_device(self, rate: int) -> "miniaudio.PlaybackDevice":
        """Return a running device; without a sound card, report it and return a silent device."""
        try:
            device = self._make_device(rate, self._backends)
            if device.backend == "Null" and self._backends is None:
                self._pipe.send(mute="no sound card for playback")
        except (miniaudio.MiniaudioError, LookupError) as error:
            self._pipe.send(mute=f"no sound card for playback: {error.args[0]}")
            self._name = ""
            device = self._make_device(rate, [miniaudio.Backend.NULL])
        self._queue.on_device_opened(rate)
        device.start(self._queue.start_generator())
        return device

    def _make_device(self, rate: int, backends: "list[miniaudio.Backend] | None") -> "miniaudio.PlaybackDevice":
        return miniaudio.PlaybackDevice(
            output_format=miniaudio.SampleFormat.SIGNED16,
            nchannels=1,
            sample_rate=rate,
            buffersize_msec=BUFFER_MS,
            device_id=self._find_device_id(),
            backends=backends,
            app_name="missiontree",
        )

    def _find_device_id(self) -> Any:
        """Return the id of the first sound card whose name contains ``name`` of this player; None for the default.

        Raises LookupError if there is none.
        """
        if not self._name:
            return None
        found = miniaudio.Devices(self._backends).get_playbacks()
        for device in found:
            if self._name.casefold() in device["name"].casefold():
                return device["id"]
        names = ", ".join(repr(device["name"]) for device in found)
        raise LookupError(f"no loudspeaker {self._name!r}; available: {names or 'none'}")

    @property
    def backend(self) -> str:
        """Name of the backend: ``PulseAudio``, ``ALSA`` .. ``Null``."""
        return str(self._device.backend)

    def close(self) -> None:
        """Close the device."""
        with self._lock:
            self._closed = True
            self._device.close()
        self._queue.idle.set()
        self._idler.join()


def _decode_file(path: str, rate: int) -> bytes:
    """Return a file as 16-bit mono samples. Raises miniaudio.MiniaudioError."""
    # By way of floats: miniaudio mixes more than two channels of 16 bits with an overflow, which is loud noise.
    floats, whole = miniaudio.SampleFormat.FLOAT32, miniaudio.SampleFormat.SIGNED16
    sound = miniaudio.decode_file(path, floats, nchannels=1, sample_rate=rate)
    return bytes(miniaudio.convert_frames(floats, 1, rate, sound.samples.tobytes(), whole, 1, rate))


def _file_duration(path: str) -> float:
    """Return the duration of a sound file in seconds, by its content; 0 if it is unknown.

    It is also 0 for a WAV file, because the robot has checked its duration before.
    """
    with suppress(miniaudio.MiniaudioError, OSError), Path(path).open("rb") as file:
        begin = file.read(4)
        measures = {b"fLaC": miniaudio.flac_get_file_info, b"OggS": miniaudio.vorbis_get_file_info}
        if begin not in (b"RIFF", b"RF64"):
            return float(measures.get(begin, miniaudio.mp3_get_file_info)(path).duration)
    return 0.0


def main() -> None:
    """Play until the input ends."""
    name, backend, volume = sys.argv[1:]
    pipe, orders = MessagePipe(), sys.stdin.buffer
    player = SoundCardPlayer(name, backend, float(volume), pipe)
    pipe.send(ready=player.backend)
    for line in orders:
        message = json.loads(line)
        player.handle_message(message, orders.read(message.get("bytes", 0)))
    player.close()


if __name__ == "__main__":
    # miniaudio takes numpy where it is there, and the web for radio stations: neither is used here, and to load them
    # takes three times as long as all the rest.
    sys.modules.update({"numpy": None, "urllib.request": ModuleType("urllib.request")})  # type: ignore[dict-item]
    try:
        import miniaudio
    except ImportError as missing:
        MessagePipe().send(absent=str(missing))
        sys.stdin.buffer.read()
    else:
        main()
