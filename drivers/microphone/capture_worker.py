"""Worker process that records from the sound card with miniaudio, because ALSA prints errors from C.

``capture_worker.py DEVICE BACKEND``: part of a device name, or empty for the system's default; a miniaudio backend such
as ``null``, or empty for any. It sends ``{"ready": BACKEND}``, then repeatedly ``{"bytes": N}`` and N bytes of sound:
16-bit mono at 16 kHz, 20 ms each. It imports nothing of ours. It ends with its input, or without sound: only a new
process finds a microphone that was plugged in again.
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
    """Send a message, with sound if any, to the robot."""
    sys.stdout.buffer.write(json.dumps(message).encode() + b"\n" + body)
    sys.stdout.buffer.flush()


class SoundForwarder:
    """Sends the sound of the sound card to the robot, on a thread of miniaudio; ``piece_count`` counts the pieces."""

    def __init__(self) -> None:
        self.piece_count = 0

    def receive_sound(self) -> Generator[None, bytes, None]:
        """Return a generator that receives sound; it must be primed, as miniaudio requires."""
        while True:
            sound = bytes((yield))
            self.piece_count += 1
            send({"bytes": len(sound)}, sound)

    def wait_for_end(self, orders: int, timeout: float = SILENCE_TIMEOUT) -> str:
        """Wait for the end of the file descriptor ``orders``; return a reason if sound stops arriving before."""
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
