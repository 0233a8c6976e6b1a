"""Player of sounds, one at a time, through a program that owns the sound card."""

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Final

from drivers.api import DeviceStatus, StatusCallback, ignore
from drivers.clock import Clock
from drivers.errors import BadRequest, NoReply
from drivers.extras import extra_hint
from drivers.sound.cancel_token import CancelToken
from drivers.sound.speech_programs import Speech, split_sound
from drivers.sound.worker_client import WorkerClient
from drivers.transport.worker_process import Message, WorkerProcess

WORKER_PROGRAM = Path(__file__).with_name("sound_worker.py")

STOP_TIMEOUT = 0.06
"""Seconds after a stop until the player program is killed, so that there is silence within 0.1 s."""

PLAY_TIMEOUT_MARGIN = 3.0
"""Seconds by which playback may exceed the length of a sound before the player counts as hanging."""

DECODE_TIMEOUT = 20.0
"""Seconds within which the player must decode a file."""

StartCallback = Callable[[float, float], None]
"""Called when a sound starts, with the time on the clock and its length in seconds."""


class SoundState(Enum):
    """State of a sound in the player program. REFUSED: the program cannot decode the file."""

    SENT, PLAYING, ENDED, REFUSED = range(4)


class SoundEvent(Enum):
    """Event of a sound: SEND when it is sent to the player program, the others for messages about it."""

    SEND, START, END, REFUSE = range(4)


TRANSITIONS: Final = {
    **{(state, SoundEvent.SEND): SoundState.SENT for state in SoundState},
    (SoundState.SENT, SoundEvent.START): SoundState.PLAYING,
    (SoundState.SENT, SoundEvent.REFUSE): SoundState.REFUSED,
    (SoundState.PLAYING, SoundEvent.END): SoundState.ENDED,
}
"""Next state of a sound by state and event. Other pairs change nothing.

If the end of a sound is never reported, a timeout kills the player program.
"""


