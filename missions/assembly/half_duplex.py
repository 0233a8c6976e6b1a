"""Ears that do not hear their own robot: when it speaks, as the ears ask."""

from math import inf

from drivers.api import Voice
from drivers.clock import Clock

ECHO_TIME = 0.25
"""Seconds after its end in which what was said may still sound: in the loudspeaker's buffer, and in the room."""


class HalfDuplex:
    """Tells whether the robot was speaking at a time. For one thread, which asks at least ten times a second.

    The voice says only what sounds now: so what it is asked about must be the newest sound.
    """

    def __init__(self, voice: Voice | None, clock: Clock) -> None:
        self._voice = voice
        self._clock = clock
        self._speaks = False
        self._from = self._until = -inf  # what sounded last, without pauses shorter than an echo

    def may_be_own_speech(self, start: float, end: float) -> bool:
        """Say whether sound from ``start`` to ``end`` (s) may be the robot's own."""
        self._look()
        return start < self._until and end > self._from

    def _look(self) -> None:
        said = None if self._voice is None else self._voice.speaking()
        begun = None if said is None else said.started
        if begun is not None:
            if not self._speaks and begun > self._until:
                self._from = begun
            self._speaks, self._until = True, inf
        elif self._speaks:
            self._speaks, self._until = False, self._clock.now() + ECHO_TIME
