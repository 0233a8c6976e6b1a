"""External programs that speak: the known ones, their arguments, and how they are run.

A program is run once per text, and cancelled together with its child processes.
"""

import os
import shlex
import shutil
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from subprocess import DEVNULL, PIPE, Popen, TimeoutExpired
from typing import Any

from drivers.api import SpeechStyle
from drivers.api.fast_dataclass import dataclass
from drivers.clock import Clock
from drivers.errors import DeviceFault, NoReply
from drivers.sound.cancel_token import CancelToken
from drivers.sound.utterances import WORDS_PER_MINUTE, espeak_name, speaking_time, speaking_timeout
from drivers.transport.worker_process import last_error_line

# What the robot and its programs for speech tell each other, over a ``drivers.transport.worker_process``.
#
# To the synthesiser: ``{"id", "text", "voice", "instead", "speed"}``; back ``{"id", "rate", "phonemes", "trouble"}``
# and the samples. To the player: ``{"play": ID, "rate", "last"}`` and samples, a piece after another, each
# acknowledged by ``{"taken": ID}`` before the next is sent; ``{"file": ID, "path"}``, which may be ``{"refused": ID,
# "why"}``; and ``{"stop": ID}``. It says ``{"started": ID, "seconds"}`` and ``{"ended": ID, "seconds"}``, in which
# seconds are what there is of it so far, and what was heard. Both say ``{"ready": WHAT}`` first, or ``{"absent":
# WHY}``; the player's ``{"mute": WHY}`` means that it keeps time, but nobody hears it.

Message = dict[str, Any]

MAX_PIECE_BYTES = 32_768
"""Maximum bytes of sound per message. It is less than a pipe buffer, so a stopped player does not block the sender."""


@dataclass(frozen=True, slots=True, eq=False)
class Speech:
    """Sound as 16-bit mono ``samples``, with the phonemes and their start times in seconds.

    ``rate`` is in samples per second. ``trouble`` is a problem of the request, such as an unknown voice; empty if there
    is none.
    """

    samples: bytes
    rate: int
    phonemes: tuple[tuple[float, str], ...] = ()
    trouble: str = ""

    @property
    def seconds(self) -> float:
        """Duration of the sound in seconds."""
        return len(self.samples) / 2 / self.rate


def make_request(number: int, text: str, voice: str, fallback_voice: str, speed: float) -> Message:
    """Return the request to speak ``text``; ``fallback_voice`` replaces an unknown ``voice``.

    ``speed`` is in words per minute.
    """
    text, voice = (each.encode("utf-8", "replace").decode() for each in (text, voice))
    return {"id": number, "text": text, "voice": voice, "instead": fallback_voice, "speed": round(speed)}


def parse_speech(message: Mapping[str, Any], body: bytes) -> Speech:
    """Return the synthesiser's answer. Raises LookupError, TypeError or ValueError if it is invalid."""
    phonemes = tuple((int(at) / 1000.0, str(phoneme)) for at, phoneme in message["phonemes"])
    rate = int(message["rate"])
    if rate <= 0:
        raise ValueError(f"not a rate: {rate}")
    return Speech(body[: len(body) & ~1], rate, phonemes, str(message["trouble"]))


def split_sound(number: int, sound: Speech) -> Iterator[tuple[Message, bytes]]:
    """Yield the messages that play a sound as the sound ``number``, each with its part of the samples."""
    size = len(sound.samples)
    for begin in range(0, max(size, 1), MAX_PIECE_BYTES):
        last = begin + MAX_PIECE_BYTES >= size
        yield {"play": number, "rate": sound.rate, "last": last}, sound.samples[begin : begin + MAX_PIECE_BYTES]


_ESPEAK_ARGUMENTS = ("--stdin", "-v{name}", "-s{speed}", "-a{volume}")

KNOWN_PROGRAMS: Mapping[str, tuple[str, ...]] = {
    "espeak-ng": _ESPEAK_ARGUMENTS,
    "espeak": _ESPEAK_ARGUMENTS,
    "say": ("-v{voice}", "-r{speed}", "-f", "-"),  # of macOS
}
"""Programs that speak their standard input, best first, with their arguments."""


@dataclass(frozen=True, slots=True)
class Synthesiser:
    """A program that speaks its standard input (UTF-8), then ends.

    In ``arguments``, ``{voice}``, ``{language}``, ``{speed}`` (words per minute), ``{volume}`` (percent) and ``{name}``
    (the voice as espeak calls it: "en-us+f2") are replaced. An argument with an unknown value is left out.
    """

    program: str
    arguments: tuple[str, ...] = ()
    volume: float = 1.0

    def command(self, manner: SpeechStyle) -> list[str]:
        """Return the command line; it is never run by a shell, and the text is not part of it."""
        values = {
            "{voice}": manner.voice,
            "{language}": manner.language,
            "{name}": espeak_name(manner),
            "{speed}": f"{manner.speed:.0f}" if manner.speed else "",
            "{volume}": f"{self.volume:.0%}".rstrip("%"),
        }
        return [
            self.program,
            *(_fill_argument(each, values) for each in self.arguments if not _has_unknown_value(each, values)),
        ]


