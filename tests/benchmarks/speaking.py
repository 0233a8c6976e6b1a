"""Synthetic speech for the trials of the ears, each text once."""

from collections.abc import Mapping
from pathlib import Path
from threading import Event
from types import TracebackType
from typing import Any, Self

import numpy as np

import drivers.sound
from drivers.clock import SystemClock
from drivers.microphone.wav_microphone import resample
from drivers.sound.speech_programs import make_request, parse_speech
from drivers.transport.worker_process import WorkerProcess
from tests.benchmarks.spoken import Samples

PROGRAM = Path(drivers.sound.__file__).with_name("espeak_worker.py")
SPEECH_TIMEOUT = 60.0
"""Seconds that the synthesiser may take for a text: machines are shared."""


class Speaking:
    """A synthesiser, and the talker of its program; for one thread."""

    def __init__(self) -> None:
        self._worker = WorkerProcess("voice", PROGRAM, SystemClock())
        self._running, self._answered = Event(), Event()
        self._trouble = ""
        self._sound: Samples = np.zeros(0, np.int16)
        self._spoken: dict[tuple[str, str, int], Samples] = {}

    def __enter__(self) -> Self:
        """Start the program."""
        self._worker.open(self)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End it."""
        self._worker.close()

    def say(self, text: str, voice: str, speed: int) -> Samples:
        """Return how a text sounds in a voice, at so many words a minute."""
        key = text, voice, speed
        if key not in self._spoken:
            if not self._running.wait(SPEECH_TIMEOUT):
                raise TimeoutError("the synthesiser does not start")
            self._answered.clear()
            self._trouble = ""
            self._worker.send(make_request(len(self._spoken), text, voice, "", speed))
            if not self._answered.wait(SPEECH_TIMEOUT):
                raise TimeoutError(f"the synthesiser does not say {text!r}: {self._worker.health().detail}")
            if self._trouble:
                raise ValueError(self._trouble)
            self._spoken[key] = self._sound
        return self._spoken[key]

    def on_started(self) -> None:
        """Note that it runs."""
        self._running.set()

    def on_message(self, message: Mapping[str, Any], body: bytes) -> None:
        """Take a sound."""
        if "id" not in message:
            return
        answer = parse_speech(message, body)
        self._trouble = answer.trouble
        self._sound = resample(np.frombuffer(answer.samples, "<i2").astype(np.float64), answer.rate)
        self._answered.set()

    def on_exit(self, reason: str) -> None:  # noqa: ARG002 - who waits will say so
        """Note that it does not run."""
        self._running.clear()