class SoundPlayer(WorkerClient):
    """Player of sounds through the sound card ``device``, by a worker process. For one thread.

    ``device`` is part of its name, empty for the system's default. ``volume`` is a factor. Without a sound card, sounds
    take their usual time in silence; then ``mute_reason`` has the reason, and it is reported once. ``backend`` is one
    of miniaudio's, for tests.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        device: str = "",
        volume: float = 1.0,
        backend: str = "",
        report: StatusCallback = ignore,
    ) -> None:
        self.hint = extra_hint("speak", "`aplay -l` lists sound cards")
        arguments = (device, backend, str(volume))
        worker = WorkerProcess("voice", WORKER_PROGRAM, clock, arguments=arguments, hint=self.hint, report=report)
        super().__init__(worker, clock, report=report, hint=self.hint)
        self.mute_reason = ""
        self._number = 0  # of the current sound
        self._sound_state = SoundState.ENDED
        self._sound_started_at = 0.0
        self._on_start: StartCallback | None = None  # until it was called
        self._seconds = 0.0
        self._sent_pieces = self._acknowledged_pieces = 0  # pieces sent, and acknowledged
        self._refusal = ""

    def play(self, sound: Speech, token: CancelToken, on_start: StartCallback) -> bool:
        """Play a sound to its end; return False if cancelled. Raises NotConnected or NoReply."""
        if not self._start_sound(token, on_start):
            return False
        for message, samples in split_sound(self._number, sound):
            self._sent_pieces += 1
            self._worker.send(message, samples)
            if not self._wait_until(lambda: self._acknowledged_pieces == self._sent_pieces, token, PLAY_TIMEOUT_MARGIN):
                return self._stop_sound(token)
            self._report_start(sound.seconds)  # it plays while the rest is still being sent
        return self._wait_for_end(token, sound.seconds)

    def play_file(self, path: Path, token: CancelToken, on_start: StartCallback) -> bool:
        """Play a file as ``play`` does. Also raises BadRequest if it cannot be decoded."""
        if not self._start_sound(token, on_start):
            return False
        self._worker.send({"file": self._number, "path": str(path.absolute())})
        known = self._wait_until(lambda: self._sound_state is not SoundState.SENT, token, DECODE_TIMEOUT)
        if self._sound_state is SoundState.REFUSED:
            raise BadRequest(f"{self._worker.name}: {path}: {self._refusal}", hint=f"`file {path}` shows what it is")
        return self._wait_for_end(token, self._seconds) if known else self._stop_sound(token)

    def _start_sound(self, token: CancelToken, on_start: StartCallback) -> bool:
        if not self._wait_until_ready(token):
            return False
        with self._condition:
            self._number += 1
            self._handle_sound(SoundEvent.SEND)
            self._seconds, self._sent_pieces, self._acknowledged_pieces = 0.0, 0, 0
        self._on_start = on_start
        return True

    def _report_start(self, seconds: float) -> None:
        """Call the callback for the start of a sound once, if the sound has started; ``seconds`` is its length."""
        if self._sound_state in (SoundState.PLAYING, SoundState.ENDED) and self._on_start is not None:
            listener, self._on_start = self._on_start, None
            listener(self._sound_started_at, seconds)

    def _wait_for_end(self, token: CancelToken, seconds: float) -> bool:
        """Wait until the sound that was sent has started and ended; return False if it was cancelled."""
        if not self._wait_until(
            lambda: self._sound_state in (SoundState.PLAYING, SoundState.ENDED), token, PLAY_TIMEOUT_MARGIN
        ):
            return self._stop_sound(token)
        self._report_start(seconds)
        left = self._sound_started_at + seconds + PLAY_TIMEOUT_MARGIN - self._clock.now()
        return self._wait_until(lambda: self._sound_state is SoundState.ENDED, token, left) or self._stop_sound(token)

    def _stop_sound(self, token: CancelToken) -> bool:
        """Stop the current sound, by killing the player if necessary, and return False.

        Raises NoReply if ``token`` is not cancelled, since the player hangs then.
        """
        if not token.is_cancelled:
            self._worker.kill()
            raise NoReply(f"{self._worker.name}: the loudspeaker hangs", hint=self._hint)
        until = self._clock.now() + STOP_TIMEOUT
        try:
            self._worker.send({"stop": self._number}, timeout=STOP_TIMEOUT / 2)
            with self._condition:  # a sound that has not started will not start: the stop follows it
                quiet = self._sound_state is not SoundState.PLAYING or self._condition.wait_for(
                    lambda: self._sound_state is SoundState.ENDED or not self._is_ready,
                    until - self._clock.now(),
                )
        except (NoReply, ConnectionError):
            quiet = False
        if not quiet:
            self._worker.kill()
        return False

    def on_exit(self, reason: str) -> None:
        """Forget that there was no sound card: the player program has exited, and the next one may find one."""
        self.mute_reason = ""
        super().on_exit(reason)

    def _handle_message(self, message: Message, body: bytes) -> DeviceStatus | None:  # noqa: ARG002 - the player sends no sound
        match message:
            case {"mute": why}:
                self.mute_reason = f"{self._worker.name}: {why}: words are printed instead"
                return DeviceStatus(self._worker.name, "fault", self.mute_reason, self._hint)
            case {"taken": self._number}:
                self._acknowledged_pieces += 1
            case {"started": self._number, "seconds": seconds}:
                self._sound_started_at, self._seconds = self._clock.now(), float(seconds)
                self._handle_sound(SoundEvent.START)
            case {"ended": self._number}:
                self._handle_sound(SoundEvent.END)
            case {"refused": self._number, "why": why}:
                self._refusal = str(why)
                self._handle_sound(SoundEvent.REFUSE)
        return None

    def _handle_sound(self, event: SoundEvent) -> None:
        self._sound_state = TRANSITIONS.get((self._sound_state, event), self._sound_state)
