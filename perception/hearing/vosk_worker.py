"""Worker process that recognises speech with Vosk and a model of the user's.

The messages are those of ``recogniser_worker.py``, except for the setup: ``{"model": FOLDER, "phrases": [..]}``. A
sound is answered by the recognised ``phrase``, and the confidence ``sure``, 0 to 1, of each word. This module imports
no other module of MissionTree.
"""

import json
import sys
import time
from typing import Any

import vosk

RATE = 16_000
"""Samples per second."""


def decode(recogniser: "vosk.KaldiRecognizer", sound: bytes) -> dict[str, Any]:
    """Return the recognised text of a sound, with confidences."""
    recogniser.Reset()
    recogniser.AcceptWaveform(sound)
    found = json.loads(recogniser.FinalResult())
    return {"phrase": found.get("text", ""), "sure": [word["conf"] for word in found.get("result", ())]}


def main() -> None:
    """Answer requests on standard input until it ends."""
    vosk.SetLogLevel(-1)
    recogniser = None
    for line in sys.stdin.buffer:
        message = json.loads(line)
        sound = sys.stdin.buffer.read(message.get("bytes", 0))
        if "phrases" in message:
            grammar = json.dumps([*message["phrases"], "[unk]"])
            recogniser = vosk.KaldiRecognizer(vosk.Model(message["model"]), RATE, grammar)
            recogniser.SetWords(True)
            answer: dict[str, Any] = {"ready": True}
        else:
            began = time.process_time()
            found = {"phrase": ""} if recogniser is None else decode(recogniser, sound)
            answer = {"decoded": message["decode"], **found, "spent": time.process_time() - began}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
