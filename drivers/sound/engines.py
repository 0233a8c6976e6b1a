"""What turns words into sound: espeak-ng in a process of ours, or the user's Piper."""

import json
from pathlib import Path
from typing import Protocol

from drivers.api import DeviceStatus, Manner, Report, ignore
from drivers.clock import Clock
from drivers.errors import DeviceFault, NoReply
from drivers.extras import extra_hint
from drivers.sound.cut import Cut
from drivers.sound.partner import Partner
from drivers.sound.program import Speech, request, run, speech
from drivers.sound.spoken import WORDS_PER_MINUTE, espeak_name, longest
from drivers.transport.pipe import Message, Worker

PROGRAM = Path(__file__).with_name("espeak_worker.py")

THINKING = 3.0
"""Seconds that the synthesiser may take for a text, and one more for each 1000 letters: it needs a tenth of that."""


class Engine(Protocol):
    """Turns words into sound; one that ``speaks_itself`` plays it too."""

    @property
    def speaks_itself(self) -> bool:
        """Whether it needs no player."""
        ...

    @property
    def broken(self) -> str:
        """Why there is no hope for it, else ""."""
        ...

    def open(self) -> None:
        """Start what it needs; returns at once."""
        ...

    def close(self) -> None:
        """End that. Safe from any state, more than once."""
        ...

    def speak(self, text: str, manner: Manner, cut: Cut) -> Speech | None:
        """Return a text as sound; None when it was broken off, or has been spoken. Raises DriverError.

        ``manner`` has everything that the robot file or the mission says.
        """
        ...


class Espeak(Partner):
    """espeak-ng through the wheel ``espeakng-loader``. ``usual`` is the voice where a mission's does not exist."""

    speaks_itself = False

    def __init__(self, clock: Clock, *, usual: Manner, report: Report = ignore, name: str = "voice") -> None:
        hint = extra_hint("speak", "`driver: print` speaks without espeak-ng")
        worker = Worker(name, PROGRAM, clock, hint=hint, report=report)
        super().__init__(worker, clock, report=report, hint=hint)
        self._usual = espeak_name(usual)
        self._number = 0
        self._answer: tuple[Message, bytes] | None = None

    def speak(self, text: str, manner: Manner, cut: Cut) -> Speech | None:
        """See Engine. Raises NotConnected or NoReply."""
        if not self._be_ready(cut):
            return None
        with self._news:
            self._number += 1
            self._answer = None
        self._worker.send(request(self._number, text, espeak_name(manner), self._usual, manner.speed))
        if self._until(lambda: self._answer is not None, cut, THINKING + len(text) / 1000) or cut.made:
            return None if cut.made else self._answered()
        self._worker.kill()
        raise NoReply(f"{self._worker.name}: espeak-ng hangs with {text[:40]!r}", hint=self._hint)

    def _answered(self) -> Speech | None:
        """Return the answer taken apart: here, where that keeps nobody from breaking it off."""
        return None if self._answer is None else speech(*self._answer)

    def _take(self, message: Message, body: bytes) -> DeviceStatus | None:
        if message.get("id") != self._number:
            return None
        self._answer = message, body
        if not message.get("trouble"):
            return None
        name = self._worker.name
        what = f"{name}: {message['trouble']}: it speaks with {self._usual or 'en'!r} instead"
        return DeviceStatus(name, "fault", what, "such as `voice: en-us+f2`; docs/speaking.md says which there are")


class Piper:
    """The user's program ``piper`` with the voice in the file ``model``; what the voice is, its MODEL.json says."""

    speaks_itself = False
    broken = ""

    def __init__(self, model: Path, clock: Clock, *, program: str = "piper") -> None:
        self._model = model
        self._clock = clock
        self._program = program
        self._name = "voice"

    def open(self) -> None:
        """Do nothing: it is run for each text."""

    def close(self) -> None:
        """Do nothing: what runs is broken off with the words that it says."""

    def speak(self, text: str, manner: Manner, cut: Cut) -> Speech | None:
        """See Engine. Raises DeviceFault and NoReply."""
        rate = self._sample_rate()
        pace = WORDS_PER_MINUTE / manner.speed
        command = [self._program, "--model", str(self._model), "--output-raw", "--length-scale", f"{pace:.3f}"]
        # It takes each line for a text of its own.
        line, limit = " ".join(text.split()), longest(text, manner)
        ran = run(self._name, command, line, cut, self._clock, limit=limit, wanted=True)
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
            raise DeviceFault(f"{self._name}: {about}: not a rate of samples: {rate}")
        return rate
