"""Text-to-speech engines: espeak-ng in a worker process, or the user's Piper."""

import json
from pathlib import Path
from typing import Protocol

from drivers.api import DeviceStatus, SpeechStyle, StatusCallback, ignore
from drivers.clock import Clock
from drivers.errors import DeviceFault, NoReply
from drivers.extras import extra_hint
from drivers.sound.cancel_token import CancelToken
from drivers.sound.speech_programs import Speech, make_request, parse_speech, run_program
from drivers.sound.utterances import WORDS_PER_MINUTE, espeak_name, speaking_timeout
from drivers.sound.worker_client import WorkerClient
from drivers.transport.worker_process import Message, WorkerProcess

WORKER_PROGRAM = Path(__file__).with_name("espeak_worker.py")

SYNTHESIS_TIMEOUT = 3.0
"""Seconds to synthesise a text, plus 1 s per 1000 letters; normally a tenth of that is enough."""


class SpeechEngine(Protocol):
    """Text-to-speech engine. If ``plays_sound`` is True it also plays the sound."""

    @property
    def plays_sound(self) -> bool:
        """True if the engine plays the sound itself, without a player."""
        ...

    @property
    def failure_reason(self) -> str:
        """Reason of a permanent failure, or an empty string."""
        ...

    def open(self) -> None:
        """Start the engine's process, if any; returns at once."""
        ...

    def close(self) -> None:
        """End the engine's process. Safe from any state, more than once."""
        ...

    def speak(self, text: str, manner: SpeechStyle, token: CancelToken) -> Speech | None:
        """Return a text as sound; None if it was cancelled, or the engine has played it. Raises DriverError.

        ``manner`` is voice, language and speed, with the defaults of the robot file filled in. ``token`` cancels the
        text.
        """
        ...


class EspeakEngine(WorkerClient):
    """espeak-ng from the package ``espeakng-loader``, in a worker process.

    ``default_manner`` has the voice that is used if a requested voice is unknown.
    """

    plays_sound = False

    def __init__(
        self, clock: Clock, *, default_manner: SpeechStyle, report: StatusCallback = ignore, name: str = "voice"
    ) -> None:
        hint = extra_hint("speak", "`driver: print` speaks without espeak-ng")
        worker = WorkerProcess(name, WORKER_PROGRAM, clock, hint=hint, report=report)
        super().__init__(worker, clock, report=report, hint=hint)
        self._default_voice = espeak_name(default_manner)
        self._number = 0
        self._answer: tuple[Message, bytes] | None = None

    def speak(self, text: str, manner: SpeechStyle, token: CancelToken) -> Speech | None:
        """Return a text as sound; None if it was cancelled. Raises NotConnected or NoReply."""
        if not self._wait_until_ready(token):
            return None
        with self._condition:
            self._number += 1
            self._answer = None
        self._worker.send(make_request(self._number, text, espeak_name(manner), self._default_voice, manner.speed))
        timeout = SYNTHESIS_TIMEOUT + len(text) / 1000
        if self._wait_until(lambda: self._answer is not None, token, timeout) or token.is_cancelled:
            return None if token.is_cancelled else self._parse_answer()
        self._worker.kill()
        why = f"espeak-ng did not finish the text {text[:40]!r} in {timeout:.1f} s, and is restarted"
        raise NoReply(f"{self._worker.name}: {why}", hint=self._hint)

    def _parse_answer(self) -> Speech | None:
        """Return the worker's answer as speech; None without one.

        It must be called without the lock, so that cancelling is not delayed.
        """
        return None if self._answer is None else parse_speech(*self._answer)

    def _handle_message(self, message: Message, body: bytes) -> DeviceStatus | None:
        if message.get("id") != self._number:
            return None
        self._answer = message, body
        if not message.get("trouble"):
            return None
        name = self._worker.name
        what = f"{name}: {message['trouble']}: speaking with {self._default_voice or 'en'!r} instead"
        return DeviceStatus(name, "fault", what, "such as `voice: en-us+f2`; docs/speaking.md lists voices")


class PiperEngine:
    """Text-to-speech engine that runs the user's program ``piper`` with the voice in the file ``model``.

    The sample rate of the voice is read from the file with the same name and ``.json`` added.
    """

    plays_sound = False
    failure_reason = ""

    def __init__(self, model: Path, clock: Clock, *, program: str = "piper") -> None:
        self._model = model
        self._clock = clock
        self._program = program
        self._name = "voice"

    def open(self) -> None:
        """Do nothing: Piper is run for each text."""

    def close(self) -> None:
        """Do nothing: a running program is cancelled with its text."""

    def speak(self, text: str, manner: SpeechStyle, token: CancelToken) -> Speech | None:
        """Return a text as sound; None if it was cancelled. Raises DeviceFault and NoReply."""
        rate = self._sample_rate()
        pace = WORDS_PER_MINUTE / manner.speed
        command = [self._program, "--model", str(self._model), "--output-raw", "--length-scale", f"{pace:.3f}"]
        # It takes each line for a text of its own.
        line, limit = " ".join(text.split()), speaking_timeout(text, manner)
        ran = run_program(self._name, command, line, token, self._clock, timeout=limit, keep_output=True)
        return None if ran is None else Speech(ran.output[: len(ran.output) & ~1], rate)

    def _sample_rate(self) -> int:
        about = self._model.with_name(f"{self._model.name}.json")
        try:
            rate = int(json.loads(about.read_text(encoding="utf-8"))["audio"]["sample_rate"])
        except (OSError, ValueError, LookupError, TypeError) as error:
            hint = (
                "a voice of Piper's is two files: `model: voice.onnx` in the robot file, and voice.onnx.json beside it"
            )
            raise DeviceFault(f"{self._name}: {about}: cannot be read: {error}", hint=hint) from error
        if rate <= 0:
            raise DeviceFault(f"{self._name}: {about}: invalid sample rate: {rate}")
        return rate
