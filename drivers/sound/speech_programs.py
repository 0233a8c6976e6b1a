"""Programs of others that speak: which there are, and how each is told what to say.

Each is run once for each text, and silenced with all that it has started.
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
"""Bytes of sound in a message: less than a pipe holds, so that a player that has stopped keeps nobody waiting."""


@dataclass(frozen=True, slots=True, eq=False)
class Speech:
    """Sound: 16-bit ``samples``, one channel; when which phoneme begins (s); what was wrong with the request, or ""."""

    samples: bytes
    rate: int
    phonemes: tuple[tuple[float, str], ...] = ()
    trouble: str = ""

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return len(self.samples) / 2 / self.rate


def make_request(number: int, text: str, voice: str, fallback_voice: str, speed: float) -> Message:
    """Ask for a text in a ``voice``, or ``instead`` in that one where there is no such voice; in words a minute."""
    text, voice = (each.encode("utf-8", "replace").decode() for each in (text, voice))
    return {"id": number, "text": text, "voice": voice, "instead": fallback_voice, "speed": round(speed)}


def parse_speech(message: Mapping[str, Any], body: bytes) -> Speech:
    """Return what the synthesiser has answered. Raises LookupError, TypeError or ValueError for what is no answer."""
    phonemes = tuple((int(at) / 1000.0, str(phoneme)) for at, phoneme in message["phonemes"])
    rate = int(message["rate"])
    if rate <= 0:
        raise ValueError(f"not a rate: {rate}")
    return Speech(body[: len(body) & ~1], rate, phonemes, str(message["trouble"]))


def split_sound(number: int, sound: Speech) -> Iterator[tuple[Message, bytes]]:
    """Yield the messages that play a sound, each with its samples."""
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
"""Programs that speak their standard input, best first, and their arguments."""


@dataclass(frozen=True, slots=True)
class Synthesiser:
    """A program that speaks what it reads from its standard input (UTF-8), and ends when it has.

    In ``arguments``, ``{voice}``, ``{language}`` and ``{speed}`` (words a minute) stand for the manner of speaking,
    ``{volume}`` for how loud (percent), ``{name}`` for the voice as espeak calls it: "en-us+f2". An argument is left
    out while what stands in it is not known.
    """

    program: str
    arguments: tuple[str, ...] = ()
    volume: float = 1.0

    def command(self, manner: SpeechStyle) -> list[str]:
        """Return what to run; never through a shell, and the text is no part of it."""
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
    """Return the best program on the PATH (or in ``folders``, joined as in PATH); None where there is none."""
    for name, arguments in KNOWN_PROGRAMS.items():
        program = shutil.which(name, path=folders)
        if program is not None:
            return Synthesiser(program, arguments, volume)
    return None


PIPE_DRAIN_TIMEOUT = 0.2
"""Seconds for which a program's pipes are still read when it has ended: what it has started may hold them for ever."""


@dataclass(frozen=True, slots=True)
class ProgramOutput:
    """What a program that has ended wrote, if that was wanted, and the last line of its complaints."""

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
    """Run ``command`` for ``name``, ``text`` on its standard input; what it writes is kept if that is ``wanted``.

    Returns None when it was broken off. Raises DeviceFault when it cannot be run, or fails, and NoReply when it has not
    ended after ``limit`` seconds.
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
        raise NoReply(f"{name}: {command[0]}: has not ended after {timeout:.0f} s", hint=hint)
    if process.returncode != 0:
        raise DeviceFault(f"{name}: {command[0]}: ended with {process.returncode}: {ran.last_error_line}", hint=hint)
    return ran


def _read_output(process: "Popen[bytes]", text: bytes, clock: Clock, until: float) -> ProgramOutput | None:
    """Return what a program says until it ends; None for one that had to be killed, since it did not in time."""
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
    """Kill a program and whatever it started, unless it has been waited for and its number may be another's."""
    if process.returncode is None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)


MIN_DURATION_SHARE = 1 / 3
"""Part of the time that words take: a program that complains and has ended by then has not spoken them."""


class ProgramEngine:
    """A ``drivers.sound.engines.SpeechEngine`` that has a program speak."""

    plays_sound = True
    failure_reason = ""

    def __init__(self, synthesiser: Synthesiser, clock: Clock) -> None:
        self._synthesiser = synthesiser
        self._clock = clock
        self._name = "voice"

    def open(self) -> None:
        """Do nothing: the program is run for each text."""

    def close(self) -> None:
        """Do nothing: what runs is broken off with the words that it says."""

    def speak(self, text: str, manner: SpeechStyle, token: CancelToken) -> Speech | None:
        """See Engine. Raises DeviceFault, also where it says that it has spoken and cannot have; and NoReply.

        Without a sound card espeak-ng complains, ends at once, and with 0.
        """
        command, began = self._synthesiser.command(manner), self._clock.now()
        ran = run_program(self._name, command, text, token, self._clock, timeout=speaking_timeout(text, manner))
        seconds = MIN_DURATION_SHARE * speaking_time(text, manner.speed or WORDS_PER_MINUTE)
        if ran is not None and ran.last_error_line and self._clock.now() - began < seconds:
            program = self._synthesiser.program
            hint = "`aplay -l` lists sound cards; `driver: print` speaks without"
            raise DeviceFault(f"{self._name}: {program}: ended before it had spoken: {ran.last_error_line}", hint=hint)
        return None
