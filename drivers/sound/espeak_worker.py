"""Worker process that speaks with espeak-ng (GPL-3); it imports nothing of ours.

The messages are described in ``drivers.sound.speech_programs``. Calls, numbers and structures are those of espeak-ng's
``speak_lib.h``.
"""

import ctypes
import json
import os
import select
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

SYNCHRONOUS = 2
PHONEME_EVENTS = 1  # option of espeak_Initialize
PHONEME = 7  # type of an event
RATE_PARAMETER = 1
UTF8 = 1
BUFFER_MS = 200
MIN_SPEED, MAX_SPEED = 80, 450
"""Words per minute that espeak-ng can speak."""


class EspeakEventId(ctypes.Union):
    """Value of an event of espeak-ng: a number, a name, or a short string such as a phoneme."""

    _fields_ = (("number", ctypes.c_int), ("name", ctypes.c_char_p), ("string", ctypes.c_char * 8))


class EspeakEvent(ctypes.Structure):
    """Event of espeak-ng at a position in the sound."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("unique_identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),  # ms
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("id", EspeakEventId),
    )


class EspeakVoice(ctypes.Structure):
    """Voice of espeak-ng; ``languages`` is a priority byte and a name, repeated."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("languages", ctypes.c_char_p),
        ("identifier", ctypes.c_char_p),
        ("gender", ctypes.c_ubyte),
        ("age", ctypes.c_ubyte),
        ("variant", ctypes.c_ubyte),
        ("reserved", ctypes.c_ubyte),
        ("score", ctypes.c_int),
        ("spare", ctypes.c_void_p),
    )


Callback = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(EspeakEvent))


class EspeakLibrary:
    """The shared library of espeak-ng; ``sound`` and ``phonemes`` are the result of the last text.

    During synthesis ``is_obsolete`` is called five times per second of sound; synthesis stops once it returns True.
    """

    def __init__(self, library: str, data: str, is_obsolete: Callable[[], bool]) -> None:
        self._is_obsolete = is_obsolete
        self._abandoned = False
        self.sound = bytearray()
        self.phonemes: list[tuple[int, str]] = []
        self._library = ctypes.CDLL(library)
        self._library.espeak_ListVoices.restype = ctypes.POINTER(ctypes.POINTER(EspeakVoice))
        self.rate = self._library.espeak_Initialize(SYNCHRONOUS, BUFFER_MS, data.encode(), PHONEME_EVENTS)
        if self.rate <= 0:
            sys.exit(f"espeak-ng does not find its data in {data}")
        self._callback = Callback(self._on_sound)  # which must live as long as the library
        self._library.espeak_SetSynthCallback(self._callback)
        self._variants = {path.name for path in Path(data, "voices", "!v").iterdir()}
        self._languages = self._voices_by_language()

    def select_voice(self, voice: str) -> bool:
        """Select a voice such as "en-us+f2"; return False if it or its variant does not exist."""
        base, plus, variant = voice.partition("+")
        if plus and variant not in self._variants:
            return False
        name = self._languages.get(base.lower(), base) + plus + variant
        return int(self._library.espeak_SetVoiceByName(name.encode())) == 0

    def speak(self, text: str, speed: int) -> bool:
        """Synthesise a text; return False if it was stopped because ``is_obsolete`` returned True."""
        self._abandoned = False
        self.sound.clear()
        self.phonemes.clear()
        self._library.espeak_SetParameter(RATE_PARAMETER, min(max(speed, MIN_SPEED), MAX_SPEED), 0)
        data = text.replace("\0", " ").encode()
        self._library.espeak_Synth(data, len(data) + 1, 0, 1, 0, UTF8, None, None)
        return not self._abandoned

    def _on_sound(self, samples: int | None, count: int, events: Any) -> int:
        if samples is not None and count:
            self.sound.extend(ctypes.string_at(samples, 2 * count))
        number = 0
        while events[number].type:
            event = events[number]
            if event.type == PHONEME:
                self.phonemes.append((event.audio_position, event.id.string.decode("utf-8", "replace")))
            number += 1
        self._abandoned = self._abandoned or self._is_obsolete()
        return int(self._abandoned)

    def _voices_by_language(self) -> dict[str, str]:
        """Return the voice identifiers by language: espeak-ng does not find a voice by "en-gb"."""
        found: dict[str, str] = {}
        voices, number = self._library.espeak_ListVoices(None), 0
        while voices[number]:
            voice = voices[number].contents
            found.setdefault(voice.languages[1:].decode().lower(), voice.identifier.decode())
            number += 1
        return found


def send(message: dict[str, object], body: bytes = b"") -> None:
    """Send a message, with sound if any, to the robot."""
    head = {**message, "bytes": len(body)} if body else message
    sys.stdout.buffer.write(json.dumps(head).encode() + b"\n" + body)
    sys.stdout.buffer.flush()


def handle_request(espeak: EspeakLibrary, request: dict[str, Any]) -> None:
    """Synthesise the text of one request and send it, unless a newer request has arrived meanwhile."""
    trouble = ""
    if not espeak.select_voice(request["voice"] or "en"):
        trouble = f"espeak-ng has no voice {request['voice'][:40]!r}"
        if not espeak.select_voice(request["instead"] or "en"):
            espeak.select_voice("en")
    if not espeak.speak(request["text"], request["speed"]):
        return
    head = {"id": request["id"], "rate": espeak.rate, "phonemes": espeak.phonemes, "trouble": trouble}
    send(head, bytes(espeak.sound))


def main() -> None:
    """Answer requests until the input ends."""
    try:
        import espeakng_loader  # noqa: PLC0415 - that it is missing is something to tell
    except ImportError as error:
        send({"absent": str(error)})
        sys.stdin.buffer.read()
        return
    # Unbuffered: what has come, and is not read yet, can be seen.
    requests = os.fdopen(sys.stdin.fileno(), "rb", buffering=0, closefd=False)
    espeak = EspeakLibrary(
        espeakng_loader.get_library_path(),
        espeakng_loader.get_data_path(),
        lambda: bool(select.select([requests], [], [], 0)[0]),
    )
    send({"ready": "espeak-ng"})
    for line in requests:
        handle_request(espeak, json.loads(line))


if __name__ == "__main__":
    main()
