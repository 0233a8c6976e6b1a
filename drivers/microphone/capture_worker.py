"""Worker process that records from the sound card with miniaudio.

It is a process of its own because ALSA prints errors from C, which would disturb the terminal of the run. Command line:
``capture_worker.py DEVICE BACKEND``. DEVICE is part of a device name, or empty for the system's default. BACKEND is a
miniaudio backend such as ``null``, or empty for any. The worker sends ``{"ready": BACKEND}`` to its standard output,
then repeatedly ``{"bytes": N}`` and N bytes of sound: 16-bit mono at 16 kHz, 20 ms each. It imports no other module of
MissionTree. It ends when its standard input ends, and when sound stops arriving: only a new process finds a microphone
that was plugged in again.
"""

import json
import select
import sys
from collections.abc import Generator

import miniaudio

RATE = 16_000
"""Sound samples per second."""

SILENCE_TIMEOUT = 2.0
"""Seconds without data after which the sound card counts as gone; even a quiet room gives data."""

PIECE_MS = 20
"""Approximate milliseconds of sound per message; sound cards may differ."""


def send(message: dict[str, object], body: bytes = b"") -> None:
    """Write a message to standard output, followed by the bytes of sound in ``body``, if any."""
    sys.stdout.buffer.write(json.dumps(message).encode() + b"\n" + body)
    sys.stdout.buffer.flush()


class SoundForwarder:
    """Writes the sound of the sound card to standard output, on a thread of miniaudio.

    ``piece_count`` is the number of pieces written.
    """

    def __init__(self) -> None:
        self.piece_count = 0

    def receive_sound(self) -> Generator[None, bytes, None]:
        """Return a generator that receives sound by its ``send`` method.

        Call ``next`` on it first, as miniaudio requires.
        """
        while True:
            sound = bytes((yield))
            self.piece_count += 1
            send({"bytes": len(sound)}, sound)

    def wait_for_end(self, orders: int, timeout: float = SILENCE_TIMEOUT) -> str:
        """Wait until the file descriptor ``orders`` ends; return an empty text.

        Return earlier, with a message, if no sound has arrived for ``timeout`` seconds.
        """
        before = -1
        while before != self.piece_count:
            before = self.piece_count
            if select.select([orders], [], [], timeout)[0]:
                return ""
        return f"no sound for {timeout:g} s: is it still plugged in?"


def find_device_id(name: str, backends: list[miniaudio.Backend]) -> object | None:
    """Return the id of the first device whose name contains ``name``; None for the default. Exits if there is none."""
    if not name:
        return None
    found = miniaudio.Devices(backends).get_captures()
    for device in found:
        if name.casefold() in device["name"].casefold():
            identity: object = device["id"]
            return identity
    names = ", ".join(repr(device["name"]) for device in found)
    sys.exit(f"no microphone {name!r}; available: {names or 'none'}")


def main() -> None:
    """Record sound until the standard input ends."""
    name, backend = [*sys.argv[1:], "", ""][:2]
    backends = [miniaudio.Backend[backend.upper()]] if backend else []
    try:
        device = miniaudio.CaptureDevice(
            input_format=miniaudio.SampleFormat.SIGNED16,
            nchannels=1,
            sample_rate=RATE,
            buffersize_msec=PIECE_MS,
            device_id=find_device_id(name, backends),
            backends=backends or None,
            app_name="missiontree",
        )
    except miniaudio.MiniaudioError as error:
        sys.exit(f"no sound card for recording: {error.args[0]}")
    send({"ready": device.backend})
    passing = SoundForwarder()
    taking = passing.receive_sound()
    next(taking)
    device.start(taking)
    trouble = passing.wait_for_end(sys.stdin.fileno())
    device.close()
    if trouble:
        sys.exit(trouble)


if __name__ == "__main__":
    main()
