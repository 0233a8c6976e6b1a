"""The program that records from the sound card with miniaudio, in a process of its own: ALSA complains from C.

``capture_worker.py DEVICE BACKEND``: part of a device's name, empty for the system's own choice; and a backend of
miniaudio's such as ``null``, empty for any. It says ``{"ready": BACKEND}``, then again and again ``{"bytes": N}`` with
N bytes of sound behind: 16-bit mono at 16 kHz, 20 ms at a time. It imports nothing of ours, and ends with its input, or
when no more sound comes: a microphone that was plugged in again is found by the next one only.
"""

import json
import select
import sys
from collections.abc import Generator

import miniaudio

RATE = 16_000
"""Samples a second."""

SILENCE_TIMEOUT = 2.0
"""Seconds without any sound after which the sound card counts as gone: even a quiet room is sound."""

PIECE_MS = 20
"""Milliseconds of sound in a message, about: sound cards have their own ideas."""


def send(message: dict[str, object], body: bytes = b"") -> None:
    """Say something to the robot."""
    sys.stdout.buffer.write(json.dumps(message).encode() + b"\n" + body)
    sys.stdout.buffer.flush()


class SoundForwarder:
    """Passes on what the sound card gives, on a thread of miniaudio's; ``piece_count`` are the pieces so far."""

    def __init__(self) -> None:
        self.piece_count = 0

    def receive_sound(self) -> Generator[None, bytes, None]:
        """Take sound; to be primed, as miniaudio wants it."""
        while True:
            sound = bytes((yield))
            self.piece_count += 1
            send({"bytes": len(sound)}, sound)

    def wait_for_end(self, orders: int, timeout: float = SILENCE_TIMEOUT) -> str:
        """Wait for the end of ``orders`` (a file); return why it comes before that, when no more sound does."""
        before = -1
        while before != self.piece_count:
            before = self.piece_count
            if select.select([orders], [], [], timeout)[0]:
                return ""
        return f"no sound has come for {timeout:g} s: is it still plugged in?"


def find_device_id(name: str, backends: list[miniaudio.Backend]) -> object | None:
    """Return the first device whose name holds ``name``, None for the system's choice. Ends the program without one."""
    if not name:
        return None
    found = miniaudio.Devices(backends).get_captures()
    for device in found:
        if name.casefold() in device["name"].casefold():
            identity: object = device["id"]
            return identity
    names = ", ".join(repr(device["name"]) for device in found)
    sys.exit(f"no microphone is called {name!r}; there are: {names or 'none'}")


def main() -> None:
    """Record until the input ends."""
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
        sys.exit(f"no sound card that records: {error.args[0]}")
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
