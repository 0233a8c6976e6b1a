"""Half duplex for ears: while the robot speaks, its microphone is muted, since there is no echo cancellation."""

from math import inf

from drivers.api import Voice
from drivers.clock import Clock

ECHO_TIME = 0.25
"""Seconds for which the robot's speech may still sound after its end, in the loudspeaker's buffer and in the room."""


class HalfDuplex:
    """Tells whether sound at a time may be the robot's own speech.

    Call it from one thread, at least ten times a second, since it notices speech only when it is called.
    """

    def __init__(self, voice: Voice | None, clock: Clock) -> None:
        self._voice = voice
        self._clock = clock
        self._speaks = False
        self._from = self._until = -inf  # what sounded last, without pauses shorter than an echo

    def may_be_own_speech(self, start: float, end: float) -> bool:
        """Return True if sound from ``start`` to ``end`` (s) may be the robot's own speech."""
        self._look()
        return start < self._until and end > self._from

    def _look(self) -> None:
        utterance = None if self._voice is None else self._voice.speaking()
        begun = None if utterance is None else utterance.started
        if begun is not None:
            if not self._speaks and begun > self._until:
                self._from = begun
            self._speaks, self._until = True, inf
        elif self._speaks:
            self._speaks, self._until = False, self._clock.now() + ECHO_TIME
