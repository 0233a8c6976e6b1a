"""The loudspeaker: sounds one at a time, through a program that owns the sound card."""

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Final

from drivers.api import DeviceStatus, Report, ignore
from drivers.clock import Clock
from drivers.errors import BadRequest, NoReply
from drivers.extras import extra_hint
from drivers.sound.cut import Cut
from drivers.sound.partner import Partner
from drivers.sound.program import Speech, pieces
from drivers.transport.pipe import Message, Worker

PROGRAM = Path(__file__).with_name("sound_worker.py")

QUIET = 0.06
"""Seconds after which a player that was told to stop is killed: so that it is silent within a tenth of a second."""

SLACK = 3.0
"""Seconds by which a sound may take longer than it is, before its player is taken to hang."""

DECODING = 20.0
"""Seconds that a file may take to be decoded."""

Begun = Callable[[float, float], None]
"""Told when a sound begins: the clock's time, and how many seconds it lasts."""


class SoundState(Enum):
    """State of a sound in its program; REFUSED: it cannot be decoded."""

    SENT, PLAYING, ENDED, REFUSED = range(4)


class SoundEvent(Enum):
    """A new sound, or a message of the program about it."""

    SEND, START, END, REFUSE = range(4)


TRANSITIONS: Final = {
    **{(state, SoundEvent.SEND): SoundState.SENT for state in SoundState},
    (SoundState.SENT, SoundEvent.START): SoundState.PLAYING,
    (SoundState.SENT, SoundEvent.REFUSE): SoundState.REFUSED,
    (SoundState.PLAYING, SoundEvent.END): SoundState.ENDED,
}
"""Any other pair changes nothing: the program may be mistaken, and what does not end is killed."""


class Player(Partner):
    """Plays through ``device`` (part of its name; empty: the system's choice), ``volume`` 1 as the sound comes.

    Without a sound card sounds take as long as they would; ``mute`` says why then, and a notice once. ``backend`` is
    one of miniaudio's, for tests. For one thread.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        device: str = "",
        volume: float = 1.0,
        backend: str = "",
        report: Report = ignore,
    ) -> None:
        self.hint = extra_hint("speak", "`aplay -l` lists sound cards")
        arguments = (device, backend, str(volume))
        worker = Worker("voice", PROGRAM, clock, arguments=arguments, hint=self.hint, report=report)
        super().__init__(worker, clock, report=report, hint=self.hint)
        self.mute = ""
        self._number = 0  # of the sound below
        self._sound = SoundState.ENDED
        self._begun_at = 0.0
        self._listener: Begun | None = None  # until it was told of the beginning
        self._seconds = 0.0
        self._given = self._taken = 0  # pieces of it: sent, and there
        self._refusal = ""

    def play(self, sound: Speech, cut: Cut, begun: Begun) -> bool:
        """Play a sound to its end; False when it was broken off. Raises NotConnected or NoReply."""
        if not self._begin(cut, begun):
            return False
        for message, samples in pieces(self._number, sound):
            self._given += 1
            self._worker.send(message, samples)
            if not self._until(lambda: self._taken == self._given, cut, SLACK):
                return self._silenced(cut)
            self._tell(sound.seconds)  # it is heard while the rest of it is still to be sent
        return self._finish(cut, sound.seconds)

    def play_file(self, path: Path, cut: Cut, begun: Begun) -> bool:
        """Play a file as ``play`` does. Raises BadRequest too: for what cannot be decoded."""
        if not self._begin(cut, begun):
            return False
        self._worker.send({"file": self._number, "path": str(path.absolute())})
        known = self._until(lambda: self._sound is not SoundState.SENT, cut, DECODING)
        if self._sound is SoundState.REFUSED:
            raise BadRequest(f"{self._worker.name}: {path}: {self._refusal}", hint=f"`file {path}` shows what it is")
        return self._finish(cut, self._seconds) if known else self._silenced(cut)

    def _begin(self, cut: Cut, begun: Begun) -> bool:
        if not self._be_ready(cut):
            return False
        with self._news:
            self._number += 1
            self._handle_sound(SoundEvent.SEND)
            self._seconds, self._given, self._taken = 0.0, 0, 0
        self._listener = begun
        return True

    def _tell(self, seconds: float) -> None:
        """Tell, once, that it has begun, if it has."""
        if self._sound in (SoundState.PLAYING, SoundState.ENDED) and self._listener is not None:
            listener, self._listener = self._listener, None
            listener(self._begun_at, seconds)

    def _finish(self, cut: Cut, seconds: float) -> bool:
        """Wait for the beginning and the end of what is on its way."""
        if not self._until(lambda: self._sound in (SoundState.PLAYING, SoundState.ENDED), cut, SLACK):
            return self._silenced(cut)
        self._tell(seconds)
        left = self._begun_at + seconds + SLACK - self._clock.now()
        return self._until(lambda: self._sound is SoundState.ENDED, cut, left) or self._silenced(cut)

    def _silenced(self, cut: Cut) -> bool:
        """Return False once it is silent, by its leave or not. Raises NoReply where nobody wanted it to be."""
        if not cut.made:
            self._worker.kill()
            raise NoReply(f"{self._worker.name}: the loudspeaker hangs", hint=self._hint)
        until = self._clock.now() + QUIET
        try:
            self._worker.send({"stop": self._number}, timeout=QUIET / 2)
            with self._news:  # what has not begun will not be heard: the stop comes right behind it
                quiet = self._sound is not SoundState.PLAYING or self._news.wait_for(
                    lambda: self._sound is SoundState.ENDED or not self._ready, until - self._clock.now()
                )
        except (NoReply, ConnectionError):
            quiet = False
        if not quiet:
            self._worker.kill()
        return False

    def lost(self, why: str) -> None:
        """Note that it has died: the next may find a sound card."""
        self.mute = ""
        super().lost(why)

    def _take(self, message: Message, body: bytes) -> DeviceStatus | None:  # noqa: ARG002 - the player sends no sound
        match message:
            case {"mute": why}:
                self.mute = f"{self._worker.name}: {why}: what is said is printed"
                return DeviceStatus(self._worker.name, "fault", self.mute, self._hint)
            case {"taken": self._number}:
                self._taken += 1
            case {"started": self._number, "seconds": seconds}:
                self._begun_at, self._seconds = self._clock.now(), float(seconds)
                self._handle_sound(SoundEvent.START)
            case {"ended": self._number}:
                self._handle_sound(SoundEvent.END)
            case {"refused": self._number, "why": why}:
                self._refusal = str(why)
                self._handle_sound(SoundEvent.REFUSE)
        return None

    def _handle_sound(self, event: SoundEvent) -> None:
        self._sound = TRANSITIONS.get((self._sound, event), self._sound)