def _has_unknown_value(argument: str, values: Mapping[str, str]) -> bool:
    return any(word in argument and not value for word, value in values.items())


def _fill_argument(argument: str, values: Mapping[str, str]) -> str:
    for word, value in values.items():
        argument = argument.replace(word, value)
    return argument


def find_synthesiser(folders: str | None = None, *, volume: float = 1.0) -> Synthesiser | None:
    """Return the best program on the PATH (or in ``folders``, written like PATH); None if there is none."""
    for name, arguments in KNOWN_PROGRAMS.items():
        program = shutil.which(name, path=folders)
        if program is not None:
            return Synthesiser(program, arguments, volume)
    return None


PIPE_DRAIN_TIMEOUT = 0.2
"""Maximum seconds to read the last output of a program that has ended; its child processes may keep the pipes open."""


@dataclass(frozen=True, slots=True)
class ProgramOutput:
    """Output of an ended program, and the last line of its error output. ``output`` is empty if it was not kept."""

    output: bytes
    last_error_line: str


def run_program(
    name: str,
    command: Sequence[str],
    text: str,
    token: CancelToken,
    clock: Clock,
    *,
    timeout: float,
    keep_output: bool = False,
) -> ProgramOutput | None:
    """Run ``command`` with ``text`` on its standard input, until it ends; return its output, None if cancelled.

    ``name`` is the part in error messages. Standard output is kept only if ``keep_output``. Raises DeviceFault if the
    program cannot be run or fails, and NoReply if it has not ended after ``timeout`` seconds.
    """
    hint = f"echo hello | {shlex.join(command)}" + (" > hello.raw" if keep_output else "")
    try:
        process = Popen(  # noqa: S603 - no shell, and what is said goes in through stdin
            command,
            stdin=PIPE,
            stdout=PIPE if keep_output else DEVNULL,
            stderr=PIPE,
            start_new_session=True,  # so that programs which it starts fall silent with it
        )
    except OSError as error:
        raise DeviceFault(f"{name}: {command[0]}: {error}", hint=hint) from error
    with token.on_cancel(lambda: _kill_group(process)):
        ran = _read_output(process, text.encode("utf-8", "replace"), clock, clock.now() + timeout)
    if token.is_cancelled:
        return None
    if ran is None:
        raise NoReply(f"{name}: {command[0]}: timed out after {timeout:.0f} s", hint=hint)
    if process.returncode != 0:
        raise DeviceFault(f"{name}: {command[0]}: ended with {process.returncode}: {ran.last_error_line}", hint=hint)
    return ran


def _read_output(process: "Popen[bytes]", text: bytes, clock: Clock, until: float) -> ProgramOutput | None:
    """Return the output of a program after it has ended; None if it was killed because the clock reached ``until``."""
    given: bytes | None = text
    output: bytes | None
    complaint: bytes | None
    ended = killed = False
    while True:
        try:
            output, complaint = process.communicate(given, timeout=PIPE_DRAIN_TIMEOUT)
            break
        except TimeoutExpired as late:
            given, output, complaint = None, late.output, late.stderr
        if ended:  # and was given the time to say its last
            break
        ended = process.poll() is not None
        if not ended and clock.now() > until:
            _kill_group(process)
            ended = killed = True
    process.poll()
    for pipe in (process.stdin, process.stdout, process.stderr):
        if pipe is not None:
            pipe.close()
    return None if killed else ProgramOutput(output or b"", last_error_line(complaint or b""))


def _kill_group(process: "Popen[bytes]") -> None:
    """Kill a program and its child processes.

    A program that was already waited for is left alone, since its process id may have been reused.
    """
    if process.returncode is None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)


MIN_DURATION_SHARE = 1 / 3
"""Minimum duration of a program that has error output, as a share of the speaking time of its text.

If it ends earlier, it has not spoken.
"""


class ProgramEngine:
    """A ``drivers.sound.engines.SpeechEngine`` that runs an external program, which plays the sound itself."""

    plays_sound = True
    failure_reason = ""

    def __init__(self, synthesiser: Synthesiser, clock: Clock) -> None:
        self._synthesiser = synthesiser
        self._clock = clock
        self._name = "voice"

    def open(self) -> None:
        """Do nothing: the program is run for each text."""

    def close(self) -> None:
        """Do nothing: a running program is cancelled with its text."""

    def speak(self, text: str, manner: SpeechStyle, token: CancelToken) -> Speech | None:
        """Speak a text and return None. Raises NoReply, and DeviceFault if the program fails or ends too early.

        Without a sound card, espeak-ng writes errors and ends at once with exit code 0.
        """
        command, began = self._synthesiser.command(manner), self._clock.now()
        ran = run_program(self._name, command, text, token, self._clock, timeout=speaking_timeout(text, manner))
        seconds = MIN_DURATION_SHARE * speaking_time(text, manner.speed or WORDS_PER_MINUTE)
        if ran is not None and ran.last_error_line and self._clock.now() - began < seconds:
            program = self._synthesiser.program
            hint = "`aplay -l` lists sound cards; `driver: print` speaks without"
            raise DeviceFault(f"{self._name}: {program}: ended before it had spoken: {ran.last_error_line}", hint=hint)
        return None
