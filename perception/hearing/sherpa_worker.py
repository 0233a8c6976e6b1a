"""Worker process that recognises speech with sherpa-onnx and a model of the user's.

The model is a folder with a streaming transducer: ``tokens.txt``, and ``encoder*.onnx``, ``decoder*.onnx`` and
``joiner*.onnx``, preferably of 8 bits (``*.int8.onnx``). The messages are those of ``vosk_worker.py``, but ``sure`` has
a value per token, of which a word may have several. This module imports no other module of MissionTree.
"""

import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import sherpa_onnx

RATE = 16_000
"""Samples per second."""

TRAILING_SILENCE = np.zeros(int(0.6 * RATE), np.float32)
"""Silence appended to a sound: a streaming model looks ahead, and would withhold the last word."""


def find_model_part(model: Path, name: str) -> str:
    """Return the ONNX file in the folder ``model`` whose name begins with ``name``.

    Ends the process with a message if there is none.
    """
    found = [*sorted(model.glob(f"{name}*.int8.onnx")), *sorted(model.glob(f"{name}*.onnx"))]
    if not found:
        sys.exit(f"{model}: there is no {name}*.onnx: a streaming transducer has encoder, decoder, joiner, tokens.txt")
    return str(found[0])


def load_recogniser(model: Path) -> "sherpa_onnx.OnlineRecognizer":
    """Return a single-threaded recogniser with the model in a folder."""
    if not (model / "tokens.txt").is_file():
        sys.exit(f"{model}: there is no tokens.txt: unpack a streaming transducer of sherpa-onnx there")
    return sherpa_onnx.OnlineRecognizer.from_transducer(
        tokens=str(model / "tokens.txt"),
        encoder=find_model_part(model, "encoder"),
        decoder=find_model_part(model, "decoder"),
        joiner=find_model_part(model, "joiner"),
        num_threads=1,
        decoding_method="modified_beam_search",  # which alone says how likely each token is
    )


def decode(recogniser: "sherpa_onnx.OnlineRecognizer", sound: bytes) -> dict[str, Any]:
    """Return the transcription of a sound, with confidences."""
    stream = recogniser.create_stream()
    stream.accept_waveform(RATE, np.frombuffer(sound, "<i2").astype(np.float32) / 32768)
    stream.accept_waveform(RATE, TRAILING_SILENCE)
    stream.input_finished()
    while recogniser.is_ready(stream):
        recogniser.decode_stream(stream)
    likely = recogniser.ys_probs(stream)
    return {"phrase": recogniser.get_result(stream), "sure": [math.exp(min(each, 0.0)) for each in likely]}


def main() -> None:
    """Answer requests on standard input until it ends."""
    recogniser = None
    for line in sys.stdin.buffer:
        message = json.loads(line)
        sound = sys.stdin.buffer.read(message.get("bytes", 0))
        if "model" in message:
            recogniser = load_recogniser(Path(message["model"]))
            answer: dict[str, Any] = {"ready": True}
        else:
            began = time.process_time()
            found = {"phrase": ""} if recogniser is None else decode(recogniser, sound)
            answer = {"decoded": message["decode"], **found, "spent": time.process_time() - began}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
